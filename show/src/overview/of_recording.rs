use std::collections::HashMap;

use foxhunt_core::BearingModes;

use super::{KnownAntenna, Overview, Received, Turn};
use foxhunt_archive::{
    recorded::{BearingReading, RecordedReception, RecordedReceptions},
    recording::Recording,
    struck::{ReceptionKey, RowId},
};

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
            relative_levels: recordings.iter().any(|recording| !recording.is_calibrated()),
            remarks: recordings.iter().flat_map(Recording::remarks).cloned().collect(),
            ..Self::default()
        }
    }

    /// Adds the receptions of one recording and beacon, of the search of this number. `file` is
    /// what the recording is called in a [`RowId`]; `readings` are its turns, and may be empty.
    pub fn add_receptions(
        &mut self,
        search: Option<usize>,
        file: &str,
        beacon: Option<&str>,
        received: &RecordedReceptions,
        readings: &[BearingReading],
        antenna: Option<KnownAntenna<'_>>,
    ) {
        // A row can begin a turn and hold a measurement besides, at another time.
        let of_turn: HashMap<(u64, u64), &BearingReading> = (readings.iter())
            .map(|read| ((read.sweep.line, read.sweep.sweep.time.to_bits()), read))
            .collect();
        for RecordedReception { line, drone, reception } in received.iter() {
            let read = of_turn.get(&(line, reception.time.to_bits()));
            let receiver = self.receiver(&drone);
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
                id: Some(key(file, line, beacon)),
                nis: None,
                turn,
            });
        }
    }

    /// Adds a turn of a recording as an extractor read it; `file` is what the recording is called
    /// in a [`RowId`].
    pub fn add_reading(
        &mut self,
        file: &str,
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
            id: Some(key(file, read.sweep.line, read.sweep.beacon_name.as_deref())),
            nis: None,
            turn: Some(Turn::new(&sweep, antenna, bearing.map(|bearing| bearing.angle))),
        });
    }
}

fn key(file: &str, line: u64, beacon: Option<&str>) -> ReceptionKey {
    let beacon = beacon.map(str::to_owned);
    ReceptionKey::Recorded(RowId { file: file.to_owned(), line, beacon })
}
