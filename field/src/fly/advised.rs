use foxhunt_core::{Pose, Spinner, SteadyMotion, Vehicle, Waypoint};
use foxhunt_hardware::{Aircraft, AircraftState, Finding, Hands};
use nalgebra::Vector3;

use super::Examine;

/// An aircraft that its pilot flies: every order is advice, which somebody else shows, and no order
/// reaches it.
///
/// In the air it counts as one that follows, at its pilot's pace; on the ground as one that is
/// about to take off.
#[derive(Debug)]
pub(super) struct Advised<A>(pub(super) A);

impl<A: Vehicle> Vehicle for Advised<A> {
    type Error = A::Error;

    fn pose(&mut self) -> Result<Pose, A::Error> {
        self.0.pose()
    }

    fn position_sigma(&self) -> Option<Vector3<f64>> {
        self.0.position_sigma()
    }

    fn go_to(&mut self, _goal: &Waypoint) -> Result<(), A::Error> {
        Ok(())
    }

    fn land(&mut self) -> Result<(), A::Error> {
        Ok(())
    }

    fn steady_motion(&self) -> Option<SteadyMotion> {
        self.0.steady_motion()
    }
}

impl<A: Spinner> Spinner for Advised<A> {
    fn spin(&mut self, _rate: Option<f64>) -> Result<(), A::Error> {
        Ok(())
    }
}

impl<A: Aircraft> Aircraft for Advised<A> {
    fn state(&mut self) -> Result<AircraftState, A::Error> {
        let state = self.0.state()?;
        let placed = self.0.pose().is_ok();
        Ok(AircraftState {
            commanded: state.airborne && state.armed && placed,
            offered: false,
            // Its pilot brings it down when he is advised to, and is waited for.
            hands: if state.airborne || state.armed { Hands::Ours } else { Hands::Nobody },
            hindrance: if placed { String::new() } else { state.hindrance },
            ..state
        })
    }

    fn take_off(&mut self, _up_m: f64) -> Result<(), A::Error> {
        Ok(())
    }

    fn take_over(&mut self) -> Result<(), A::Error> {
        Ok(())
    }

    fn return_to_launch(&mut self) -> Result<(), A::Error> {
        Ok(())
    }
}

impl<A: Examine> Examine for Advised<A> {
    fn examine(&mut self, pause: &mut dyn FnMut()) -> Vec<Finding> {
        self.0.examine(pause)
    }
}
