use super::white::CHUNK;
use crate::vectorised::{self, Kernel};

/// Number of particles down to which work on a cloud is halved.
pub(super) const BLOCK: usize = 8 * CHUNK;

/// Fewer particles are not worth waking a thread for.
#[cfg(feature = "parallel")]
const LEAST: usize = 8 * BLOCK;

/// Work on the particles of a cloud that can be done in parts, in any order.
pub(super) trait Divided: Kernel {
    /// Returns the number of particles.
    fn particles(&self) -> usize;

    /// Splits off the work on the first `particles` particles, a multiple of [`BLOCK`].
    fn split_at(self, particles: usize) -> (Self, Self)
    where
        Self: Sized;

    /// Puts together what came of two parts.
    fn join(first: Self::Output, second: Self::Output) -> Self::Output;
}

/// Does one part after the other. Where it is halved depends on the number of particles alone, so
/// that sums have the same bits on any number of threads.
pub(super) fn one_by_one<W: Divided>(work: W) -> W::Output {
    match middle(&work) {
        None => vectorised::run(work),
        Some(middle) => {
            let (first, second) = work.split_at(middle);
            W::join(one_by_one(first), one_by_one(second))
        }
    }
}

/// Does the parts on the threads of the current pool, if there are enough particles.
#[cfg(feature = "parallel")]
pub(super) fn on_threads<W: Divided<Output: Send> + Send>(work: W) -> W::Output {
    fn halve<W: Divided<Output: Send> + Send>(work: W) -> W::Output {
        match middle(&work) {
            None => vectorised::run(work),
            Some(middle) => {
                let (first, second) = work.split_at(middle);
                let (first, second) = rayon::join(|| halve(first), || halve(second));
                W::join(first, second)
            }
        }
    }
    if work.particles() < LEAST { one_by_one(work) } else { halve(work) }
}

fn middle(work: &impl Divided) -> Option<usize> {
    let blocks = work.particles().div_ceil(BLOCK);
    (blocks > 1).then_some(blocks / 2 * BLOCK)
}

/// Threads for work that needs no models.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Threads {
    /// Here.
    One,
    /// On all of the current pool.
    #[cfg(feature = "parallel")]
    Pool,
}

impl Threads {
    pub(super) fn run<W: Divided<Output: Send> + Send>(self, work: W) -> W::Output {
        match self {
            Self::One => one_by_one(work),
            #[cfg(feature = "parallel")]
            Self::Pool => on_threads(work),
        }
    }
}

/// The part of a mutable slice up to `at`; the other one stays.
pub(super) fn take_first<'a, T>(slice: &mut &'a mut [T], at: usize) -> &'a mut [T] {
    let (first, second) = core::mem::take(slice).split_at_mut(at);
    *slice = second;
    first
}
