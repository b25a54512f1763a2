use alloc::{vec, vec::Vec};

use crate::{
    count::number,
    vectorised::{Kernel, run},
};

/// Convolves weights over rows of `columns` cells with a Gaussian along one side, 0 along the rows;
/// `variance` counts in cells². Sets `out`; what spreads beyond the border is lost.
pub(crate) fn blur(weights: &[f64], out: &mut [f64], columns: usize, along: usize, variance: f64) {
    let side = if along == 0 { columns } else { weights.len() / columns };
    run(Convolution { weights, columns, along, taps: &taps(variance, side), out });
}

/// A convolution along one side, 0 along the rows.
struct Convolution<'a> {
    weights: &'a [f64],
    columns: usize,
    along: usize,
    taps: &'a [f64],
    out: &'a mut [f64],
}

impl Kernel for Convolution<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Self { weights, columns, along, taps, out } = self;
        let rows = weights.len() / columns;
        for (row, out) in out.chunks_exact_mut(columns).enumerate() {
            let line = &weights[row * columns..][..columns];
            out.iter_mut().zip(line).for_each(|(out, v)| *out = taps[0] * v);
            for (reach, tap) in taps.iter().enumerate().skip(1) {
                let add = |out: &mut [f64], from: &[f64]| {
                    out.iter_mut().zip(from).for_each(|(out, v)| *out += tap * v);
                };
                if along == 0 {
                    add(&mut out[reach..], line);
                    add(out, &line[reach..]);
                } else {
                    if row >= reach {
                        add(out, &weights[(row - reach) * columns..]);
                    }
                    if row + reach < rows {
                        add(out, &weights[(row + reach) * columns..]);
                    }
                }
            }
        }
    }
}

/// One side of a symmetric kernel of this variance that sums to 1. Up to half a cell² three
/// weights have exactly that variance; beyond, the Gaussian at whole cells has it to 10⁻³.
fn taps(variance: f64, side: usize) -> Vec<f64> {
    if variance <= 0.5 {
        return vec![1.0 - variance, 0.5 * variance];
    }
    let gauss = |reach: usize| libm::exp(-0.5 * number(reach * reach) / variance);
    let mut taps: Vec<f64> = (0..side).map(gauss).take_while(|tap| *tap > 1e-14).collect();
    let total = 2.0 * taps.iter().sum::<f64>() - taps[0];
    taps.iter_mut().for_each(|tap| *tap /= total);
    taps
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_gaussian_stays_one_and_gains_the_variance() {
        const SIDE: usize = 81;
        for (before, added) in [(9.0, [0.3, 0.0]), (9.0, [4.0, 0.7]), (16.0, [0.01, 12.0])] {
            let axis = |i: usize| number(i) - 40.0;
            let mut weights: Vec<f64> = (0..SIDE * SIDE)
                .map(|i| {
                    let x = axis(i % SIDE);
                    let y = axis(i / SIDE);
                    libm::exp(-0.5 * (x * x + y * y) / before)
                })
                .collect();
            let mut along_rows = vec![0.0; SIDE * SIDE];
            blur(&weights, &mut along_rows, SIDE, 0, added[0]);
            blur(&along_rows, &mut weights, SIDE, 1, added[1]);
            let weight = |i: usize| weights[i];
            let total: f64 = weights.iter().sum();
            let expected = core::f64::consts::TAU * before;
            assert!((total / expected - 1.0).abs() < 1e-9, "mass {total}, not {expected}");
            for (along, added) in added.into_iter().enumerate() {
                let at = |i: usize| axis(if along == 0 { i % SIDE } else { i / SIDE });
                let variance =
                    (0..SIDE * SIDE).map(|i| weight(i) * at(i) * at(i)).sum::<f64>() / total;
                let error = variance - before - added;
                assert!(error.abs() < 1e-3 * (before + added), "variance {variance}");
            }
        }
    }
}
