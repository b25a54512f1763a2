//! Residuals of many targets at once, in loops without branches.

use core::f64::consts::{PI, TAU};

use foxhunt_core::{Pose, elementary, vectorised::Kernel};

use super::LevelLaw;

/// Number of targets that are worked on at once: data between two loops stay in the nearest cache.
pub(super) const BLOCK: usize = 512;

/// A measured level less the levels expected of many targets; sets `out`.
pub(super) struct LevelResiduals<'a, L, const P: usize> {
    pub(super) law: &'a L,
    /// Parameters of the law, a column each.
    pub(super) parameters: [&'a [f64]; P],
    /// East and North.
    pub(super) places: [&'a [f64]; 2],
    pub(super) target_up: f64,
    pub(super) receiver: &'a Pose,
    pub(super) level: f64,
    pub(super) out: &'a mut [f64],
}

impl<L: LevelLaw<P>, const P: usize> Kernel for LevelResiduals<'_, L, P> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let place = self.receiver.position;
        let up = self.target_up - place.z;
        for (block, out) in self.out.chunks_mut(BLOCK).enumerate() {
            let rows = block * BLOCK..block * BLOCK + out.len();
            let [east, north] = self.places.map(|column| &column[rows.clone()]);
            for ((out, east), north) in out.iter_mut().zip(east).zip(north) {
                let x = east - place.x;
                let y = north - place.y;
                *out = x * x + y * y + up * up;
            }
            self.law.levels_dbm(self.parameters.map(|column| &column[rows.clone()]), out);
            out.iter_mut().for_each(|out| *out = self.level - *out);
        }
    }
}

/// A measured bearing less the bearings of many targets, from −π to π; sets `out`.
pub(super) struct BearingResiduals<'a> {
    /// East and North.
    pub(super) places: [&'a [f64]; 2],
    pub(super) receiver: &'a Pose,
    /// In (−π, π].
    pub(super) bearing: f64,
    pub(super) out: &'a mut [f64],
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
