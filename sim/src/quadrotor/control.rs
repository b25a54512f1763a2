use nalgebra::{Vector2, Vector3};

use super::{Inputs, Piloting, QuadrotorConfig, Reference, State, dynamics::GRAVITY};

/// The controllers of Isaacs et al. 2014, §III, with what they have to remember.
///
/// Errors are reference minus state. What differs from the print: the derivative of (9) brakes;
/// (20) and (24) become angles by 1/g with the signs that East-North-Up gives them, and their
/// tangents are exact; the error of (10) is not wrapped; (26) brakes, too. A derivative acts on
/// the difference to the reference's own speed, but for the yaw's, as in the document.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Controller {
    /// ∫ of the place's error, in m s.
    place: Vector2<f64>,
    /// ∫ of the heading's error, in rad s.
    heading: f64,
}

/// The rate at which controllers on board of an AR.Drone make a commanded rate true, per second.
const ON_BOARD: f64 = 5.0;

/// The commanded rate for an acceleration of `proportional` − `damping` · `rate` by controllers
/// on board: k_p e − k_d ẋ with k_d short of the braking that they do themselves (eq. 26, 27).
fn commanded(proportional: f64, damping: f64, rate: f64) -> f64 {
    proportional / ON_BOARD - (damping / ON_BOARD - 1.0) * rate
}

/// The acceleration that the controllers on board make of a commanded rate.
fn on_board(commanded: f64, rate: f64) -> f64 {
    ON_BOARD * (commanded - rate)
}

impl Controller {
    /// The commands to the rotors for the next `dt` seconds.
    pub(super) fn command(
        &mut self,
        config: &QuadrotorConfig,
        reference: &Reference,
        state: &State,
        dt: f64,
    ) -> Inputs {
        let [heading, pitch, roll] = state.attitude.into();
        let turning = state.rates.x;
        let level = libm::cos(pitch) * libm::cos(roll);
        let climb = self.climb(config, reference, state);
        let thrust = (GRAVITY + climb) / level.max(0.1);

        // The commanded tilt lies along the heading and across it (eq. 25), so it turns with the
        // body: the other way round, and that is its rate.
        let wanted = self.accelerate(config, reference, state, dt);
        let sin = libm::sin(heading);
        let cos = libm::cos(heading);
        let forward = wanted.x * cos + wanted.y * sin;
        let left = wanted.y * cos - wanted.x * sin;
        let pitched = -libm::atan(forward / GRAVITY);
        let rolled = -libm::atan(left * libm::cos(pitched) / GRAVITY);
        let tilting = Vector2::new(turning * rolled, -turning * pitched);
        let gains = &config.gains;
        let tilt = gains.tilt_p * Vector2::new(pitched - pitch, rolled - roll)
            + gains.tilt_d * (tilting - state.rates.yz());

        let yaw = self.yaw(config, reference, state, dt);
        Inputs {
            thrust: thrust.clamp(0.0, config.thrust_limit * GRAVITY),
            torque: Vector3::new(yaw, tilt.x, tilt.y),
            wind: Vector3::zeros(),
            drag: config.drag_per_s,
        }
    }

    /// The vertical acceleration in m/s² (eq. 9, or 26).
    fn climb(&self, config: &QuadrotorConfig, reference: &Reference, state: &State) -> f64 {
        let gains = &config.gains;
        let error = reference.position.z - state.position.z;
        let climb = state.velocity.z;
        let p = gains.altitude_p * error;
        let d = gains.altitude_d;
        let ahead = d * reference.velocity.z + reference.acceleration.z;
        match config.piloting {
            Piloting::Forces => p - d * climb + ahead,
            Piloting::Velocities => {
                // Twice the climb of the reference is enough for any correction.
                let most = 2.0 * config.climb_mps;
                on_board(commanded(p + ahead, d, climb).clamp(-most, most), climb)
            }
        }
    }

    /// The acceleration over ground in m/s², East and North (eq. 20, 24), within the tilt that is
    /// allowed.
    fn accelerate(
        &mut self,
        config: &QuadrotorConfig,
        reference: &Reference,
        state: &State,
        dt: f64,
    ) -> Vector2<f64> {
        let gains = &config.gains;
        let error = (reference.position - state.position).xy();
        let speed = (reference.velocity - state.velocity).xy();
        let wanted = gains.place_p * error
            + gains.place_i * self.place
            + gains.place_d * speed
            + reference.acceleration.xy();
        let most = GRAVITY * libm::tan(config.tilt_limit_deg.to_radians());
        let requested = wanted.norm();
        if requested > most {
            // What cannot be done is not remembered either.
            return wanted * (most / requested);
        }
        self.place += error * dt;
        wanted
    }

    /// The angular acceleration about up in rad/s² (eq. 10, or 27).
    fn yaw(
        &mut self,
        config: &QuadrotorConfig,
        reference: &Reference,
        state: &State,
        dt: f64,
    ) -> f64 {
        let gains = &config.gains;
        let error = reference.heading - state.attitude.x;
        let rate = state.rates.x;
        let requested = gains.yaw_p * error + gains.yaw_i * self.heading;
        let d = gains.yaw_d;
        let wanted = match config.piloting {
            Piloting::Forces => requested - d * rate,
            Piloting::Velocities => on_board(commanded(requested, d, rate), rate),
        };
        let most = config.yaw_limit_rad_s2;
        if wanted.abs() <= most {
            self.heading += error * dt;
        }
        wanted.clamp(-most, most)
    }
}
