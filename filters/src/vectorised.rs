//! Sums and maps over columns, on wide vectors where the processor has them.

use foxhunt_core::columns;
pub(crate) use foxhunt_core::vectorised::{Kernel, run};

/// So many sums run side by side: two or more wide vectors, and the same ones everywhere.
const LANES: usize = 16;

/// Folds what `of` makes of each pair into lanes, and these into one number.
#[inline(always)]
fn fold(a: &[f64], b: &[f64], from: f64, with: impl Fn(f64, f64, f64) -> f64) -> [f64; LANES] {
    let mut lanes = [from; LANES];
    let ((a, a_rest), (b, b_rest)) = (a.as_chunks::<LANES>(), b.as_chunks::<LANES>());
    for (a, b) in a.iter().zip(b) {
        for ((lane, a), b) in lanes.iter_mut().zip(a).zip(b) {
            *lane = with(*lane, *a, *b);
        }
    }
    for ((lane, a), b) in lanes.iter_mut().zip(a_rest).zip(b_rest) {
        *lane = with(*lane, *a, *b);
    }
    lanes
}

/// Σ aᵢ bᵢ.
#[inline(always)]
pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    total(fold(a, b, 0.0, |sum, a, b| sum + a * b))
}

/// Σ aᵢ.
#[inline(always)]
pub(crate) fn sum(a: &[f64]) -> f64 {
    total(fold(a, a, 0.0, |sum, a, _| sum + a))
}

/// The sum of the lanes, in pairs.
#[inline(always)]
fn total(mut lanes: [f64; LANES]) -> f64 {
    let mut half = LANES;
    while half > 1 {
        half /= 2;
        for lane in 0..half {
            lanes[lane] += lanes[half + lane];
        }
    }
    lanes[0]
}

/// Returns the largest number, NaN aside; −∞ without any.
#[inline(always)]
pub(crate) fn largest(a: &[f64]) -> f64 {
    let larger = |most: f64, a: f64| if a > most { a } else { most };
    let lanes = fold(a, a, f64::NEG_INFINITY, |most, a, _| larger(most, a));
    lanes.into_iter().fold(f64::NEG_INFINITY, larger)
}

/// The largest number, NaN aside; −∞ without any.
pub(crate) struct Largest<'a>(pub &'a [f64]);

impl Kernel for Largest<'_> {
    type Output = f64;

    #[inline(always)]
    fn run(self) -> f64 {
        largest(self.0)
    }
}

/// Σ aᵢ.
pub(crate) struct Sum<'a>(pub &'a [f64]);

impl Kernel for Sum<'_> {
    type Output = f64;

    #[inline(always)]
    fn run(self) -> f64 {
        sum(self.0)
    }
}

/// Σ aᵢ bᵢ.
pub(crate) struct Dot<'a>(pub &'a [f64], pub &'a [f64]);

impl Kernel for Dot<'_> {
    type Output = f64;

    #[inline(always)]
    fn run(self) -> f64 {
        dot(self.0, self.1)
    }
}

/// Sets each of `out` to `of` what stands in the same row of the columns; `of` also takes
/// what was there before.
pub(crate) struct Map<'a, O, const K: usize> {
    pub columns: [&'a [f64]; K],
    pub of: O,
    pub out: &'a mut [f64],
}

impl<O: Fn([f64; K], f64) -> f64, const K: usize> Kernel for Map<'_, O, K> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let columns = columns::rows(&self.columns, 0..self.out.len());
        for (i, out) in self.out.iter_mut().enumerate() {
            *out = (self.of)(columns::row(&columns, i), *out);
        }
    }
}
