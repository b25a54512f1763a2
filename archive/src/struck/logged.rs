use std::path::Path;

use foxhunt_hunt::{hunt::Event, log::Log};

use super::{ReceptionId, StruckError, StruckList, read};

/// Receptions of a log that are left out of its replay.
pub type Struck = StruckList<ReceptionId>;

impl Struck {
    /// Reads a file of receptions, each of which is in the log.
    ///
    /// # Errors
    ///
    /// [`StruckError`] names the file, the line and the value.
    pub fn read(path: &Path, log: &Log) -> Result<Self, StruckError> {
        Self::parse(&read(path)?, path, log)
    }

    /// Reads receptions from text; `path` is what errors call it.
    ///
    /// # Errors
    ///
    /// [`StruckError`] names the file, the line and the value.
    pub fn parse(text: &str, path: &Path, log: &Log) -> Result<Self, StruckError> {
        Self::checked(text, path, "drone, beacon and time of a reception", |line, id| {
            let nearest = nearest(*id, log);
            if nearest == Some(*id) {
                return Ok(());
            }
            let path = path.to_owned();
            Err(StruckError::NoReception { path, line, reception: *id, nearest })
        })
    }
}

/// The log's reception of the same drone and beacon that is nearest in time.
fn nearest(wanted: ReceptionId, log: &Log) -> Option<ReceptionId> {
    let receptions = log.events.iter().filter_map(|event| match event {
        Event::Received { drone, reception, .. } => Some(ReceptionId::new(*drone, reception)),
        _ => None,
    });
    receptions
        .filter(|other| (other.drone, other.beacon) == (wanted.drone, wanted.beacon))
        .min_by(|a, b| (a.time - wanted.time).abs().total_cmp(&(b.time - wanted.time).abs()))
}

#[cfg(test)]
mod tests {
    use foxhunt_hunt::registry::Registry;

    use super::*;
    use crate::replay::{Replayer, replay};

    /// A log of six bearings about a beacon at (40, 30) and of one that is far off, at 6 s.
    fn log() -> Log {
        let mut text = concat!(
            r#"{"foxhunt_log":6,"scenario":"field","seed":1,"estimator_name":"ukf","#,
            r#""model":{"reference_dbm":-29.06,"exponent":2.765},"beacons":[]}"#,
            "\n",
            r#"{"event":"beacon_started","time":0.0,"beacon":0,"name":"fox","#,
            r#""prior":{"mean":[0.0,0.0],"covariance":[2500.0,0.0,0.0,2500.0]}}"#,
            "\n",
        )
        .to_owned();
        let places = [(0.0, 0.0), (60.0, 0.0), (0.0, 60.0), (20.0, 0.0), (60.0, 60.0), (40.0, 0.0)];
        for (second, (east, north)) in (1_u8..).zip(places) {
            let towards = f64::atan2(30.0 - north, 40.0 - east);
            let angle = if second == 6 { -towards } else { towards };
            let time = f64::from(second);
            let drone = second % 2;
            text += &format!(
                r#"{{"event":"received","time":{time:?},"drone":{drone},"first_position":false,"#,
            );
            text += &format!(
                r#""reception":{{"beacon":0,"time":{time:?},"receiver":{{"position":[{east:?},"#,
            );
            text += &format!(
                r#"{north:?},4.0],"heading":0.0}},"bearing":{{"angle":{angle:?},"sigma":0.1,"#,
            );
            text += "\"confidence\":0.9},\"covariance\":0.0}}\n";
        }
        Log::parse(&text, Path::new("log")).expect("a log")
    }

    fn parse(lines: &str) -> Result<Struck, StruckError> {
        let text = format!("{{\"foxhunt_struck\":1}}\n{lines}");
        Struck::parse(&text, Path::new("list"), &log())
    }

    #[test]
    fn what_is_struck_is_as_if_it_had_never_been_received() {
        let mut log = log();
        let struck = parse("{\"drone\":0,\"beacon\":0,\"time\":6.0}\n\n").expect("it is there");
        assert_eq!(struck.len(), 1);
        let registry = Registry::builtin();
        let ukf = registry.estimator("ukf").expect("it is built in");
        let mut replayer =
            Replayer::new(&log.header, &registry, Some(ukf)).expect("it is").without(struck);
        for event in &log.events {
            let _ = replayer.event(event).expect("a plain log");
        }
        let without = replayer.finish();
        let with = replay(&log, &registry, Some(ukf)).expect("a plain log");
        log.events.pop();
        let never = replay(&log, &registry, Some(ukf)).expect("a plain log");
        assert_eq!(without.fixes[0].estimate, never.fixes[0].estimate);
        assert_eq!((without.fixes[0].steps, never.fixes[0].steps), (5, 5));
        assert_ne!(with.fixes[0].estimate, never.fixes[0].estimate);
    }

    #[test]
    fn what_is_wrong_is_named() {
        let error = |lines: &str| parse(lines).expect_err("it is wrong").to_string();
        let elsewhere = error("{\"drone\":0,\"beacon\":0,\"time\":5.9}");
        for part in ["list, line 2", "time 5.9", "nearest is at 6"] {
            assert!(elsewhere.contains(part), "{part:?} is not in {elsewhere}");
        }
        let other_drone = error("{\"drone\":1,\"beacon\":0,\"time\":6.0}");
        assert!(other_drone.contains("nearest is at 5"), "{other_drone}");
        let nobody = error("{\"drone\":0,\"beacon\":7,\"time\":6.0}");
        assert!(nobody.contains("none of that beacon"), "{nobody}");
        let line = "{\"drone\":0,\"beacon\":0,\"time\":6.0}";
        let twice = error(&format!("{line}\n{line}\n"));
        assert!(twice.contains("line 3") && twice.contains("line 2"), "{twice}");
        for broken in ["6.0", "{\"drone\":0}", "{\"drone\":0,\"beacon\":0,\"time\":6.0,\"x\":1}"] {
            assert!(error(broken).contains("line 2"), "{broken}");
        }
        for header in ["", "{}", "{\"foxhunt_struck\":2}", "{\"foxhunt_log\":6}"] {
            let error = Struck::parse(header, Path::new("list"), &log()).expect_err("no header");
            assert!(error.to_string().contains("list, line 1"), "{error}");
        }
    }
}
