//! Measurement models: what a receiver at a known pose measures of a target in a given state.

mod bearing;
mod changed_level;
mod combined;
mod difference;
#[cfg(feature = "alloc")]
mod directional;
mod level;
mod level_law;
mod magnetic_dipole;

pub use bearing::{BearingMixture, BearingOnly};
pub use changed_level::{ChangedLevel, LevelChange, OverTerrain};
pub use combined::{Censored, Stacked};
pub use difference::{DifferentialRss, RangeDifference};
#[cfg(feature = "alloc")]
pub use directional::{DirectionalLevel, WithElevationPattern};
pub use level::{FreePathLossRssBearing, FreePowerRssBearing, LevelBearing, Rss, RssBearing};
pub use level_law::{FreePathLoss, FreePower, LevelLaw};
pub use magnetic_dipole::MagneticDipole;

use core::f64::consts::{PI, TAU};

use foxhunt_core::{MeasurementModel, Pose, State, columns, elementary, vectorised::Kernel};
use nalgebra::{SVector, Vector3};

use crate::Propagation;

/// Nearer than this to overhead, in metres, a bearing has no slope. It is far below any
/// position's σ, so only the singularity itself is cut out.
const OVERHEAD: f64 = 1e-3;

/// The largest m / g of [`Sight::parts`] for series: the squares of what [`artanh_arctan`] takes
/// are below 4 m / g (1 + 3 m / g).
const NEAR: f64 = 3e-5;

/// Number of targets that are worked on at once: data between two loops stay in the nearest cache.
const BLOCK: usize = 512;

/// Below this square of their argument the terms of the series that are left out, the first of them
/// a ninth of its fourth power, are below half the last digit.
const SMALL: f64 = 1.4e-4;

/// The way from a receiver to a target, in metres East, North, Up.
#[derive(Clone, Copy, Debug)]
struct Sight(Vector3<f64>);

impl Sight {
    /// The sight from `receiver` to the target in `state` at the height `target_up`.
    #[inline]
    fn new<const N: usize>(state: &State<N>, receiver: &Pose, target_up: f64) -> Self {
        const { assert!(N >= 2, "a state holds East and North") };
        Self(Vector3::new(state[0], state[1], target_up) - receiver.position)
    }

    /// The slant range.
    #[inline]
    fn range(&self) -> f64 {
        self.square().map_or_else(|| self.odd_range(), libm::sqrt)
    }

    /// The square of the slant range; `None` where it is too small or too large for a number.
    #[inline]
    fn square(&self) -> Option<f64> {
        let square = self.0.norm_squared();
        (1e-200..1e300).contains(&square).then_some(square)
    }

    /// The level that is received, by the form of its law that takes no root.
    #[inline]
    fn level_dbm<L: LevelLaw<P>, const P: usize>(&self, law: &L, parameters: &[f64; P]) -> f64 {
        let Some(square) = self.square() else {
            return law.level_dbm(parameters, self.odd_range());
        };
        let mut level = [square];
        law.levels_dbm(parameters.each_ref().map(core::slice::from_ref), &mut level);
        level[0]
    }

    #[cold]
    fn odd_range(self) -> f64 {
        libm::hypot(libm::hypot(self.0.x, self.0.y), self.0.z)
    }

    /// The direction, counter-clockwise from East; 0 exactly overhead.
    #[inline]
    fn bearing(&self) -> f64 {
        let x = self.0.x;
        let y = self.0.y;
        if x.abs() + y.abs() < 1e300 { elementary::atan2(y, x) } else { libm::atan2(y, x) }
    }

    /// Changes of ln d² and of the bearing when the target moves by `east` and `north`, each as
    /// its odd and its even part in the offset. `None` where the places had better be looked at one
    /// by one: near overhead, beyond the largest numbers, and where the target goes more than half
    /// as far as it is away over ground.
    ///
    /// With m the square of the offset δ, f = 2 d·δ and s = d², ln d² changes by
    /// ln((s + m ± f) / s), so the parts are artanh(f / (s + m)) and
    /// artanh(q / (2 s² + q)), q = (2 s + m) m − f². Over ground, with a = 2 d × δ and
    /// g = d², the bearing turns by ± arctan(½ a / (g ± f/2)); the parts follow from sums of
    /// two arctangents.
    #[inline(always)]
    fn parts(&self, east: f64, north: f64) -> Option<([f64; 2], [f64; 2])> {
        let x = self.0.x;
        let y = self.0.y;
        let ground = self.ground_squared();
        let square = self.0.norm_squared();
        let moved = east * east + north * north;
        let plain = ground >= 4.0 * OVERHEAD * OVERHEAD && square < 1e150;
        let forth = 2.0 * (x * east + y * north);
        let across = 2.0 * (x * north - y * east);
        let forth_squared = forth * forth;
        let across_squared = across * across;
        let bent = (square + square + moved) * moved - forth_squared;
        let twice = across + across;
        let whole = 2.0 * square * square;
        let grown = [forth / (square + moved), bent / (whole + bent)];
        let turned = [
            across / (ground - moved),
            -twice * forth / (4.0 * ground * ground - forth_squared + across_squared),
        ];
        let halves = |turns: [f64; 2]| turns.map(|turn| 0.5 * turn);
        if plain && moved <= NEAR * ground {
            let (logs, turns) = artanh_arctan(grown, turned);
            return Some((logs, halves(turns)));
        }
        (plain && moved <= 0.25 * ground)
            .then(|| (grown.map(libm::atanh), halves(turned.map(libm::atan))))
    }

    /// ∂P(d)/∂(East, North).
    fn power_slope(&self, propagation: &impl Propagation) -> [f64; 2] {
        self.range_slope().map(|along| along * propagation.slope(self.range()))
    }

    /// ∂d/∂(East, North): zero overhead, and where the range overflows.
    #[inline]
    fn range_slope(&self) -> [f64; 2] {
        let range = self.range();
        if (OVERHEAD..=f64::MAX).contains(&range) {
            let inverse = 1.0 / range;
            [self.0.x * inverse, self.0.y * inverse]
        } else {
            [0.0; 2]
        }
    }

    /// ∂d²/∂(East, North), and d² where that is far from overhead and overflow.
    #[inline]
    fn square_slope(&self) -> Option<([f64; 2], f64)> {
        let square = self.square().filter(|square| *square >= OVERHEAD * OVERHEAD)?;
        Some(([2.0 * self.0.x, 2.0 * self.0.y], square))
    }

    /// ∂bearing/∂(East, North): zero overhead, where no bearing is defined, and where the
    /// square of the range overflows, where it turns by nothing.
    #[inline]
    fn bearing_slope(&self) -> [f64; 2] {
        let ground = self.ground_squared();
        if (OVERHEAD * OVERHEAD..=f64::MAX).contains(&ground) {
            let inverse = 1.0 / ground;
            [-self.0.y * inverse, self.0.x * inverse]
        } else {
            [0.0; 2]
        }
    }

    fn ground_squared(&self) -> f64 {
        self.0.x * self.0.x + self.0.y * self.0.y
    }
}

/// A measured level less the levels expected of many targets; sets `out`.
struct LevelResiduals<'a, L, const P: usize> {
    law: &'a L,
    /// Parameters of the law, a column each.
    parameters: [&'a [f64]; P],
    /// East and North.
    places: [&'a [f64]; 2],
    target_up: f64,
    receiver: &'a Pose,
    level: f64,
    out: &'a mut [f64],
}

impl<L: LevelLaw<P>, const P: usize> Kernel for LevelResiduals<'_, L, P> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let place = self.receiver.position;
        let up = self.target_up - place.z;
        for (block, out) in self.out.chunks_mut(BLOCK).enumerate() {
            let rows = block * BLOCK..block * BLOCK + out.len();
            let [east, north] = columns::rows(&self.places, rows.clone());
            for ((out, east), north) in out.iter_mut().zip(east).zip(north) {
                let x = east - place.x;
                let y = north - place.y;
                *out = x * x + y * y + up * up;
            }
            self.law.levels_dbm(columns::rows(&self.parameters, rows), out);
            out.iter_mut().for_each(|out| *out = self.level - *out);
        }
    }
}

/// A measured bearing less the bearings of many targets, from −π to π; sets `out`.
struct BearingResiduals<'a> {
    /// East and North.
    places: [&'a [f64]; 2],
    receiver: &'a Pose,
    /// In (−π, π].
    bearing: f64,
    out: &'a mut [f64],
}

impl Kernel for BearingResiduals<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let place = self.receiver.position;
        for ((out, east), north) in self.out.iter_mut().zip(self.places[0]).zip(self.places[1]) {
            let off = self.bearing - elementary::atan2(north - place.y, east - place.x);
            let off = if off > PI { off - TAU } else { off };
            *out = if off < -PI { off + TAU } else { off };
        }
    }
}

/// The odd and the even part of h(x + δ) ⊖ h(x) from two differences; apart from where it is
/// rarely called, and with copies, so that there the numbers need not be in memory.
#[cold]
#[inline(never)]
fn differences<const N: usize, const M: usize>(
    model: &impl MeasurementModel<N, M>,
    state: State<N>,
    expected: SVector<f64, M>,
    offset: State<N>,
    receiver: &Pose,
) -> [SVector<f64, M>; 2] {
    let change = |offset| model.residual(&model.expected(&(state + offset), receiver), &expected);
    let ahead = change(offset);
    let behind = change(-offset);
    [(ahead - behind) * 0.5, (ahead + behind) * 0.5]
}

/// artanh x of two numbers and arctan x of two others, all with squares below 1.4·10⁻⁴: as
/// series of four at once.
#[inline]
fn artanh_arctan(artanh: [f64; 2], arctan: [f64; 2]) -> ([f64; 2], [f64; 2]) {
    debug_assert!(artanh.iter().chain(&arctan).all(|x| x * x < SMALL), "{artanh:?}, {arctan:?}");
    let artanh = artanh.map(|x| {
        let [even, odd] = terms(x * x);
        x * (even + odd)
    });
    let arctan = arctan.map(|x| {
        let [even, odd] = terms(x * x);
        x * (even - odd)
    });
    (artanh, arctan)
}

/// The even and the odd terms of artanh √z / √z = 1 + z/3 + z²/5 + z³/7 + …, whose
/// difference is arctan √z / √z.
#[inline]
fn terms(z: f64) -> [f64; 2] {
    let w = z * z;
    [1.0 + w * (1.0 / 5.0), z * (1.0 / 3.0 + w * (1.0 / 7.0))]
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::abs_diff_eq;

    #[test]
    fn the_series_are_the_functions() {
        for i in -2000..=2000_i16 {
            let x = f64::from(i) * 5.9e-6;
            // Four roundings here, and the last digits of the library's.
            let room = 4.0 * f64::EPSILON * x.abs();
            let ([hyperbolic, _], [circular, _]) = artanh_arctan([x, 0.0], [x, 0.0]);
            assert!(abs_diff_eq!(hyperbolic, libm::atanh(x), epsilon = room), "artanh {x}");
            assert!(abs_diff_eq!(circular, libm::atan(x), epsilon = room), "arctan {x}");
        }
    }
}
