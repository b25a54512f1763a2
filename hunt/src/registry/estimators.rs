//! The estimators that have a name, and the menu of them.

use std::f64::consts::TAU;

#[cfg(feature = "batch")]
use foxhunt_filters::Loss;

use super::{EstimatorEntry, combined, locators};
use crate::{
    config::{
        EstimatorConfig, FilterConfig, GateConfig, MovingConfig, OutlierConfig, ParticleConfig,
        ReceiversConfig, SeveralConfig,
    },
    hunt::{Components, TimeStep, TrackConfig, WithoutBearing},
};

/// The reference's random walk in metres per step: q² is 0.1957², its exponent lost in print
/// (Pritzl 2018, §4.4).
const PRITZL_DRIFT: f64 = 0.1957;

/// √70 m, the root of the reference's prior variance (Pritzl 2018, §4.4).
const PRITZL_PRIOR_SIGMA_M: f64 = 8.366_600_265_340_756;

/// The root of 0.19572 m², the other reading of what is printed there.
const PRITZL_VARIANCE_DRIFT: f64 = 0.442_402_531_638_326;

/// The estimator `default`: it assumes what a user knows, which is neither the transmitter's
/// power nor the level's σ to better than some dB.
pub const DEFAULT_ESTIMATOR: &str = "default";

/// Enough for what follows to change an iterated update by less than the filter's own tolerance;
/// most end after 3 to 6.
const ITERATIONS: u32 = 10;

/// The random walk of a still beacon, m/√s: a few decimetres over a hunt, so that nothing
/// freezes.
const STILL: f64 = 0.02;

/// Number of receptions from which a grid gives a Kalman filter its start: two formation positions
/// of three drones.
const START_ON_GRID: u32 = 6;

/// Bearings alone; a turn without one is of no use.
const BEARING_ONLY: TrackConfig = TrackConfig {
    time_step: TimeStep::Elapsed,
    first_position_rss_sigma_db: None,
    rss_sigma_db: None,
    without_bearing: WithoutBearing::Discard,
    components: Components::BearingOnly,
};

/// Estimators that a newcomer chooses from, in the order of the list, each with when to use it.
///
/// Every estimator that a scenario, a trial or `locate` takes by itself is here, and one for each
/// kind of recording. The others are variants, baselines and forms from the literature.
const MENU: [(&str, &str); 22] = [
    (
        "default",
        "levels and bearings of a still beacon; the power and σ of the level need not be known",
    ),
    (
        "team",
        "hunts by receivers of different makes: learns what each one's levels and compass are off",
    ),
    (
        "several",
        "hunts for an unknown number of transmitters on one frequency, with the extractor \
         `maximum-likelihood-several`",
    ),
    (
        "grid",
        "levels and bearings of a still beacon, with a known power and a known σ of the level; \
         some 15 times faster than `default`",
    ),
    (
        "particle",
        "the cases of `grid`, with 5000 particles; recordings: the default of `locate` for turns \
         at fewer than three places",
    ),
    (
        "iterated-posterior-linearisation",
        "levels and bearings on a microcontroller: it allocates nothing after it has started",
    ),
    ("ukf", "the common unscented Kalman filter, to compare with"),
    ("ekf", "the common extended Kalman filter, to compare with; over-confident near a beacon"),
    ("imm", "levels and bearings of a beacon that stands and walks by turns"),
    (
        "gaussian-sum",
        "measurements that two places fit; bearings alone, in a room or from one moving receiver",
    ),
    ("particle-bearing", "bearings alone of a still beacon in a room; ignores the level"),
    ("particle-bearing-moving", "bearings alone of a moving beacon in a room; ignores the level"),
    (
        "batch",
        "a still beacon and little computing time; solves for all receptions again after each one",
    ),
    ("batch-robust", "the cases of `batch`, with outliers"),
    ("range-difference", "range differences to a reference receiver"),
    ("magnetic-dipole", "the magnetic field of an avalanche beacon"),
    ("pulses", "single pulses of a tag, in a hunt or a recording; the antenna must be known"),
    (
        "shadowing-grid",
        "recordings: the default of `locate` for levels, and for turns at three places or more",
    ),
    ("bearing-grid", "recordings: the default of `locate` for bearings alone"),
    ("multilateration", "recordings: the default for ranges alone, of Wi-Fi or ultra-wideband"),
    ("range-differences", "recordings: the default for range differences alone (--reference-m)"),
    ("ukf-pritzl2018", "the reference system's filter, to compare with"),
];

/// Every estimator that has a name.
pub(super) fn builtin() -> Vec<EstimatorEntry> {
    let gate = GateConfig::Probability(0.999);
    let as_read = |filter| EstimatorConfig {
        filter,
        drift: STILL,
        prior_sigma_m: None,
        power_sigma_db: None,
        exponent_sigma: None,
        receivers: None,
        several: None,
        moving: None,
        lag_s: None,
        start_on_grid: None,
        track: TrackConfig::default(),
    };
    let started =
        |filter| EstimatorConfig { start_on_grid: Some(START_ON_GRID), ..as_read(filter) };
    let pritzl = |drift, filter| EstimatorConfig {
        filter,
        drift,
        prior_sigma_m: Some(PRITZL_PRIOR_SIGMA_M),
        power_sigma_db: None,
        exponent_sigma: None,
        receivers: None,
        several: None,
        moving: None,
        lag_s: None,
        start_on_grid: None,
        track: TrackConfig::pritzl2018(),
    };
    let pritzl_ukf = FilterConfig::Ukf {
        gate: GateConfig::Pritzl2018,
        alpha: 0.001,
        beta: 2.0,
        kappa: 1.0,
        iterations: 1,
    };
    let bearing_cloud = FilterConfig::Particle(ParticleConfig::of(2000));
    let mut entries = vec![
        EstimatorEntry::of_settings(
            DEFAULT_ESTIMATOR,
            "grid that estimates the reference power and σ of the level along with the place",
            "Bucy & Senne 1971; Doucet et al. 2000 (Rao-Blackwell)",
            EstimatorConfig {
                power_sigma_db: Some(5.0),
                ..as_read(FilterConfig::Grid { side: 64, level_noise_spread: Some(0.5) })
            },
        ),
        EstimatorEntry::of_settings(
            "team",
            "the grid of `default`, with an offset of level and compass and a σ for each receiver",
            "Doucet et al. 2000 (Rao-Blackwell); Särkkä & Nummenmaa 2009",
            EstimatorConfig {
                power_sigma_db: Some(5.0),
                receivers: Some(ReceiversConfig { level_sigma_db: 8.0, bearing_sigma_deg: 10.0 }),
                ..as_read(FilterConfig::Grid { side: 64, level_noise_spread: None })
            },
        ),
        EstimatorEntry::of_settings(
            "several",
            "an unknown number of transmitters on one frequency: labelled multi-Bernoulli over \
             rows of Gaussians",
            "Reuter, Vo, Vo & Dietmayer 2014",
            EstimatorConfig {
                power_sigma_db: Some(5.0),
                several: Some(SeveralConfig {
                    detection: 0.5,
                    wrong: 0.05,
                    births: 0.4,
                    most_birth: 0.2,
                }),
                ..as_read(FilterConfig::RangeParameterised { parts: 8, iterations: ITERATIONS })
            },
        ),
        EstimatorEntry::of_settings(
            "grid",
            "recursive Bayes over cells that follow the belief",
            "Bucy & Senne 1971",
            as_read(FilterConfig::Grid { side: 64, level_noise_spread: None }),
        ),
        EstimatorEntry::of_settings(
            "ukf-pritzl2018",
            "the reference system's unscented Kalman filter with its gate and its σ of the level",
            "Pritzl 2018, §4.4",
            pritzl(PRITZL_DRIFT, pritzl_ukf),
        ),
        EstimatorEntry::of_settings(
            "ekf-pritzl2018",
            "the extended Kalman filter that the reference system was compared with",
            "Pritzl 2018, §4.4 and §6",
            pritzl(PRITZL_DRIFT, FilterConfig::Ekf { gate: GateConfig::Pritzl2018, iterations: 1 }),
        ),
        EstimatorEntry::of_settings(
            "ukf-pritzl2018-variance",
            "ukf-pritzl2018 with the printed 0.19572 m² read as the variance",
            "Pritzl 2018, §4.4",
            pritzl(PRITZL_VARIANCE_DRIFT, pritzl_ukf),
        ),
        EstimatorEntry::of_settings(
            "ukf",
            "unscented Kalman filter, sigma points at √2 standard deviations, χ² gate",
            "Julier & Uhlmann 2004; Wan & van der Merwe 2000",
            started(FilterConfig::Ukf { gate, alpha: 1.0, beta: 2.0, kappa: 0.0, iterations: 1 }),
        ),
        EstimatorEntry::of_settings(
            "ekf",
            "extended Kalman filter, χ² gate",
            "Bar-Shalom, Li & Kirubarajan 2001, §10.3",
            started(FilterConfig::Ekf { gate, iterations: 1 }),
        ),
        EstimatorEntry::of_settings(
            "ekf-iterated",
            "extended Kalman filter linearised up to 10 times about its posterior, χ² gate",
            "Bell & Cathey 1993",
            started(FilterConfig::Ekf { gate, iterations: ITERATIONS }),
        ),
        EstimatorEntry::of_settings(
            "ekf-dual",
            "two extended Kalman filters, each from one half of the prior, weighed by their \
             evidence: for measurements that two places fit",
            "Okello, Fletcher, Mušicki & Ristic 2011",
            as_read(FilterConfig::DualEkf { iterations: 1 }),
        ),
        EstimatorEntry::of_settings(
            "cubature",
            "cubature Kalman filter, χ² gate",
            "Arasaratnam & Haykin 2009",
            started(FilterConfig::Cubature { gate, outliers: None, iterations: 1 }),
        ),
        EstimatorEntry::of_settings(
            "iterated-posterior-linearisation",
            "cubature points redrawn up to 10 times from the posterior, damped, χ² gate",
            "García-Fernández, Svensson, Morelande & Särkkä 2015; Raitoharju et al. 2018",
            started(FilterConfig::Cubature { gate, outliers: None, iterations: ITERATIONS }),
        ),
        EstimatorEntry::of_settings(
            "iterated-posterior-linearisation-robust",
            "iterated posterior linearisation without a gate: one reception in twenty is an \
             outlier",
            "the above; Bar-Shalom & Tse 1975",
            started(FilterConfig::Cubature {
                gate: GateConfig::Open,
                outliers: Some(OutlierConfig { share: 0.05, support: 100.0 * TAU }),
                iterations: ITERATIONS,
            }),
        ),
        EstimatorEntry::of_settings(
            "gaussian-sum",
            "the prior as 49 Gaussians, each run by iterated posterior linearisation, merged as \
             they agree",
            "Alspach & Sorenson 1972; Runnalls 2007",
            as_read(FilterConfig::GaussianSum { parts: 7, outliers: None, iterations: ITERATIONS }),
        ),
        EstimatorEntry::of_settings(
            "range-parameterised",
            "a row of 12 Gaussians along the first bearing, ranges in geometric progression",
            "Peach 1995; Arulampalam & Ristic 2000",
            as_read(FilterConfig::RangeParameterised { parts: 12, iterations: ITERATIONS }),
        ),
        EstimatorEntry::of_settings(
            "imm",
            "interacting multiple models, still and moving, each linearised up to 10 times about \
             its posterior",
            "Blom & Bar-Shalom 1988",
            EstimatorConfig {
                moving: Some(MovingConfig { spectral_density: 2.5e-3, speed_sigma: 0.3 }),
                ..started(FilterConfig::Imm {
                    sojourn_s: [600.0, 60.0],
                    still_drift: STILL,
                    iterations: ITERATIONS,
                })
            },
        ),
        EstimatorEntry::of_settings(
            "particle",
            "particle filter, 5000 particles, regularised systematic resampling",
            "Gordon, Salmond & Smith 1993; Liu & West 2001",
            as_read(FilterConfig::Particle(ParticleConfig::of(5000))),
        ),
        EstimatorEntry::of_settings(
            "particle-adaptive",
            "particle filter with 500 to 20 000 particles, as many as the belief is wide",
            "Fox 2003",
            as_read(FilterConfig::Particle(ParticleConfig {
                adaptive_bin: Some(0.5),
                ..ParticleConfig::of(20_000)
            })),
        ),
        EstimatorEntry::of_settings(
            "particle-rao-blackwellised",
            "2000 particles, each with a Gaussian of the reference power, which is in doubt by 5 \
             dB",
            "Doucet et al. 2000; Schön, Gustafsson & Nordlund 2005",
            EstimatorConfig {
                power_sigma_db: Some(5.0),
                ..as_read(FilterConfig::RaoBlackwellised { count: 2000 })
            },
        ),
        EstimatorEntry::of_settings(
            "particle-bearing",
            "particle filter on bearings alone, 2000 particles",
            "Isaacs et al. 2014, §IV",
            EstimatorConfig { track: BEARING_ONLY, ..as_read(bearing_cloud) },
        ),
        EstimatorEntry::of_settings(
            "particle-bearing-moving",
            "particle filter on bearings alone, 5000 particles, target at some centimetres per \
             second",
            "Isaacs et al. 2014, §IV",
            EstimatorConfig {
                moving: Some(MovingConfig { spectral_density: 2.5e-5, speed_sigma: 0.05 }),
                track: BEARING_ONLY,
                ..as_read(FilterConfig::Particle(ParticleConfig::of(5000)))
            },
        ),
        EstimatorEntry::of_settings(
            "grid-free-exponent",
            "grid that estimates the reference power and the path-loss exponent along with the \
             place",
            "Bucy & Senne 1971; Doucet et al. 2000 (Rao-Blackwell)",
            EstimatorConfig {
                power_sigma_db: Some(5.0),
                exponent_sigma: Some(0.5),
                receivers: None,
                several: None,
                ..as_read(FilterConfig::Grid { side: 64, level_noise_spread: None })
            },
        ),
    ];
    #[cfg(feature = "batch")]
    entries.extend([
        EstimatorEntry::of_settings(
            "batch",
            "the most probable place, solved anew over all receptions after each",
            "Levenberg 1944; Marquardt 1963; Bar-Shalom, Li & Kirubarajan 2001, §3.4",
            as_read(FilterConfig::Batch { loss: Loss::Gaussian }),
        ),
        EstimatorEntry::of_settings(
            "batch-robust",
            "batch with residuals as Student's t with 4 degrees of freedom has them",
            "Lange, Little & Taylor 1989",
            as_read(FilterConfig::Batch { loss: Loss::StudentT { degrees: 4.0 } }),
        ),
    ]);
    entries.extend(combined::builtin());
    entries.extend(locators::builtin());
    with_menu(entries)
}

/// Adds to each entry of the menu when to use it.
fn with_menu(entries: Vec<EstimatorEntry>) -> Vec<EstimatorEntry> {
    let with = |entry: EstimatorEntry| match MENU.iter().find(|(name, _)| entry.name == *name) {
        Some((_, when)) => entry.recommended_for(*when),
        None => entry,
    };
    entries.into_iter().map(with).collect()
}

/// Returns the place of a name in the menu; names of a user's own come last.
pub(super) fn menu_place(name: &str) -> usize {
    MENU.iter().position(|(listed, _)| *listed == name).unwrap_or(MENU.len())
}
