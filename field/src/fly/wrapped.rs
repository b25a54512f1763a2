//! Aircraft around an aircraft: one that its pilot flies by advice, and one whose heights are
//! above the ground.

use std::collections::VecDeque;

use foxhunt_core::{Pose, Spinner, SteadyMotion, Vehicle, Waypoint};
use foxhunt_hardware::{Aircraft, AircraftState, Finding, Hands};
use nalgebra::Vector3;

use super::{Examine, Ground, terrain::WayError};

/// An aircraft that is this near to the end of an order gets the next one: over ground and in
/// height, in metres.
const ARRIVED_M: [f64; 2] = [1.0, 0.3];

/// An aircraft that its pilot flies: every order is advice, which somebody else shows, and no order
/// reaches it.
///
/// In the air it counts as one that follows, at its pilot's pace; on the ground as one that is
/// about to take off.
#[derive(Debug)]
pub(super) struct Advised<A>(pub A);

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

/// An aircraft whose heights are above the ground below it, by an elevation model, while its
/// autopilot's heights are above the launch place.
///
/// On the ground it learns what its autopilot's heights count from. A line that does not clear the
/// ground is flown in several orders: straight up, across, straight down.
#[derive(Debug)]
pub(super) struct OverGround<A> {
    aircraft: A,
    ground: Ground,
    /// Least and greatest height above the ground to which it may be sent, in metres.
    limits_m: [f64; 2],
    /// Height of the autopilot's zero, in the heights of the model; `None` until it is learned.
    datum: Option<f64>,
    /// Places to fly to after the present order, in the heights of the model.
    next: VecDeque<Vector3<f64>>,
    /// Place to which it was ordered.
    ordered: Vector3<f64>,
}

/// Reason why an aircraft's height above the ground is unknown, or why it did not obey.
#[derive(Debug, thiserror::Error)]
pub(super) enum OverGroundError<E> {
    /// The aircraft failed.
    #[error(transparent)]
    Aircraft(E),
    /// It was in the air from the beginning.
    #[error("the height of the ground that it took off from is not known: it was in the air")]
    NoDatum,
    /// There is no way over the ground.
    #[error(transparent)]
    Way(#[from] WayError),
    /// It is at no place of the model.
    #[error("({east:.1}, {north:.1}) m is beyond terrain.reach_m")]
    Beyond {
        /// East in metres.
        east: f64,
        /// North in metres.
        north: f64,
    },
    /// A goal that it may not be sent to.
    #[error("{up_m:.1} m above the ground; {least_m} to {most_m} m are allowed")]
    Limit {
        /// Height of the goal above the ground, in metres.
        up_m: f64,
        /// The least.
        least_m: f64,
        /// The most.
        most_m: f64,
    },
}

impl<A> OverGround<A> {
    pub(super) fn new(aircraft: A, ground: Ground, limits_m: [f64; 2]) -> Self {
        let next = VecDeque::new();
        let ordered = Vector3::zeros();
        Self { aircraft, ground, limits_m, datum: None, next, ordered }
    }

    fn height<E>(&self, place: &Vector3<f64>) -> Result<f64, OverGroundError<E>> {
        let beyond = OverGroundError::Beyond { east: place.x, north: place.y };
        self.ground.height(&place.xy()).ok_or(beyond)
    }
}

impl<A: Aircraft> OverGround<A> {
    /// Orders the next piece of the way if the aircraft is at the end of the last one.
    fn go_on(&mut self) -> Result<(), A::Error> {
        let (Some(datum), Some(next)) = (self.datum, self.next.front().copied()) else {
            return Ok(());
        };
        let Ok(pose) = self.aircraft.pose() else { return Ok(()) };
        let left = pose.position + Vector3::z() * datum - self.ordered;
        if left.xy().norm() > ARRIVED_M[0] || left.z.abs() > ARRIVED_M[1] {
            return Ok(());
        }
        self.aircraft.go_to(&Waypoint { position: next - Vector3::z() * datum })?;
        self.next.pop_front();
        self.ordered = next;
        Ok(())
    }
}

impl<A: Aircraft> Vehicle for OverGround<A> {
    type Error = OverGroundError<A::Error>;

    fn pose(&mut self) -> Result<Pose, Self::Error> {
        let mut pose = self.aircraft.pose().map_err(OverGroundError::Aircraft)?;
        let ground = self.height(&pose.position)?;
        pose.position.z += self.datum.ok_or(OverGroundError::NoDatum)? - ground;
        Ok(pose)
    }

    fn position_sigma(&self) -> Option<Vector3<f64>> {
        self.aircraft.position_sigma()
    }

    fn go_to(&mut self, goal: &Waypoint) -> Result<(), Self::Error> {
        let datum = self.datum.ok_or(OverGroundError::NoDatum)?;
        let ([least_m, most_m], up_m) = (self.limits_m, goal.position.z);
        if !(least_m..=most_m).contains(&up_m) {
            return Err(OverGroundError::Limit { up_m, least_m, most_m });
        }
        let pose = self.aircraft.pose().map_err(OverGroundError::Aircraft)?;
        let here = pose.position + Vector3::z() * datum;
        let mut there = goal.position;
        there.z += self.height(&there)?;
        let mut way: VecDeque<_> = self.ground.way(&here, &there, most_m)?.into();
        let first = way.pop_front().unwrap_or(there);
        let order = Waypoint { position: first - Vector3::z() * datum };
        self.aircraft.go_to(&order).map_err(OverGroundError::Aircraft)?;
        (self.next, self.ordered) = (way, first);
        Ok(())
    }

    fn land(&mut self) -> Result<(), Self::Error> {
        self.next.clear();
        self.aircraft.land().map_err(OverGroundError::Aircraft)
    }
}

impl<A: Aircraft> Spinner for OverGround<A> {
    fn spin(&mut self, rate: Option<f64>) -> Result<(), Self::Error> {
        self.aircraft.spin(rate).map_err(OverGroundError::Aircraft)
    }
}

impl<A: Aircraft> Aircraft for OverGround<A> {
    fn state(&mut self) -> Result<AircraftState, Self::Error> {
        let mut state = self.aircraft.state().map_err(OverGroundError::Aircraft)?;
        if !state.airborne {
            // As of its last moment on the ground, since autopilots count from where they arm.
            let place = self.aircraft.pose().ok().map(|pose| pose.position);
            let ground = place.and_then(|place| Some(self.ground.height(&place.xy())? - place.z));
            self.datum = ground.or(self.datum);
            self.next.clear();
        } else if self.datum.is_none() {
            state.commanded = false;
            state.offered = false;
            state.hindrance = OverGroundError::<A::Error>::NoDatum.to_string();
        }
        if state.commanded {
            if let Err(refusal) = self.go_on() {
                // It stays where it is, and is missed where it was sent.
                self.next.clear();
                state.hindrance = refusal.to_string();
            }
        } else {
            // Whoever takes it sends it where he likes, and it is ordered again when it is back.
            self.next.clear();
        }
        Ok(state)
    }

    fn take_off(&mut self, up_m: f64) -> Result<(), Self::Error> {
        self.aircraft.take_off(up_m).map_err(OverGroundError::Aircraft)
    }

    fn take_over(&mut self) -> Result<(), Self::Error> {
        self.aircraft.take_over().map_err(OverGroundError::Aircraft)
    }

    fn return_to_launch(&mut self) -> Result<(), Self::Error> {
        self.next.clear();
        self.aircraft.return_to_launch().map_err(OverGroundError::Aircraft)
    }

    fn clear_to_take_off(&mut self) {
        self.aircraft.clear_to_take_off();
    }

    fn photograph(&mut self) -> Result<(), Self::Error> {
        self.aircraft.photograph().map_err(OverGroundError::Aircraft)
    }

    fn device_failure(&mut self) -> Option<Self::Error> {
        self.aircraft.device_failure().map(OverGroundError::Aircraft)
    }

    fn picture_failure(&mut self) -> Option<Self::Error> {
        self.aircraft.picture_failure().map(OverGroundError::Aircraft)
    }
}

impl<A: Examine> Examine for OverGround<A> {
    fn examine(&mut self, pause: &mut dyn FnMut()) -> Vec<Finding> {
        self.aircraft.examine(pause)
    }
}
