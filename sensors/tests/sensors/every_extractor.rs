//! Properties of every extractor: the exported laws, refusals, errors as large as their σ.

use core::f64::consts::{PI, TAU};

use foxhunt_core::{
    BearingExtractor, BearingMode, NoReading, Pose, Reading, Sample, Sweep, angle, laws,
};
use foxhunt_sensors::{
    Antenna, CrossCorrelation, CrossCorrelationConfig, FirstHarmonic, Isotropic, MainLobeFit,
    Maximum, MaximumLikelihood, MaximumLikelihoodConfig, PatternTable, Pritzl2018, Residuals, Yagi,
};
use proptest::prelude::*;
use rand::{RngExt, SeedableRng, rngs::Xoshiro256PlusPlus};
use rand_distr::{Distribution, Normal};

use crate::sweeps::{Conditions, simulate, sweep_of};

/// Boxed like the program has them.
struct Boxed(Box<dyn BearingExtractor>);

impl BearingExtractor for Boxed {
    fn extract(&self, sweep: &Sweep<'_>) -> Result<Reading, NoReading> {
        self.0.extract(sweep)
    }
}

fn likelihood(residuals: Residuals) -> MaximumLikelihood<PatternTable> {
    let patch = MaximumLikelihood::new(PatternTable::reference_patch());
    patch.with_residuals(residuals).expect("defaults")
}

fn all() -> Vec<(&'static str, Boxed)> {
    vec![
        ("pritzl2018", Boxed(Box::new(Pritzl2018::default()))),
        ("maximum", Boxed(Box::new(Maximum::default()))),
        ("first harmonic", Boxed(Box::new(FirstHarmonic::default()))),
        ("first harmonic in dB", Boxed(Box::new(FirstHarmonic::in_decibels()))),
        ("main lobe", Boxed(Box::new(MainLobeFit::default()))),
        (
            "cross-correlation",
            Boxed(Box::new(CrossCorrelation::new(PatternTable::reference_patch()))),
        ),
        ("Gaussian", Boxed(Box::new(likelihood(Residuals::Gaussian)))),
        ("t", Boxed(Box::new(likelihood(Residuals::StudentT)))),
        ("reflection", Boxed(Box::new(likelihood(Residuals::Reflection)))),
        ("several", Boxed(Box::new(likelihood(Residuals::Superposed)))),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn each_keeps_the_laws(
        bearing in -3.2..3.2, heading in -3.2..3.2, noise_db in 0.0..6.0, lost in 0.0..0.97,
        whole_db: bool, seed: u64,
    ) {
        let conditions = Conditions { bearing, noise_db, lost, whole_db, heading };
        let samples = simulate(&conditions, &PatternTable::reference_patch(), seed);
        let mut room = samples.clone();
        for (_, extractor) in all() {
            laws::bearing_extractor(&extractor, &sweep_of(&samples), &mut room);
        }
    }

    /// Any readings, one or a thousand alike: no panic, no NaN, no σ of nothing.
    #[test]
    fn nothing_breaks_them(
        received in prop::collection::vec((-7.0..7.0f64, 0..24u16, -120..-20i16), 1..60),
    ) {
        let samples: Vec<Sample> = received
            .into_iter()
            .map(|(boresight, position, dbm)| Sample {
                time: 0.0,
                receiver: Pose { pitch: 0.3 * boresight.sin(), ..Pose::default() },
                boresight,
                position,
                rss_dbm: f64::from(dbm),
            })
            .collect();
        let sweep = Sweep { positions: 24, samples: &samples, ..Sweep::default() };
        for (name, extractor) in all() {
            let reading = extractor.extract(&sweep).expect("there are samples");
            prop_assert!(reading.rss_dbm.is_finite() && reading.rss_sigma_db > 0.0, "{name}");
            if let Ok(found) = reading.bearing {
                prop_assert!(found.angle.is_finite() && found.sigma > 0.0, "{name}: {found:?}");
                let bound = (found.sigma * reading.rss_sigma_db).abs() + 1e-9;
                prop_assert!(reading.covariance.abs() <= bound, "{name}: no covariance");
            }
        }
    }
}

/// A turn in which a reflection vanishes, and one in which rounding decided which look came first:
/// either read otherwise when it was louder or turned.
#[test]
fn the_search_for_a_reflection_does_not_depend_on_rounding() {
    let vanishing = Conditions {
        bearing: -2.293970009509383,
        heading: 0.45694831129959407,
        noise_db: 0.1937253642422705,
        lost: 0.10982243300819514,
        whole_db: false,
    };
    let rounded = Conditions {
        bearing: 0.0,
        heading: -0.38632945305661415,
        noise_db: 0.1,
        lost: 0.0,
        whole_db: true,
    };
    let extractor = likelihood(Residuals::Reflection);
    for (conditions, seed) in [(vanishing, 14_587_836_258_946_246_955), (rounded, 0)] {
        let samples = simulate(&conditions, &PatternTable::reference_patch(), seed);
        laws::bearing_extractor(&extractor, &sweep_of(&samples), &mut samples.clone());
    }
}

/// Errors over some turns.
struct Errors {
    rms_deg: f64,
    /// The root mean square of error over σ.
    ratio: f64,
    /// The share within 1.96 σ.
    inside: f64,
    refused: u16,
}

fn errors(
    extractor: &impl BearingExtractor,
    turns: u16,
    mut draw: impl FnMut(&mut Xoshiro256PlusPlus, f64) -> Vec<Sample>,
) -> Errors {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(20);
    let (mut squares, mut ratios, mut inside, mut found, mut refused) = (0.0, 0.0, 0.0, 0.0, 0);
    for _ in 0..turns {
        let bearing = rng.random_range(-PI..PI);
        let samples = draw(&mut rng, bearing);
        match extractor.extract(&sweep_of(&samples)).expect("a turn").bearing {
            Ok(read) => {
                let error = angle::wrap(read.angle - bearing);
                found += 1.0;
                squares += error * error;
                ratios += (error / read.sigma).powi(2);
                inside += f64::from(u8::from(error.abs() < 1.96 * read.sigma));
            }
            Err(_) => refused += 1,
        }
    }
    let rms_deg = (squares / found).sqrt().to_degrees();
    Errors { rms_deg, ratio: (ratios / found).sqrt(), inside: inside / found, refused }
}

/// 300 clean turns, seed 20. Published are 3.7, 9.1, 0.65 and thrice 0.46; the root mean square of
/// 300 scatters by 4 %, of the two maxima, whose errors come in steps with long tails, by 6 %.
/// Bands of 5 of that about what 2000 turns have; σ of all but the reference's is theirs within a
/// fifth, of the maximum, a rule of thumb, within a half.
#[test]
fn clean_turns_cost_what_was_published() {
    let expected = [3.8, 9.1, 0.75, 0.68, 1.4, 0.47, 0.47, 0.47, 0.48, 0.47];
    for ((name, extractor), expected) in all().into_iter().zip(expected) {
        let read = errors(&extractor, 300, |rng, bearing| {
            let heading = rng.random_range(0.0..TAU);
            let conditions = Conditions { bearing, heading, ..Conditions::default() };
            simulate(&conditions, &PatternTable::reference_patch(), rng.random())
        });
        assert_eq!(read.refused, 0, "{name}");
        let off = (read.rms_deg / expected - 1.0).abs();
        assert!(off < if expected > 3.0 { 0.3 } else { 0.2 }, "{name}: {}°", read.rms_deg);
        let band = match name {
            "pritzl2018" => 0.0..0.3,
            "maximum" => 0.5..1.5,
            _ => 0.8..1.25,
        };
        assert!(band.contains(&read.ratio), "{name}: error over σ {}", read.ratio);
    }
}

/// A turn over transmitters at these directions and levels in dB, each reading of 2 dB.
fn superposed(sources: &[(f64, f64)], seed: u64) -> Vec<Sample> {
    let patch = PatternTable::reference_patch();
    let mut samples = simulate(&Conditions { noise_db: 0.0, ..Conditions::default() }, &patch, 0);
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
    let noise = Normal::new(0.0, 2.0).expect("a standard deviation");
    for sample in &mut samples {
        let power = |(bearing, level): &(f64, f64)| {
            10.0_f64.powf(0.1 * (level + patch.gain_db(sample.boresight - bearing)))
        };
        let total: f64 = sources.iter().map(power).sum();
        sample.rss_dbm = 10.0 * total.log10() + noise.sample(&mut rng);
    }
    samples
}

/// Two to four transmitters at least 70° apart, levels within 10 dB, 60 turns of each number: all
/// are found and nothing else, the squared errors over σ² have the mean 1 within 5 standard errors
/// (√(2/n) of it), and the shares are those of the powers within 0.02 rms.
#[test]
fn transmitters_on_one_frequency_are_told_apart() {
    let extractor = likelihood(Residuals::Superposed);
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(3);
    for number in 2..=4_u8 {
        let mut squares = 0.0;
        let mut off = 0.0;
        let mut count = 0.0;
        for turn in 0..60 {
            let first = rng.random_range(-PI..PI);
            let mut sources: Vec<(f64, f64)> = Vec::new();
            for index in 0..number {
                let spread = TAU / f64::from(number);
                let angle = first + spread * f64::from(index);
                let play = (spread - 1.22).max(0.0) / 2.0;
                let angle = angle::wrap(angle + rng.random_range(-play..=play));
                sources.push((angle, rng.random_range(-70.0..-60.0)));
            }
            let samples = superposed(&sources, turn);
            let reading = extractor.extract(&sweep_of(&samples)).expect("a turn");
            let modes = reading.modes.as_slice();
            assert_eq!(modes.len(), usize::from(number), "{sources:?}: {modes:?}");
            let power = |level: f64| 10.0_f64.powf(0.1 * level);
            let total: f64 = sources.iter().map(|(_, level)| power(*level)).sum();
            for (bearing, level) in sources {
                let nearest = modes.iter().min_by(|a, b| {
                    let to = |mode: &BearingMode| angle::distance(mode.angle, bearing);
                    to(a).total_cmp(&to(b))
                });
                let mode = nearest.expect("there are some");
                squares += (angle::wrap(mode.angle - bearing) / mode.sigma).powi(2);
                off += (mode.weight - power(level) / total).powi(2);
                count += 1.0;
            }
        }
        let nees: f64 = squares / count;
        assert!((nees - 1.0).abs() < 5.0 * (2.0_f64 / count).sqrt(), "{number}: {nees}");
        assert!((off / count).sqrt() < 0.02, "{number}: {}", (off / count).sqrt());
    }
}

/// 400 turns of one transmitter: a second one is invented in less than 2 % of them.
#[test]
fn one_transmitter_is_not_taken_for_two() {
    let extractor = likelihood(Residuals::Superposed);
    let invented = (0..400).filter(|seed| {
        let samples = superposed(&[(0.3, -60.0)], *seed);
        !extractor.extract(&sweep_of(&samples)).expect("a turn").modes.is_empty()
    });
    let invented = invented.count();
    assert!(invented < 8, "{invented}");
}

/// One reflector at half amplitude, its direction and phase drawn for each of 200 turns, seed
/// 20. A single path errs by 10° and more than its σ; two paths by 1.4° rms in 2000 turns, of
/// which 95 % lie within 1.96 σ. The rms is made by few: it stays below 3°; a share of 0.95 in 200
/// scatters by 1.5 %, and 5 of that are 87 %.
#[test]
fn a_reflection_is_distinguished_from_the_direct_wave() {
    let antenna = PatternTable::reference_patch();
    let noise = Normal::new(0.0, 2.0).expect("a standard deviation");
    let draw = |rng: &mut Xoshiro256PlusPlus, bearing: f64| -> Vec<Sample> {
        let (from, phase) = (rng.random_range(-PI..PI), rng.random_range(0.0..TAU));
        let amplitude = |a: f64| 10_f64.powf(antenna.gain_db(a) / 20.0);
        let mut samples = Vec::new();
        for position in 0..128_u16 {
            let boresight = angle::wrap(TAU * f64::from(position) / 128.0);
            let (direct, other) = (amplitude(bearing - boresight), amplitude(from - boresight));
            let re: f64 = direct + 0.5 * other * phase.cos();
            let power = re * re + (0.5 * other * phase.sin()).powi(2);
            for _ in 0..6 {
                let rss_dbm = -60.0 + 10.0 * power.log10() + noise.sample(rng);
                let receiver = Pose::default();
                samples.push(Sample { time: 0.0, receiver, boresight, position, rss_dbm });
            }
        }
        samples
    };
    let single = errors(&likelihood(Residuals::Gaussian), 200, draw);
    assert!(single.rms_deg > 7.0, "one path: {}°", single.rms_deg);
    let two = errors(&likelihood(Residuals::Reflection), 200, draw);
    assert!(two.rms_deg < 3.0 && two.refused < 4, "two paths: {}°", two.rms_deg);
    assert!(two.inside > 0.87, "{} inside", two.inside);
}

#[test]
fn settings_are_checked() {
    let patch = PatternTable::reference_patch;
    assert!(Maximum::default().with_rss_sigma_db(0.0).is_err());
    assert!(FirstHarmonic::default().with_max_sigma(f64::NAN).is_err());
    assert!(FirstHarmonic::default().with_rss_sigma_db(-1.0).is_err());
    assert!(MainLobeFit::default().with_half_width(PI).is_err());
    assert!(MainLobeFit::default().with_max_sigma(0.0).is_err());
    let correlation =
        CrossCorrelationConfig { max_sigma_deg: 0.0, ..CrossCorrelationConfig::of(patch()) };
    assert!(CrossCorrelation::with_config(correlation).is_err());
    let correlation =
        CrossCorrelationConfig { rss_sigma_db: -0.1, ..CrossCorrelationConfig::of(patch()) };
    assert!(CrossCorrelation::with_config(correlation).is_err());
    assert!(patch().gain_dbi(0.0, 0.0).is_finite());
}

/// Each setting of a likelihood is refused by its own name, where it is out of its range and where
/// the residuals do not use it.
#[test]
fn settings_of_a_likelihood_are_refused_by_name() {
    let of = || MaximumLikelihoodConfig::of(PatternTable::reference_patch());
    let refused = |residuals, config| match MaximumLikelihood::with_config(config, residuals) {
        Ok(_) => "none",
        Err(error) => error.name,
    };
    let gaussian = |config| refused(Residuals::Gaussian, config);
    assert_eq!(gaussian(of()), "none");
    let config = MaximumLikelihoodConfig { elevation_deg: 90.0, ..of() };
    assert_eq!(gaussian(config), "elevation_deg");
    let config = MaximumLikelihoodConfig { steepest_deg: Some(-90.0), ..of() };
    assert_eq!(gaussian(config), "steepest_deg");
    let config = MaximumLikelihoodConfig { sample_sigma_db: 0.0, ..of() };
    assert_eq!(gaussian(config), "sample_sigma_db");
    let config = MaximumLikelihoodConfig { misfit_sigma_db: -1.0, ..of() };
    assert_eq!(gaussian(config), "misfit_sigma_db");
    let config = MaximumLikelihoodConfig { rss_sigma_db: -0.1, ..of() };
    assert_eq!(gaussian(config), "rss_sigma_db");
    let config = MaximumLikelihoodConfig { max_sigma_deg: f64::INFINITY, ..of() };
    assert_eq!(gaussian(config), "max_sigma_deg");
    let config = MaximumLikelihoodConfig { min_positions: 2, ..of() };
    assert_eq!(gaussian(config), "min_positions");
    let config = MaximumLikelihoodConfig { degrees: 0.0, ..of() };
    assert_eq!(refused(Residuals::StudentT, config), "degrees");
    let degrees = || MaximumLikelihoodConfig { degrees: 3.0, ..of() };
    assert_eq!(refused(Residuals::StudentT, degrees()), "none");
    let steepest = || MaximumLikelihoodConfig { steepest_deg: Some(-75.0), ..of() };
    assert_eq!(gaussian(steepest()), "none");
    for residuals in [Residuals::Gaussian, Residuals::Reflection, Residuals::Superposed] {
        assert_eq!(refused(residuals, degrees()), "degrees", "{residuals:?}");
    }
    for residuals in [Residuals::StudentT, Residuals::Reflection, Residuals::Superposed] {
        assert_eq!(refused(residuals, steepest()), "steepest_deg", "{residuals:?}");
    }
}

#[test]
fn an_antenna_that_is_flat_all_round_gives_no_direction() {
    let conditions = Conditions { bearing: 1.0, ..Conditions::default() };
    let samples = simulate(&conditions, &PatternTable::reference_patch(), 5);
    let sweep = sweep_of(&samples);
    let flat =
        |residuals| MaximumLikelihood::new(Isotropic).with_residuals(residuals).expect("defaults");
    let readings = [
        CrossCorrelation::new(Isotropic).extract(&sweep),
        flat(Residuals::Gaussian).extract(&sweep),
        flat(Residuals::StudentT).extract(&sweep),
        flat(Residuals::Reflection).extract(&sweep),
    ];
    for reading in readings {
        let reading = reading.expect("it has a level");
        assert!(reading.bearing.is_err() && reading.rss_dbm.is_finite(), "{reading:?}");
    }
}

/// Through a dipole tilted by its elevation, two paths are laid against the gain at that elevation.
#[test]
fn an_elevation_goes_through_all_that_is_made_of_the_antenna() {
    let yagi = Yagi::new(5, 0.25, 15.0).expect("in range");
    let bearing = 0.7;
    let conditions = Conditions { bearing, ..Conditions::default() };
    let elevation: f64 = -0.7;
    let mean = yagi.mean_gain_db(elevation);
    let mut samples = simulate(&conditions, &PatternTable::reference_patch(), 5);
    for sample in &mut samples {
        // A reflection at half amplitude, in phase, from 2 rad aside.
        let field = |at: f64| 10.0_f64.powf(yagi.gain_dbi(at - sample.boresight, elevation) / 20.0);
        let sum = field(bearing) + 0.5 * field(bearing + 2.0);
        sample.rss_dbm = -60.0 + 20.0 * sum.log10() - mean;
    }
    let extractor = |elevation: f64| {
        let elevation_deg = elevation.to_degrees();
        let config = MaximumLikelihoodConfig { elevation_deg, ..MaximumLikelihoodConfig::of(yagi) };
        let likelihood = MaximumLikelihood::with_config(config, Residuals::Reflection);
        likelihood.expect("in range").extract(&sweep_of(&samples))
    };
    let reported = extractor(elevation).expect("a full turn").bearing.expect("a main lobe");
    assert!(angle::distance(reported.angle, bearing) < 0.01, "{reported:?}");
}
