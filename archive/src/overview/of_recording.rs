use std::collections::HashMap;

use foxhunt_core::{BearingModes, Pose, Reception};

use super::{KnownAntenna, Overview, Received, Turn};
use crate::{recorded::BearingReading, recording::Recording};

/// What a reception and the row or turn that it was made of have in common: the bits of time and
/// place.
type Key = [u64; 4];

fn key(time: f64, receiver: &Pose) -> Key {
    let place = receiver.position;
    [time.to_bits(), place.x.to_bits(), place.y.to_bits(), place.z.to_bits()]
}

impl Overview {
    /// An overview of recordings, with nothing received yet.
    #[must_use]
    pub fn of_recordings(recordings: &[Recording], method: &str) -> Self {
        let files = recordings.iter().map(|recording| {
            let file = recording.file();
            std::path::Path::new(file)
                .file_name()
                .map_or(file.into(), |name| name.to_string_lossy())
        });
        let in_utc = !recordings.is_empty() && recordings.iter().all(Recording::is_in_utc);
        Self {
            title: files.collect::<Vec<_>>().join(", "),
            method: method.to_owned(),
            epoch_unix_s: in_utc.then_some(0.0),
            frame: recordings.iter().find_map(Recording::frame),
            ..Self::default()
        }
    }

    /// Adds the receptions of one recording, of the search of this number; `readings` are its
    /// turns, and may be empty.
    pub fn add_receptions(
        &mut self,
        search: Option<usize>,
        recording: &Recording,
        receptions: &[Reception],
        readings: &[BearingReading],
        antenna: Option<KnownAntenna<'_>>,
    ) {
        let rows = recording.records().iter().filter_map(|record| {
            Some((key(record.time?, record.receiver.as_ref()?), record.drone.as_str()))
        });
        let of_row: HashMap<Key, &str> = rows.collect();
        let turns = readings.iter().map(|read| {
            let sweep = &read.sweep.sweep;
            (key(sweep.time, &sweep.receiver), read)
        });
        let of_turn: HashMap<Key, &BearingReading> = turns.collect();
        for reception in receptions {
            let key = key(reception.time, &reception.receiver);
            let read = of_turn.get(&key);
            let drone = read.map(|read| read.sweep.drone.as_str()).or(of_row.get(&key).copied());
            let receiver = self.receiver(drone.unwrap_or_else(|| recording.file()));
            let bearing = reception.bearing.map(|bearing| bearing.angle);
            let turn = read
                .map(|read| Turn::new(&read.sweep.as_sweep(reception.beacon), antenna, bearing));
            self.add(Received {
                time: reception.time,
                receiver,
                search,
                place: reception.receiver.position,
                level: reception.level,
                bearing: reception.bearing,
                modes: reception.modes,
                remark: reception.silence.map(|_| "nothing above the receiver's floor".to_owned()),
                used: true,
                struck: false,
                id: None,
                nis: None,
                turn,
            });
        }
    }

    /// Adds a turn of a recording as an extractor read it.
    pub fn add_reading(
        &mut self,
        read: &BearingReading,
        extractor: &str,
        antenna: Option<KnownAntenna<'_>>,
    ) {
        let sweep = read.sweep.as_sweep(foxhunt_core::BeaconId(0));
        let bearing = read.reading.bearing.ok();
        let remark = match &read.reading.bearing {
            Err(reason) => format!("by {extractor}; no bearing: {reason}"),
            Ok(_) if read.is_low() => format!("by {extractor}; low confidence"),
            Ok(_) => format!("by {extractor}"),
        };
        let receiver = self.receiver(&read.sweep.drone);
        let modes: BearingModes = read.reading.modes;
        self.add(Received {
            time: sweep.time,
            receiver,
            search: None,
            place: sweep.receiver.position,
            level: Some(foxhunt_core::Level {
                rss_dbm: read.reading.rss_dbm,
                sigma_db: read.reading.rss_sigma_db,
            }),
            bearing,
            modes,
            remark: Some(remark),
            used: !read.is_low(),
            struck: false,
            id: None,
            nis: None,
            turn: Some(Turn::new(&sweep, antenna, bearing.map(|bearing| bearing.angle))),
        });
    }
}
