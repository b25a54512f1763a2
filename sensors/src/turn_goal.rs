use alloc::{sync::Arc, vec::Vec};
use core::{f64::consts::TAU, fmt};

use foxhunt_core::{
    BearingExtractor, Pose, Sample, Sweep, Unanswered, angle,
    parameter::{FieldError, in_range, positive},
};

use crate::Antenna;

/// Goal of a turn: it goes on until its bearings are as certain as wanted.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct TurnGoalConfig {
    /// σ in degrees that a bearing is wanted with.
    pub bearing_sigma_deg: f64,
    /// A turn ends after this long, in seconds, however uncertain its bearings are.
    pub longest_s: f64,
}

impl TurnGoalConfig {
    /// Checks the ranges of all numbers.
    ///
    /// # Errors
    ///
    /// [`FieldError`] names the first that is out of its range.
    pub fn check(&self) -> Result<(), FieldError> {
        let wanted = "from 0.01 to 57, the widest bearing that is used";
        in_range("bearing_sigma_deg", self.bearing_sigma_deg, 0.01..=57.0, wanted)?;
        positive("longest_s", self.longest_s)?;
        Ok(())
    }
}

/// A goal of turns, and the extractor that tells how near a turn is to it.
#[derive(Clone)]
pub struct TurnGoal {
    /// Largest wanted σ of a bearing, in radians.
    sigma: f64,
    longest_s: f64,
    extractor: Arc<dyn BearingExtractor + Send + Sync>,
}

impl fmt::Debug for TurnGoal {
    fn fmt(&self, to: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { sigma, longest_s, .. } = self;
        to.debug_struct("TurnGoal")
            .field("sigma", sigma)
            .field("longest_s", longest_s)
            .finish_non_exhaustive()
    }
}

impl TurnGoal {
    /// A goal for the bearings of an extractor, by its
    /// [expected σ](BearingExtractor::expected_sigma).
    ///
    /// # Errors
    ///
    /// [`FieldError`] names what is out of range in the configuration.
    pub fn new(
        config: TurnGoalConfig,
        extractor: Arc<dyn BearingExtractor + Send + Sync>,
    ) -> Result<Self, FieldError> {
        config.check()?;
        let TurnGoalConfig { bearing_sigma_deg, longest_s } = config;
        Ok(Self { sigma: bearing_sigma_deg.to_radians(), longest_s, extractor })
    }

    /// The longest that a turn goes on, in seconds.
    #[must_use]
    pub fn longest_s(&self) -> f64 {
        self.longest_s
    }

    /// Returns true if the bearing from such samples is expected to be as certain as wanted.
    #[must_use]
    pub fn is_reached(&self, sweep: &Sweep<'_>) -> bool {
        self.extractor.expected_sigma(sweep).is_some_and(|sigma| sigma <= self.sigma)
    }

    /// Number of questions, `least` to `most`, that a turn through `antenna` is expected to take if
    /// they are spread evenly over the circle: with that many a turn without noise reaches the
    /// goal. `over_floor_db` is how far the mean level lies above the receiver's floor, infinite
    /// where all are answered. Where it is not reached, `most`.
    #[must_use]
    pub fn expected_questions(
        &self,
        antenna: &dyn Antenna,
        elevation: f64,
        over_floor_db: f64,
        (least, most): (u16, u16),
    ) -> u16 {
        let mean_db = antenna.mean_gain_db(elevation);
        let floor_dbm = over_floor_db.is_finite().then_some(-over_floor_db);
        let reached = |count: u16| {
            let receiver = Pose::at(0.0, 0.0, 0.0);
            let mut samples = Vec::new();
            let mut unanswered = Vec::new();
            for position in 0..count {
                // A third of a step off the axis: neither the best nor the worst of places.
                let boresight = angle::wrap(TAU * (f64::from(position) + 0.33) / f64::from(count));
                let rss_dbm = antenna.gain_dbi(-boresight, elevation) - mean_db;
                let time = f64::from(position);
                if floor_dbm.is_some_and(|floor| rss_dbm < floor) {
                    unanswered.push(Unanswered { time, boresight, position });
                } else {
                    samples.push(Sample { time, receiver, boresight, position, rss_dbm });
                }
            }
            self.is_reached(&Sweep {
                time: f64::from(count),
                receiver,
                positions: count,
                samples: &samples,
                unanswered: &unanswered,
                floor_dbm,
                ..Sweep::default()
            })
        };
        let mut below = least.max(1) - 1;
        let mut count = least.max(1);
        while count < most && !reached(count) {
            (below, count) = (count, count.saturating_mul(2).min(most));
        }
        // Between one that was too few and one that is enough.
        while count - below > 1 {
            let middle = below + (count - below) / 2;
            if reached(middle) {
                count = middle;
            } else {
                below = middle;
            }
        }
        count
    }

    /// The speed in radians per second, `fastest` at most, at which a body turns so that pulses
    /// that come each `interval_s` spread over the circle: some eight in a turn, the next turn's
    /// between them by the golden section.
    #[must_use]
    pub(crate) fn rate_rad_s(interval_s: f64, fastest: f64) -> f64 {
        const PULSES: f64 = 8.618_033_988_749_895;
        (TAU / (PULSES * interval_s)).min(fastest.abs()).copysign(fastest)
    }
}

/// Offset of the boresights of a stepper's round from the first round's, as a share of a step:
/// halves, then quarters, then eighths (van der Corput 1935), and after eight rounds again.
pub(crate) fn between_steps(round: u32) -> f64 {
    f64::from((round % 8).reverse_bits() >> 29) / 8.0
}
