use foxhunt_core::Pose;
use foxhunt_sensors::ReflectedWave;
use nalgebra::Vector3;

use super::{Channel, Port};

/// The way from a beacon to a receiver: what does not change while neither moves.
#[derive(Clone, Debug)]
pub(super) struct Path {
    beacon: usize,
    from: Vector3<f64>,
    to: Vector3<f64>,
    /// The level over a level turn of the antenna.
    pub(super) level_dbm: f64,
    reflected: Vec<Wave>,
}

/// A wave beside the direct one.
#[derive(Clone, Copy, Debug)]
pub(super) struct Wave {
    /// The direction that it comes from, of any length.
    pub(super) sight: Vector3<f64>,
    /// Its amplitude over the direct wave's, before the antenna.
    pub(super) amplitude: f64,
    /// The phase by which it leads the direct wave, in radians.
    pub(super) phase: f64,
}

/// The directions that the waves of a path come from in the body's own frame: what does not change
/// while neither moves nor the body turns, whatever its antenna does.
#[derive(Clone, Debug)]
pub(super) struct Arrivals {
    pose: Pose,
    /// The azimuth from the nose and the elevation of the direct wave.
    direct: (f64, f64),
    /// The reflected ones; their azimuths are from the nose.
    reflected: Vec<ReflectedWave>,
}

impl Path {
    /// The path from the receiver at `from` to the beacon at `to`.
    pub(super) fn new(
        channel: &Channel,
        beacon: usize,
        from: Vector3<f64>,
        to: Vector3<f64>,
    ) -> Self {
        let level_dbm = channel.level_dbm(beacon, &from, &to);
        let direct = (to - from).norm();
        let reflected = channel.reflectors.iter().map(|reflector| {
            let sight = reflector.place - from;
            let excess = sight.norm() + (to - reflector.place).norm() - direct;
            let phase = reflector.phase - channel.wave_number * excess;
            Wave { sight, amplitude: reflector.amplitude, phase }
        });
        Self { beacon, from, to, level_dbm, reflected: reflected.collect() }
    }

    pub(super) fn beacon(&self) -> usize {
        self.beacon
    }

    /// Returns true if receiver and beacon are still there.
    pub(super) fn is_between(&self, from: &Vector3<f64>, to: &Vector3<f64>) -> bool {
        self.from == *from && self.to == *to
    }

    /// The arrivals of its waves at a receiver in a pose.
    pub(super) fn arrivals(&self, pose: &Pose) -> Arrivals {
        let reflected = self.reflected.iter().map(|wave| wave.arrival(pose)).collect();
        Arrivals { pose: *pose, direct: arrival(pose, &(self.to - self.from)), reflected }
    }
}

impl Wave {
    /// The wave as it arrives at a body in a pose, its azimuth from the nose.
    fn arrival(&self, pose: &Pose) -> ReflectedWave {
        let Self { amplitude, phase, .. } = *self;
        let (azimuth, elevation) = arrival(pose, &self.sight);
        ReflectedWave { azimuth, elevation, amplitude, phase }
    }
}

/// Azimuth from the nose and elevation of a direction, for a body in a pose.
fn arrival(pose: &Pose, sight: &Vector3<f64>) -> (f64, f64) {
    let body = pose.to_body(sight);
    let azimuth = libm::atan2(body.y, body.x);
    (azimuth, libm::atan2(body.z, libm::hypot(body.x, body.y)))
}

impl Arrivals {
    /// Returns true if the arrivals belong to a receiver in a pose.
    pub(super) fn are_at(&self, pose: &Pose) -> bool {
        self.pose == *pose
    }

    /// The antenna's gain over its mean, in dB; the antenna is turned by `turned` from the nose. An
    /// omnidirectional one has only the gain that reflected and scattered waves add.
    pub(super) fn gain_db(
        &self,
        channel: &Channel,
        scattered: &[Wave],
        turned: f64,
        port: Port<'_>,
    ) -> f64 {
        let aimed = |wave: ReflectedWave| ReflectedWave { azimuth: wave.azimuth - turned, ..wave };
        let scattered = scattered.iter().map(|wave| wave.arrival(&self.pose));
        let reflected: Vec<_> =
            self.reflected.iter().copied().chain(scattered).map(aimed).collect();
        let (azimuth, elevation) = self.direct;
        channel.relative_gain_db(azimuth - turned, elevation, &reflected, port)
    }
}

#[cfg(test)]
mod tests {
    use foxhunt_sensors::{Antenna, AntennaConfig, Dipole};
    use rand::{SeedableRng, rngs::Xoshiro256PlusPlus};

    use super::*;
    use crate::ChannelConfig;

    fn gain(antenna: AntennaConfig, pose: &Pose, to: Vector3<f64>, turned: f64) -> f64 {
        let config = ChannelConfig { antenna, ..ChannelConfig::default() };
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(1);
        let channel = Channel::new(&config, None, 1, &mut rng).expect("in order");
        let path = Path::new(&channel, 0, pose.position, to);
        path.arrivals(pose).gain_db(&channel, &[], turned, Port::Directional)
    }

    #[test]
    fn a_body_that_leans_tips_its_antenna() {
        let far_north = Vector3::new(0.0, 1000.0, 0.0);
        let level = Pose::level(Vector3::zeros(), std::f64::consts::FRAC_PI_2);
        let dipole = |pose: &Pose| gain(AntennaConfig::Dipole, pose, far_north, 0.3);
        assert!(dipole(&level).abs() < 1e-9);
        // Nose down by 0.4 rad, the beacon ahead is 0.4 rad above the body's own horizon.
        let leaning = Dipole.gain_dbi(0.0, 0.4) - Dipole.gain_dbi(0.0, 0.0);
        assert!((dipole(&Pose { pitch: -0.4, ..level }) - leaning).abs() < 1e-9);
        assert!(dipole(&Pose { roll: 0.4, ..level }).abs() < 1e-9, "about the line of sight");
        let above = Pose { position: Vector3::new(0.0, 1000.0, 1000.0), ..level };
        let below = gain(AntennaConfig::Dipole, &above, Vector3::new(1e3, 1e3, 0.0), 0.0);
        let at_45 = Dipole.gain_dbi(0.0, std::f64::consts::FRAC_PI_4) - Dipole.gain_dbi(0.0, 0.0);
        assert!((below - at_45).abs() < 1e-9, "{below} dB");
    }

    #[test]
    fn heading_and_rotator_turn_it_alike() {
        let to = Vector3::new(30.0, 40.0, 0.0);
        let of = |heading: f64, turned: f64| {
            let pose = Pose { heading, ..Pose::default() };
            gain(AntennaConfig::ReferencePatch, &pose, to, turned)
        };
        assert!((of(0.7, 0.2) - of(0.0, 0.9)).abs() < 1e-9);
        let best = of(0.5, 40.0_f64.atan2(30.0) - 0.5);
        assert!(best > of(0.5, 0.0) && best > of(0.5, 1.0));
    }
}
