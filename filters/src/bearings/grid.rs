use alloc::vec::Vec;

use foxhunt_core::{
    Pose,
    parameter::{positive, require},
};
use nalgebra::Vector2;

use super::{BearingLine, linear::checked};
use crate::{
    PlacePrior, PosteriorMap,
    batch::BatchError,
    shadowing_grid::{Grid, Search, bounds},
};

/// The posterior of a target's place from bearings whose σ is known up to a factor.
///
/// The bearings are `θ_i = atan2(target − receiver_i) + s σ_i e_i`, e ~ von Mises with the variance
/// of N(0, 1); s², common to all of them, is inverse gamma with ν degrees of freedom about 1. With
/// s integrated out a place has the likelihood (ν + Σ 2 (1 − cos Δθ_i)/σ_i²)^(−(n+ν)/2): Student's
/// t, so that few bearings that do not quite meet make a wide region, and many that do a narrow one
/// (Gelman et al. 2013, section 3.2). The place's prior is [`PlacePrior::NearReceivers`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BearingGrid {
    /// The degrees of freedom ν of the bearings' common variance: how many bearings its knowledge
    /// is worth.
    pub freedom: f64,
    /// How far the search goes beyond the receivers at first, in metres.
    pub margin_m: f64,
    /// The most cells, at least 100.
    pub max_cells: u32,
}

/// Two degrees of freedom: of the σ that bearings come with little more than the order of magnitude
/// is known. A margin of 200 m, 4000 cells.
impl Default for BearingGrid {
    fn default() -> Self {
        Self { freedom: 2.0, margin_m: 200.0, max_cells: 4000 }
    }
}

/// What [`BearingGrid`] made of its bearings.
#[derive(Clone, Debug, PartialEq)]
pub struct BearingGridFix {
    /// The posterior on the finest cells.
    pub map: PosteriorMap,
    /// The probability of the outermost ring of all cells that were searched.
    pub border_mass: f64,
    /// The least Σ 2 (1 − cos Δθ_i)/σ_i² of all cells, which is near n − 2 where the σ are true.
    pub misfit: f64,
}

impl BearingGrid {
    /// Locates the target of bearings, each with its σ in radians.
    ///
    /// # Errors
    ///
    /// [`BatchError::TooFew`] for fewer than two bearings, [`BatchError::Value`] for the one that
    /// is not finite, [`BatchError::Flat`] when all were taken in one place or no place fits, and
    /// [`BatchError::Parameter`] for a setting that is out of range.
    pub fn locate(&self, bearings: &[(BearingLine, f64)]) -> Result<BearingGridFix, BatchError> {
        positive("the bearings' degrees of freedom", self.freedom)?;
        positive("margin_m", self.margin_m)?;
        require(self.max_cells >= 100, "max_cells", self.max_cells.into(), "at least 100")?;
        checked(bearings)?;
        let at = |line: &BearingLine| Pose::at(line.receiver.x, line.receiver.y, 0.0);
        let receivers: Vec<Pose> = bearings.iter().map(|(line, _)| at(line)).collect();
        let (low, high) = bounds(&receivers);
        let diagonal_m = (high - low).norm();
        if diagonal_m <= 0.0 {
            return Err(BatchError::Flat { rcond: 0.0 });
        }
        let search = Search {
            low,
            high,
            place: PlacePrior::NearReceivers,
            margin_m: self.margin_m,
            cell_m: diagonal_m / 64.0,
            max_cells: self.max_cells,
        };
        let log_prior = search.place.log_density(&low, &high);
        #[expect(clippy::cast_precision_loss, reason = "bearings do not come by the quadrillion")]
        let exponent = 0.5 * (bearings.len() as f64 + self.freedom);
        let posterior = |grid: Grid| {
            let log_mass: Vec<f64> = (0..grid.len())
                .map(|cell| {
                    let place = grid.centre(cell);
                    log_prior(&place)
                        - exponent * libm::log(self.freedom + misfit(bearings, &place))
                })
                .collect();
            let peak = log_mass.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            let mut mass: Vec<f64> = log_mass.iter().map(|&log| libm::exp(log - peak)).collect();
            let total: f64 = mass.iter().sum();
            if !(total > 0.0 && total.is_finite()) {
                return Err(BatchError::Flat { rcond: 0.0 });
            }
            mass.iter_mut().for_each(|mass| *mass /= total);
            Ok(PosteriorMap::new(grid, mass))
        };
        let (searched, refined) = search.run(posterior, |map| map)?;
        let border_mass = searched.border_mass();
        let map = refined.unwrap_or(searched);
        let misfits = map.cells().map(|(place, _)| misfit(bearings, &place));
        let misfit = misfits.fold(f64::INFINITY, f64::min);
        Ok(BearingGridFix { map, border_mass, misfit })
    }
}

/// Σ 2 (1 − cos Δθ_i)/σ_i².
fn misfit(bearings: &[(BearingLine, f64)], place: &Vector2<f64>) -> f64 {
    let of_one = |(line, sigma): &(BearingLine, f64)| {
        let way = place - line.receiver;
        let range = way.norm();
        // At the receiver itself every direction is as good as any other: the mean over all.
        let cosine = if range > 0.0 {
            (way.x * libm::cos(line.bearing) + way.y * libm::sin(line.bearing)) / range
        } else {
            0.0
        };
        2.0 * (1.0 - cosine) / (sigma * sigma)
    };
    bearings.iter().map(of_one).sum()
}
