//! White noise by the chunk, and the kernel that sets copies of a particle apart with it.

use core::f64::consts::FRAC_PI_2;

use foxhunt_core::{Axis, State, angle, elementary};
use nalgebra::SMatrix;
use rand::{Rng, RngExt};
use rand_distr::StandardNormal;

use super::CHUNK;
use crate::count::number;

/// The odd number nearest to 2⁶⁴ over the golden ratio.
const GAMMA: u64 = 0x9e37_79b9_7f4a_7c15;

/// A step's random numbers, each a function of the step's key and of its place, so that
/// they may be drawn in any order.
///
/// SplitMix64 (Steele, Lea & Flood 2014), whose n-th number is a hash of key + n γ: without a
/// state, vectors draw as many at once as they hold.
pub(super) struct Draws {
    key: u64,
    bits: [u64; CHUNK],
}

impl Draws {
    pub(super) fn new(key: u64) -> Self {
        Self { key, bits: [0; CHUNK] }
    }

    /// Independent draws from N(0, 1), the first `count` of each column; other ones for each
    /// `block`.
    #[inline(always)]
    pub(super) fn fill_white<const N: usize>(
        &mut self,
        block: usize,
        columns: &mut [[f64; CHUNK]; N],
        count: usize,
    ) {
        for (row, column) in columns.iter_mut().enumerate() {
            self.fill_pairs(block * N + row, &mut column[..count.next_multiple_of(2)]);
        }
    }

    /// In pairs (Box & Muller 1958): a vector at a time, where the ziggurat takes one after the
    /// other.
    #[inline(always)]
    fn fill_pairs(&mut self, block: usize, out: &mut [f64]) {
        self.draw(block, out.len());
        let half = out.len() / 2;
        let (ranges, turns) = self.bits[..2 * half].split_at(half);
        let (first, second) = out.split_at_mut(half);
        for (((range, turn), first), second) in ranges.iter().zip(turns).zip(first).zip(second) {
            let range = square_root(-2.0 * elementary::ln(positive(*range)));
            // An eighth of a turn to either side, and then to one of the four sides.
            let (sin, cos) = elementary::sin_cos_octant((positive(*turn) - 0.5) * FRAC_PI_2);
            let cos = f64::from_bits(cos.to_bits() ^ ((turn & 2) << 62));
            let swap = turn & 1 == 0;
            *first = range * if swap { cos } else { sin };
            *second = range * if swap { sin } else { cos };
        }
    }

    /// Independent draws of the standard exponential distribution, −ln u; other ones for each
    /// `block`.
    #[inline(always)]
    pub(super) fn fill_exponential(&mut self, block: usize, out: &mut [f64]) {
        self.draw(block, out.len());
        for (out, bits) in out.iter_mut().zip(&self.bits) {
            *out = -elementary::ln(positive(*bits));
        }
    }

    /// The numbers of a block, which holds as many as a chunk.
    #[inline(always)]
    fn draw(&mut self, block: usize, count: usize) {
        let first = (block * CHUNK) as u64;
        let mut counter = self.key.wrapping_add(first.wrapping_mul(GAMMA));
        for bits in &mut self.bits[..count] {
            counter = counter.wrapping_add(GAMMA);
            let mixed = (counter ^ (counter >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
            let mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
            *bits = mixed ^ (mixed >> 31);
        }
    }
}

/// Sets the copies of a particle apart and keeps both moments of the cloud (Liu & West 2001):
/// x' = x̂ + √(1 − h²) (x ⊖ x̂) + h L ξ.
pub(super) struct Kernel<const N: usize> {
    axes: [Axis; N],
    mean: State<N>,
    spread: SMatrix<f64, N, N>,
    shrinkage: f64,
}

impl<const N: usize> Kernel<N> {
    /// The kernel about a cloud of this mean and the covariance L Lᵀ; none for a bandwidth of 0.
    pub(super) fn new(
        mean: &State<N>,
        factor: &SMatrix<f64, N, N>,
        bandwidth: f64,
        axes: [Axis; N],
    ) -> Option<Self> {
        (bandwidth > 0.0).then(|| Self {
            axes,
            mean: *mean,
            spread: factor * bandwidth,
            shrinkage: libm::sqrt(1.0 - bandwidth * bandwidth),
        })
    }

    /// A draw from about a particle; an angle of it is not wrapped.
    pub(super) fn draw(&self, state: &State<N>, rng: &mut impl Rng) -> State<N> {
        let deviation = Axis::difference(&self.axes, state, &self.mean);
        self.mean + deviation * self.shrinkage + self.spread * white(rng)
    }

    /// Draws from about columns of particles, given the draws from N(0, I).
    #[inline(always)]
    pub(super) fn spread_columns(&self, columns: &mut [&mut [f64]; N], white: &[[f64; CHUNK]; N]) {
        for (row, column) in columns.iter_mut().enumerate() {
            let mean = self.mean[row];
            let axis = self.axes[row];
            for x in column.iter_mut() {
                let deviation = match axis {
                    Axis::Linear => *x - mean,
                    Axis::Angle => angle::wrap(*x - mean),
                };
                *x = mean + deviation * self.shrinkage;
            }
            for (white, factor) in white.iter().zip(&self.spread.row(row)) {
                column.iter_mut().zip(white).for_each(|(x, white)| *x += factor * white);
            }
        }
    }
}

/// A draw from N(0, I).
pub(super) fn white<R: Rng, const N: usize>(rng: &mut R) -> State<N> {
    State::from_fn(|_, _| rng.sample(StandardNormal))
}

/// A uniform number in (0, 1] from the upper 52 bits.
#[inline(always)]
fn positive(bits: u64) -> f64 {
    2.0 - f64::from_bits((bits >> 12) | (0x3ff << 52))
}

/// The standard library's is one instruction, and `libm`'s cannot be vectorised; both round
/// correctly.
#[inline(always)]
fn square_root(x: f64) -> f64 {
    #[cfg(feature = "std")]
    return x.sqrt();
    #[cfg(not(feature = "std"))]
    return libm::sqrt(x);
}

/// The bandwidth that is best for a Gaussian (Silverman 1986, §4.3.2), below 1.
pub(super) fn silverman(dimension: usize, count: usize) -> f64 {
    let n = number(dimension);
    let count = number(count);
    libm::pow(4.0 / ((n + 2.0) * count), 1.0 / (n + 4.0)).min(0.99)
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::{abs_diff_eq, assert_abs_diff_eq};

    #[test]
    fn the_numbers_are_those_of_the_generator() {
        // The first five of SplitMix64 from the seed 1234567 (Vigna's splitmix64.c).
        const REFERENCE: [u64; 5] = [
            6_457_827_717_110_365_317,
            3_203_168_211_198_807_973,
            9_817_491_932_198_370_423,
            4_593_380_528_125_082_431,
            16_408_922_859_458_223_821,
        ];
        let mut draws = Draws::new(1_234_567);
        draws.draw(0, 5);
        assert_eq!(draws.bits[..5], REFERENCE);
        draws.draw(2, 1);
        let second = draws.bits[0];
        draws.key = draws.key.wrapping_add(GAMMA.wrapping_mul(CHUNK as u64));
        draws.draw(1, 1);
        assert_eq!(draws.bits[0], second);
    }

    #[test]
    fn white_numbers_are_independent_and_normal() {
        // 400 000 pairs from seed 3; each moment within five standard errors: a false alarm of
        // the 14 comes once in 100 000 seeds.
        let mut rng = Draws::new(3);
        let mut sums = [0.0; 12];
        let mut inside = [0_u32; 2];
        for chunk in 0..1600 {
            let mut draws = [[0.0; CHUNK]];
            rng.fill_white(chunk, &mut draws, 500);
            let (first, second) = draws[0][..500].split_at(250);
            for (x, y) in first.iter().zip(second) {
                let xx = x * x;
                let yy = y * y;
                let moments = [
                    *x,
                    *y,
                    xx,
                    yy,
                    x * xx,
                    y * yy,
                    xx * xx,
                    yy * yy,
                    x * y,
                    xx * y,
                    x * yy,
                    xx * yy,
                ];
                sums.iter_mut().zip(moments).for_each(|(sum, moment)| *sum += moment / 4e5);
                inside[0] += u32::from(x.abs() < 0.5);
                inside[1] += u32::from(*y < -1.5);
            }
        }
        // Means and variances of the moments of a standard normal pair.
        let (means, variances) = (
            [0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 3.0, 3.0, 0.0, 0.0, 0.0, 1.0],
            [1.0, 1.0, 2.0, 2.0, 15.0, 15.0, 96.0, 96.0, 1.0, 3.0, 3.0, 8.0],
        );
        for ((sum, mean), variance) in sums.iter().zip(means).zip(variances) {
            assert_abs_diff_eq!(*sum, mean, epsilon = 5.0 * libm::sqrt(variance / 4e5));
        }
        for (count, share) in inside.iter().zip([0.382_924_922_548_026, 0.066_807_201_268_858]) {
            let error = libm::sqrt(share * (1.0 - share) / 4e5);
            assert!(abs_diff_eq!(f64::from(*count) / 4e5, share, epsilon = 5.0 * error), "{count}");
        }
    }

    #[test]
    fn exponential_numbers_have_their_moments() {
        // 512 000 draws from seed 4; five standard errors.
        let mut rng = Draws::new(4);
        let mut draws = [0.0; CHUNK];
        let mut sum = 0.0;
        let mut squares = 0.0;
        for chunk in 0..1000 {
            rng.fill_exponential(chunk, &mut draws);
            assert!(draws.iter().all(|draw| *draw >= 0.0 && *draw < 36.1));
            sum += draws.iter().sum::<f64>() / 512e3;
            squares += draws.iter().map(|draw| draw * draw).sum::<f64>() / 512e3;
        }
        assert_abs_diff_eq!(sum, 1.0, epsilon = 5.0 / libm::sqrt(512e3));
        assert_abs_diff_eq!(squares, 2.0, epsilon = 5.0 * libm::sqrt(20.0 / 512e3));
    }
}
