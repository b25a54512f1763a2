use foxhunt_core::Pose;
use foxhunt_hunt::{hunt::Event, log::Log};

use super::{
    Details, North, Place, Record, RecordedBearing, Recording, Turns, beyond_place, row::Shared,
};

impl Recording {
    /// The receptions of a hunt's log as a recording with its truth: levels and ready-made bearings
    /// with their σ, in the log's own frame. `name` is the file's name in messages; the line of a
    /// record is that of its event. Returns `None` for a log without receptions.
    #[must_use]
    pub fn of_log(log: &Log, name: &str) -> Option<Self> {
        let shared = Shared::default();
        let records: Vec<Record> = log
            .events
            .iter()
            .zip(2..)
            .filter_map(|(event, line)| {
                let Event::Received { drone, reception, .. } = event else { return None };
                let beacon = log.header.beacons.get(usize::from(reception.beacon.0));
                let bearing = reception.bearing;
                let Pose { position, heading, .. } = reception.receiver;
                let details = Details {
                    beacon: beacon.map(|beacon| beacon.name.as_str().into()),
                    drone: drone.to_string().into(),
                    floor_dbm: reception.silence.map(|floor| floor.rss_dbm),
                    ceiling_dbm: reception.saturation.map(|ceiling| ceiling.rss_dbm),
                    bearing: bearing.map(|bearing| RecordedBearing {
                        angle: bearing.angle,
                        sigma: Some(bearing.sigma),
                        is_calibrated: false,
                    }),
                    measured: reception.measured,
                    truth: beacon.and_then(|beacon| beacon.place_at(reception.time)),
                    tilted: beyond_place(reception.receiver),
                    ..Details::default()
                };
                Some(Record {
                    line,
                    time: Some(reception.time),
                    place: Some(Place { position, heading }),
                    rss_dbm: reception.level.map(|level| level.rss_dbm),
                    details: shared.details(details),
                })
            })
            .collect();
        let rows = u64::try_from(records.len()).unwrap_or(u64::MAX);
        if rows == 0 {
            return None;
        }
        Some(Self {
            file: name.to_owned(),
            format: "foxhunt log".to_owned(),
            frame: None,
            in_degrees: false,
            north: North::True,
            in_utc: false,
            calibrated: true,
            names_drones: true,
            turns: Turns::Circle,
            rows,
            dropped: Vec::new(),
            backwards: None,
            ignored: Vec::new(),
            remarks: Vec::new(),
            records,
        })
    }
}
