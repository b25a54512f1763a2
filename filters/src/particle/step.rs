use alloc::vec::Vec;

use foxhunt_core::{Axis, MotionModel, angle};

use super::{
    divided::{Divided, take_first},
    kernel,
    moments::Moments,
    white::{CHUNK, Draws},
};
use crate::vectorised::Kernel;

/// Carries a cloud on into other columns, a chunk after the other, each with random numbers of its
/// own. Returns the moments of what comes of it, if its weights are known and no axis is an angle.
pub(super) struct Step<'a, F, const N: usize> {
    pub(super) key: u64,
    pub(super) from: &'a [Vec<f64>; N],
    pub(super) to: [&'a mut [f64]; N],
    /// The first particle in `to`, at the beginning of a chunk.
    pub(super) first: usize,
    /// Indices of the particles to copy; `None` keeps each one.
    pub(super) ancestors: Option<&'a [u32]>,
    /// Sets them apart first.
    pub(super) kernel: Option<&'a kernel::Kernel<N>>,
    /// Moves them then, for so long.
    pub(super) motion: Option<(&'a F, f64)>,
    pub(super) axes: [Axis; N],
    /// Weights of the resulting particles.
    pub(super) weights: Option<&'a [f64]>,
}

impl<F: MotionModel<N>, const N: usize> Kernel for Step<'_, F, N> {
    type Output = Option<Moments<N>>;

    #[inline(always)]
    fn run(mut self) -> Option<Moments<N>> {
        let count = self.to[0].len();
        let mut draws = Draws::new(self.key);
        let mut white = [[0.0; CHUNK]; N];
        let weights = self.weights.filter(|_| !self.axes.contains(&Axis::Angle));
        let mut moments = Moments::default();
        for begin in (0..count).step_by(CHUNK) {
            let range = begin..count.min(begin + CHUNK);
            let chunk = (self.first + begin) / CHUNK;
            let mut to = self.to.each_mut().map(|column| &mut column[range.clone()]);
            for (to, from) in to.iter_mut().zip(self.from) {
                match self.ancestors {
                    None => {
                        let first = self.first + begin;
                        to.copy_from_slice(&from[first..first + range.len()]);
                    }
                    Some(ancestors) => {
                        for (to, ancestor) in to.iter_mut().zip(&ancestors[range.clone()]) {
                            *to = from[*ancestor as usize];
                        }
                    }
                }
            }
            if let Some(kernel) = self.kernel {
                draws.fill_white(2 * chunk, &mut white, range.len());
                kernel.spread_columns(&mut to, &white);
            }
            if let Some((motion, dt)) = self.motion {
                draws.fill_white(2 * chunk + 1, &mut white, range.len());
                let white = white.each_ref().map(|white| &white[..range.len()]);
                motion.move_columns(to.each_mut().map(|column| &mut **column), white, dt);
            }
            for (column, axis) in to.iter_mut().zip(self.axes) {
                if axis == Axis::Angle {
                    column.iter_mut().for_each(|x| *x = angle::wrap(*x));
                }
            }
            if let Some(weights) = weights {
                // The draws have been used.
                let to = to.each_ref().map(|column| &**column);
                moments.add_chunk(to, &weights[range], [None; N], &mut white);
            }
        }
        weights.map(|_| moments)
    }
}

impl<F: MotionModel<N>, const N: usize> Divided for Step<'_, F, N> {
    fn particles(&self) -> usize {
        self.to[0].len()
    }

    fn split_at(mut self, particles: usize) -> (Self, Self) {
        let to = self.to.each_mut().map(|column| take_first(column, particles));
        let ancestors = self.ancestors.map(|ancestors| ancestors.split_at(particles));
        let weights = self.weights.map(|weights| weights.split_at(particles));
        let first = Self {
            to,
            ancestors: ancestors.map(|(first, _)| first),
            weights: weights.map(|(first, _)| first),
            ..self
        };
        let second = Self {
            to: self.to,
            first: self.first + particles,
            ancestors: ancestors.map(|(_, second)| second),
            weights: weights.map(|(_, second)| second),
            ..self
        };
        (first, second)
    }

    fn join(first: Self::Output, second: Self::Output) -> Self::Output {
        first.zip(second).map(|(first, second)| first.and(&second))
    }
}
