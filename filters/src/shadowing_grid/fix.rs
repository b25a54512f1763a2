use alloc::vec::Vec;

use foxhunt_core::{Belief, Estimate};
use nalgebra::Vector2;

use super::{Marginal, PosteriorMap};

/// The result of a [`ShadowingGrid`](super::ShadowingGrid).
#[derive(Clone, Debug, PartialEq)]
pub struct ShadowingFix {
    /// Place of the target: the posterior mean and covariance, East and North in metres. The
    /// posterior is often far from Gaussian; [`map`](Self::map) shows it.
    pub position: Estimate<2>,
    /// The intercept a, in the readings' unit.
    pub intercept: Marginal,
    /// The slope b, in the readings' unit per unit of the regressor.
    pub slope: Marginal,
    /// The gain c, in the readings' unit per unit of the second regressor.
    pub gain: Marginal,
    /// The target's height, as the regressors take it.
    pub height: Marginal,
    /// The standard deviation σ of shadowing and noise together, in the readings' unit.
    pub sigma: Marginal,
    /// The correlation lengths in metres, each with its posterior probability.
    pub correlation_lengths_m: Vec<(f64, f64)>,
    /// The nuggets, each with its posterior probability.
    pub nuggets: Vec<(f64, f64)>,
    /// The probability of the outermost ring of the searched cells. A large one (such as 0.2; an
    /// even spread over 100 × 100 cells has 0.04) means that the target may be outside of the
    /// searched area, and that `position` is then of little use.
    pub border_mass: f64,
    /// Number of segments that the path's readings were made into.
    pub segments: usize,
    /// The factor by which segments were made longer, so that they are not too many: 1 where they
    /// are as configured.
    pub stretch: f64,
    /// The posterior over the whole searched area.
    pub map: PosteriorMap,
    /// The posterior on finer cells around the mass, where `map` was too coarse for it;
    /// `position` comes from here then.
    pub refined: Option<PosteriorMap>,
}

impl ShadowingFix {
    /// The posterior on the finest cells.
    #[must_use]
    pub fn finest(&self) -> &PosteriorMap {
        self.refined.as_ref().unwrap_or(&self.map)
    }
}

/// The cells with a probability, as a planner sees them.
impl Belief for ShadowingFix {
    fn position(&self) -> Estimate<2> {
        self.position
    }

    fn visit_positions(&self, visit: &mut dyn FnMut(&Vector2<f64>, f64)) {
        self.finest()
            .cells()
            .filter(|&(_, mass)| mass > 0.0)
            .for_each(|(place, mass)| visit(&place, mass));
    }
}
