use foxhunt_core::Pose;
use nalgebra::Vector2;

use super::{
    ShadowingFix, ShadowingGridConfig, ShadowingGridError, grid::Grid, likelihood::Likelihood,
    path::Segments,
};

/// A batch estimator for one still target and many readings of an omnidirectional receiver.
///
/// The model of the readings, after thinning along the path, is
/// `value_i = a + b · regressor(cell, receiver_i) + e_i`, e ~ N(0, σ² C),
/// `C_ij = (1 − nugget) exp(−D_ij/ℓ) + nugget δ_ij` with D the horizontal distance of the
/// receivers (Gudmundson 1991, "Correlation model for shadow fading in mobile radio systems").
/// a has a flat prior or is known, b is known or has a prior on nodes, σ has the prior 1/σ, ℓ is
/// one of a few lengths. With a and σ integrated out (Handcock & Stein 1993, "A Bayesian
/// analysis of kriging") the likelihood of a cell, a slope and a length is
/// |C|^−½ (u·u)^−½ SSR^(−(n−1)/2), where C = L Lᵀ, u = L⁻¹ 1 and SSR is the square of
/// L⁻¹ (values − b x) less its part along u; with a known it is |C|^−½ SSR^(−n/2).
///
/// For a received level in dB the regressor is −10 log₁₀ of the distance, a the level at 1 m and
/// b the path-loss exponent.
///
/// ```
/// use foxhunt_core::{Pose, nalgebra::Vector2};
/// use foxhunt_filters::ShadowingGrid;
/// let level = |cell: &Vector2<f64>, receiver: &Pose| {
///     -10.0 * (receiver.position - cell.push(1.0)).norm().log10()
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
///         (pose, -40.0 + 2.5 * level(&Vector2::new(120.0, 60.0), &pose) + fading_db)
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
    /// `regressor` is x for a target at the given East and North and a receiver; a place for
    /// which it is not finite is held impossible. Where the posterior is narrow for the cells,
    /// up to six finer grids around the mass follow, each of a quarter of
    /// `max_cells` at most.
    ///
    /// # Errors
    ///
    /// Names the first reading that is not finite; and when fewer than four segments remain,
    /// when all of them are above one place, when the correlation has no factor (a nugget of 0
    /// and coinciding places), or when no cell has a finite likelihood.
    pub fn locate<F>(
        &self,
        readings: &[(Pose, f64)],
        regressor: F,
    ) -> Result<ShadowingFix, ShadowingGridError>
    where
        F: Fn(&Vector2<f64>, &Pose) -> f64,
    {
        let config = &self.config;
        let segments = Segments::along(readings, config.segment_m, config.max_segments as usize)?;
        let segment_m = segments.segment_m;
        let likelihood = Likelihood::new(config, segments)?;

        let (low, high) = bounds(likelihood.receivers());
        let margin = Vector2::repeat(config.margin_m);
        let grid = Grid::over(low - margin, high + margin, config.cell_m, config.max_cells);
        let searched = likelihood.posterior(grid, &regressor)?;
        let mut refined = None;
        for _ in 0..REFINEMENTS {
            let last = refined.as_ref().unwrap_or(&searched);
            let Some(finer) = last.map.finer(config.max_cells / 4) else { break };
            refined = Some(likelihood.posterior(finer, &regressor)?);
        }

        let best = refined.as_ref().unwrap_or(&searched);
        let lengths = config.correlation_lengths_m.iter().copied();
        Ok(ShadowingFix {
            position: best.map.estimate(),
            intercept: best.intercept.marginal(),
            slope: best.slope.marginal(),
            sigma: best.sigma.marginal(),
            correlation_lengths_m: lengths.zip(best.lengths.iter().copied()).collect(),
            border_mass: searched.map.border_mass(),
            segments: likelihood.receivers().len(),
            segment_m,
            map: searched.map,
            refined: refined.map(|posterior| posterior.map),
        })
    }
}

/// Each refinement makes cells up to four times smaller: six reach 4096.
const REFINEMENTS: u8 = 6;

/// The corners of the receivers' bounding box.
fn bounds(receivers: &[Pose]) -> (Vector2<f64>, Vector2<f64>) {
    let places = receivers.iter().map(|receiver| receiver.position.xy());
    let nowhere = (Vector2::repeat(f64::INFINITY), Vector2::repeat(f64::NEG_INFINITY));
    places.fold(nowhere, |(low, high), place| (low.inf(&place), high.sup(&place)))
}
