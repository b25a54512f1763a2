//! Logs of hunts, written, read back and replayed.

use approx::{abs_diff_eq, assert_abs_diff_eq};
use std::path::Path;

use foxhunt_archive::{
    replay::{ReplayError, replay, replay_with},
    struck::Struck,
};
use foxhunt_core::{
    BeaconId, Bearing, Belief, Decision, Estimate, EstimatorError, Level, Outcome, OwnedSweep,
    Pose, RandomWalk, Reception, Sample, Stage, Station, angle, planner_fn,
};
use foxhunt_filters::Ckf;
use foxhunt_hunt::{
    config::ModelConfig,
    hunt::{Command, Event, Hunt, HuntConfig, Parts, Search, Track, TrackConfig},
    log::{LOG_VERSION, Log, LogHeader, LogWriter},
    registry::{EstimatorEntry, Need, Needs, Registry, TrackRequest, beacon_seed},
};
use foxhunt_sensors::Pritzl2018;
use foxhunt_show::overview::{KeptTurn, Overview};
use nalgebra::{Vector2, Vector3};
use serde_json::Value;

const SEED: u64 = 7;
const TARGET: Vector2<f64> = Vector2::new(30.0, 12.0);
const MODEL: ModelConfig = ModelConfig {
    reference_dbm: -29.06,
    exponent: 2.765,
    target_up_m: 0.0,
    antenna: None,
    reference_m: None,
    pulses: None,
    terrain: None,
};

/// A level and a bearing with errors that look like noise.
fn reception(time: f64, beacon: BeaconId, receiver: Pose) -> Reception {
    let way = TARGET - receiver.position.xy();
    let range = way.norm().hypot(receiver.position.z);
    let rss_dbm =
        MODEL.reference_dbm - 10.0 * MODEL.exponent * range.log10() + 2.0 * (7.3 * time).sin();
    let angle = way.y.atan2(way.x) + 0.1 * (3.1 * time).sin();
    Reception {
        beacon,
        time,
        receiver,
        level: Some(Level { rss_dbm, sigma_db: 3.0 }),
        bearing: Some(Bearing { angle, sigma: 0.15, confidence: 0.8 }),
        ..Reception::default()
    }
}

fn track(
    estimator: &EstimatorEntry,
    search: &Search<'_>,
    monitored: bool,
) -> Result<Track, EstimatorError> {
    let model = MODEL.build().expect("in range");
    let seed = beacon_seed(SEED, search.beacon);
    let request =
        TrackRequest { search: *search, model: &model, reference: None, pulses: None, seed };
    estimator.track(&request, monitored)
}

/// The events of a hunt that one drone flies in ten legs.
fn fly(estimator: &EstimatorEntry) -> Vec<Event> {
    let own = estimator.clone();
    let mut legs = 0;
    let planner = planner_fn(move |_: &dyn Belief, stations: &mut [Station]| {
        legs += 1;
        for station in stations {
            let north = if legs % 3 == 0 { 15.0 } else { -4.0 };
            station.goal.position = station.pose.position + Vector3::new(5.0, north, 0.0);
        }
        let more = Decision::Listen(Stage::Searching);
        Ok(if legs < 10 { more } else { Decision::Finish(Outcome::Converged) })
    });
    let tracks = move |search: &Search<'_>| track(&own, search, false);
    let parts = Parts::new(Pritzl2018::default(), planner, tracks);
    let beacons = vec!["fox".to_owned()];
    let mut hunt = Hunt::new(parts, beacons, HuntConfig::default()).expect("proper parts");
    let mut pose = Pose::at(0.0, 0.0, 10.0);
    hunt.start(0.0, vec![Station::holding(pose)]).expect("one drone");
    let mut events = Vec::new();
    let mut time = 0.0;
    while !hunt.is_finished() {
        time += 1.0;
        assert!(time < 1000.0, "it has to end");
        hunt.located(time, 0, pose);
        hunt.advance(time).expect("nothing fails");
        while let Some(command) = hunt.poll_command() {
            match command {
                Command::GoTo { goal, .. } => pose.position = goal.position,
                Command::Listen { beacons, .. } => {
                    for beacon in beacons {
                        hunt.reception(time, 0, &reception(time, beacon, pose));
                    }
                }
                Command::Land { .. } => {}
            }
        }
        events.extend(std::iter::from_fn(|| hunt.poll_event()));
    }
    events
}

/// The log of a hunt as it stands in a file.
fn written(estimator: &EstimatorEntry) -> String {
    let header = LogHeader {
        foxhunt_log: LOG_VERSION,
        scenario: "toy".to_owned(),
        seed: SEED,
        estimator_name: estimator.name.clone().into_owned(),
        estimator: estimator.settings().copied(),
        model: MODEL,
        planner: None,
        beacons: Vec::new(),
        epoch_unix_s: None,
        homes: Vec::new(),
        origin: None,
    };
    let mut text = Vec::new();
    let mut writer = LogWriter::new(&mut text, &header).expect("memory takes everything");
    for event in fly(estimator) {
        writer.event(&event).expect("memory takes everything");
    }
    String::from_utf8(text).expect("JSON is UTF-8")
}

fn parse(text: &str) -> Log {
    Log::parse(text, Path::new("toy.jsonl")).expect("a log")
}

/// A bare cubature filter of the user's own.
fn own(drift: f64) -> EstimatorEntry {
    let needs = Needs {
        level: Need::Used,
        bearing: Need::Used,
        others: Vec::new(),
        moving: false,
        all_at_once: false,
    };
    let make = move |request: &TrackRequest<'_>| {
        let walk = RandomWalk::uniform(drift);
        let filter = Ckf::new(walk, request.model.clone(), request.search.prior)?;
        Ok(Track::new::<2, 2>(filter, TrackConfig::default()))
    };
    EstimatorEntry::own("mine", "a bare cubature filter", "this test", needs, make)
}

#[test]
fn a_log_replays_to_the_bit_through_its_own_settings() {
    let registry = Registry::builtin();
    for name in ["default", "ukf-pritzl2018", "particle", "particle-bearing", "imm"] {
        let estimator = registry.estimator(name).expect("built in");
        let log = parse(&written(estimator));
        let replayed = replay(&log, &registry, None).expect("its own settings");
        assert!(replayed.compared >= 10, "{name}: {replayed:?}");
        assert_eq!(replayed.different, 0, "{name}");
        let [fix] = &replayed.fixes[..] else { panic!("{replayed:?}") };
        let logged = fix.logged.as_ref().expect("it ended");
        assert_eq!((fix.steps, &fix.name), (logged.steps, &"fox".to_owned()), "{name}");
        assert_eq!(fix.estimate, logged.estimate, "{name}");
        assert_eq!(fix.nis.count() > 0, fix.whiteness.ljung_box().is_some(), "{name}");

        let other = registry.estimator("ekf").expect("built in");
        let other = replay(&log, &registry, Some(other)).expect("level and bearing are there");
        assert_eq!(other.compared, replayed.compared);
        assert!(other.different > 0, "{name} is not ekf");
    }
}

#[test]
fn the_log_holds_the_prior_of_the_filter() {
    let registry = Registry::builtin();
    let started = |name: &str| {
        let events = fly(registry.estimator(name).expect("built in"));
        let started = events.iter().find_map(|event| match event {
            Event::BeaconStarted { prior, hunt_prior, .. } => Some((*prior, *hunt_prior)),
            _ => None,
        });
        started.expect("the search has begun")
    };
    let hunt = Estimate::isotropic(Vector2::zeros(), HuntConfig::default().prior_sigma_m);
    let (prior, hunt_prior) = started("ukf-pritzl2018");
    // √70 m (Pritzl 2018, §4.4), squared again.
    assert_abs_diff_eq!(prior.covariance[(0, 0)], 70.0, epsilon = 1e-9);
    assert_eq!(hunt_prior, Some(hunt));
    assert_eq!(started("ukf"), (hunt, None));
}

#[test]
fn an_estimator_of_ones_own_replays_where_it_is_registered() {
    let text = written(&own(0.02));
    let log = parse(&text);
    assert_eq!(log.header.estimator, None);
    let registered = Registry::builtin().with_estimator(own(0.02));
    let replayed = replay(&log, &registered, None).expect("it is registered");
    assert!(replayed.compared >= 10 && replayed.different == 0, "{replayed:?}");
    // Another one under its name is another one.
    let wrong = Registry::builtin().with_estimator(own(0.5));
    assert!(replay(&log, &wrong, None).expect("there is one").different > 0);
    let error = replay(&log, &Registry::builtin(), None).expect_err("nobody knows it");
    assert_eq!(error, ReplayError::NotRegistered { estimator: "mine".to_owned() });
    assert!(error.to_string().contains("\"mine\"; register that name"), "{error}");
    // Through the user's own tracks.
    let estimator = own(0.02);
    let mut tracks = |search: &Search<'_>| track(&estimator, search, true);
    let by_hand = replay_with(&log, &mut tracks).expect("a proper estimator");
    assert_eq!((by_hand.compared, by_hand.different), (replayed.compared, 0));
    // All at once is no stream.
    let grid = registered.estimator("shadowing-grid").expect("built in");
    assert!(matches!(replay(&log, &registered, Some(grid)), Err(ReplayError::Name(_))));
}

/// The log as versions 2 to 5 wrote it: the prior of the hunt, no beacon and no degrees of freedom
/// of corrections.
fn as_version(version: u32, text: &str) -> String {
    let lines = text.lines().map(|line| {
        let mut line: Value = serde_json::from_str(line).expect("JSON");
        let fields = line.as_object_mut().expect("an object");
        if let Some(number) = fields.get_mut("foxhunt_log") {
            *number = version.into();
        }
        if fields.get("event").is_some_and(|event| event == "corrected") {
            assert!(fields.remove("beacon").is_some());
            assert!(fields.remove("degrees_of_freedom").is_some());
        }
        if let Some(hunt_prior) = fields.remove("hunt_prior") {
            fields.insert("prior".to_owned(), hunt_prior);
        }
        format!("{line}\n")
    });
    lines.collect()
}

#[test]
fn logs_of_older_versions_replay_to_the_bit() {
    let registry = Registry::builtin();
    for name in ["ukf-pritzl2018", "ukf"] {
        let text = written(registry.estimator(name).expect("built in"));
        let new = replay(&parse(&text), &registry, None).expect("its own settings");
        for version in 2..=5 {
            let old = parse(&as_version(version, &text));
            assert_eq!(old.header.foxhunt_log, version);
            assert_eq!(replay(&old, &registry, None), Ok(new.clone()), "{name}, {version}");
        }
    }
    let newer = as_version(LOG_VERSION + 1, &written(registry.estimator("ukf").expect("built in")));
    assert!(Log::parse(&newer, Path::new("toy.jsonl")).is_err());
}

/// Hunts of scenario `one-drone`, seed 3, flown and logged before version 6. Filters round
/// otherwise since then, and a cloud draws other random numbers: it lands within a standard
/// deviation.
#[test]
fn logs_of_the_program_before_version_6_lead_to_the_same_fixes() {
    let registry = Registry::builtin();
    for (name, within_sigma) in [("ukf-pritzl2018", 1e-6), ("particle", 1.0), ("default", 1e-6)] {
        let file = format!("../archive/tests/data/logs/version-5-{name}.jsonl");
        let log = Log::read(&Path::new(env!("CARGO_MANIFEST_DIR")).join(file)).expect("a log");
        assert_eq!(log.header.foxhunt_log, 5);
        let replayed = replay(&log, &registry, None).expect("its own settings");
        assert!(replayed.compared > 5, "{name}: {replayed:?}");
        let [fix] = &replayed.fixes[..] else { panic!("{replayed:?}") };
        let logged = fix.logged.as_ref().expect("it was found").estimate;
        let off = fix.estimate.nees(&logged.mean).expect("definite").sqrt();
        assert!(off < within_sigma, "{name}: {off} standard deviations");
        let ratio = fix.estimate.covariance.trace() / logged.covariance.trace();
        assert!(abs_diff_eq!(ratio, 1.0, epsilon = within_sigma), "{name}: {ratio}");
    }
}

#[test]
fn replays_and_overviews_have_the_remarks_of_the_examination() {
    let registry = Registry::builtin();
    let file = "../archive/tests/data/logs/version-5-default.jsonl";
    let mut log = Log::read(&Path::new(env!("CARGO_MANIFEST_DIR")).join(file)).expect("a log");
    let codes = |log: &Log| -> Vec<String> {
        let (overview, replayed) =
            Overview::of_log(log, &registry, None, &Struck::default(), Vec::new(), None)
                .expect("its own settings");
        let [search] = &overview.searches[..] else { panic!("{:?}", overview.searches) };
        let [fix] = &replayed.fixes[..] else { panic!("{replayed:?}") };
        assert_eq!(search.remarks, fix.remarks);
        fix.remarks.iter().map(|remark| remark.code.to_string()).collect()
    };
    assert_eq!(codes(&log), [""; 0]);
    // An antenna that looked the other way.
    for event in &mut log.events {
        if let Event::Received { reception, .. } = event
            && let Some(bearing) = &mut reception.bearing
        {
            bearing.angle = angle::wrap(bearing.angle + std::f64::consts::PI);
        }
    }
    assert!(codes(&log).contains(&"bearings-do-not-meet".to_owned()), "{:?}", codes(&log));
}

#[test]
fn an_overview_holds_the_beliefs_of_the_replay() {
    let registry = Registry::builtin();
    let particle = registry.estimator("particle").expect("built in");
    let log = parse(&written(particle));
    let logged: Vec<_> = (log.events.iter())
        .filter_map(|event| match event {
            Event::Received { drone, reception, .. } => Some((*drone, *reception)),
            _ => None,
        })
        .collect();
    let (drone, first) = *logged.first().expect("receptions");
    let sample = Sample {
        time: first.time,
        receiver: first.receiver,
        boresight: 0.0,
        position: 0,
        rss_dbm: -60.0,
    };
    let sweep = OwnedSweep {
        beacon: first.beacon,
        time: first.time,
        positions: 8,
        samples: vec![sample; 8],
        ..OwnedSweep::default()
    };
    let kept = vec![KeptTurn { drone, sweep }];
    let overview = Overview::of_log(&log, &registry, None, &Struck::default(), kept, None);
    let (overview, replayed) = overview.expect("its own estimator");
    assert_eq!(replayed.different, 0);
    assert_eq!(overview.received.len(), logged.len());
    for (received, (_, reception)) in overview.received.iter().zip(&logged) {
        assert_eq!(received.bearing, reception.bearing);
        assert!(received.used && received.search == Some(0));
    }
    let turns = overview.received.iter().filter_map(|received| received.turn.as_ref());
    assert_eq!(turns.map(|turn| turn.samples.len()).collect::<Vec<_>>(), [8]);
    let [search] = overview.searches.as_slice() else { panic!("one beacon") };
    // The prior, and one belief for each reception.
    assert_eq!(search.beliefs.len(), logged.len() + 1);
    let corrected = log.events.iter().filter_map(|event| match event {
        Event::Corrected { estimate, .. } => Some(*estimate),
        _ => None,
    });
    for (believed, estimate) in search.beliefs.iter().skip(1).zip(corrected) {
        assert_eq!(believed.estimate, estimate, "to the bit");
        assert_eq!(believed.cloud.len(), 2000);
        // Places that stand for a belief lie about its mean: 2000 of them within σ/4.
        let mean = believed.cloud.iter().sum::<Vector2<f64>>() / 2000.0;
        let off = believed.estimate.nees(&mean);
        assert!(off.is_some_and(|off| off < 1.0 / 16.0), "{off:?}");
    }
    assert_eq!(search.outcome.as_deref(), Some("converged"));
    assert!(overview.notices.iter().any(|notice| notice.text == "looking for fox"));
    let path = &overview.receivers[0].path;
    assert!(path.is_sorted_by(|a, b| a.time <= b.time) && path.len() > logged.len(), "{path:?}");
}
