use foxhunt_core::Rotator;

use super::OnBoard;
use crate::SimError;

/// The motor that turns a simulated drone's antenna.
#[derive(Clone, Debug)]
pub struct SimRotator(pub(crate) OnBoard);

impl Rotator for SimRotator {
    type Error = SimError;

    /// # Errors
    ///
    /// [`SimError::Angle`] for an angle that is not finite; the older order stays then.
    fn turn_to(&mut self, angle: f64) -> Result<(), SimError> {
        if !angle.is_finite() {
            return Err(SimError::Angle { angle });
        }
        self.0.with(|drone, now| drone.turn_to(angle, now));
        Ok(())
    }

    #[inline]
    fn poll(&mut self) -> Result<Option<f64>, SimError> {
        Ok(self.0.with(|drone, now| drone.motor.standing(now)))
    }

    #[inline]
    fn next_event(&self) -> Option<f64> {
        Some(self.0.with(|drone, now| drone.motor.stands_at(now)))
    }
}
