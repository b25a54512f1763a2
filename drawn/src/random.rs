use rand::{RngExt, SeedableRng, rngs::Xoshiro256PlusPlus};
use rand_distr::{Distribution, StandardNormal};

/// Numbers of one draw, from its class and its seed.
pub struct Random(Xoshiro256PlusPlus);

impl Random {
    /// Creates the numbers of a draw. A class has its own whatever others there are.
    pub fn new(class: &str, seed: u64) -> Self {
        // The hash of Fowler, Noll & Vo (FNV-1a, 64 bits).
        let hash = class.bytes().fold(0xCBF2_9CE4_8422_2325_u64, |hash, byte| {
            (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01B3)
        });
        Self(Xoshiro256PlusPlus::seed_from_u64(hash ^ seed.wrapping_mul(0x9E37_79B9_7F4A_7C15)))
    }

    /// Draws evenly between two numbers.
    pub fn between(&mut self, least: f64, most: f64) -> f64 {
        least + (most - least) * self.0.random::<f64>()
    }

    /// Draws between two positive numbers, evenly in the logarithm.
    pub fn log_between(&mut self, least: f64, most: f64) -> f64 {
        self.between(least.ln(), most.ln()).exp()
    }

    /// Draws a whole number from `least` to `most`.
    pub fn count(&mut self, least: u32, most: u32) -> u32 {
        self.0.random_range(least..=most)
    }

    /// Draws an index below `end`; 0 where `end` is 0.
    pub fn index(&mut self, end: usize) -> usize {
        self.0.random_range(0..end.max(1))
    }

    /// Returns true with a probability.
    pub fn chance(&mut self, probability: f64) -> bool {
        self.0.random::<f64>() < probability
    }

    /// Draws from a normal distribution about zero.
    pub fn normal(&mut self, sigma: f64) -> f64 {
        let unit: f64 = StandardNormal.sample(&mut self.0);
        sigma * unit
    }

    /// Draws a sign.
    pub fn sign(&mut self) -> f64 {
        if self.chance(0.5) { 1.0 } else { -1.0 }
    }

    /// Draws distinct indices below `end`, in rising order.
    pub fn some_of(&mut self, count: usize, end: usize) -> Vec<usize> {
        let mut all: Vec<usize> = (0..end).collect();
        while all.len() > count {
            let gone = self.index(all.len());
            all.remove(gone);
        }
        all
    }
}
