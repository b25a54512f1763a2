use nalgebra::Vector3;

use super::QuadrotorConfig;

/// The path that a quadrotor is requested to follow: from where it is to its goal, at no more than
/// so much speed and change of speed; and the ramp of its heading.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Reference {
    goal: Vector3<f64>,
    pub(super) position: Vector3<f64>,
    pub(super) velocity: Vector3<f64>,
    pub(super) acceleration: Vector3<f64>,
    /// The heading in radians, not wrapped.
    pub(super) heading: f64,
    /// The slope of its ramp, in radians per second.
    rate: f64,
}

impl Reference {
    pub(super) fn holding(position: Vector3<f64>, heading: f64) -> Self {
        let velocity = Vector3::zeros();
        let acceleration = Vector3::zeros();
        Self { goal: position, position, velocity, acceleration, heading, rate: 0.0 }
    }

    pub(super) fn go_to(&mut self, goal: Vector3<f64>) {
        self.goal = goal;
    }

    /// Turns from `heading` on at `rate`.
    pub(super) fn turn(&mut self, heading: f64, rate: f64) {
        (self.heading, self.rate) = (heading, rate);
    }

    /// The rate at which it turns, in radians per second.
    pub(super) fn rate(&self) -> f64 {
        self.rate
    }

    pub(super) fn advance(&mut self, config: &QuadrotorConfig, dt: f64) {
        self.heading += self.rate * dt;
        let way = self.goal - self.position;
        let distance = way.norm();
        let most = config.acceleration_mps2 * dt;
        if distance <= most * dt && self.velocity.norm() <= 2.0 * most {
            (self.position, self.velocity) = (self.goal, Vector3::zeros());
            self.acceleration = Vector3::zeros();
            return;
        }
        // The slower of the two sets the pace, so that the line is straight. On the goal, but
        // still moving, any direction will do, as nothing is wanted along it.
        let distance = distance.max(f64::MIN_POSITIVE);
        let over_ground = way.xy().norm() / distance;
        let climb = way.z.abs() / distance;
        let pace = (over_ground / config.speed_mps).max(climb / config.climb_mps);
        // Nine tenths of what it may do to slow down leave room to correct the course; near the
        // goal no faster than that a step does not pass it.
        let slowing = libm::sqrt(1.8 * config.acceleration_mps2 * distance);
        let wanted = way * ((1.0 / pace).min(slowing).min(distance / dt) / distance);
        let change = wanted - self.velocity;
        let change = change * (most / change.norm().max(most));
        self.velocity += change;
        self.acceleration = change / dt;
        self.position += self.velocity * dt;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_arrives_within_its_limits_and_stays() {
        let config = QuadrotorConfig::default();
        let dt = 1.0 / config.rate_hz;
        let mut reference = Reference::holding(Vector3::new(1.0, 2.0, 3.0), 0.0);
        for goal in [Vector3::new(9.0, -4.0, 4.0), Vector3::new(9.0, -4.0, 0.5)] {
            // A first goal elsewhere: the way bends.
            reference.go_to(Vector3::new(-5.0, 2.0, 3.0));
            (0..800).for_each(|_| reference.advance(&config, dt));
            reference.go_to(goal);
            for _ in 0..8000 {
                reference.advance(&config, dt);
                assert!(reference.velocity.xy().norm() <= config.speed_mps * (1.0 + 1e-9));
                assert!(reference.velocity.z.abs() <= config.climb_mps * (1.0 + 1e-9));
                assert!(reference.acceleration.norm() <= config.acceleration_mps2 * (1.0 + 1e-9));
            }
            assert_eq!((reference.position, reference.velocity), (goal, Vector3::zeros()));
        }
    }

    #[test]
    fn it_comes_back_to_where_it_is_ordered_to_stop() {
        let config = QuadrotorConfig::default();
        let dt = 1.0 / config.rate_hz;
        let mut reference = Reference::holding(Vector3::zeros(), 0.0);
        reference.go_to(Vector3::new(20.0, 0.0, 0.0));
        (0..800).for_each(|_| reference.advance(&config, dt));
        let here = reference.position;
        reference.go_to(here);
        (0..4000).for_each(|_| reference.advance(&config, dt));
        assert_eq!((reference.position, reference.velocity), (here, Vector3::zeros()));
    }
}
