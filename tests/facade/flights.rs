//! Real recordings through the whole way from a file to a place or a bearing.

use approx::assert_abs_diff_eq;
use std::{
    fs,
    path::{Path, PathBuf},
};

use foxhunt::{
    config::ExtractorConfig,
    core::{Estimate, Receptions},
    geodesy::{Geodetic, radians_to_compass_deg},
    locate::LocateConfig,
    recorded::{CalibrateConfig, ReceptionConfig, bearings, calibrate, receptions},
    recording::{ReadOptions, Recording},
    registry::Registry,
};
use nalgebra::Vector2;

use crate::support::entry;

/// A folder of recordings, or `None` if it is missing.
#[expect(clippy::print_stdout, reason = "a test that is skipped prints so")]
fn recordings(folder: &str) -> Option<PathBuf> {
    let path = PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../shared/data")).join(folder);
    if path.exists() {
        return Some(path);
    }
    println!("skipped: no recordings at {}", path.display());
    None
}

/// Latitude, longitude and height of each place, in the order of `truth.csv`.
fn truths(folder: &Path) -> Vec<Geodetic> {
    let text = fs::read_to_string(folder.join("truth.csv")).expect("the truth is beside the data");
    text.lines()
        .skip(1)
        .map(|line| {
            let cells: Vec<f64> =
                line.split(',').skip(1).take(3).map(|c| c.parse().expect("a number")).collect();
            Geodetic::new(cells[0], cells[1], 0.0).expect("a place")
        })
        .collect()
}

/// Six flights over three transmitters of unknown power. The median error has to stay under that
/// of the strongest reading (46 m) and the published fits (37 m); the ellipses have to be honest,
/// that of the place outside the flown area above all.
#[test]
fn autonomous_flights_are_located() {
    let Some(folder) = recordings("aerpaw_afar") else { return };
    let truths = truths(&folder);
    let registry = Registry::builtin();
    let mut errors = Vec::new();
    let mut held = 0;
    for team in [288, 300] {
        for (place, truth) in (1..).zip(&truths) {
            let path = folder.join(format!("afar_exp{team}_loc{place}_1hz.csv"));
            let recording = Recording::read(&path, &ReadOptions::default()).expect("it is read");
            let frame = recording.frame().expect("it has positions");
            let received = receptions(
                &[recording],
                None,
                ExtractorConfig::default().build().expect("the default").as_ref(),
                &ReceptionConfig::default(),
            )
            .expect("every row is a reception");
            let estimator = registry.suited_to(&received).expect("it is built in");
            let located = estimator.locate(&received, &LocateConfig::default());
            let located = located.expect("there is enough to go by");
            let truth = frame.to_local(truth).xy();
            let error = (located.estimate.mean - truth).norm();
            let nees = located.estimate.nees(&truth).expect("positive definite");
            let ellipse = located.estimate.ellipse(0.95).expect("positive definite");
            println!("{team}/{place}: {error:.0} m, ellipse {:.0} m", ellipse.semi_major);
            held += u32::from(nees <= 5.991);
            if place == 3 {
                assert!(ellipse.semi_major > 100.0, "the ellipse of place 3 is too sure");
            }
            errors.push(error);
        }
    }
    errors.sort_by(f64::total_cmp);
    let median = (errors[2] + errors[3]) / 2.0;
    let mean = errors.iter().sum::<f64>() / 6.0;
    assert!(median <= 37.0 && mean <= 48.0, "median {median} m, mean {mean} m");
    assert_eq!(held, 6, "ellipses that hold the truth");
}

/// Two flights whose clocks both begin at 0 are two paths: what lies between the two drones was
/// never flown, and readings from there would be thinned into places where nobody was.
#[test]
fn flights_are_not_mixed_by_their_clocks() {
    let Some(folder) = recordings("aerpaw_afar") else { return };
    let paths = [288, 300].map(|team| folder.join(format!("afar_exp{team}_loc1_1hz.csv")));
    let both = Recording::read_all(&paths, &ReadOptions::default()).expect("they are read");
    let extractor = ExtractorConfig::default().build().expect("the default");
    let received = receptions(&both, None, extractor.as_ref(), &ReceptionConfig::default())
        .expect("every row is a reception");
    let first = both[0].records().len();
    for (i, (before, after)) in received.iter().zip(received.iter().skip(1)).enumerate() {
        let step = (after.receiver.position - before.receiver.position).norm();
        let seconds = after.time - before.time;
        assert!(
            i + 1 == first || step < 20.0 * seconds,
            "a drone flies {step} m in {seconds} s at row {i}"
        );
    }
}

/// Two rotations in hover: one good, one whose top is 135° wide.
#[test]
fn rotations_in_hover_have_a_bearing_or_a_low_confidence() {
    let Some(folder) = recordings("uavrt_rotation") else { return };
    let main_turn = |file: &str| {
        let recording =
            Recording::read(folder.join(file), &ReadOptions::default()).expect("it is read");
        let turns = bearings(
            &recording,
            ExtractorConfig::default().build().expect("the default").as_ref(),
            128,
        )
        .expect("it is a turn");
        turns.into_iter().max_by_key(|turn| turn.sweep.sweep.samples.len()).expect("one at least")
    };
    let good = main_turn("rotation_B_2023-06.csv");
    let bearing = good.reading.bearing.expect("it has one");
    let compass = radians_to_compass_deg(bearing.angle);
    assert!((186.0..=206.0).contains(&compass), "B points to {compass}°");
    assert!(!good.is_low(), "the confidence of B is {}", bearing.confidence);

    let poor = main_turn("rotation_A_2023-05-22.csv");
    assert!(poor.reading.bearing.is_err() || poor.is_low(), "A: {:?}", poor.reading);
}

#[test]
fn tags_at_known_distances_calibrate_the_path_loss() {
    let Some(folder) = recordings("rssi_distance") else { return };
    let recording =
        Recording::read(folder.join("vhf_tags.csv"), &ReadOptions::default()).expect("it is read");
    let extractor = ExtractorConfig::default().build().expect("the default");
    let sources = [(&recording, extractor.as_ref() as &dyn foxhunt::core::BearingExtractor)];
    let fit = calibrate(&sources, Some("0"), &CalibrateConfig::default()).expect("847 points").fit;
    assert_eq!(fit.points, 847);
    assert_abs_diff_eq!(fit.exponent, 2.29, epsilon = 0.005);
    assert_abs_diff_eq!(fit.sigma_db, 4.1, epsilon = 0.05);
}

/// The eight hand-held bearings of Lenth 1981, and where the animal was.
fn hand_held_bearings() -> Option<(Receptions, Vector2<f64>)> {
    let folder = recordings("lenth1981")?;
    let recording =
        Recording::read(folder.join("bearings.csv"), &ReadOptions::default()).expect("it is read");
    let truth = foxhunt::recorded::recorded_truth(std::slice::from_ref(&recording), None)
        .expect("truth.csv is beside it");
    let extractor = ExtractorConfig::default().build().expect("the default");
    let received = receptions(&[recording], None, extractor.as_ref(), &ReceptionConfig::default())
        .expect("every row is a reception");
    assert_eq!(received.len(), 8);
    Some((received, truth))
}

#[test]
fn hand_held_bearings_cross_near_the_truth() {
    let Some((received, truth)) = hand_held_bearings() else { return };
    let registry = Registry::builtin();
    let estimator = registry.suited_to(&received).expect("it is built in");
    let config = LocateConfig { margin_m: 10.0, ..LocateConfig::default() };
    let located = estimator.locate(&received, &config).expect("bearings cross");
    let error = (located.estimate.mean - truth).norm();
    println!("lenth1981 through {}: {error:.2} m", estimator.name);
    // One of the eight bearings is a gross outlier: the published estimate on all of them is
    // 1.95 off, and the bootstrap filter's likelihood is as little robust.
    assert!(error < 2.5, "off by {error} m");
}

/// Lenth 1981, table 2, all eight bearings: place, standard errors and correlation, to the
/// printed digits.
#[test]
fn hand_held_bearings_give_the_published_digits() {
    let Some((received, _)) = hand_held_bearings() else { return };
    for (name, place, errors, correlation, rejected) in [
        ("lenth1981", [5.87, 1.13], [1.490, 1.733], 0.509, 0),
        ("lenth1981-huber", [6.78, 1.66], [0.883, 0.945], 0.600, 0),
        ("lenth1981-andrews", [7.21, 1.97], [0.156, 0.155], 0.669, 1),
    ] {
        let located = entry(name).locate(&received, &LocateConfig::default());
        let located = located.expect("bearings cross");
        let Estimate { mean, covariance } = located.estimate;
        let found = [covariance[(0, 0)].sqrt(), covariance[(1, 1)].sqrt()];
        let text = format!("{name}: {:.3} {:.3}, {found:.4?}", mean.x, mean.y);
        assert!((mean - Vector2::from(place)).amax() < 0.0051, "{text}");
        let off =
            (Vector2::from(found) - Vector2::from(errors)).component_div(&Vector2::from(errors));
        assert!(off.amax() < 0.01, "{text}");
        assert!((covariance[(0, 1)] / found[0] / found[1] - correlation).abs() < 0.005, "{text}");
        assert_eq!((located.observations, located.rejected), (8 - rejected, rejected), "{name}");
    }
}
