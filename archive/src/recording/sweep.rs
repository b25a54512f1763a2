//! Sweeps of a recording, played back and written.

use std::{
    collections::{BTreeMap, VecDeque},
    f64::consts::TAU,
    io::Write,
};

use foxhunt_core::{
    BeaconId, OwnedSweep, PatternSource, Pose, Sample, Sweep, Unanswered,
    angle::{self, nearest_position},
    parameter::at_least_one,
};
use foxhunt_wire::geodesy::radians_to_compass_deg;

use super::{Column, Record, Recording, RecordingError, Turns};

/// A level along a boresight, with the row that it is from and the time of its sample.
#[derive(Clone, Copy)]
struct LevelRow<'r> {
    record: &'r Record,
    boresight: f64,
    rss_dbm: f64,
    time: f64,
}

impl Turns {
    /// Cuts one drone's readings of one beacon, in the order in which they were taken, into
    /// turns of positions `step` radians apart.
    fn cut<'h, 'r>(self, levels: &'h [LevelRow<'r>], step: f64) -> Vec<&'h [LevelRow<'r>]> {
        let mut turns = Vec::new();
        let mut begin = 0;
        let mut gone = 0.0_f64;
        for (index, pair) in levels.windows(2).enumerate() {
            let [before, after] = pair else { continue };
            gone += angle::wrap(after.boresight - before.boresight);
            let ends = match self {
                Self::File => false,
                // Half a step short: the first position of the next turn, as well as it was met.
                Self::Circle => gone.abs() >= TAU - 0.5 * step,
                Self::GapS(gap) => after.time - before.time > gap,
            };
            if ends {
                turns.extend(levels.get(begin..=index));
                begin = index + 1;
                gone = 0.0;
            }
        }
        turns.extend(levels.get(begin..).filter(|rest| !rest.is_empty()));
        turns
    }
}

/// One turn of the antenna out of a recording.
#[derive(Clone, Debug, PartialEq)]
pub struct RecordedSweep {
    /// The name of the beacon that it is of; `None` for a nameless one.
    pub beacon_name: Option<String>,
    /// The receiver's name.
    pub drone: String,
    /// The turn's number, if the recording has such.
    pub turn: Option<u32>,
    /// The line of its first reading.
    pub line: u64,
    /// True if the recording has the receiver's place; if not, poses are at the origin.
    pub located: bool,
    /// Readings of the turn in the order of time. The receiver is the mean over the turn; the rows
    /// between its first and last that have a boresight but no level are `unanswered`. All recorded
    /// sweeps are of beacon 0: [`as_sweep`](Self::as_sweep) numbers them.
    pub sweep: OwnedSweep,
}

impl RecordedSweep {
    /// Returns the sweep as extractors take it, with this beacon.
    #[must_use]
    pub fn as_sweep(&self, beacon: BeaconId) -> Sweep<'_> {
        Sweep { beacon, ..self.sweep.as_sweep() }
    }
}

impl Recording {
    /// The turns of the antenna, in the order in which they ended.
    ///
    /// A turn holds one drone's readings of one beacon that have a boresight and a level. The
    /// `turn` column decides which belong together; without it, the mapping's [`Turns`] do. A
    /// reading without a `position` belongs to the one whose nominal angle 2πi / `positions` is
    /// nearest to its boresight. Where the recording has no times, its rows are taken to be a
    /// second apart.
    ///
    /// A recording whose antenna has no direction has no sweeps.
    ///
    /// # Errors
    ///
    /// [`RecordingError::Parameter`] for 0 positions; [`RecordingError::Field`] for a
    /// `position` that such a turn does not have.
    pub fn sweeps(&self, positions: u16) -> Result<Vec<RecordedSweep>, RecordingError> {
        at_least_one("positions", u32::from(positions))
            .map_err(|source| RecordingError::Parameter { file: self.file.clone(), source })?;
        let step = TAU / f64::from(positions);
        let mut sweeps = Vec::new();
        for group in self.groups() {
            let turns = match group.first().map(|first| first.record.turn) {
                Some(Some(_)) => vec![&group[..]],
                _ => self.turns.cut(&group, step),
            };
            for turn in turns {
                sweeps.push(self.sweep(turn, positions)?);
            }
        }
        sweeps.sort_by(|a: &RecordedSweep, b| a.sweep.time.total_cmp(&b.sweep.time));
        Ok(sweeps)
    }

    /// Groups the rows with boresight and level by beacon, drone and turn, each in the order of
    /// time.
    fn groups(&self) -> Vec<Vec<LevelRow<'_>>> {
        let mut groups = Vec::<Vec<LevelRow<'_>>>::new();
        let mut places = BTreeMap::new();
        let mut order = 0.0;
        for record in &self.records {
            order += 1.0;
            let (Some(boresight), Some(rss_dbm)) = (record.boresight, record.rss_dbm) else {
                continue;
            };
            let time = record.time.unwrap_or(order);
            let level = LevelRow { record, boresight, rss_dbm, time };
            let key = (record.turn, record.beacon.as_deref(), &*record.drone);
            let place = *places.entry(key).or_insert(groups.len());
            match groups.get_mut(place) {
                Some(group) => group.push(level),
                None => groups.push(vec![level]),
            }
        }
        for group in &mut groups {
            group.sort_by(|a, b| a.time.total_cmp(&b.time));
        }
        groups
    }

    fn sweep(
        &self,
        levels: &[LevelRow<'_>],
        positions: u16,
    ) -> Result<RecordedSweep, RecordingError> {
        let mut samples = Vec::with_capacity(levels.len());
        for one in levels {
            let receiver = one.record.receiver().unwrap_or_default();
            let position = self.position(one.record, one.boresight, positions)?;
            samples.push(Sample {
                time: one.time,
                receiver,
                boresight: one.boresight,
                position,
                rss_dbm: one.rss_dbm,
            });
        }
        let records = || levels.iter().map(|one| one.record);
        let first = records().min_by_key(|record| record.line);
        let last = records().map(|record| record.line).max();
        let unanswered = self.unanswered(first, last, positions)?;
        Ok(RecordedSweep {
            beacon_name: first.and_then(|record| record.beacon.as_deref()).map(str::to_owned),
            drone: first.map(|record| record.drone.to_string()).unwrap_or_default(),
            turn: first.and_then(|record| record.turn),
            line: first.map_or(0, |record| record.line),
            located: first.is_some_and(|record| record.receiver().is_some()),
            sweep: OwnedSweep {
                time: samples.last().map_or(0.0, |sample| sample.time),
                receiver: Pose::mean(samples.iter().map(|sample| &sample.receiver))
                    .unwrap_or_default(),
                positions,
                samples,
                unanswered,
                floor_dbm: first.and_then(|record| record.floor_dbm),
                ..OwnedSweep::default()
            },
        })
    }

    /// The rows without a level between two rows, of the same drone, beacon and turn.
    fn unanswered(
        &self,
        first: Option<&Record>,
        last: Option<u64>,
        positions: u16,
    ) -> Result<Vec<Unanswered>, RecordingError> {
        let (Some(first), Some(last)) = (first, last) else { return Ok(Vec::new()) };
        let of_turn = |(_, record): &(f64, &Record)| {
            let same = record.beacon == first.beacon
                && record.drone == first.drone
                && record.turn == first.turn;
            same && record.rss_dbm.is_none() && (first.line..=last).contains(&record.line)
        };
        let unanswered = |(order, record): (f64, &Record)| {
            let boresight = record.boresight?;
            let time = record.time.unwrap_or(order);
            let position = self.position(record, boresight, positions);
            Some(position.map(|position| Unanswered { time, boresight, position }))
        };
        let orders = std::iter::successors(Some(1.0), |order| Some(order + 1.0));
        orders.zip(&self.records).filter(of_turn).filter_map(unanswered).collect()
    }

    fn position(
        &self,
        record: &Record,
        boresight: f64,
        positions: u16,
    ) -> Result<u16, RecordingError> {
        match record.position {
            Some(given) if given >= positions => {
                Err(self.no_such_position(record, given, positions))
            }
            Some(given) => Ok(given),
            None => Ok(nearest_position(boresight, positions)),
        }
    }

    fn no_such_position(&self, record: &Record, given: u16, positions: u16) -> RecordingError {
        RecordingError::Field {
            file: self.file.clone(),
            line: record.line,
            column: "position".to_owned(),
            value: given.to_string(),
            problem: super::FieldProblem::NotWhole { max: f64::from(positions - 1) },
        }
    }
}

/// A pattern source that replays the turns of a recording instead of turning an antenna: for each
/// beacon of [`begin`](PatternSource::begin) it lends the next turn of that beacon.
#[derive(Clone, Debug, Default)]
pub struct RecordedSource {
    /// Remaining turns, in the order in which they ended.
    turns: VecDeque<(BeaconId, RecordedSweep)>,
    pending: VecDeque<BeaconId>,
    current: Option<RecordedSweep>,
}

impl RecordedSource {
    /// The turns of one drone. `beacons` are the names of the hunt's beacons in their order; a
    /// turn that names none of them is left out, and one without a name is of the first.
    #[must_use]
    pub fn new(
        sweeps: impl IntoIterator<Item = RecordedSweep>,
        drone: &str,
        beacons: &[String],
    ) -> Self {
        let id = |sweep: &RecordedSweep| match &sweep.beacon_name {
            None => Some(BeaconId(0)),
            Some(name) => {
                let index = beacons.iter().position(|known| known == name)?;
                u16::try_from(index).ok().map(BeaconId)
            }
        };
        let own = sweeps.into_iter().filter(|sweep| sweep.drone == drone);
        let turns = own.filter_map(|sweep| Some((id(&sweep)?, sweep))).collect();
        Self { turns, pending: VecDeque::new(), current: None }
    }

    /// Returns the number of turns that remain.
    #[must_use]
    pub fn left(&self) -> usize {
        self.turns.len()
    }
}

impl PatternSource for RecordedSource {
    type Error = RecordingEnded;

    fn begin(&mut self, beacons: &[BeaconId]) -> Result<(), RecordingEnded> {
        self.pending = beacons.iter().copied().collect();
        Ok(())
    }

    fn poll(&mut self) -> Result<Option<Sweep<'_>>, RecordingEnded> {
        let Some(beacon) = self.pending.pop_front() else { return Ok(None) };
        let next = self.turns.iter().position(|(of, _)| *of == beacon);
        let (_, sweep) =
            next.and_then(|index| self.turns.remove(index)).ok_or(RecordingEnded { beacon })?;
        Ok(Some(self.current.insert(sweep).as_sweep(beacon)))
    }
}

/// A recording holds no more turns of a beacon.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the recording holds no further turn of beacon {}", beacon.0)]
pub struct RecordingEnded {
    /// The beacon, counted from 0.
    pub beacon: BeaconId,
}

/// The columns of a written recording. A number comes first: a name may begin like a comment.
const COLUMNS: [Column; 13] = [
    Column::Turn,
    Column::Drone,
    Column::Beacon,
    Column::TimeS,
    Column::EastM,
    Column::NorthM,
    Column::UpM,
    Column::HeadingDegCompass,
    Column::PitchDeg,
    Column::RollDeg,
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
                receiver.pitch.to_degrees().to_string(),
                receiver.roll.to_degrees().to_string(),
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
        (Column::PitchDeg, sample.receiver.pitch.to_degrees()),
        (Column::RollDeg, sample.receiver.roll.to_degrees()),
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
