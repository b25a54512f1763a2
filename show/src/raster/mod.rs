//! Fields over the ground on square cells: the probability of each cell, with the smallest region
//! that holds it.

use foxhunt_core::Estimate;
#[cfg(feature = "maps")]
use foxhunt_core::Pose;
use foxhunt_filters::PosteriorMap;
#[cfg(feature = "maps")]
use foxhunt_filters::{FieldMap, FieldMapConfig};
use foxhunt_hunt::locate::Searched;
use nalgebra::{Matrix2, Vector2};

use crate::overview::{Believed, Overview, SearchOverview};

/// Number of cells along the longer side of a raster that is made from places or from moments.
const SIDE: f64 = 96.0;

/// Half-width of the raster of a Gaussian, in σ of its longer axis.
const REACH: f64 = 3.5;

/// Values on square cells, East and North in metres.
#[derive(Clone, Debug, PartialEq)]
pub struct Raster {
    /// The corner of all cells that is farthest south and west.
    pub corner: Vector2<f64>,
    /// Side of a cell in metres.
    pub cell_m: f64,
    /// Number of cells from west to east.
    pub columns: usize,
    /// The value of each cell, row by row from the south, each row from the west.
    pub values: Vec<f64>,
}

impl Raster {
    /// Returns the number of cells from south to north.
    #[must_use]
    pub fn rows(&self) -> usize {
        self.values.len().checked_div(self.columns).unwrap_or(0)
    }

    /// Returns the corner of all cells that is farthest north and east.
    #[must_use]
    pub fn far_corner(&self) -> Vector2<f64> {
        self.corner + Vector2::new(count(self.columns), count(self.rows())) * self.cell_m
    }

    /// Returns the centre of a cell by its index.
    #[must_use]
    pub fn centre(&self, index: usize) -> Vector2<f64> {
        let column = index.checked_rem(self.columns).unwrap_or(0);
        let row = index.checked_div(self.columns).unwrap_or(0);
        self.corner + Vector2::new(count(column) + 0.5, count(row) + 0.5) * self.cell_m
    }

    /// Returns the value at a place, on straight lines between the centres of cells; `None` outside
    /// of all cells.
    #[must_use]
    pub fn between(&self, place: &Vector2<f64>) -> Option<f64> {
        let at = (place - self.corner) / self.cell_m;
        let size = [self.columns, self.rows()];
        let mut sides = [(0, 0, 0.0); 2];
        for ((side, along), cells) in sides.iter_mut().zip([at.x, at.y]).zip(size) {
            if !(along >= 0.0 && along <= count(cells)) {
                return None;
            }
            let from = (along - 0.5).clamp(0.0, count(cells) - 1.0);
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped")]
            let low = from.floor() as usize;
            *side = (low, (low + 1).min(cells.saturating_sub(1)), from - from.floor());
        }
        let [(west, east, right), (south, north, up)] = sides;
        let value = |row: usize, column: usize| self.values.get(row * self.columns + column);
        let along =
            |row: usize| Some(value(row, west)? * (1.0 - right) + value(row, east)? * right);
        Some(along(south)? * (1.0 - up) + along(north)? * up)
    }

    /// Returns the raster with every value changed.
    #[must_use]
    pub fn map(&self, change: impl FnMut(&f64) -> f64) -> Self {
        Self { values: self.values.iter().map(change).collect(), ..*self }
    }

    /// Returns the probability of the smallest region of highest density that holds each cell, of a
    /// raster of probabilities: cells of at most 0.5 hold a half together.
    #[must_use]
    pub fn cumulative(&self) -> Self {
        let mut order: Vec<usize> = (0..self.values.len()).collect();
        let value = |cell: &usize| self.values.get(*cell).copied().unwrap_or(0.0);
        order.sort_by(|a, b| value(b).total_cmp(&value(a)));
        let total: f64 = self.values.iter().sum();
        let mut levels = vec![1.0; self.values.len()];
        let mut sum = 0.0;
        for cell in order {
            sum += value(&cell);
            if let Some(level) = levels.get_mut(cell).filter(|_| total > 0.0) {
                *level = (sum / total).min(1.0);
            }
        }
        Self { values: levels, ..*self }
    }

    /// Returns blocks of cells as one cell each, with their sum, so that no side has more than
    /// `most` cells.
    #[must_use]
    pub fn coarser(&self, most: usize) -> Self {
        let block = self.columns.max(self.rows()).div_ceil(most.max(1)).max(1);
        let columns = self.columns.div_ceil(block);
        let mut values = vec![0.0; columns * self.rows().div_ceil(block)];
        for (index, value) in self.values.iter().enumerate() {
            let row = index / self.columns / block;
            let column = index % self.columns / block;
            if let Some(sum) = values.get_mut(row * columns + column) {
                *sum += value;
            }
        }
        Self { corner: self.corner, cell_m: self.cell_m * count(block), columns, values }
    }

    /// Returns the least rectangle of cells outside of which none has more than a share of the
    /// largest value.
    #[must_use]
    pub fn cropped(&self, share: f64) -> Self {
        let least = share * self.values.iter().copied().fold(0.0, f64::max);
        let held = self.values.iter().enumerate().filter(|(_, value)| **value > least);
        let places = held.map(|(index, _)| (index / self.columns, index % self.columns));
        let ends = places.fold(None, |ends: Option<[usize; 4]>, (row, column)| {
            let [south, north, west, east] = ends.unwrap_or([row, row, column, column]);
            Some([south.min(row), north.max(row), west.min(column), east.max(column)])
        });
        let Some([south, north, west, east]) = ends else { return self.clone() };
        let rows = self.values.chunks(self.columns).skip(south).take(north + 1 - south);
        Self {
            corner: self.corner + Vector2::new(count(west), count(south)) * self.cell_m,
            cell_m: self.cell_m,
            columns: east + 1 - west,
            values: rows.flat_map(|row| row.iter().take(east + 1).skip(west)).copied().collect(),
        }
    }
}

/// A count as a number.
#[expect(clippy::cast_precision_loss, reason = "cells are far below 2^53")]
fn count(count: usize) -> f64 {
    count as f64
}

impl From<&PosteriorMap> for Raster {
    fn from(map: &PosteriorMap) -> Self {
        Self {
            corner: map.south_west() - Vector2::repeat(0.5 * map.cell_m()),
            cell_m: map.cell_m(),
            columns: map.columns(),
            values: map.mass().to_vec(),
        }
    }
}

/// The probability that a transmitter in each cell would have been received.
impl From<&Searched> for Raster {
    fn from(searched: &Searched) -> Self {
        let Searched { corner, cell_m, columns, ref pod, .. } = *searched;
        Self { corner, cell_m, columns, values: pod.clone() }
    }
}

/// Returns the probability of each cell in the end of a search: of its grid, of its places, or of
/// the Gaussian of its moments. `None` if it has found nothing.
#[must_use]
pub fn belief(search: &SearchOverview) -> Option<Raster> {
    if let Some(map) = &search.map {
        return Some(Raster::from(map));
    }
    let Believed { estimate, cloud, .. } = search.last()?;
    if cloud.is_empty() { gaussian(estimate) } else { kernels(cloud) }
}

/// Number of levels below which there is no map of them.
#[cfg(feature = "maps")]
const LEAST_LEVELS: usize = 12;

/// Number of cells along the longer side of a map of the level.
#[cfg(feature = "maps")]
const LEVEL_SIDE: f64 = 48.0;

/// Part of the receivers' area by which a map of the level goes beyond it on each side.
#[cfg(feature = "maps")]
const LEVEL_BEYOND: f64 = 0.15;

/// Maps the level that a search has received, without any law of propagation (Gaussian process):
/// the mean in dBm, or in dB about the recordings' own reference, and σ in dB. `None` if there are
/// too few levels or places, or if the build is without the feature `maps`.
#[cfg(feature = "maps")]
#[must_use]
pub fn level(overview: &Overview, search: usize) -> Option<[Raster; 2]> {
    let received = overview.received.iter();
    let readings: Vec<(Pose, f64)> = received
        .filter(|one| one.search == Some(search) && !one.struck)
        .filter_map(|one| {
            Some((Pose::at(one.place.x, one.place.y, one.place.z), one.level?.rss_dbm))
        })
        .collect();
    if readings.len() < LEAST_LEVELS {
        return None;
    }
    let places = readings.iter().map(|(pose, _)| (pose.position.xy(), pose.position.xy()));
    let corners = places.reduce(|(low, high), (a, b)| (low.inf(&a), high.sup(&b)));
    let (low, high) = corners?;
    let beyond = Vector2::repeat(LEVEL_BEYOND * (high - low).max());
    let cells = empty(low - beyond, high + beyond, LEVEL_SIDE)?;
    let map = FieldMap::fit(&readings, &FieldMapConfig::default()).ok()?;
    let levels = (0..cells.values.len()).map(|cell| map.level(&cells.centre(cell)));
    let (mean, sigma): (Vec<f64>, Vec<f64>) = levels.unzip();
    let is_finite = mean.iter().chain(&sigma).all(|value| value.is_finite());
    is_finite.then(|| [Raster { values: mean, ..cells.clone() }, Raster { values: sigma, ..cells }])
}

/// As with the feature `maps`, without which there is no map of the level.
#[cfg(not(feature = "maps"))]
#[must_use]
pub fn level(_: &Overview, _: usize) -> Option<[Raster; 2]> {
    None
}

/// Empty cells over a rectangle, `side` of them along its longer side.
fn empty(low: Vector2<f64>, high: Vector2<f64>, side: f64) -> Option<Raster> {
    let size = high - low;
    let cell_m = size.max() / side;
    if !(cell_m.is_finite() && cell_m > 0.0) {
        return None;
    }
    let cells = size.map(|metres| (metres / cell_m).ceil().clamp(1.0, side + 1.0));
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "1 to side + 1")]
    let [columns, rows] = [cells.x, cells.y].map(|along| along as usize);
    Some(Raster { corner: low, cell_m, columns, values: vec![0.0; columns * rows] })
}

fn gaussian(estimate: &Estimate<2>) -> Option<Raster> {
    let factor = estimate.covariance.cholesky()?;
    let reach = estimate.covariance.diagonal().map(|variance| REACH * variance.sqrt());
    let mut raster = empty(estimate.mean - reach, estimate.mean + reach, SIDE)?;
    let density = |place: Vector2<f64>| {
        let away = place - estimate.mean;
        libm::exp(-0.5 * away.dot(&factor.solve(&away)))
    };
    raster.values = (0..raster.values.len()).map(|cell| density(raster.centre(cell))).collect();
    let total: f64 = raster.values.iter().sum();
    Some(raster.map(|value| value / total))
}

/// Number of places about which the shape of a cloud is looked at.
const LOOKS: usize = 32;

/// Variance of a kernel over the local one for one place; it falls with the number of places to the
/// power of −1/3 (Silverman 1986, eq. 4.14).
const KERNEL: f64 = 3.0;

/// Spreads places by Gaussian kernels of the shape that the cloud has about its places: each of two
/// parts stays as narrow as it is, and so does a ridge.
fn kernels(places: &[Vector2<f64>]) -> Option<Raster> {
    let shape = local_covariance(places)?;
    let covariance = shape * (KERNEL * libm::pow(count(places.len()), -1.0 / 3.0));
    let factor = covariance.cholesky()?;
    let reach = covariance.diagonal().map(|variance| 3.0 * variance.sqrt());
    let first = places.first()?;
    let low = places.iter().fold(*first, |low, at| low.inf(at)) - reach;
    let high = places.iter().fold(*first, |high, at| high.sup(at)) + reach;
    let mut raster = empty(low, high, SIDE)?;
    let columns = raster.columns;
    let rows = raster.rows();
    let cell = |metres: f64, most: usize| {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped")]
        let cell = (metres / raster.cell_m).floor().clamp(0.0, count(most - 1)) as usize;
        cell
    };
    let mut values = vec![0.0; columns * rows];
    for place in places {
        let from = place - reach - raster.corner;
        let to = place + reach - raster.corner;
        for row in cell(from.y, rows)..=cell(to.y, rows) {
            for column in cell(from.x, columns)..=cell(to.x, columns) {
                let index = row * columns + column;
                let away = raster.centre(index) - place;
                if let Some(value) = values.get_mut(index) {
                    *value += libm::exp(-0.5 * away.dot(&factor.solve(&away)));
                }
            }
        }
    }
    let total: f64 = values.iter().sum();
    raster.values = values;
    Some(raster.map(|value| value / total))
}

/// Returns the covariance of the quarter of all places that is nearest to a place, near by the
/// covariance of all; the mean about some places.
fn local_covariance(places: &[Vector2<f64>]) -> Option<Matrix2<f64>> {
    let whole = covariance(places.iter());
    let least = Matrix2::identity() * (1e-6 + 1e-6 * whole.trace());
    let factor = (whole + least).cholesky()?;
    let near = places.len().div_ceil(4);
    let every = places.len().div_ceil(LOOKS).max(1);
    let looks: Vec<_> = places.iter().step_by(every).collect();
    let mut sum = Matrix2::zeros();
    for look in &looks {
        let mut others: Vec<(f64, &Vector2<f64>)> = (places.iter())
            .map(|other| {
                let away = other - *look;
                (away.dot(&factor.solve(&away)), other)
            })
            .collect();
        let _ = others.select_nth_unstable_by(near.checked_sub(1)?, |a, b| a.0.total_cmp(&b.0));
        sum += covariance(others.iter().take(near).map(|(_, other)| *other));
    }
    Some(sum / count(looks.len()) + least)
}

fn covariance<'a>(places: impl Iterator<Item = &'a Vector2<f64>>) -> Matrix2<f64> {
    let mut sums = (0.0, Vector2::zeros(), Matrix2::zeros());
    for place in places {
        sums = (sums.0 + 1.0, sums.1 + place, sums.2 + place * place.transpose());
    }
    let (number, sum, squares) = sums;
    let mean = sum / number;
    squares / number - mean * mean.transpose()
}

#[cfg(test)]
mod tests {
    use approx::assert_abs_diff_eq;

    use super::*;

    /// The share of a raster within a distance of a place.
    fn within(raster: &Raster, place: Vector2<f64>, metres: f64) -> f64 {
        let cells = raster.values.iter().enumerate();
        cells
            .filter(|(cell, _)| (raster.centre(*cell) - place).norm() <= metres)
            .map(|(_, value)| value)
            .sum()
    }

    #[test]
    fn a_gaussian_has_its_ellipses_as_regions() {
        let mean = Vector2::new(10.0, -20.0);
        let search = SearchOverview {
            beliefs: vec![believed(Estimate::isotropic(mean, 5.0), Vec::new())],
            ..SearchOverview::default()
        };
        let raster = belief(&search).expect("a belief");
        assert_abs_diff_eq!(raster.values.iter().sum::<f64>(), 1.0, epsilon = 1e-12);
        // √(−2 ln 0.5) σ holds a half.
        assert_abs_diff_eq!(within(&raster, mean, 5.0 * 1.177_41), 0.5, epsilon = 0.01);
        let levels = raster.cumulative();
        let half = levels.values.iter().zip(&raster.values).filter(|(level, _)| **level <= 0.5);
        assert_abs_diff_eq!(half.map(|(_, mass)| mass).sum::<f64>(), 0.5, epsilon = 0.01);
        // 95 % lie within 2.4477 σ.
        let border = levels.between(&(mean + Vector2::new(5.0 * 2.4477, 0.0))).expect("inside");
        assert_abs_diff_eq!(border, 0.95, epsilon = 0.01);
        assert_eq!(levels.between(&(mean + Vector2::new(50.0, 0.0))), None);
    }

    fn believed(estimate: Estimate<2>, cloud: Vec<Vector2<f64>>) -> Believed {
        Believed {
            time: 0.0,
            steps: 1,
            ellipse_95: estimate.ellipse(0.95),
            estimate,
            error_m: None,
            cloud,
        }
    }

    #[test]
    fn places_in_two_parts_stay_apart() {
        let along = |number: u32| f64::from(number % 20) - 10.0;
        let place = |number: u32| {
            let east = if number.is_multiple_of(2) { 0.0 } else { 500.0 };
            Vector2::new(east + along(number / 2), along(number / 40))
        };
        let cloud: Vec<_> = (0..800).map(place).collect();
        let search = SearchOverview {
            beliefs: vec![believed(Estimate::isotropic(Vector2::zeros(), 250.0), cloud)],
            ..SearchOverview::default()
        };
        let raster = belief(&search).expect("a belief");
        assert_abs_diff_eq!(raster.values.iter().sum::<f64>(), 1.0, epsilon = 1e-12);
        for east in [0.0, 500.0] {
            assert_abs_diff_eq!(
                within(&raster, Vector2::new(east, 0.0), 150.0),
                0.5,
                epsilon = 0.02
            );
        }
        assert!(within(&raster, Vector2::new(250.0, 0.0), 80.0) < 0.01);
    }

    #[test]
    fn blocks_and_margins_keep_the_probability() {
        let values = (0..35).map(|cell| if cell % 7 == 0 { 0.0 } else { 1.0 / 30.0 }).collect();
        let raster = Raster { corner: Vector2::new(-3.0, 5.0), cell_m: 2.0, columns: 7, values };
        let coarse = raster.coarser(4);
        assert_eq!((coarse.columns, coarse.rows(), coarse.cell_m), (4, 3, 4.0));
        assert_abs_diff_eq!(coarse.values.iter().sum::<f64>(), 1.0, epsilon = 1e-12);
        let cropped = raster.cropped(0.1);
        assert_eq!((cropped.columns, cropped.rows()), (6, 5));
        assert_eq!(cropped.corner, Vector2::new(-1.0, 5.0));
        assert_eq!(cropped.far_corner(), raster.far_corner());
    }

    #[cfg(feature = "maps")]
    #[test]
    fn the_map_of_the_level_knows_the_path_and_not_what_is_far_from_it() {
        use foxhunt_core::Level;
        use nalgebra::Vector3;

        use crate::overview::Received;

        let mut overview = Overview::default();
        let receiver = overview.receiver("walk");
        for step in 0..60_u8 {
            // Along three lanes, and stronger to the East.
            let lane = f64::from(step / 20);
            let along = f64::from(step % 20);
            overview.add(Received {
                time: f64::from(step),
                receiver,
                search: Some(0),
                place: Vector3::new(20.0 * along, 50.0 * lane, 2.0),
                level: Some(Level { rss_dbm: -90.0 + along, sigma_db: 4.0 }),
                bearing: None,
                modes: foxhunt_core::BearingModes::default(),
                remark: None,
                used: true,
                struck: false,
                id: None,
                nis: None,
                turn: None,
            });
        }
        let [mean, sigma] = level(&overview, 0).expect("many levels");
        let at = |raster: &Raster, east, north| {
            raster.between(&Vector2::new(east, north)).expect("within the map")
        };
        assert_abs_diff_eq!(at(&mean, 40.0, 50.0), -88.0, epsilon = 1.5);
        assert_abs_diff_eq!(at(&mean, 360.0, 50.0), -72.0, epsilon = 1.5);
        assert!(at(&sigma, 200.0, 50.0) < at(&sigma, -50.0, -50.0));
        assert_eq!(level(&overview, 1), None);
    }

    #[test]
    fn nothing_found_has_no_raster() {
        assert_eq!(belief(&SearchOverview::default()), None);
    }
}
