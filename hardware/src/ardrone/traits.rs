use foxhunt_core::{Clock, Pose, Spinner, Vehicle, Waypoint};
use foxhunt_wire::{
    ByteStream,
    ardrone::{ArDroneCommand, encode_commands},
};
use nalgebra::{Vector2, Vector3};

use super::{ArDrone, ArDroneConfig, ArDroneError, control::Goal, serve::send, vehicle::Phase};
use crate::{Aircraft, AircraftState, Hands};

impl<A: ByteStream, N: ByteStream, C: Clock> Vehicle for ArDrone<A, N, C> {
    type Error = ArDroneError;

    fn pose(&mut self) -> Result<Pose, ArDroneError> {
        let now = self.serve()?;
        self.check_link(now)?;
        Ok(self.known_pose())
    }

    fn position_sigma(&self) -> Option<Vector3<f64>> {
        let over_ground = self.sigma.hypot(self.config.drift_share * self.flown);
        // Ultrasound is good to a few centimetres.
        Some(Vector3::new(over_ground, over_ground, 0.1))
    }

    fn go_to(&mut self, goal: &Waypoint) -> Result<(), ArDroneError> {
        let now = self.serve()?;
        let older = self.commanded_goal(now)?;
        let place = goal.position;
        let config = &self.config;
        ArDroneConfig::limit("an Up", place.z, config.min_up_m, config.max_up_m)?;
        let start = Vector2::new(config.east_m, config.north_m);
        let away = (place.xy() - start).norm();
        ArDroneConfig::limit("a distance", away, 0.0, config.fence_radius_m)?;
        self.goal = Some(Goal { place, ..older });
        Ok(())
    }

    fn land(&mut self) -> Result<(), ArDroneError> {
        self.come_down(Phase::Landing)
    }
}

impl<A: ByteStream, N: ByteStream, C: Clock> Spinner for ArDrone<A, N, C> {
    fn spin(&mut self, rate: Option<f64>) -> Result<(), ArDroneError> {
        let now = self.serve()?;
        let goal = self.commanded_goal(now)?;
        let most = self.config.yaw_rate_deg_s;
        ArDroneConfig::limit("a turn", rate.unwrap_or(0.0).to_degrees(), -most, most)?;
        self.goal = Some(Goal { heading: self.heading(), rate: rate.unwrap_or(0.0), ..goal });
        Ok(())
    }
}

/// It has no rules of its own for coming back: it is flown to where it started, and lands there.
impl<A: ByteStream, N: ByteStream, C: Clock> Aircraft for ArDrone<A, N, C> {
    fn state(&mut self) -> Result<AircraftState, ArDroneError> {
        let now = self.serve()?;
        let demo = self.demo();
        Ok(AircraftState {
            silent_s: self.silent_s(now),
            mode: demo.map_or_else(String::new, |demo| format!("{:?}", demo.flight)),
            armed: self.is_flying(),
            airborne: self.is_flying(),
            commanded: self.phase == Phase::Flying && self.check_link(now).is_ok(),
            offered: self.phase == Phase::Lost && self.is_flying(),
            hands: match self.phase {
                Phase::Idle => Hands::Nobody,
                Phase::Lost if self.check_link(now).is_err() => Hands::Unheard,
                Phase::Lost => Hands::GivenBack,
                _ => Hands::Ours,
            },
            hindrance: self.hindrance(now),
            battery: demo.map(|demo| f64::from(demo.battery_percent.min(100)) / 100.0),
            above_ground: None,
        })
    }

    fn take_off(&mut self, up_m: f64) -> Result<(), ArDroneError> {
        let now = self.serve()?;
        ArDroneConfig::limit("an Up", up_m, self.config.min_up_m, self.config.max_up_m)?;
        if self.is_flying() || matches!(self.phase, Phase::TakingOff { .. }) {
            return Ok(());
        }
        self.check_link(now)?;
        if self.phase == Phase::Landing {
            return Err(ArDroneError::NotCommanded { why: self.hindrance(now) });
        }
        self.failure.clear();
        // It stands level now.
        let bytes = encode_commands(&[ArDroneCommand::FlatTrim], &mut self.sequence);
        send(&mut self.orders, &bytes)?;
        (self.phase, self.goal) = (Phase::TakingOff { up: up_m, since: now, calm: false }, None);
        Ok(self.send_due(now)?)
    }

    fn take_over(&mut self) -> Result<(), ArDroneError> {
        Self::take_over(self)
    }

    fn return_to_launch(&mut self) -> Result<(), ArDroneError> {
        self.come_down(Phase::Returning)
    }
}
