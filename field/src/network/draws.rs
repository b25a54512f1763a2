use rand::{RngExt, SeedableRng, rngs::Xoshiro256PlusPlus};

/// Independent numbers that are uniform in [0, 1), for
/// [`Impaired`](foxhunt_hardware::link::Impaired) links; the same for the same seed.
pub fn uniform_draws(seed: u64) -> impl FnMut() -> f64 + use<> {
    let mut generator = Xoshiro256PlusPlus::seed_from_u64(seed);
    move || generator.random()
}
