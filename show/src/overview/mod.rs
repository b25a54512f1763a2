//! Contents of a hunt, or of recordings, to be looked at: paths, receptions, beliefs in time,
//! events.
//!
//! The [page](crate::page) shows it, [`export`](crate::export) writes it for other programs.

mod notice;
mod of_log;
mod of_recording;
mod turn;

pub use notice::{Notice, notice};
pub use of_log::{KeptTurn, OverviewReader};
pub use turn::{KnownAntenna, Turn};

use std::collections::BTreeSet;

use foxhunt_core::{Bearing, BearingModes, Ellipse, Estimate, HeightAboveGround, Level, Remark};
use foxhunt_filters::PosteriorMap;
#[cfg(feature = "batch")]
use foxhunt_hunt::locate::Tracked;
use foxhunt_hunt::{
    calibration::ConformalFactors,
    locate::{Located, Measurand, Region, Rival, Searched},
};
use foxhunt_wire::geodesy::LocalFrame;
use nalgebra::{Vector2, Vector3};

use foxhunt_archive::{
    recorded::RowResidual,
    struck::{ReceptionKey, StruckRows},
};

/// A hunt, or what was read of recordings, in the order of time. Places are East, North and Up in
/// metres, angles radians counter-clockwise from East, times seconds.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Overview {
    /// Title: the hunt or the recordings.
    pub title: String,
    /// The estimator, or the reader of the bearings.
    pub method: String,
    /// The seed of what was drawn at random, where anything was.
    pub seed: Option<u64>,
    /// UNIX time at the time 0, in seconds, where it is known.
    pub epoch_unix_s: Option<f64>,
    /// The local frame on Earth, if known.
    pub frame: Option<LocalFrame>,
    /// True if levels are in dB about an unknown reference, and not in dBm.
    pub relative_levels: bool,
    /// The drones, or other receivers.
    pub receivers: Vec<Receiver>,
    /// Receptions of the receivers.
    pub received: Vec<Received>,
    /// The searches, each for one beacon.
    pub searches: Vec<SearchOverview>,
    /// Events in words, with reasons.
    pub notices: Vec<Notice>,
    /// Doubts about the recordings.
    pub remarks: Vec<Remark>,
    /// Area that was searched, where nothing was received.
    pub searched: Option<Searched>,
}

/// A drone, or another receiver.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Receiver {
    /// Name of the receiver.
    pub name: String,
    /// Places of the receiver with their times; on straight lines between.
    pub path: Vec<Knot>,
    /// Battery, link and position of the receiver over time, for drones that report them.
    pub health: Vec<Health>,
}

/// A drone's battery, link, position and height from a time on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Health {
    /// Time in seconds.
    pub time: f64,
    /// Charge left in its battery, from 0 to 1.
    pub battery: Option<f64>,
    /// True if its messages come.
    pub linked: bool,
    /// σ of its position, the greatest axis in metres.
    pub position_sigma_m: Option<f64>,
    /// Height above the ground by its own devices.
    pub above_ground: Option<HeightAboveGround>,
}

/// A place at a time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Knot {
    /// Time in seconds.
    pub time: f64,
    /// Place: East, North and Up in metres.
    pub place: Vector3<f64>,
}

impl Knot {
    fn on_ground(time: f64, place: Vector2<f64>) -> Self {
        Self { time, place: place.push(0.0) }
    }
}

/// A reception, with what became of it.
#[derive(Clone, Debug, PartialEq)]
pub struct Received {
    /// Time in seconds.
    pub time: f64,
    /// Index of the receiver, from 0.
    pub receiver: usize,
    /// Index of the search, from 0; `None` where nothing was searched.
    pub search: Option<usize>,
    /// Place of the receiver.
    pub place: Vector3<f64>,
    /// The power.
    pub level: Option<Level>,
    /// The bearing.
    pub bearing: Option<Bearing>,
    /// The directions that compete for it.
    pub modes: BearingModes,
    /// Reason why there is no bearing, or another remark.
    pub remark: Option<String>,
    /// True if the estimator used it.
    pub used: bool,
    /// True if it was struck out by hand.
    pub struck: bool,
    /// Key of the reception in the log or in the recordings.
    pub id: Option<ReceptionKey>,
    /// Normalised innovation squared of the reception, and the degrees of freedom.
    pub nis: Option<(f64, usize)>,
    /// The turn of the antenna that it was read in, where its samples were kept.
    pub turn: Option<Turn>,
}

/// The search for a beacon.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SearchOverview {
    /// The beacon's name.
    pub name: String,
    /// True place or way of the beacon, if known.
    pub truth: Vec<Knot>,
    /// Beliefs in the order of time.
    pub beliefs: Vec<Believed>,
    /// Beliefs of the same times given all receptions, the later ones included, where the replay is
    /// smoothed.
    pub smoothed: Vec<Believed>,
    /// The smallest region that holds it with 95 % in the end, where the estimator has one.
    pub regions_95: Vec<Region>,
    /// The posterior over the cells of a grid in the end, where the estimator has one.
    pub map: Option<PosteriorMap>,
    /// Other places that are nearly as probable in the end.
    pub rivals: Vec<Rival>,
    /// Doubts about the place in the end.
    pub remarks: Vec<Remark>,
    /// Residuals of the rows of recordings from the place in the end.
    pub rows: Vec<RowResidual>,
    /// Factors by which the ellipse holds it with 95 % by the user's recordings, where there are
    /// any.
    pub conformal: Option<ConformalFactors>,
    /// Outcome of the search, if it ended.
    pub outcome: Option<String>,
}

/// The belief at a time.
#[derive(Clone, Debug, PartialEq)]
pub struct Believed {
    /// Time in seconds.
    pub time: f64,
    /// Number of receptions up to then.
    pub steps: u32,
    /// The first two moments of the place.
    pub estimate: Estimate<2>,
    /// The ellipse that holds it with 95 %.
    pub ellipse_95: Option<Ellipse>,
    /// The distance to the truth in metres, where that is known.
    pub error_m: Option<f64>,
    /// Places of equal weight that stand for the belief, where two moments do not do.
    pub cloud: Vec<Vector2<f64>>,
}

impl Believed {
    /// A belief by its moments, without places for its shape.
    fn of(time: f64, steps: u32, estimate: Estimate<2>, truth: Option<Vector2<f64>>) -> Self {
        Self {
            time,
            steps,
            estimate,
            ellipse_95: estimate.ellipse(0.95),
            error_m: truth.map(|truth| (estimate.mean - truth).norm()),
            cloud: Vec::new(),
        }
    }

    fn located(time: f64, located: &Located, truth: Option<Vector2<f64>>) -> Self {
        Self {
            time,
            steps: u32::try_from(located.observations).unwrap_or(u32::MAX),
            estimate: located.estimate,
            ellipse_95: located.ellipse_95(),
            error_m: truth.map(|truth| (located.estimate.mean - truth).norm()),
            cloud: located.places.clone(),
        }
    }
}

impl SearchOverview {
    /// A search that has one answer, from all receptions at once.
    #[must_use]
    pub fn located(
        name: String,
        located: &Located,
        truth: Option<Vector2<f64>>,
        time: f64,
    ) -> Self {
        Self {
            name,
            truth: truth.map(|place| Knot::on_ground(time, place)).into_iter().collect(),
            beliefs: vec![Believed::located(time, located, truth)],
            regions_95: located.regions_95.clone(),
            map: located.map.clone(),
            rivals: located.rivals.clone(),
            remarks: located.remarks.clone(),
            ..Self::default()
        }
    }

    /// Replaces the residuals of the rows.
    #[must_use]
    pub fn with_rows(self, rows: Vec<RowResidual>) -> Self {
        Self { rows, ..self }
    }

    /// A transmitter that moves, with where it truly was at a time.
    #[cfg(feature = "batch")]
    #[must_use]
    pub fn tracked(
        name: String,
        tracked: &Tracked,
        truth: impl Fn(f64) -> Option<Vector2<f64>>,
    ) -> Self {
        let place = |(time, located): &(f64, Located)| {
            let truth = truth(*time);
            let knot = truth.map(|place| Knot::on_ground(*time, place));
            (Believed::located(*time, located, truth), knot)
        };
        let (beliefs, truth): (_, Vec<_>) = tracked.places.iter().map(place).unzip();
        let truth = truth.into_iter().flatten().collect();
        Self { name, truth, beliefs, ..Self::default() }
    }

    /// Returns the last belief.
    #[must_use]
    pub fn last(&self) -> Option<&Believed> {
        self.beliefs.last()
    }
}

impl Overview {
    /// Returns the index of the receiver with a name; adds it if it is missing.
    pub fn receiver(&mut self, name: &str) -> usize {
        let known = self.receivers.iter().position(|receiver| receiver.name == name);
        known.unwrap_or_else(|| {
            self.receivers.push(Receiver {
                name: name.to_owned(),
                path: Vec::new(),
                health: Vec::new(),
            });
            self.receivers.len() - 1
        })
    }

    /// Adds a reception, and its place to the path of its receiver.
    pub fn add(&mut self, received: Received) {
        if let Some(receiver) = self.receivers.get_mut(received.receiver) {
            receiver.path.push(Knot { time: received.time, place: received.place });
        }
        self.received.push(received);
    }

    /// Marks receptions of recordings that were struck out.
    pub fn strike(&mut self, struck: &StruckRows) {
        for received in &mut self.received {
            if let Some(ReceptionKey::Recorded(row)) = &received.id {
                received.struck = struck.contains(row);
            }
        }
    }

    /// Marks the bearings that the rows of the searches say were left out.
    pub fn mark_left_out(&mut self) {
        let mut left_out = BTreeSet::new();
        for (number, search) in self.searches.iter().enumerate() {
            let rows = search.rows.iter();
            let bearings = rows.filter(|row| row.left_out && row.kind == Measurand::Bearing);
            left_out.extend(bearings.map(|row| (number, row.file.as_str(), row.line)));
        }
        for received in &mut self.received {
            if let (Some(search), Some(ReceptionKey::Recorded(row))) =
                (received.search, &received.id)
            {
                received.used &= !left_out.contains(&(search, row.file.as_str(), row.line));
            }
        }
    }

    /// The first and the last time of all that is in it; both 0 where there is nothing.
    #[must_use]
    pub fn span(&self) -> [f64; 2] {
        let paths = self.receivers.iter().flat_map(|receiver| &receiver.path);
        let times = (self.received.iter().map(|received| received.time))
            .chain(paths.map(|knot| knot.time))
            .chain(self.searches.iter().flat_map(|s| &s.beliefs).map(|b| b.time))
            .chain(self.notices.iter().map(|notice| notice.time))
            .filter(|time| time.is_finite());
        let span = times.fold([f64::INFINITY, f64::NEG_INFINITY], |[first, last], time| {
            [time.min(first), time.max(last)]
        });
        if span.iter().all(|time| time.is_finite()) { span } else { [0.0; 2] }
    }
}
