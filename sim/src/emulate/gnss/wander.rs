use nalgebra::Vector3;
use rand::{RngExt, SeedableRng, rngs::Xoshiro256PlusPlus};
use rand_distr::StandardNormal;

/// A number that separates a receiver's stream from the streams of the world and of other drones'
/// receivers.
const RECEIVER: u64 = 0x6e55_0e77_0000_0000;

/// The error of a receiver's place: East, North and Up by themselves, each a first-order
/// Gauss-Markov process with a stationary σ. e(t + dt) = ρ e(t) + σ √(1 − ρ²) n, with ρ =
/// exp(−dt / τ).
#[derive(Clone, Debug)]
pub(super) struct Wander {
    sigma: Vector3<f64>,
    /// The time constant τ in seconds.
    tau: f64,
    stream: Xoshiro256PlusPlus,
    error: Vector3<f64>,
}

impl Wander {
    pub(super) fn new(sigma: Vector3<f64>, tau: f64, seed: u64, drone: usize) -> Self {
        let drone = u64::try_from(drone).unwrap_or(u64::MAX);
        let mut stream = Xoshiro256PlusPlus::seed_from_u64(seed ^ RECEIVER ^ drone);
        let error = normal(&mut stream).component_mul(&sigma);
        Self { sigma, tau, stream, error }
    }

    /// The error after `dt` seconds more.
    pub(super) fn step(&mut self, dt: f64) -> Vector3<f64> {
        let rho = libm::exp(-dt / self.tau);
        let fresh = normal(&mut self.stream).component_mul(&self.sigma);
        self.error = self.error * rho + fresh * libm::sqrt(1.0 - rho * rho);
        self.error
    }
}

fn normal(stream: &mut Xoshiro256PlusPlus) -> Vector3<f64> {
    Vector3::from_fn(|_, _| stream.sample(StandardNormal))
}
