use foxhunt_core::{BeaconId, Clock, PatternSource, Pose, Radio, Sweep, Vehicle};

use super::{OmnidirectionalConfig, OmnidirectionalError};
use crate::{ParameterError, heard_turn::HeardTurn, questions::Questions};

/// An antenna that hears alike from everywhere: its sweeps have one position, which holds all
/// samples, so that extractors find a level and no bearing.
///
/// Several beacons are asked one after the other, question by question. A sweep ends when each was
/// asked as often as it shall be; a question that stays without an answer counts, so that a sweep
/// ends however deaf the radio is. A device that fails is told of at each poll and tried again at
/// the next; a question that it keeps from being asked counts after its time-out, too.
#[derive(Debug)]
pub struct OmnidirectionalSource<R, V, C> {
    config: OmnidirectionalConfig,
    radio: R,
    vehicle: V,
    clock: C,
    /// How many questions are left of the sweep that is under way.
    left: usize,
    /// Since when the present question is due.
    since: Option<f64>,
    heard: HeardTurn,
    questions: Questions,
    last_pose: Pose,
}

type Failure<R, V> = OmnidirectionalError<<R as Radio>::Error, <V as Vehicle>::Error>;

impl<R: Radio, V: Vehicle, C: Clock> OmnidirectionalSource<R, V, C> {
    /// A source made of its devices.
    ///
    /// # Errors
    ///
    /// [`ParameterError`] names what is out of range in the configuration.
    pub fn new(
        config: OmnidirectionalConfig,
        radio: R,
        vehicle: V,
        clock: C,
    ) -> Result<Self, ParameterError> {
        config.check()?;
        Ok(Self {
            config,
            radio,
            vehicle,
            clock,
            left: 0,
            since: None,
            heard: HeardTurn::default(),
            questions: Questions::default(),
            last_pose: Pose::default(),
        })
    }

    /// How many answers of this sweep, or of the last one, were dropped because the power or the
    /// place was not finite; of all its beacons together.
    #[must_use]
    pub fn dropped(&self) -> u32 {
        self.questions.dropped
    }

    /// Takes every step that can be taken now; true when the sweep is complete.
    fn advance(&mut self) -> Result<bool, Failure<R, V>> {
        let now = self.clock.now();
        let manner = self.config.manner();
        let due = *self.since.get_or_insert(now);
        if now >= due + manner.spacing + 2.0 * manner.answer_timeout {
            // A device kept it from being asked, or answered.
            self.questions.give_up(&mut self.heard, &manner);
            self.settled(now);
        }
        let here = match self.vehicle.pose() {
            Ok(pose) if pose.is_finite() => {
                self.heard.placed(self.vehicle.position_sigma());
                self.last_pose = pose;
                Some(pose)
            }
            Err(error) if self.left > 0 => return Err(OmnidirectionalError::Vehicle(error)),
            _ => None,
        };
        while self.left > 0 {
            let (radio, heard) = (&mut self.radio, &mut self.heard);
            let stepped = if self.questions.is_pending() {
                let settled = self.questions.listen(radio, heard, &manner, now, here);
                // One that is given up is settled even where the radio has failed.
                if !self.questions.is_pending() {
                    self.settled(now);
                }
                settled
            } else if let Some(here) = here {
                self.questions.ask(radio, heard, &manner, now, here)
            } else {
                Ok(false)
            };
            if !stepped.map_err(OmnidirectionalError::Radio)? {
                return Ok(false);
            }
        }
        Ok(true)
    }

    fn settled(&mut self, now: f64) {
        self.left = self.left.saturating_sub(1);
        self.since = Some(now);
    }
}

impl<R: Radio, V: Vehicle, C: Clock> PatternSource for OmnidirectionalSource<R, V, C> {
    type Error = Failure<R, V>;

    fn begin(&mut self, beacons: &[BeaconId]) -> Result<(), Self::Error> {
        self.left = usize::from(self.config.questions) * beacons.len();
        self.since = None;
        self.heard = HeardTurn::of(beacons);
        self.questions = Questions::default();
        Ok(())
    }

    fn poll(&mut self) -> Result<Option<Sweep<'_>>, Self::Error> {
        if !self.heard.has_ended() {
            if self.heard.count() == 0 || !self.advance()? {
                return Ok(None);
            }
            self.heard.end(self.clock.now());
        }
        Ok(self.heard.lend(1, self.config.floor_dbm, self.last_pose))
    }
}
