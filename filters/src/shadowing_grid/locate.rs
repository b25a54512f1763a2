//! The estimator over a grid of cells, and the fix that it gives.

use alloc::vec::Vec;

use foxhunt_core::{Belief, Estimate, Pose};
use nalgebra::Vector2;

use super::{
    Marginal, Mixture, PosteriorMap, ShadowedReading, ShadowingGridConfig, ShadowingGridError,
    likelihood::{Likelihood, Posterior},
    path::{Path, Segments, Summary},
    search::{REFINEMENTS, Search},
};

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
    /// Indices of the readings that were left out as gross errors, in order.
    pub left_out: Vec<usize>,
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

/// A batch estimator for one still target and many readings of an omnidirectional receiver.
///
/// The model of the readings, after thinning along the path, is
/// `value_i = a + b · x(cell, receiver_i) + c · g(cell, receiver_i) + e_i`, e ~ N(0, σ² C),
/// `C_ij = (1 − nugget) exp(−D_ij/ℓ) + nugget δ_ij` with D the distance of the receivers
/// (Gudmundson 1991, "Correlation model for shadow fading in mobile radio systems"). a has a flat
/// prior, is known, or was calibrated, which is one more reading; b and c are known or have a prior
/// on nodes, σ has the prior 1/σ, ℓ and the nugget are each one of a few. With a and σ
/// integrated out (Handcock & Stein 1993, "A Bayesian analysis of kriging") the likelihood of a
/// cell, a slope, a gain and a correlation is
/// |C|^−½ (u·u)^−½ SSR^(−(n−1)/2), where C = L Lᵀ, u = L⁻¹ 1 and SSR is the square of
/// L⁻¹ (values − b x − c g) less its part along u; with a known it is |C|^−½ SSR^(−n/2).
///
/// For a received level in dB x is −10 log₁₀ of the distance, a the level at 1 m and b the
/// path-loss exponent; g is 20 log₁₀ of the elevation's cosine, the gain of a vertical dipole
/// over the angle, and c the number of such antennas.
///
/// ```
/// use foxhunt_core::{Pose, nalgebra::Vector2};
/// use foxhunt_filters::ShadowingGrid;
/// let level = |cell: &Vector2<f64>, receiver: &Pose| {
///     let way = receiver.position - cell.push(1.0);
///     let cosine = (way.xy().norm() / way.norm()).max(0.1);
///     [-10.0 * way.norm().log10(), 20.0 * cosine.log10()]
/// };
/// // Two legs of a flight at 30 m; the transmitter is at (120, 60).
/// let legs = [(0.0, 0.0), (1.0, 100.0)];
/// let readings: Vec<_> = legs
///     .iter()
///     .flat_map(|(back, north)| (0..25).map(move |i| (f64::from(i) - back * 24.0, north)))
///     .map(|(step, north)| Pose::at(10.0 * step.abs(), *north, 30.0))
///     .enumerate()
///     .map(|(i, pose)| {
///         let fading_db = 2.0 * (i as f64).sin();
///         (pose, -40.0 + 2.5 * level(&Vector2::new(120.0, 60.0), &pose)[0] + fading_db)
///     })
///     .collect();
/// let fix = ShadowingGrid::default().locate(&readings, level)?;
/// assert!((fix.position.mean - Vector2::new(120.0, 60.0)).norm() < 20.0);
/// assert!(fix.border_mass < 0.01);
/// # Ok::<(), foxhunt_filters::ShadowingGridError>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ShadowingGrid {
    config: ShadowingGridConfig,
}

impl ShadowingGrid {
    /// An estimator with the given settings.
    ///
    /// # Errors
    ///
    /// [`ShadowingGridError::Parameter`] names the first setting outside of its range.
    pub fn new(config: ShadowingGridConfig) -> Result<Self, ShadowingGridError> {
        config.check()?;
        Ok(Self { config })
    }

    /// The settings.
    #[must_use]
    pub fn config(&self) -> &ShadowingGridConfig {
        &self.config
    }

    /// Locates the target of `readings`, given in the order in which they were taken.
    ///
    /// A segment of which nothing is known but that its value lay below or above a limit weighs in
    /// by the probability of that, Φ(±(limit − m) / s). Its mean m and s follow from
    /// a + b x + c g, σ and the values of the nearest segments, as in kriging (Chilès & Delfiner
    /// 2012, *Geostatistics*, §3.4). The power is 1 / Σⱼ rᵢⱼ over all such segments, r the
    /// correlation that remains: segments that fade together count as one (a composite likelihood:
    /// Varin, Reid & Firth 2011). Of more than a hundred on one side some stand for the others
    /// beside them.
    ///
    /// Readings that scatter more wildly than noise of their own does fade, or are wrong. Gross
    /// errors stand far from what was received beside them, on both sides, while fades lie below;
    /// such readings are left out where they are 1 to 25 % of all. Readings farther apart than half
    /// of `segment_m` show nothing of this.
    ///
    /// The target's height is not looked at: [`locate_with`](Self::locate_with) takes it.
    ///
    /// `regressors` are x and g for a target at the given East and North and a receiver; a place
    /// for which they are not finite is held impossible. Where the prior of the place reaches
    /// beyond the area and there is mass on its border, up to six wider grids follow; where the
    /// posterior is narrow for the cells, up to six finer ones around the mass, each of a quarter
    /// of `max_cells` at most.
    ///
    /// # Errors
    ///
    /// Names the first reading that is not finite; and when fewer than three segments remain, or
    /// none with a value, when all of them are above one place, when the correlation has no factor
    /// (a nugget of 0 and coinciding places), or when no cell has a finite likelihood.
    pub fn locate<R, F>(
        &self,
        readings: R,
        regressors: F,
    ) -> Result<ShadowingFix, ShadowingGridError>
    where
        R: IntoIterator<Item: Into<ShadowedReading>>,
        F: Fn(&Vector2<f64>, &Pose) -> [f64; 2],
    {
        let at_height = |cell: &Vector2<f64>, receiver: &Pose, _| regressors(cell, receiver);
        self.locate_with(readings, at_height, &[], |_| 0.0)
    }

    /// Locates the target with further evidence of its place: `log_likelihood` is the evidence's
    /// logarithm for a target at the given East and North, `others` are where it was received. The
    /// prior of the place is that of all receivers. `regressors` are given the target's height,
    /// too, one of the prior's or their mean. No reading is left out beside other evidence.
    ///
    /// # Errors
    ///
    /// As [`locate`](Self::locate).
    pub fn locate_with<R, F, L>(
        &self,
        readings: R,
        regressors: F,
        others: &[Pose],
        log_likelihood: L,
    ) -> Result<ShadowingFix, ShadowingGridError>
    where
        R: IntoIterator<Item: Into<ShadowedReading>>,
        F: Fn(&Vector2<f64>, &Pose, f64) -> [f64; 2],
        L: Fn(&Vector2<f64>) -> f64,
    {
        let path = Path::new(readings)?;
        let is_noisy = |path: &Path| path.is_noisy(|_| self.config.segment_m);
        let noisy = is_noisy(&path);
        let fix = self.along((&path, noisy), &regressors, others, &log_likelihood)?;
        if noisy || !others.is_empty() {
            return Ok(fix);
        }
        let place = fix.finest().median();
        let law = |receiver: &Pose| {
            let [x, g] = regressors(&place, receiver, fix.height.mean);
            fix.intercept.mean + fix.slope.mean * x + fix.gain.mean * g
        };
        let left_out = path.outliers(law, self.config.sigma_prior.1);
        if left_out.is_empty() {
            return Ok(fix);
        }
        let rest = path.without(&left_out);
        let of_rest = self.along((&rest, is_noisy(&rest)), &regressors, others, &log_likelihood);
        Ok(of_rest.map_or(fix, |fix| ShadowingFix { left_out, ..fix }))
    }

    /// Locates the target of the readings along a path, which have noise of their own or fade.
    fn along<F, L>(
        &self,
        (path, is_noisy): (&Path, bool),
        regressors: &F,
        others: &[Pose],
        log_likelihood: &L,
    ) -> Result<ShadowingFix, ShadowingGridError>
    where
        F: Fn(&Vector2<f64>, &Pose, f64) -> [f64; 2],
        L: Fn(&Vector2<f64>) -> f64,
    {
        let config = &self.config;
        let most = config.max_segments as usize;
        let (summary, segment_m, share) = if is_noisy {
            (Summary::TrimmedMean, config.segment_m, config.segment_share)
        } else {
            (Summary::Quantile(config.quantile), FADING_STRETCH * config.segment_m, 0.0)
        };
        let segments = path.segments(|_| segment_m, most, summary);
        several_places(path, &segments, config.sigma_prior)?;
        let places = path.places().chain(others.iter().map(|other| other.position));
        let (low, high) = bounds(places.map(|place| place.xy()));
        let mut stretch = segments.stretch;
        let mut likelihood = Likelihood::new(config, segments)?;

        let log_prior = config.place.log_density(&low, &high);
        let mut heights = config.height.log_nodes();
        // Each height costs as much as a known one: fewer cells make up for half of that.
        let max_cells = if heights.len() > 1 { config.max_cells / 2 } else { config.max_cells };
        let max_cells = max_cells.max(LEAST_CELLS);
        let search = Search {
            low,
            high,
            place: config.place,
            margin_m: config.margin_m,
            cell_m: config.cell_m,
            max_cells,
        };
        let log_density = |place: &Vector2<f64>| log_prior(place) + log_likelihood(place);
        let posterior = |grid| likelihood.posterior(grid, &heights, regressors, &log_density);
        let searched = search.cover(posterior, |posterior| &posterior.map)?;
        for ((_, log_weight), share) in heights.iter_mut().zip(&searched.shares.heights) {
            if *share < IMPROBABLE_HEIGHT {
                *log_weight = f64::NEG_INFINITY;
            }
        }

        // The closer the places in question are known, the shorter are the segments near them.
        let mut refined: Option<Posterior> = None;
        let mut cut_for_m = f64::INFINITY;
        for _ in 0..REFINEMENTS {
            let last = refined.as_ref().unwrap_or(&searched);
            let area = last.map.extent_of_mass();
            let side_m = (area.1 - area.0).min();
            let cuts = share > 0.0 && side_m < 0.5 * cut_for_m;
            let finer = last.map.finer(max_cells / 2);
            if !cuts && finer.is_none() {
                break;
            }
            if cuts {
                cut_for_m = side_m;
                let Estimate { mean, covariance } = last.map.estimate();
                let sigmas = covariance.diagonal().map(libm::sqrt);
                let length_m = |place: &Vector2<f64>| {
                    let beyond_m =
                        ((place - mean).abs() - 2.0 * sigmas).sup(&Vector2::zeros()).norm();
                    let near_m = share * (beyond_m + sigmas.min());
                    near_m.min(segment_m).max(share * FAR * beyond_m)
                };
                let segments = path.segments(length_m, most, summary);
                stretch = segments.stretch;
                likelihood = Likelihood::new(config, segments)?;
            }
            let posterior = |grid| likelihood.posterior(grid, &heights, regressors, &log_density);
            refined = Some(match finer {
                Some(finer) if !cuts => posterior(finer)?,
                finer => {
                    let cell_m = finer.map_or(last.map.cell_m(), |finer| finer.cell_m());
                    search.within(area, cell_m, posterior, |posterior| &posterior.map)?
                }
            });
        }
        let best = refined.as_ref().unwrap_or(&searched);
        let heights = heights.iter().map(|node| node.0).zip(best.shares.heights.iter().copied());
        let nuggets = config.nuggets.len();
        let of_correlations = |belongs: &dyn Fn(usize) -> bool| -> f64 {
            let shares = best.shares.correlations.iter().enumerate();
            shares.filter(|(i, _)| belongs(*i)).map(|(_, share)| share).sum()
        };
        let of_length = |(i, &length_m)| (length_m, of_correlations(&|k| k / nuggets == i));
        let of_nugget = |(i, &nugget)| (nugget, of_correlations(&|k| k % nuggets == i));
        let sigma_m = config.receiver_sigma_m;
        let refined = if sigma_m > 0.0 {
            Some(best.map.blurred(sigma_m, config.max_cells))
        } else {
            refined.as_ref().map(|posterior| posterior.map.clone())
        };
        Ok(ShadowingFix {
            position: refined.as_ref().unwrap_or(&searched.map).estimate(),
            intercept: best.intercept.marginal(),
            slope: best.slope.marginal(),
            gain: best.gain.marginal(),
            height: Mixture::of(heights).marginal(),
            sigma: best.sigma.marginal(),
            correlation_lengths_m: (config.correlation_lengths_m.iter().enumerate())
                .map(of_length)
                .collect(),
            nuggets: config.nuggets.iter().enumerate().map(of_nugget).collect(),
            border_mass: searched.map.border_mass(),
            segments: likelihood.segments(),
            stretch,
            left_out: Vec::new(),
            map: searched.map,
            refined,
        })
    }
}

/// Refuses readings of a single place, and of fewer places than levels have unknowns. A silence
/// tells of a place where σ has a prior: one level shows none.
fn several_places(
    path: &Path,
    segments: &Segments,
    (prior_readings, prior_sigma): (f64, f64),
) -> Result<(), ShadowingGridError> {
    if let Some(place) = path.only_place() {
        return Err(ShadowingGridError::OnePlace { east: place.x, north: place.y });
    }
    let received = segments.receivers.len();
    let silences_tell = received > 0 && prior_readings * prior_sigma > 0.0;
    let segments = received + if silences_tell { segments.censored.len() } else { 0 };
    if segments < LEAST_SEGMENTS { Err(ShadowingGridError::TooFew { segments }) } else { Ok(()) }
}

/// Least number of cells of a grid.
const LEAST_CELLS: u32 = 100;

/// Probability of a height on the coarse cells below which finer ones do without it.
const IMPROBABLE_HEIGHT: f64 = 0.02;

/// Share of the length by distance alone that a segment far away has, where that is more than
/// `segment_m`.
const FAR: f64 = 0.3;

/// Length of the segments of readings that fade over `segment_m`: a fade spans metres, readings
/// within one tell what a single one does, and a quantile needs several fades.
const FADING_STRETCH: f64 = 1.4;

/// Number of places from which levels and silences tell something of the target's: of two, the
/// intercept and the prior's slope explain any.
const LEAST_SEGMENTS: usize = 3;

/// The corners of the receivers' bounding box.
pub(crate) fn bounds(
    places: impl IntoIterator<Item = Vector2<f64>>,
) -> (Vector2<f64>, Vector2<f64>) {
    let nowhere = (Vector2::repeat(f64::INFINITY), Vector2::repeat(f64::NEG_INFINITY));
    let places = places.into_iter();
    places.fold(nowhere, |(low, high), place| (low.inf(&place), high.sup(&place)))
}
