//! Shared parts of the commands that locate transmitters from recordings.

use std::{
    borrow::Cow,
    path::{Path, PathBuf},
};

use foxhunt::{
    calibration::{CalibrationFile, ConformalFile, PathLossSection},
    config::{BoxedExtractor, ExtractorConfig, PulseLevelConfig},
    core::{EstimatorError, Reception, Receptions, Remark, nalgebra::Vector2},
    locate::{
        ClockSearch, FoundOffset, Height, LocateConfig, LocateError, Located, Power, Residual,
    },
    overview::{Overview, SearchOverview},
    page::{NotStrikable, PageLog},
    recorded::{
        ReceptionConfig, RecordedReception, RecordedReceptions, RowResidual, bearings,
        correct_arrays, recorded_receptions, recorded_truth, row_name,
    },
    recording::Recording,
    registry::{EstimatorEntry, Registry, antenna_named},
    relocation::Relocation,
    sensors::{ElevationPattern, Isotropic},
    struck::{RowId, StruckError, StruckRows, file_names},
};
#[cfg(feature = "batch")]
use foxhunt::{
    locate::{Listener, Tracked, TrackingConfig, left_out, track_watched},
    recorded::listeners,
};
use serde::{Serialize, Serializer};

use super::{
    calibration::{Calibration, Part, Surroundings, calibrated, narrate_corrected, parts},
    choice::{self, Extraction},
    parameters::{EastNorthUp, OverTerrain, Parameter, Relief},
    recorded::{Clocked, LatLon, Reading, no_degrees},
    views::Antennas,
};
use crate::{error::CliError, output::warn_once};

/// Name shown for a beacon without one.
pub const NAMELESS: &str = "(no name)";

/// Truths farther apart than this are not interpolated, in seconds.
#[cfg(feature = "batch")]
pub const TRUTH_GAP_S: f64 = 300.0;

/// Options for locating transmitters.
#[derive(Debug, clap::Args)]
pub struct Locating {
    /// The estimator (`foxhunt list estimators` describes them); chosen by what was recorded unless
    /// given
    #[arg(long, value_name = "NAME")]
    estimator: Option<String>,
    /// The power at one metre in dBm, or `free` where it is not known; needs --exponent
    #[arg(long, value_name = "V|free", default_value = "free", allow_hyphen_values = true)]
    p0_dbm: Parameter,
    /// The path-loss exponent, or `free` where it is not known
    #[arg(long, value_name = "V|free", default_value = "free", allow_hyphen_values = true)]
    exponent: Parameter,
    /// Height of the transmitter above the ground in metres, or `free` where it is not known
    /// [default: 0; free for receivers that fly, if the estimator can estimate it]
    #[arg(long, value_name = "M|free", allow_hyphen_values = true)]
    target_up_m: Option<Parameter>,
    /// The receiver's antenna, whose vertical pattern the levels follow: a name or a file as for
    /// --antenna; where neither antenna is named, `shadowing-grid` infers what the levels lose at
    /// steep angles, and the others take them for isotropic
    #[arg(long, value_name = "NAME|FILE")]
    receiver_antenna: Option<String>,
    /// The transmitter's antenna, upright; isotropic unless given
    #[arg(long, value_name = "NAME|FILE")]
    transmitter_antenna: Option<String>,
    /// Width of the margin searched around the area that was flown over, in metres; the default
    /// estimators of levels alone and of bearings alone begin with it, and widen it as needed
    #[arg(long, value_name = "M", default_value_t = 200.0)]
    margin_m: f64,
    /// Standard deviation of the receiver's own place on each axis, in metres, as its GNSS states
    /// it, for rows without receiver_sigma_m; unless given, 3 m for places in degrees, and places
    /// in metres are known
    #[arg(long, value_name = "M")]
    receiver_sigma_m: Option<f64>,
    /// Place of the reference receiver of range and level differences, in metres of the local frame
    #[arg(long, value_name = "E,N,U", allow_hyphen_values = true)]
    reference_m: Option<EastNorthUp>,
    /// The seed of estimators that draw random numbers
    #[arg(long, default_value_t = 1, value_name = "N")]
    seed: u64,
    #[command(flatten)]
    terrain: OverTerrain,
    #[command(flatten)]
    calibration: Calibration,
    /// Show a second region, which holds the transmitter with 95 % by your own recordings: the
    /// factors that `judge --calibrate` wrote
    #[arg(long, value_name = "FILE")]
    conformal: Option<PathBuf>,
    #[command(flatten)]
    surroundings: Surroundings,
    #[command(flatten)]
    extraction: Extraction,
    #[command(flatten)]
    reading: Reading,
}

/// Recordings, and how transmitters are located from them.
pub struct Prepared {
    recordings: Vec<Recording>,
    /// The parts of each recording that are read in different ways.
    parts: Vec<Vec<Extracted>>,
    reading: ReceptionConfig,
    config: LocateConfig,
    /// The ground below the receivers, where it is given.
    relief: Option<Relief>,
    antenna: Antennas,
    /// Name of each recording in a list of rows struck out.
    names: Vec<String>,
    struck: StruckRows,
    /// True if σ of bearings was learned from how well the bearings of all beacons meet.
    learned_sigma: bool,
    /// Offset between the clocks of the recording and its path that was found and taken off.
    found_clock: Option<FoundOffset>,
}

/// Receptions of a beacon as an estimator takes them.
#[derive(Debug, Default)]
pub struct Received {
    rows: RecordedReceptions,
    /// Index of the first reception of each recording, and the number of the recording.
    begins: Vec<(usize, usize)>,
}

impl Received {
    /// Returns the receptions.
    pub fn receptions(&self) -> &Receptions {
        self.rows.receptions()
    }

    /// Returns the receptions with these indices, in their order.
    #[cfg(feature = "batch")]
    pub fn only(&self, indices: &[usize]) -> Self {
        let mut chosen = Self::default();
        for (index, row) in self.rows.iter().enumerate() {
            if !indices.contains(&index) {
                continue;
            }
            let begin = chosen.receptions().len();
            if let Some((number, ..)) = self.row(index)
                && chosen.begins.last().is_none_or(|(_, last)| *last != number)
            {
                chosen.begins.push((begin, number));
            }
            chosen.rows.extend(std::iter::once(row));
        }
        chosen
    }

    /// Returns the number of the recording of a reception, its line and its receiver.
    fn row(&self, index: usize) -> Option<(usize, u64, &str)> {
        let (line, drone) = self.rows.row(index)?;
        let (_, number) = self.begins.iter().rev().find(|(begin, _)| *begin <= index)?;
        Some((*number, line, drone))
    }
}

/// Residuals of rows, in little memory.
#[derive(Debug, Default)]
pub struct Residuals {
    residuals: Vec<Residual>,
    received: Received,
    /// Names of the recordings.
    names: Vec<String>,
}

impl Residuals {
    /// Returns the number of residuals.
    pub fn len(&self) -> usize {
        self.residuals.len()
    }

    /// Returns the residuals that `keep` chooses.
    pub fn chosen(&self, keep: impl Fn(&Residual) -> bool) -> impl Iterator<Item = RowResidual> {
        let residual = |of: &Residual| {
            let (number, line, drone) = self.received.row(of.reception)?;
            let file = self.names.get(number).cloned().unwrap_or_default();
            Some(RowResidual::new(&RowId { file, line, beacon: None }, Some(drone), of))
        };
        self.residuals.iter().filter(move |of| keep(of)).filter_map(residual)
    }
}

impl Serialize for Residuals {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_seq(self.chosen(|_| true))
    }
}

/// Track of a beacon.
#[cfg(feature = "batch")]
pub struct Track {
    /// The track; its residuals are in `rows`.
    pub tracked: Tracked,
    /// The receivers that listened.
    pub listeners: Vec<Listener>,
    pub rows: Residuals,
}

/// Part of a recording, or all of it, that is read with one extractor.
struct Extracted {
    part: Option<Recording>,
    extractor: BoxedExtractor,
}

impl Locating {
    /// Reads recordings and what the flags name, and leaves out what a list of receptions has;
    /// `is_track` for a transmitter that moves.
    pub fn prepare(
        &self,
        files: &[PathBuf],
        ignore: Option<&Path>,
        is_track: bool,
        registry: &Registry,
    ) -> Result<Prepared, CliError> {
        self.check()?;
        let own = self.calibration.read()?;
        // Mistakes of the command line are reported before those of files.
        self.power(&own)?;
        let Clocked { mut recordings, offset_s: clock_offset_s, found: found_clock } =
            self.reading.read_with_clock(files, self.clock_search(is_track))?;
        let is_timed = recordings.iter().all(Recording::is_timed);
        // Each receiver has a clock of its own.
        let has_one_clock = matches!(&recordings[..], [own] if own.drones().len() < 2);
        let clock_offset_s = clock_offset_s.or((!has_one_clock).then_some(0.0));
        if clock_offset_s.is_some_and(|offset_s| offset_s.abs() > 0.0) && !is_timed {
            return Err(CliError::input("--clock-offset-s needs the time of each row"));
        }
        let calibration = match recordings.first() {
            Some(first) => self.calibration.or_shipped(&own, first),
            None => Cow::Borrowed(&own),
        };
        narrate_corrected(correct_arrays(&mut recordings, &calibration.arrays));
        let turns =
            |recording: &Recording| recording.records().iter().any(|r| r.boresight.is_some());
        if calibration.bearings.is_none()
            && calibration.stations.is_empty()
            && calibration.station_model.is_none()
            && recordings.iter().any(turns)
        {
            self.surroundings.narrate();
        }
        let extracted = |recording| self.extracted(registry, recording, &calibration);
        let parts = recordings.iter().map(extracted).collect::<Result<_, _>>()?;
        let by_sample = match &self.estimator {
            Some(name) => registry.estimator(name).map_err(CliError::input)?.takes_samples(),
            None => false,
        };
        if by_sample && self.transmitter_antenna.is_some() {
            return Err(CliError::input(
                "--transmitter-antenna: an estimator of single samples does not use it",
            ));
        }
        let relief = self.terrain.read(&recordings, self.margin_m)?;
        let site_sigma_deg = self.surroundings.site().sigma().to_degrees();
        let reading = ReceptionConfig {
            positions: self.reading.positions,
            bearings: calibration.bearing_calibration(),
            receiver_sigma_m: self.receiver_sigma_m,
            by_sample,
            ..ReceptionConfig::default()
        };
        let config = LocateConfig {
            power: self.power(&calibration)?,
            target_up_m: match self.target_up_m {
                Some(Parameter::Value(up)) => up,
                Some(Parameter::Free) | None => 0.0,
            },
            height: match self.target_up_m {
                Some(Parameter::Value(_)) => Height::Known,
                Some(Parameter::Free) => Height::Free,
                None => Height::FreeInFlight,
            },
            pattern: self.pattern()?,
            antenna: self.receiver_antenna.as_deref().map(antenna_named),
            pulses: PulseLevelConfig { site_sigma_deg, ..PulseLevelConfig::default() },
            terrain: relief.as_ref().map(|relief| relief.config.clone()),
            margin_m: self.margin_m,
            reference_m: self.reference_m.map(Into::into),
            clock_offset_s,
            is_timed,
            seed: self.seed,
            ..LocateConfig::default()
        };
        let known = self.extraction.config(registry, &ExtractorConfig::default())?;
        let antenna = Antennas::of(&known);
        let names = file_names(&recordings);
        let struck = StruckRows::default();
        let mut prepared = Prepared {
            recordings,
            parts,
            reading,
            config,
            relief,
            antenna,
            names,
            struck,
            learned_sigma: false,
            found_clock,
        };
        if let Some(list) = ignore {
            let rows = prepared.every_row()?;
            prepared.struck = StruckRows::read(list, &rows)
                .map_err(|error: StruckError| CliError::input(error))?;
        }
        #[cfg(feature = "batch")]
        let prepared = prepared.with_learned_sigma()?;
        Ok(prepared)
    }

    /// Returns the search for the offset of the clocks of levels and path, or the reason why the
    /// offset is not looked for.
    fn clock_search(&self, is_track: bool) -> Result<ClockSearch, &'static str> {
        if is_track {
            return Err("a transmitter with --track moves");
        }
        if self.terrain.is_given() {
            return Err("--terrain changes the law of the levels");
        }
        if self.receiver_antenna.is_some() || self.transmitter_antenna.is_some() {
            return Err("a stated antenna changes the law of the levels");
        }
        let target_up_m = match self.target_up_m {
            Some(Parameter::Value(up_m)) => up_m,
            Some(Parameter::Free) | None => 0.0,
        };
        Ok(ClockSearch { margin_m: self.margin_m, target_up_m, ..ClockSearch::default() })
    }

    /// The parts of a recording, each with the extractor of the command line, calibrated. A station
    /// has one of its own, unless another one is given.
    fn extracted(
        &self,
        registry: &Registry,
        recording: &Recording,
        calibration: &CalibrationFile,
    ) -> Result<Vec<Extracted>, CliError> {
        let extracted = |Part { recording, station }: Part<'_, '_>| {
            let extractor = self.extraction.build(registry)?;
            let name = self.extraction.name();
            let around = &self.surroundings;
            let extractor = if station.is_none() || !self.extraction.is_given() {
                calibrated(calibration, station.as_deref(), name, extractor, around)?
            } else {
                around.around(extractor)
            };
            let part = match recording {
                Cow::Borrowed(_) => None,
                Cow::Owned(part) => Some(part),
            };
            Ok(Extracted { part, extractor })
        };
        parts(recording, calibration).into_iter().map(extracted).collect()
    }

    /// The beacon that is meant.
    pub fn beacon(&self, recordings: &[Recording]) -> Result<Option<String>, CliError> {
        self.reading.beacon(recordings)
    }

    /// Reads the factors by the user's recordings, where a file is named.
    pub fn conformal(&self) -> Result<Option<ConformalFile>, CliError> {
        let path = self.conformal.as_deref();
        path.map(ConformalFile::read).transpose().map_err(CliError::input)
    }

    /// The name of the beacon of the command line.
    pub fn wanted(&self) -> Option<&str> {
        self.reading.wanted()
    }

    /// Returns true if the command line names the estimator.
    pub fn names_estimator(&self) -> bool {
        self.estimator.is_some()
    }

    /// Returns the estimator of the command line, or the estimator that suits the receptions.
    pub fn estimator<'a>(
        &self,
        registry: &'a Registry,
        received: &Receptions,
    ) -> Result<&'a EstimatorEntry, CliError> {
        match &self.estimator {
            Some(name) => choice::estimator(registry, name, "--estimator"),
            // What suits receptions over level ground takes all of them at once.
            None if self.terrain.is_given() => {
                registry.estimator("particle").map_err(CliError::input)
            }
            None => registry.suited_to(received).map_err(CliError::input),
        }
    }

    /// Refuses numbers that are out of range.
    fn check(&self) -> Result<(), CliError> {
        if !(self.margin_m > 0.0 && self.margin_m.is_finite()) {
            let message = format!("--margin-m is {}; it must be positive", self.margin_m);
            return Err(CliError::input(message));
        }
        Ok(())
    }

    /// Returns the antennas' gain over the elevation; [`None`] if the command line names no
    /// antenna.
    fn pattern(&self) -> Result<Option<ElevationPattern>, CliError> {
        let of = |flag: &str, named: &Option<String>| {
            let Some(named) = named else { return Ok(None) };
            let antenna = antenna_named(named).build();
            let antenna = antenna.map_err(|why| CliError::input(format!("{flag}: {why}")))?;
            Ok::<_, CliError>(Some(ElevationPattern::of(&antenna)))
        };
        let receiver = of("--receiver-antenna", &self.receiver_antenna)?;
        let transmitter = of("--transmitter-antenna", &self.transmitter_antenna)?;
        if receiver.is_none() && transmitter.is_none() {
            return Ok(None);
        }
        let isotropic = || ElevationPattern::of(&Isotropic);
        let receiver = receiver.unwrap_or_else(isotropic);
        let transmitter = transmitter.unwrap_or_else(isotropic);
        Ok(Some(ElevationPattern::between(&receiver, &transmitter)))
    }

    /// Returns the knowledge of the transmitter's power, from the flags or else the calibration.
    fn power(&self, calibration: &CalibrationFile) -> Result<Power, CliError> {
        match (self.p0_dbm, self.exponent) {
            (Parameter::Free, Parameter::Free) => {
                Ok(calibration.path_loss.as_ref().map_or(Power::Free, PathLossSection::power))
            }
            (Parameter::Value(reference_dbm), Parameter::Value(exponent)) => {
                Ok(Power::Known { reference_dbm, exponent })
            }
            (Parameter::Free, Parameter::Value(exponent)) => Ok(Power::FreeReference { exponent }),
            (Parameter::Value(_), Parameter::Free) => Err(CliError::input(
                "--p0-dbm needs --exponent: no estimator knows the power alone",
            )),
        }
    }
}

impl Prepared {
    /// All recordings, in one frame.
    pub fn recordings(&self) -> &[Recording] {
        &self.recordings
    }

    /// Returns the settings of the transmitter and the search, from the flags and the calibration.
    pub fn config(&self) -> &LocateConfig {
        &self.config
    }

    /// Takes σ of ready-made bearings without one from how well the bearings of all beacons meet,
    /// if there are several beacons: σ belongs to the receivers, not to a beacon.
    #[cfg(feature = "batch")]
    fn with_learned_sigma(mut self) -> Result<Self, CliError> {
        use foxhunt::{locate::learn_bearing_sigma, recording::Record};

        use crate::output::warn;

        let of_unknown_sigma = |record: &Record| {
            record.boresight.is_none() && record.bearing.is_some_and(|b| b.sigma.is_none())
        };
        let mut records = self.recordings.iter().flat_map(Recording::records);
        if !records.any(of_unknown_sigma) {
            return Ok(self);
        }
        let mut names = Vec::new();
        let mut beacons = Vec::new();
        for (number, recording) in self.recordings.iter().enumerate() {
            for beacon in recording.beacons() {
                names.push(beacon.unwrap_or(NAMELESS));
                beacons.push(self.receptions_of(number, beacon)?);
            }
        }
        self.config.assumed_bearing_sigma = Some(self.reading.bearing_sigma);
        if beacons.len() > 1 {
            let learned = learn_bearing_sigma(&beacons, &self.config);
            let odd: Vec<&str> =
                learned.left_out.iter().filter_map(|index| names.get(*index).copied()).collect();
            let without = if odd.is_empty() {
                String::new()
            } else {
                format!("; without those of {}, which do not meet", odd.join(", "))
            };
            self.reading.bearing_sigma *= learned.factor;
            self.config.bearing_freedom = learned.freedom;
            self.config.assumed_bearing_sigma = None;
            self.learned_sigma = true;
            let sigma_deg = self.reading.bearing_sigma.to_degrees();
            warn(&format!(
                "  σ of bearings without one: {sigma_deg:.1}°, from how those of {} beacons \
                 meet{without}",
                beacons.len()
            ));
        }
        Ok(self)
    }

    /// Tracks a beacon through all recordings; `watch` is given how many steps are done, and how
    /// many there are at most.
    #[cfg(feature = "batch")]
    pub fn track(
        &self,
        beacon: Option<&str>,
        tracking: &TrackingConfig,
        watch: &dyn Fn(usize, usize),
    ) -> Result<Track, CliError> {
        if let Some(recording) = self.recordings.iter().find(|recording| !recording.is_timed()) {
            let message = format!("{}: --track needs the time of each row", recording.file());
            return Err(CliError::input(message));
        }
        if self.config.clock_offset_s.is_some_and(|offset_s| offset_s.abs() > 0.0) {
            let why = "--track does not use --clock-offset-s without a path beside the recordings";
            return Err(CliError::input(why));
        }
        if self.config.height == Height::Free {
            return Err(CliError::input(
                "--track does not estimate the height (--target-up-m free)",
            ));
        }
        if self.config.pattern.is_some() {
            let why = "--track does not use the antennas' patterns (--receiver-antenna, \
                       --transmitter-antenna)";
            return Err(CliError::input(why));
        }
        let received = self.received_of_track(beacon)?;
        let listeners = listeners(&self.recordings, &self.every_reception()?);
        let config = &self.config;
        let tracked = track_watched(received.receptions(), &listeners, config, tracking, watch);
        let mut tracked = tracked.map_err(not_located)?;
        let residuals = std::mem::take(&mut tracked.residuals);
        let rows = Residuals { residuals, received, names: self.names.clone() };
        Ok(Track { tracked, listeners, rows })
    }

    /// The receptions of every beacon in all recordings, also those struck out.
    #[cfg(feature = "batch")]
    fn every_reception(&self) -> Result<Receptions, CliError> {
        let mut received = Receptions::default();
        for (number, recording) in self.recordings.iter().enumerate() {
            for beacon in recording.beacons() {
                received.extend(self.rows_of(number, beacon)?.receptions());
            }
        }
        Ok(received)
    }

    /// Returns what was received of a beacon in all recordings; the rows struck out keep only what
    /// a track needs of them.
    #[cfg(feature = "batch")]
    fn received_of_track(&self, beacon: Option<&str>) -> Result<Received, CliError> {
        let mut all = Received::default();
        for number in 0..self.recordings.len() {
            let rows = self.rows_of(number, beacon)?;
            all.begins.push((all.receptions().len(), number));
            all.rows.extend(rows.iter().map(|mut row| {
                if self.struck.contains(&self.id(number, row.line, beacon)) {
                    row.reception = left_out(&row.reception);
                }
                row
            }));
        }
        Ok(all)
    }

    /// Returns the receptions of a beacon in all recordings, also those struck out, each with its
    /// identifier.
    fn identified(&self, beacon: Option<&str>) -> Result<Vec<(RowId, Reception)>, CliError> {
        let mut received = Vec::new();
        for number in 0..self.recordings.len() {
            let rows = self.rows_of(number, beacon)?;
            let id = |row: &RecordedReception| self.id(number, row.line, beacon);
            received.extend(rows.iter().map(|row| (id(&row), row.reception)));
        }
        Ok(received)
    }

    /// Returns what was received of a beacon in all recordings.
    pub fn received(&self, beacon: Option<&str>) -> Result<Received, CliError> {
        let mut all = Received::default();
        for number in 0..self.recordings.len() {
            let received = self.received_of(number, beacon)?;
            let begin = all.receptions().len();
            if begin == 0 {
                all.rows = received.rows;
            } else {
                all.rows.extend(received.rows.iter());
            }
            all.begins.push((begin, number));
        }
        Ok(all)
    }

    /// Adds the receptions of a beacon to an overview, with the turns that they were read in. With
    /// `only`, receptions of other rows are left out.
    pub fn add_to(
        &self,
        overview: &mut Overview,
        search: Option<usize>,
        beacon: Option<&str>,
        only: Option<&[RowId]>,
    ) -> Result<(), CliError> {
        for (number, recording) in self.recordings.iter().enumerate() {
            let mut received = self.rows_of(number, beacon)?;
            if let Some(only) = only {
                let is_in = |row: &RecordedReception| {
                    only.iter().any(|id| id.line == row.line && id.file == self.name(number))
                };
                received = received.iter().filter(is_in).collect();
            }
            let mut readings = Vec::new();
            for Extracted { part, extractor } in self.parts.get(number).into_iter().flatten() {
                let part = part.as_ref().unwrap_or(recording);
                if part.records().iter().any(|record| record.boresight.is_some()) {
                    let more = bearings(part, extractor.as_ref(), self.reading.positions);
                    readings.append(&mut more.map_err(CliError::input)?);
                }
            }
            readings.retain(|read| read.sweep.beacon_name.as_deref() == beacon);
            let antenna = self.antenna.known();
            let file = self.name(number);
            overview.add_receptions(search, file, beacon, &received, &readings, antenna);
        }
        overview.strike(&self.struck);
        Ok(())
    }

    /// Returns the log with which a page locates again without the rows struck out in it: each
    /// search, with its beacon.
    pub fn relocation<'a>(
        &self,
        estimator: &EstimatorEntry,
        searches: impl IntoIterator<Item = (&'a SearchOverview, Option<&'a str>)>,
        given: bool,
    ) -> Result<Result<PageLog, NotStrikable>, CliError> {
        if self.relief.is_some() {
            return Ok(Err(NotStrikable::Terrain));
        }
        if self.learned_sigma {
            return Ok(Err(NotStrikable::LearnedSigma));
        }
        let name = given.then_some(&*estimator.name);
        let mut relocation = Relocation::new(name, self.config.clone());
        for (search, beacon) in searches {
            relocation.add(search, self.identified(beacon)?);
        }
        Ok(PageLog::of_recordings(&relocation, estimator))
    }

    /// Returns the log with which a page tracks again without the rows struck out in it; `steps` is
    /// the number of steps that tracking took.
    #[cfg(feature = "batch")]
    pub fn tracks(
        &self,
        (tracking, listeners, steps): (TrackingConfig, Vec<Listener>, usize),
        search: &SearchOverview,
        beacon: Option<&str>,
    ) -> Result<Result<PageLog, NotStrikable>, CliError> {
        if self.learned_sigma {
            return Ok(Err(NotStrikable::LearnedSigma));
        }
        let mut relocation = Relocation::of_tracks(tracking, listeners, self.config.clone());
        relocation.add(search, self.identified(beacon)?);
        Ok(PageLog::of_tracks(&relocation, steps))
    }

    /// Returns the number of receptions of a beacon that are left out.
    pub fn ignored(&self, beacon: Option<&str>) -> usize {
        self.struck.of_beacon(beacon)
    }

    /// Returns the name of a recording in a list of rows struck out.
    fn name(&self, number: usize) -> &str {
        self.names.get(number).map_or("", String::as_str)
    }

    fn id(&self, number: usize, line: u64, beacon: Option<&str>) -> RowId {
        RowId { file: self.name(number).to_owned(), line, beacon: beacon.map(str::to_owned) }
    }

    /// Returns the identifiers of all receptions.
    fn every_row(&self) -> Result<Vec<RowId>, CliError> {
        let mut ids = Vec::new();
        for (number, recording) in self.recordings.iter().enumerate() {
            for beacon in recording.beacons() {
                let rows = self.rows_of(number, beacon)?;
                ids.extend(rows.iter().map(|row| self.id(number, row.line, beacon)));
            }
        }
        Ok(ids)
    }

    /// The receptions of a beacon in one recording, counted from 0, without what is struck out.
    pub fn receptions_of(
        &self,
        number: usize,
        beacon: Option<&str>,
    ) -> Result<Receptions, CliError> {
        Ok(self.received_of(number, beacon)?.rows.into_receptions())
    }

    /// Returns what was received of a beacon in one recording, counted from 0, without what is
    /// struck out.
    pub fn received_of(&self, number: usize, beacon: Option<&str>) -> Result<Received, CliError> {
        let mut rows = self.rows_of(number, beacon)?;
        if self.struck.of_beacon(beacon) > 0 {
            let is_struck = |line| self.struck.contains(&self.id(number, line, beacon));
            rows = rows.iter().filter(|row| !is_struck(row.line)).collect();
        }
        Ok(Received { rows, begins: vec![(0, number)] })
    }

    /// Locates a beacon; remarks on single rows name file and line.
    pub fn locate(
        &self,
        estimator: &EstimatorEntry,
        received: &Received,
    ) -> Result<Located, LocateError> {
        let name = |index: usize| {
            let (number, line, _) = received.row(index)?;
            Some(row_name(&self.id(number, line, None)))
        };
        let mut located = estimator.locate_named(received.receptions(), &self.config, &name)?;
        if self.found_clock.is_some() {
            // The remark would ask for an offset besides the one that was found, and the search of
            // both files has more levels and a better law.
            located.remarks.retain(|remark| remark.code != "clocks-differ");
        }
        Ok(located)
    }

    /// Returns the identifier of a reception; `None` for an index that does not exist.
    #[cfg(feature = "batch")]
    pub fn row(&self, received: &Received, index: usize) -> Option<RowId> {
        let (number, line, _) = received.row(index)?;
        Some(self.id(number, line, None))
    }

    /// Returns the offset between the clocks of the recording and its path that was found and taken
    /// off.
    pub fn found_clock(&self) -> Option<FoundOffset> {
        self.found_clock
    }

    /// Returns the residuals of rows from the place that an estimator found.
    pub fn residuals(
        &self,
        estimator: &EstimatorEntry,
        located: &Located,
        received: Received,
    ) -> Residuals {
        let residuals = estimator.residuals(located, received.receptions(), &self.config);
        Residuals { residuals, received, names: self.names.clone() }
    }

    /// The receptions of a beacon in one recording with their rows, also those struck out.
    fn rows_of(&self, number: usize, beacon: Option<&str>) -> Result<RecordedReceptions, CliError> {
        let mut received = RecordedReceptions::default();
        let whole = self.recordings.get(number);
        for Extracted { part, extractor } in self.parts.get(number).into_iter().flatten() {
            let Some(part) = part.as_ref().or(whole) else { continue };
            let more = recorded_receptions(part, beacon, extractor.as_ref(), &self.reading);
            let more = more.map_err(CliError::input)?;
            if received.receptions().is_empty() {
                received = more;
            } else {
                received.extend(more.iter());
            }
        }
        let Some(relief) = &self.relief else { return Ok(received) };
        received.iter().map(|row| relief.placed(number, row)).collect()
    }
}

/// Classifies the error of a search: wrong input, or a failure of the estimator.
pub fn not_located(error: LocateError) -> CliError {
    match error {
        LocateError::Start(EstimatorError::Unsupported { .. }) => CliError::input(error),
        LocateError::Start(_) => CliError::failure(error),
        error => CliError::input(error),
    }
}

/// Returns a doubt about one truth of the command line for several beacons, and warns of it.
pub fn shared_truth(given: Option<LatLon>, beacons: usize) -> Option<Remark> {
    let is_shared = given.is_some() && beacons > 1;
    let remark = is_shared.then(|| {
        let text = format!(
            "--truth is taken for all {beacons} beacons alike: errors, NEES and coverage are of \
             use only if they were at one place; choose one with --beacon, or give each its own \
             with the columns truth_lat_deg and truth_lon_deg"
        );
        Remark::new("one-truth-for-all", text)
    });
    remark.iter().for_each(|remark| warn_once(&format!("warning: {remark}")));
    remark
}

/// Returns the transmitter's true place, if known, from the command line or else the recordings.
pub fn truth(
    given: Option<LatLon>,
    recordings: &[Recording],
    beacon: Option<&str>,
) -> Result<Option<Vector2<f64>>, CliError> {
    match given {
        None => Ok(recorded_truth(recordings, beacon)),
        Some(truth) => {
            let frame = recordings.iter().find_map(Recording::frame);
            let place = truth.in_frame(frame).ok_or_else(|| no_degrees("--truth"))?;
            Ok(Some(place.into()))
        }
    }
}
