use std::io::Write;

use foxhunt_core::{Sample, Sweep};
use foxhunt_wire::geodesy::radians_to_compass_deg;

use super::{Column, RecordingError};

/// The columns of a written recording. A number comes first: a name may begin like a comment.
const COLUMNS: [Column; 11] = [
    Column::Turn,
    Column::Drone,
    Column::Beacon,
    Column::TimeS,
    Column::EastM,
    Column::NorthM,
    Column::UpM,
    Column::HeadingDegCompass,
    Column::BoresightDegCompass,
    Column::Position,
    Column::RssDbm,
];

/// Writes sweeps in our own format, in local metres. They read back the same: numbers to the
/// bit, angles to rounding. A sweep without samples leaves no trace.
pub struct SweepWriter<W: Write> {
    csv: csv::Writer<W>,
    turns: u32,
}

impl<W: Write> std::fmt::Debug for SweepWriter<W> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("SweepWriter").field("turns", &self.turns).finish_non_exhaustive()
    }
}

impl<W: Write> SweepWriter<W> {
    /// Writes the header.
    ///
    /// # Errors
    ///
    /// [`RecordingError::Write`] when `out` fails.
    pub fn new(out: W) -> Result<Self, RecordingError> {
        let mut csv = csv::Writer::from_writer(out);
        csv.write_record(COLUMNS.map(Column::name)).map_err(failed)?;
        Ok(Self { csv, turns: 0 })
    }

    /// Writes one turn of a drone's antenna; each call is a new turn.
    ///
    /// # Errors
    ///
    /// [`RecordingError`] for names and numbers that would not read back; nothing is written
    /// then. [`RecordingError::Write`] when the writer fails.
    pub fn write(
        &mut self,
        drone: &str,
        beacon: &str,
        sweep: &Sweep<'_>,
    ) -> Result<(), RecordingError> {
        for (column, name) in [("drone", drone), ("beacon", beacon)] {
            if name.is_empty() || name.trim() != name {
                return Err(RecordingError::Name { column, value: name.to_owned() });
            }
        }
        for (index, sample) in sweep.samples.iter().enumerate() {
            check(index, sample)?;
        }
        for sample in sweep.samples {
            let receiver = sample.receiver;
            let cells = [
                self.turns.to_string(),
                drone.to_owned(),
                beacon.to_owned(),
                sample.time.to_string(),
                receiver.position.x.to_string(),
                receiver.position.y.to_string(),
                receiver.position.z.to_string(),
                radians_to_compass_deg(receiver.heading).to_string(),
                radians_to_compass_deg(sample.boresight).to_string(),
                sample.position.to_string(),
                sample.rss_dbm.to_string(),
            ];
            self.csv.write_record(cells).map_err(failed)?;
        }
        self.turns += 1;
        // A crash loses no turn before it.
        self.csv.flush().map_err(|source| RecordingError::Write { source })
    }

    /// Writes the rest of the buffer.
    ///
    /// # Errors
    ///
    /// [`RecordingError::Write`] when the writer fails.
    pub fn finish(mut self) -> Result<(), RecordingError> {
        self.csv.flush().map_err(|source| RecordingError::Write { source })
    }
}

fn failed(error: csv::Error) -> RecordingError {
    RecordingError::Write { source: error.into() }
}

/// Refuses a sample that reading would refuse.
fn check(index: usize, sample: &Sample) -> Result<(), RecordingError> {
    let place = sample.receiver.position;
    let bounded = [
        (Column::TimeS, sample.time),
        (Column::EastM, place.x),
        (Column::NorthM, place.y),
        (Column::UpM, place.z),
        (Column::RssDbm, sample.rss_dbm),
    ];
    for (column, value) in bounded {
        if !column.admits(value) {
            return Err(RecordingError::Sample { index, field: column.name(), value });
        }
    }
    let angles = [("heading", sample.receiver.heading), ("boresight", sample.boresight)];
    match angles.into_iter().find(|(_, angle)| !angle.is_finite()) {
        Some((field, value)) => Err(RecordingError::Sample { index, field, value }),
        None => Ok(()),
    }
}
