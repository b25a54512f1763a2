use alloc::{vec, vec::Vec};

use foxhunt_core::elementary;

use crate::{
    count::number,
    vectorised::{Kernel, Map, largest, run},
};

/// Convolves a density over square rows with a Gaussian along each side, given and left as
/// logarithms; `variance` counts in cells². What spreads beyond the border is lost.
pub(super) fn blur(logs: &mut [f64], side: usize, variance: [f64; 2]) {
    let best = largest(logs);
    if best <= f64::NEG_INFINITY || variance.iter().all(|v| *v < 1e-12) {
        return;
    }
    let mut density = vec![0.0; logs.len()];
    let exp = |[log]: [f64; 1], _| elementary::exp(log - best);
    run(Map { columns: [logs], of: exp, out: &mut density });
    let mut blurred = vec![0.0; logs.len()];
    for (along, variance) in variance.into_iter().enumerate() {
        let taps = taps(variance, side);
        run(Convolution { density: &density, side, along, taps: &taps, out: &mut blurred });
        core::mem::swap(&mut density, &mut blurred);
    }
    let log = |[density]: [f64; 1], before| {
        let log = best + elementary::ln(density);
        // A density too small for its number stays what it was.
        if density >= f64::MIN_POSITIVE { log } else { before }
    };
    run(Map { columns: [&density], of: log, out: logs });
}

/// A convolution along one side, 0 along the rows.
struct Convolution<'a> {
    density: &'a [f64],
    side: usize,
    along: usize,
    taps: &'a [f64],
    out: &'a mut [f64],
}

impl Kernel for Convolution<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Self { density, side, along, taps, out } = self;
        // Across the rows all of them are one line, whose neighbours are a row apart.
        let (length, step) = if along == 0 { (side, 1) } else { (density.len(), side) };
        for (line, out) in density.chunks_exact(length).zip(out.chunks_exact_mut(length)) {
            out.iter_mut().zip(line).for_each(|(out, v)| *out = taps[0] * v);
            for (reach, tap) in taps.iter().enumerate().skip(1) {
                let away = reach * step;
                out[away..].iter_mut().zip(line).for_each(|(out, v)| *out += tap * v);
                out.iter_mut().zip(&line[away..]).for_each(|(out, v)| *out += tap * v);
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
            let mut logs: Vec<f64> = (0..SIDE * SIDE)
                .map(|i| {
                    let (x, y) = (axis(i % SIDE), axis(i / SIDE));
                    -3.0 - 0.5 * (x * x + y * y) / before
                })
                .collect();
            blur(&mut logs, SIDE, added);
            let weight = |i: usize| libm::exp(logs[i]);
            let total: f64 = (0..SIDE * SIDE).map(weight).sum();
            let expected = libm::exp(-3.0) * core::f64::consts::TAU * before;
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
