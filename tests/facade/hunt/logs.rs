//! Logs of hunts, and their replays.

use super::*;
use approx::assert_abs_diff_eq;

/// The settings of an estimator.
fn settings(name: &str) -> EstimatorConfig {
    *entry(name).settings().expect("it has settings")
}

fn logged(outing: &Outing, config: EstimatorConfig) -> String {
    let header = LogHeader {
        foxhunt_log: LOG_VERSION,
        scenario: "toy".to_owned(),
        seed: 5,
        estimator_name: "ukf-pritzl2018".to_owned(),
        estimator: Some(config),
        model: ModelConfig {
            reference_dbm: LAW.0,
            exponent: LAW.1,
            target_up_m: 0.0,
            antenna: None,
            reference_m: None,
            pulses: None,
            terrain: None,
        },
        planner: None,
        beacons: TARGETS
            .iter()
            .map(|truth| LoggedBeacon {
                name: "b".to_owned(),
                truth: Some(*truth),
                course: None,
                others: Vec::new(),
            })
            .collect(),
        epoch_unix_s: None,
        homes: Vec::new(),
        origin: None,
    };
    let mut text = Vec::new();
    let mut writer = LogWriter::new(&mut text, &header).expect("memory takes everything");
    for event in &outing.events {
        writer.event(event).expect("memory takes everything");
    }
    String::from_utf8(text).expect("JSON is UTF-8")
}

#[test]
fn a_log_is_read_back_and_replays_to_the_bit() {
    let outing = fly(triangle(), [Health::Good, Health::Silent, Health::Good], false);
    let config = settings("ukf-pritzl2018");
    let text = logged(&outing, config);
    let log = Log::parse(&text, Path::new("toy.jsonl")).expect("its own output");
    assert_eq!(log.events, outing.events);
    assert!(!log.torn);

    let own = replay(&log, &Registry::builtin(), None).expect("its own configuration");
    let corrected = outing.events.iter().filter(|e| matches!(e, Event::Corrected { .. })).count();
    assert_eq!((own.compared, own.different), (corrected, 0));
    let registry = Registry::builtin();
    for other in registry.estimators() {
        let needs = other.needs();
        if needs.all_at_once || !needs.others.is_empty() {
            continue;
        }
        let replayed = replay(&log, &registry, Some(other)).expect("levels and bearings do");
        assert_eq!(replayed.fixes.len(), 2);
        for (fix, truth) in replayed.fixes.iter().zip(TARGETS) {
            let miss = (fix.estimate.mean - truth).norm();
            if other.name == "particle-bearing-moving" {
                // The silent drone costs 90 s at each position, in which a beacon that moves may
                // be anywhere, and the bearings are good to 3°: too much for a cloud.
                assert!(miss.is_finite());
                continue;
            }
            // The extended filter is the worst of them: its linearisation costs it 3.9 m here.
            assert!(miss < 5.0, "{} missed by {miss} m", other.name);
        }
    }
}

#[test]
fn a_filter_that_is_too_sure_of_levels_raises_an_alarm() {
    let diverged = |outing: &Outing| {
        let alarms = outing.events.iter().filter_map(|event| match event {
            Event::FilterDiverged { beacon, average_nis, interval, .. } => {
                assert!(*average_nis > interval[1] && interval[0] < interval[1]);
                Some(beacon.0)
            }
            _ => None,
        });
        alarms.collect::<Vec<_>>()
    };
    let sound = fly(triangle(), [Health::Good; 3], false);
    assert!(diverged(&sound).is_empty(), "{:?}", diverged(&sound));
    // Levels that are off by decibels, believed to a hundredth.
    let sure = TrackConfig {
        first_position_rss_sigma_db: None,
        rss_sigma_db: Some(0.01),
        ..TrackConfig::pritzl2018()
    };
    let outing = fly_as(sure, triangle(), [Health::Good; 3], false);
    let alarms = diverged(&outing);
    assert!(!alarms.is_empty(), "none in {} s", outing.duration);
    // The log keeps them, and a replay counts the same.
    let named = settings("ukf-pritzl2018");
    let text = logged(&outing, EstimatorConfig { track: sure, ..named });
    let log = Log::parse(&text, Path::new("toy.jsonl")).expect("its own output");
    assert_eq!(log.events, outing.events);
    let replayed = replay(&log, &Registry::builtin(), None).expect("its own configuration");
    assert_eq!(replayed.different, 0);
    for (beacon, fix) in (0..).zip(&replayed.fixes) {
        let noted = alarms.iter().filter(|alarm| **alarm == beacon).count();
        assert_eq!(usize::try_from(fix.diverged).expect("few"), noted, "{}", fix.name);
        assert_eq!(fix.nis.count() > 0, fix.whiteness.ljung_box().is_some());
    }
}

#[test]
fn receptions_that_come_late_are_used_at_their_own_time() {
    let outing = fly(triangle(), [Health::Good; 3], false);
    let first = outing.events.iter().map_while(|event| match event {
        Event::BeaconFinished { .. } => None,
        Event::Received { reception, .. } => Some(Some(*reception)),
        _ => Some(None),
    });
    let in_order: Vec<Reception> = first.flatten().collect();
    let mut late = in_order.clone();
    late.chunks_exact_mut(7).for_each(<[Reception]>::reverse);
    assert!(!late.is_sorted_by(|a, b| a.time <= b.time), "nothing comes late");
    let prior = Estimate::isotropic(Vector2::new(2.0, 2.0), 8.4);
    let ukf = || Ukf::new(RandomWalk::uniform(0.3), model(), prior).expect("a proper prior");
    fn fused(estimator: impl Estimator<2, 2> + 'static, receptions: &[Reception]) -> Estimate<2> {
        let mut track = Track::new(estimator, TrackConfig::default());
        for reception in receptions {
            let step = track.update(reception, false).expect("each is of use");
            assert!(matches!(step, TrackStep::Updated { .. }));
        }
        track.position()
    }
    let back = || OutOfOrder::from_first(ukf(), 1e6).expect("a proper lag");
    let exact = fused(back(), &in_order);
    let again = fused(back(), &late);
    // But for the rounding of times, of which a walk makes next to nothing.
    assert!((again.mean - exact.mean).norm() < 1e-9, "{} {}", again.mean, exact.mean);
    assert!((again.covariance - exact.covariance).norm() < 1e-9);
    let forward = fused(ukf(), &late);
    assert!((forward.mean - exact.mean).norm() > 0.01, "without it there is no difference");
}

#[test]
fn beacons_that_share_turns_are_believed_in_from_the_start() {
    let config = HuntConfig { shared_turns: true, ..hunt_config() };
    let track = TrackConfig::pritzl2018();
    let outing = fly_with(config, track, triangle(), [Health::Good; 3], false);
    let found = outing.events.iter().filter_map(|event| match event {
        Event::BeaconFinished { fix, .. } => Some(fix),
        _ => None,
    });
    let found = found.collect::<Vec<_>>();
    for (fix, truth) in found.iter().zip(TARGETS) {
        assert_eq!((fix.outcome, fix.steps), (Outcome::Converged, 3 * fix.formation_positions));
        let miss = (fix.estimate.mean - truth).norm();
        assert!(miss < 1.5, "{} is {miss} m off", fix.name);
    }
    // The second was received at every position of the first, and then at its own.
    assert!(found[1].formation_positions >= found[0].formation_positions + 7);
    let started = outing.events.iter().filter(|e| matches!(e, Event::BeaconStarted { .. }));
    assert!(
        started.clone().all(|e| matches!(e, Event::BeaconStarted { time, .. } if *time < 1e-9))
    );
    assert_eq!(started.count(), 2);
    // Its search begins around where it is believed to be.
    let goals: Vec<&Vec<_>> = outing
        .events
        .iter()
        .skip_while(|e| !matches!(e, Event::BeaconFinished { .. }))
        .filter_map(|e| match e {
            Event::GoalsSet { goals, .. } => Some(goals),
            _ => None,
        })
        .collect();
    let centre = goals[0].iter().sum::<nalgebra::Vector3<f64>>() / 3.0;
    assert!((centre.xy() - TARGETS[1]).norm() < 1.5, "it begins around {centre}");

    let named = settings("ukf-pritzl2018");
    let log = Log::parse(&logged(&outing, named), Path::new("toy.jsonl")).expect("its own output");
    assert_eq!(log.events, outing.events);
    let replayed = replay(&log, &Registry::builtin(), None).expect("its own configuration");
    assert!(replayed.compared > 40);
    assert_eq!(replayed.different, 0);
    for (replayed, fix) in replayed.fixes.iter().zip(found) {
        assert_eq!((replayed.steps, replayed.logged.as_ref()), (fix.steps, Some(fix)));
    }
}

#[test]
fn a_silent_drone_of_shared_turns_is_waited_for_as_long_as_both_may_take() {
    let config = HuntConfig { shared_turns: true, ..hunt_config() };
    let healths = [Health::Good, Health::Silent, Health::Good];
    let one = config.turn_timeout_s;
    let outing = fly_with(config, TrackConfig::pritzl2018(), Hold::new(1), healths, false);
    let waited: Vec<f64> = outing
        .events
        .iter()
        .filter_map(|event| match event {
            Event::Missing { waited_s, .. } => Some(*waited_s),
            _ => None,
        })
        .collect();
    assert_eq!(waited.len(), 2, "one event for a drone and a position");
    assert_abs_diff_eq!(waited[0], 2.0 * one, epsilon = 0.5);
    assert_abs_diff_eq!(waited[1], one, epsilon = 0.5);
}

#[test]
fn a_torn_log_loses_its_last_line_alone() {
    let outing = fly(Hold::new(1), [Health::Good; 3], false);
    let config = settings("ukf-pritzl2018");
    let text = logged(&outing, config);
    let path = Path::new("toy.jsonl");
    let torn = Log::parse(&text[..text.len() - 9], path).expect("all but the last line");
    assert!(torn.torn);
    assert_eq!(torn.events[..], outing.events[..outing.events.len() - 1]);

    let broken = text.replacen("\"received\"", "\"recieved\"", 1);
    let error = Log::parse(&broken, path).expect_err("a misspelt event").to_string();
    let line = broken.lines().position(|l| l.contains("recieved")).expect("it is there") + 1;
    assert!(error.contains(&format!("toy.jsonl, line {line}")), "{error}");
    let version = |of: u32| format!("\"foxhunt_log\":{of}");
    let newer = text.replacen(&version(LOG_VERSION), &version(LOG_VERSION + 1), 1);
    let error = Log::parse(&newer, path).expect_err("another version").to_string();
    assert!(error.contains(&(LOG_VERSION + 1).to_string()), "{error}");
    // Cut within a character, and with bytes that are no text at all.
    let file = Path::new(env!("CARGO_TARGET_TMPDIR")).join("torn.jsonl");
    let foreign = text.replace("second", "druhý");
    let within = foreign.rfind('ý').expect("it is there") + 1;
    fs::write(&file, &foreign.as_bytes()[..within]).expect("it can be written");
    let torn = Log::read(&file).expect("all but the last line");
    assert!(torn.torn && torn.events.len() < outing.events.len());
    fs::write(&file, b"\xff\n").expect("it can be written");
    assert!(Log::read(&file).is_err());
    assert!(Log::parse("", path).is_err() && Log::parse("t_s,lat\n", path).is_err());
}

#[test]
fn a_log_goes_on_behind_its_last_whole_line() {
    let outing = fly(Hold::new(1), [Health::Good; 3], false);
    let text = logged(&outing, settings("ukf-pritzl2018"));
    let file = Path::new(env!("CARGO_TARGET_TMPDIR")).join("appended.jsonl");
    let more = Event::Resumed { time: 7.5 };
    // Whole, without the end of its last line, and torn.
    for (cut, kept) in [(0, 0), (1, 0), (9, 1)] {
        fs::write(&file, &text[..text.len() - cut]).expect("it can be written");
        let there = Log::read(&file).expect("a log").events;
        assert_eq!(there.len(), outing.events.len() - kept);
        let mut writer = LogWriter::append(&file).expect("it can be written");
        writer.event(&more).expect("it can be written");
        let log = Log::read(&file).expect("a log");
        assert!(!log.torn);
        assert_eq!(log.events[..there.len()], there);
        assert_eq!(log.events[there.len()..], *std::slice::from_ref(&more), "cut by {cut}");
    }
}

#[test]
fn two_beacons_of_one_name_and_an_endless_cloud() {
    let outing = fly(Hold::new(2), [Health::Good; 3], false);
    let config = settings("ukf-pritzl2018");
    let text = logged(&outing, config);
    let path = Path::new("toy.jsonl");
    let log = Log::parse(&text.replace("\"second\"", "\"first\""), path).expect("it is a log");
    let replayed = replay(&log, &Registry::builtin(), None).expect("its own configuration");
    let beacons: Vec<BeaconId> = replayed.fixes.iter().map(|fix| fix.beacon).collect();
    assert_eq!(beacons, [BeaconId(0), BeaconId(1)]);

    let particle = settings("particle");
    let text = logged(&outing, particle).replacen("5000", "18446744073709551615", 1);
    let log = Log::parse(&text, path).expect("it is a log");
    let error = replay(&log, &Registry::builtin(), None).expect_err("no memory holds it");
    assert!(matches!(error, foxhunt::replay::ReplayError::Estimator { .. }), "{error}");
}
