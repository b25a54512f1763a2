use alloc::vec::Vec;
use core::f64::consts::PI;

use foxhunt_core::parameter::{in_range, positive, require};
use nalgebra::Vector2;

use super::{BearingLine, checked};
use crate::{
    Marginal, PlacePrior, PosteriorMap,
    batch::BatchError,
    shadowing_grid::{Grid, Mixture, Search, bounds, climb},
};

/// The posterior of a target's place from bearings whose σ is known up to a factor.
///
/// The bearings are `θ_i = atan2(target − receiver_i) + s σ_i e_i`, e ~ von Mises with the variance
/// of N(0, 1); s², common to all of them, is inverse gamma with ν degrees of freedom about 1. With
/// s integrated out a place has the likelihood (ν + Σ 2 (1 − cos Δθ_i)/σ_i²)^(−(n+ν)/2): Student's
/// t, so that few bearings that do not quite meet make a wide region, and many that do a narrow one
/// (Gelman et al. 2013, section 3.2). The place's prior is
/// [`PlacePrior::default`].
///
/// **Common errors.** What a compass or a site does to one bearing it does to all that are taken at
/// the same place: station j adds b_j ~ N(0, τ²) to each. Where some place has two bearings or more
/// their scatter is that of s σ e alone, and b is integrated out: with W = Σ 1/σ_i² and the
/// resultant R e^(iδ) = Σ e^(iΔθ_i)/σ_i² of a station its part of the sum becomes 2 (W − R) + 2 R
/// (1 − cos δ)/(1 + R τ²), and the likelihood has a factor (1 + W τ²)^(−1/2): a covariance D + τ² 1
/// 1ᵀ, by Sherman, Morrison and Woodbury. The values of τ are averaged by their evidence. They are
/// taken as they are for the s that the scatter has; the remaining doubt about s holds for both.
/// The error b is a part of σ e where no place has two bearings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BearingGrid {
    /// The degrees of freedom ν of the bearings' common variance: how many bearings its knowledge
    /// is worth.
    pub freedom: f64,
    /// Possible σ of the error that all bearings of one place share, in radians; all are as
    /// probable before the bearings.
    pub common_sigmas: [f64; 5],
    /// Initial reach of the search beyond the receivers, in metres.
    pub margin_m: f64,
    /// The most cells, at least 100.
    pub max_cells: u32,
}

/// Two degrees of freedom: of the σ that bearings come with little more than the order of magnitude
/// is known. No common error, or one with a σ of 5°, 10°, 20° or 40°, about the 8° to 25° by which
/// the turns of a real hover were off together. A margin of 200 m, 4000 cells.
impl Default for BearingGrid {
    fn default() -> Self {
        let common_sigmas = [0.0, 5.0, 10.0, 20.0, 40.0].map(f64::to_radians);
        Self { freedom: 2.0, common_sigmas, margin_m: 200.0, max_cells: 4000 }
    }
}

/// The result of a [`BearingGrid`].
#[derive(Clone, Debug, PartialEq)]
pub struct BearingGridFix {
    /// The posterior on the finest cells.
    pub map: PosteriorMap,
    /// The place of the highest density, finer than any cell.
    pub mode: Vector2<f64>,
    /// The probability of the outermost ring of all cells that were searched.
    pub border_mass: f64,
    /// The least sum of squares of all cells, over the bearings' σ, which is near n − 2 where the σ
    /// are true.
    pub misfit: f64,
    /// Common errors of the bearings of each place; `None` where no place has two bearings.
    pub common: Option<CommonErrors>,
}

/// The errors that all bearings of one place share.
#[derive(Clone, Debug, PartialEq)]
pub struct CommonErrors {
    /// The values of their σ in radians, each with its probability.
    pub sigmas: Vec<(f64, f64)>,
    /// Each place.
    pub stations: Vec<StationError>,
}

/// The error that all bearings of a place share.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StationError {
    /// Place of the first bearing, East and North in metres.
    pub place: Vector2<f64>,
    /// Number of bearings.
    pub bearings: usize,
    /// The error, measured minus true, in radians.
    pub error: Marginal,
}

/// Receivers as near as this to each other, in metres, are at one place: so far a hover drifts.
const SAME_PLACE_M: f64 = 5.0;

impl BearingGrid {
    /// Locates the target of bearings, each with its σ in radians.
    ///
    /// # Errors
    ///
    /// [`BatchError::TooFew`] for fewer than two bearings, [`BatchError::Value`] for a bearing that
    /// is not finite, [`BatchError::Flat`] when all were taken in one place or no place fits, and
    /// [`BatchError::Parameter`] for a setting that is out of range.
    pub fn locate(&self, bearings: &[(BearingLine, f64)]) -> Result<BearingGridFix, BatchError> {
        positive("margin_m", self.margin_m)?;
        require(self.max_cells >= 100, "max_cells", self.max_cells.into(), "at least 100")?;
        let model = self.model(bearings, 2)?;
        let (low, high) = bounds(bearings.iter().map(|(line, _)| line.receiver));
        let diagonal_m = (high - low).norm();
        if diagonal_m <= 0.0 {
            return Err(BatchError::Flat { rcond: 0.0 });
        }
        let search = Search {
            low,
            high,
            place: PlacePrior::default(),
            margin_m: self.margin_m,
            cell_m: diagonal_m / 64.0,
            max_cells: self.max_cells,
        };
        let log_prior = search.place.log_density(&low, &high);
        let log_density = |place: &Vector2<f64>| log_prior(place) + model.at(place).log_likelihood;
        let posterior = |grid: Grid| {
            let log_mass: Vec<f64> =
                (0..grid.len()).map(|cell| log_density(&grid.centre(cell))).collect();
            let peak = log_mass.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            let mut mass: Vec<f64> = log_mass.iter().map(|&log| libm::exp(log - peak)).collect();
            let total: f64 = mass.iter().sum();
            if !(total > 0.0 && total.is_finite()) {
                return Err(BatchError::Flat { rcond: 0.0 });
            }
            mass.iter_mut().for_each(|mass| *mass /= total);
            Ok(PosteriorMap::of_densities(grid, mass, peak + libm::log(total)))
        };
        let (searched, refined) = search.run(posterior, |map| map)?;
        let border_mass = searched.border_mass();
        let map = refined.unwrap_or(searched);
        let mode = climb(map.highest(), map.cell_m(), log_density);
        let misfits = map.cells().map(|(place, _)| model.at(&place).misfit);
        let misfit = misfits.fold(f64::INFINITY, f64::min);
        let common = (model.sigmas.len() > 1).then(|| model.common_errors(&map));
        Ok(BearingGridFix { map, mode, border_mass, misfit, common })
    }

    /// The log-likelihood of places under these bearings, up to a constant: for an estimator that
    /// takes other readings beside them, as [`ShadowingGrid::locate_with`] does.
    ///
    /// # Errors
    ///
    /// [`BatchError::Value`] for a bearing that is not finite, and [`BatchError::Parameter`] for a
    /// setting that is out of range.
    ///
    /// [`ShadowingGrid::locate_with`]: crate::ShadowingGrid::locate_with
    pub fn log_likelihood(
        &self,
        bearings: &[(BearingLine, f64)],
    ) -> Result<impl Fn(&Vector2<f64>) -> f64 + use<>, BatchError> {
        let model = self.model(bearings, 0)?;
        Ok(move |place: &Vector2<f64>| model.at(place).log_likelihood)
    }

    fn model(&self, bearings: &[(BearingLine, f64)], need: usize) -> Result<Model, BatchError> {
        positive("the bearings' degrees of freedom", self.freedom)?;
        for sigma in self.common_sigmas {
            in_range("common_sigmas", sigma, 0.0..=PI, "from 0 to π")?;
        }
        checked(bearings, need)?;
        Ok(Model::new(self, bearings))
    }
}

/// A bearing's direction as a vector, from where it was taken, with its weight 1/σ².
struct Ray {
    receiver: Vector2<f64>,
    towards: Vector2<f64>,
    weight: f64,
}

/// The bearings, place by place, and what their errors may have in common.
struct Model {
    stations: Vec<Vec<Ray>>,
    /// Values of τ in units of `scale`; 0 alone where no place has two bearings.
    sigmas: Vec<f64>,
    /// Factor of the bearings' σ, by the scatter within places.
    scale: f64,
    freedom: f64,
    count: f64,
}

/// A place under the bearings.
struct Likelihood {
    log_likelihood: f64,
    /// The sum of squares, averaged over the values of τ.
    misfit: f64,
    /// Probability of each value of τ there, and the sum of squares under it.
    of_sigmas: [(f64, f64); 5],
}

impl Model {
    fn new(config: &BearingGrid, bearings: &[(BearingLine, f64)]) -> Self {
        let mut stations: Vec<Vec<Ray>> = Vec::new();
        for (line, sigma) in bearings {
            let ray = Ray {
                receiver: line.receiver,
                towards: Vector2::new(libm::cos(line.bearing), libm::sin(line.bearing)),
                weight: 1.0 / (sigma * sigma),
            };
            let near = |first: &Ray| (first.receiver - ray.receiver).norm() <= SAME_PLACE_M;
            match stations.iter_mut().find(|rays| rays.first().is_some_and(near)) {
                Some(station) => station.push(ray),
                None => stations.push(alloc::vec![ray]),
            }
        }
        // The scatter about each place's own mean direction is free of what is common to it.
        let within = |rays: &Vec<Ray>| {
            let weight: f64 = rays.iter().map(|ray| ray.weight).sum();
            let resultant: Vector2<f64> = rays.iter().map(|ray| ray.towards * ray.weight).sum();
            2.0 * (weight - resultant.norm()).max(0.0)
        };
        let scatter: f64 = stations.iter().map(within).sum();
        let repeated = as_f64(bearings.len() - stations.len());
        let scale = libm::sqrt((config.freedom + scatter) / (config.freedom + repeated));
        let sigmas = if repeated > 0.0 {
            config.common_sigmas.iter().map(|sigma| sigma / scale).collect()
        } else {
            alloc::vec![0.0]
        };
        Self { stations, sigmas, scale, freedom: config.freedom, count: as_f64(bearings.len()) }
    }

    /// Each place's Σ 1/σ², and its resultant as cosine and sine of the error if the target is at a
    /// place.
    fn resultants(&self, place: &Vector2<f64>) -> impl Iterator<Item = (f64, Vector2<f64>)> {
        self.stations.iter().map(move |rays| {
            let mut weight = 0.0;
            let mut resultant = Vector2::zeros();
            for ray in rays {
                weight += ray.weight;
                let way = place - ray.receiver;
                let range = way.norm();
                // At the receiver itself every direction is as good as any other: the mean over
                // all.
                if range > 0.0 {
                    let error = Vector2::new(way.dot(&ray.towards), way.perp(&ray.towards));
                    resultant += error * (ray.weight / range);
                }
            }
            (weight, resultant)
        })
    }

    fn at(&self, place: &Vector2<f64>) -> Likelihood {
        let exponent = 0.5 * (self.count + self.freedom);
        let mut squares = [0.0; 5];
        let mut halved_logs = [0.0; 5];
        for (weight, resultant) in self.resultants(place) {
            let length = resultant.norm();
            for ((sigma, square), log) in self.sigmas.iter().zip(&mut squares).zip(&mut halved_logs)
            {
                let variance = sigma * sigma;
                *square += 2.0 * (weight - length)
                    + 2.0 * (length - resultant.x) / (1.0 + length * variance);
                *log -= 0.5 * libm::log1p(weight * variance);
            }
        }
        let logs = squares.iter().zip(&halved_logs).take(self.sigmas.len());
        let logs = logs.map(|(square, log)| log - exponent * libm::log(self.freedom + square));
        let peak = logs.clone().fold(f64::NEG_INFINITY, f64::max);
        let mut of_sigmas = [(0.0, 0.0); 5];
        let mut total = 0.0;
        for ((own, log), square) in of_sigmas.iter_mut().zip(logs).zip(squares) {
            *own = (libm::exp(log - peak), square);
            total += own.0;
        }
        let mut misfit = 0.0;
        for (probability, square) in &mut of_sigmas {
            *probability /= total;
            misfit += *probability * *square;
        }
        Likelihood { log_likelihood: peak + libm::log(total), misfit, of_sigmas }
    }

    /// Returns the common errors of each place's bearings, over all places where the target may be.
    fn common_errors(&self, map: &PosteriorMap) -> CommonErrors {
        let mut sigmas: Vec<(f64, f64)> =
            self.sigmas.iter().map(|sigma| (sigma * self.scale, 0.0)).collect();
        let mut errors = alloc::vec![Mixture::default(); self.stations.len()];
        for (place, mass) in map.cells() {
            let likelihood = self.at(&place);
            let of_sigmas = || self.sigmas.iter().zip(likelihood.of_sigmas);
            for ((_, (probability, _)), (_, sum)) in of_sigmas().zip(&mut sigmas) {
                *sum += mass * probability;
            }
            for ((_, resultant), error) in self.resultants(&place).zip(&mut errors) {
                let length = resultant.norm();
                for (sigma, (probability, square)) in of_sigmas() {
                    let variance = sigma * sigma / (1.0 + length * sigma * sigma);
                    let mean = variance * length * libm::atan2(resultant.y, resultant.x);
                    // The mean of s² given all bearings, of which a place takes two.
                    let scale = (self.freedom + square) / (self.freedom + self.count - 2.0);
                    error.add(mass * probability, mean, scale * variance);
                }
            }
        }
        let station = |(rays, error): (&Vec<Ray>, Mixture)| {
            let place = rays.first().map(|ray| ray.receiver).unwrap_or_default();
            StationError { place, bearings: rays.len(), error: error.marginal() }
        };
        let stations = self.stations.iter().zip(errors).map(station).collect();
        CommonErrors { sigmas, stations }
    }
}

#[expect(clippy::cast_precision_loss, reason = "bearings do not come by the quadrillion")]
fn as_f64(count: usize) -> f64 {
    count as f64
}
