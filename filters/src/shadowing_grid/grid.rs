use alloc::vec::Vec;
use core::ops::Range;

use foxhunt_core::{Covariance, Estimate};
use nalgebra::{Matrix2, Vector2};

/// Square cells over a rectangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Grid {
    /// The centre of the cell farthest south and west.
    south_west: Vector2<f64>,
    cell_m: f64,
    columns: u32,
    rows: u32,
}

impl Grid {
    /// Covers the rectangle from `low` to `high`; cells grow beyond `cell_m` where there would
    /// be more than `max_cells`. The cells overhang both sides alike.
    pub(crate) fn over(low: Vector2<f64>, high: Vector2<f64>, cell_m: f64, max_cells: u32) -> Self {
        let size = high - low;
        let count = |cell_m: f64| size.map(|side| libm::ceil(side / cell_m - 1e-9).max(1.0));
        let mut cell_m = cell_m;
        let mut shape = count(cell_m);
        while shape.x * shape.y > f64::from(max_cells) {
            let excess = shape.x * shape.y / f64::from(max_cells);
            // The square root may fall short, as cells are whole; 1 % more each time does not.
            cell_m *= libm::sqrt(excess).max(1.01);
            shape = count(cell_m);
        }
        let covered = shape * cell_m;
        let south_west = low + 0.5 * (size - covered) + Vector2::repeat(0.5 * cell_m);
        #[expect(clippy::cast_possible_truncation, reason = "whole, and below max_cells")]
        let (columns, rows) = (shape.x as u32, shape.y as u32);
        Self { south_west, cell_m, columns, rows }
    }

    /// Returns the number of cells.
    pub(crate) fn len(&self) -> usize {
        self.columns as usize * self.rows as usize
    }

    /// The side of a cell in metres.
    pub(crate) fn cell_m(&self) -> f64 {
        self.cell_m
    }

    /// Returns the number of cells from west to east.
    #[cfg(feature = "batch")]
    pub(crate) fn columns(&self) -> usize {
        self.columns as usize
    }

    /// The centre of a cell, counted from the south-west along the rows.
    pub(crate) fn centre(&self, index: usize) -> Vector2<f64> {
        let (column, row) = self.column_and_row(index);
        self.south_west + Vector2::new(f64::from(column), f64::from(row)) * self.cell_m
    }

    #[expect(clippy::cast_possible_truncation, reason = "cells are numbered by a u32")]
    fn column_and_row(&self, index: usize) -> (u32, u32) {
        let index = index as u32;
        let columns = self.columns;
        (index % columns, index / columns)
    }
}

/// A posterior over the cells of a grid.
#[derive(Clone, Debug, PartialEq)]
pub struct PosteriorMap {
    grid: Grid,
    mass: Vec<f64>,
    /// Logarithm of all mass before it was made 1, up to a constant that grids of the same data
    /// share; `None` where it is not known.
    log_total: Option<f64>,
}

impl PosteriorMap {
    /// One mass per cell, with sum 1.
    pub(crate) fn new(grid: Grid, mass: Vec<f64>) -> Self {
        Self { grid, mass, log_total: None }
    }

    /// One mass per cell, with sum 1, of densities whose sum over the cells has this logarithm.
    pub(crate) fn of_densities(grid: Grid, mass: Vec<f64>, log_sum: f64) -> Self {
        let log_total = Some(log_sum + 2.0 * libm::log(grid.cell_m));
        Self { grid, mass, log_total }
    }

    /// Returns the mass of this map, and of a wider one of the same data within and beyond the area
    /// of this one, as shares of this one's; `None` where they are not known.
    pub(super) fn within_and_beyond(&self, wider: &Self) -> Option<(f64, f64)> {
        let half = Vector2::repeat(0.5 * self.grid.cell_m);
        let low = self.grid.south_west - half;
        let high = self.grid.centre(self.grid.len().saturating_sub(1)) + half;
        let holds = |place: &Vector2<f64>| *place >= low && *place <= high;
        let within: f64 =
            wider.cells().filter(|(place, _)| holds(place)).map(|(_, mass)| mass).sum();
        let ratio = libm::exp(wider.log_total? - self.log_total?);
        Some((ratio * within, ratio * (1.0 - within)))
    }

    /// The centre of the cell farthest south and west, East and North in metres.
    #[must_use]
    pub fn south_west(&self) -> Vector2<f64> {
        self.grid.south_west
    }

    /// The side of a cell in metres.
    #[must_use]
    pub fn cell_m(&self) -> f64 {
        self.grid.cell_m
    }

    /// Returns the number of cells from west to east.
    #[must_use]
    pub fn columns(&self) -> usize {
        self.grid.columns as usize
    }

    /// Returns the number of cells from south to north.
    #[must_use]
    pub fn rows(&self) -> usize {
        self.grid.rows as usize
    }

    /// The probability of each cell, row by row from the south, each row from the west; sums
    /// to 1.
    #[must_use]
    pub fn mass(&self) -> &[f64] {
        &self.mass
    }

    /// The centre of each cell with its probability, in the order of [`mass`](Self::mass).
    pub fn cells(&self) -> impl Iterator<Item = (Vector2<f64>, f64)> {
        self.mass.iter().enumerate().map(|(i, &mass)| (self.grid.centre(i), mass))
    }

    /// The probability of the outermost ring of cells.
    #[must_use]
    pub fn border_mass(&self) -> f64 {
        let columns = self.grid.columns;
        let rows = self.grid.rows;
        let on_border = |&(i, _): &(usize, &f64)| {
            let (column, row) = self.grid.column_and_row(i);
            column == 0 || row == 0 || column + 1 == columns || row + 1 == rows
        };
        self.mass.iter().enumerate().filter(on_border).map(|(_, mass)| mass).sum()
    }

    /// Mean and covariance in metres, the place being uniform within its cell, which adds
    /// `cell_m`²/12 to each variance.
    #[must_use]
    pub fn estimate(&self) -> Estimate<2> {
        self.about(self.cells().fold(Vector2::zeros(), |sum, (place, mass)| sum + place * mass))
    }

    /// A place with the mean squared deviations from it: the covariance that an estimate other
    /// than the mean has.
    #[must_use]
    pub fn about(&self, place: Vector2<f64>) -> Estimate<2> {
        let covariance = self.cells().fold(Matrix2::zeros(), |sum, (cell, mass)| {
            let deviation = cell - place;
            sum + deviation * deviation.transpose() * mass
        });
        let within = self.grid.cell_m * self.grid.cell_m / 12.0;
        let covariance = covariance + Covariance::from_diagonal_element(within);
        Estimate { mean: place, covariance }
    }

    /// The least probability of a cell of the smallest region that holds the target with a
    /// probability: the region of highest posterior density (Box & Tiao 1973) is the cells that
    /// have as much or more.
    #[must_use]
    pub fn highest_density(&self, probability: f64) -> f64 {
        let mut mass = self.mass.clone();
        mass.sort_unstable_by(|a, b| b.total_cmp(a));
        let mut held = 0.0;
        let least = mass.iter().find(|&&mass| {
            held += mass;
            held >= probability
        });
        least.or(mass.last()).copied().unwrap_or(0.0)
    }

    /// The spatial median, East and North in metres: the place from which the target is least far
    /// on average (Weiszfeld 1937). A part of the mass that lies far off moves the mean with its
    /// distance, and the median no more than any other part of its size.
    #[must_use]
    pub fn median(&self) -> Vector2<f64> {
        let mut median = self.estimate().mean;
        // A cell is a square, not a point: half of it keeps the weights finite.
        let nearest = 0.5 * self.grid.cell_m;
        for _ in 0..200 {
            let mut sum = Vector2::zeros();
            let mut total = 0.0;
            for (place, mass) in self.cells() {
                let weight = mass / (place - median).norm().max(nearest);
                sum += place * weight;
                total += weight;
            }
            let next = sum / total;
            let step = (next - median).norm();
            median = next;
            if step < 1e-3 * self.grid.cell_m {
                break;
            }
        }
        median
    }

    /// The place of a posterior with its maximum at `mode`: the mode where mode and median are
    /// nearly one, as of a posterior that is smooth and almost symmetric, and else the
    /// [`median`](Self::median), by degrees in between.
    ///
    /// Both are then as good for measurements with errors, while of exact ones the mode is exact: a
    /// posterior that is a little skewed moves the median by some hundredths of its σ.
    #[must_use]
    pub fn centre(&self, mode: Vector2<f64>) -> Vector2<f64> {
        let median = self.median();
        let away = mode - median;
        let factor = self.about(median).covariance.cholesky();
        let apart = factor.map_or(f64::INFINITY, |own| libm::sqrt(away.dot(&own.solve(&away))));
        median + away * ((FAR_APART - apart) / (FAR_APART - NEARLY_ONE)).clamp(0.0, 1.0)
    }

    /// The cell of the highest density.
    #[cfg(feature = "batch")]
    pub(crate) fn highest(&self) -> Vector2<f64> {
        let best = self.cells().max_by(|a, b| a.1.total_cmp(&b.1));
        best.map_or(Vector2::zeros(), |(place, _)| place)
    }

    /// The map of a place that is shifted by an unknown amount, N(0, `sigma_m`²) on each axis, on
    /// `max_cells` at most.
    #[must_use]
    pub fn blurred(&self, sigma_m: f64, max_cells: u32) -> Self {
        let (low, high) = self.extent_of_mass();
        let around = Vector2::repeat(4.0 * sigma_m);
        let cell_m = self.grid.cell_m.max(sigma_m / 3.0);
        let grid = Grid::over(low - around, high + around, cell_m, max_cells);
        // Cells that are larger than σ are filled evenly, not at their centres alone.
        let sigma_m = libm::hypot(sigma_m, grid.cell_m / libm::sqrt(12.0));
        let kernel = |offset_m: f64| libm::exp(-0.5 * (offset_m / sigma_m) * (offset_m / sigma_m));
        // The kernel is a product of one along each axis: rows first, then columns.
        let columns = grid.columns as usize;
        let rows = grid.rows as usize;
        let along = |from: f64, to: f64, into_m: f64, i: usize, k: usize| {
            #[expect(clippy::cast_precision_loss, reason = "cells are numbered by a u32")]
            let offset = from + into_m * i as f64 - to - self.grid.cell_m * k as f64;
            kernel(offset)
        };
        let mut eastward = alloc::vec![0.0; columns * self.rows()];
        for (sums, own) in eastward.chunks_mut(columns).zip(self.mass.chunks(self.columns())) {
            for (k, mass) in own.iter().enumerate().filter(|(_, mass)| **mass > 1e-12) {
                for (i, sum) in sums.iter_mut().enumerate() {
                    *sum +=
                        mass * along(grid.south_west.x, self.grid.south_west.x, grid.cell_m, i, k);
                }
            }
        }
        let mut mass = alloc::vec![0.0; columns * rows];
        for (j, sums) in mass.chunks_mut(columns).enumerate() {
            for (k, own) in eastward.chunks(columns).enumerate() {
                let weight = along(grid.south_west.y, self.grid.south_west.y, grid.cell_m, j, k);
                if weight > 1e-12 {
                    sums.iter_mut().zip(own).for_each(|(sum, own)| *sum += weight * own);
                }
            }
        }
        let total: f64 = mass.iter().sum();
        mass.iter_mut().for_each(|mass| *mass /= total);
        Self::new(grid, mass)
    }

    /// A grid of finer cells over the mass, if the cells are too coarse for it and `max_cells`
    /// leave room to do better.
    pub(super) fn finer(&self, max_cells: u32) -> Option<Grid> {
        let cell_m = self.grid.cell_m;
        let narrowest = self.narrowest_sd();
        if narrowest >= FINE_ENOUGH * cell_m {
            return None;
        }
        // One step at a time: a posterior far narrower than a cell is not resolved from here.
        let wanted_m = 0.25 * narrowest.max(cell_m);
        let (low, high) = self.extent_of_mass();
        let finer = Grid::over(low, high, wanted_m, max_cells);
        (finer.cell_m < 0.8 * cell_m).then_some(finer)
    }

    /// The area of all cells.
    pub(super) fn area_m2(&self) -> f64 {
        f64::from(self.grid.columns)
            * f64::from(self.grid.rows)
            * self.grid.cell_m
            * self.grid.cell_m
    }

    /// The corners of a rectangle without the outer rows and columns that hold little, but for one
    /// on each side: as long as the lightest of the four sides fits into `share`, it is left out.
    pub(crate) fn without(&self, share: f64) -> (Vector2<f64>, Vector2<f64>) {
        let mut columns = 0..self.columns();
        let mut rows = 0..self.rows();
        let row = |row: usize, columns: &Range<usize>| -> f64 {
            columns.clone().map(|column| self.mass[row * self.columns() + column]).sum()
        };
        let column = |column: usize, rows: &Range<usize>| -> f64 {
            rows.clone().map(|row| self.mass[row * self.columns() + column]).sum()
        };
        let mut left = share;
        while columns.len() > 1 && rows.len() > 1 {
            let sides = [
                row(rows.start, &columns),
                row(rows.end - 1, &columns),
                column(columns.start, &rows),
                column(columns.end - 1, &rows),
            ];
            let lightest = (0..4).min_by(|&a, &b| sides[a].total_cmp(&sides[b])).unwrap_or(0);
            left -= sides[lightest];
            if left < 0.0 {
                break;
            }
            match lightest {
                0 => rows.start += 1,
                1 => rows.end -= 1,
                2 => columns.start += 1,
                _ => columns.end -= 1,
            }
        }
        let corner = self.grid.south_west - Vector2::repeat(0.5 * self.grid.cell_m);
        #[expect(clippy::cast_precision_loss, reason = "cells are numbered by a u32")]
        let at = |column: usize, row: usize| {
            corner + Vector2::new(column as f64, row as f64) * self.grid.cell_m
        };
        // The border that is left holds next to nothing, however few cells hold the rest.
        let last_column = self.columns();
        let last_row = self.rows();
        (
            at(columns.start.saturating_sub(1), rows.start.saturating_sub(1)),
            at((columns.end + 1).min(last_column), (rows.end + 1).min(last_row)),
        )
    }

    /// The standard deviation along the ellipse's minor axis, without the cells' own.
    fn narrowest_sd(&self) -> f64 {
        let covariance = self.estimate().covariance;
        let a = covariance[(0, 0)];
        let b = covariance[(0, 1)];
        let c = covariance[(1, 1)];
        let smallest = 0.5 * (a + c) - libm::hypot(0.5 * (a - c), b);
        libm::sqrt((smallest - self.grid.cell_m * self.grid.cell_m / 12.0).max(0.0))
    }

    /// The corners of the rectangle around all cells that matter and their neighbours.
    pub(super) fn extent_of_mass(&self) -> (Vector2<f64>, Vector2<f64>) {
        let least = NEGLIGIBLE * self.mass.iter().copied().fold(0.0, f64::max);
        let mut low = (u32::MAX, u32::MAX);
        let mut high = (0, 0);
        for (i, _) in self.mass.iter().enumerate().filter(|(_, mass)| **mass > least) {
            let (column, row) = self.grid.column_and_row(i);
            low = (low.0.min(column), low.1.min(row));
            high = (high.0.max(column), high.1.max(row));
        }
        // Beyond the grid's edge the prior is 0: there is no neighbour.
        let low = Vector2::new(low.0.saturating_sub(1).into(), low.1.saturating_sub(1).into());
        let high = Vector2::new(
            f64::from((high.0 + 2).min(self.grid.columns)),
            f64::from((high.1 + 2).min(self.grid.rows)),
        );
        let corner = self.grid.south_west - Vector2::repeat(0.5 * self.grid.cell_m);
        (corner + low * self.grid.cell_m, corner + high * self.grid.cell_m)
    }
}

/// Distance of the mode from the median, in σ of the place, below which the mode is the place: the
/// expected distance from the true place grows by 0.3 % at most.
const NEARLY_ONE: f64 = 0.1;

/// Distance of the mode from the median, in σ, above which the median is the place.
const FAR_APART: f64 = 0.25;

/// From three cells per standard deviation on, the cell's own variance is below 1 %.
const FINE_ENOUGH: f64 = 3.0;

/// The density of a Gaussian at six standard deviations: a cell below it is left out of the finer
/// grid. So far down also because a coarse grid may miss the top of a narrow peak.
const NEGLIGIBLE: f64 = 1.5e-8;

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_abs_diff_eq;

    #[test]
    fn cells_grow_until_they_are_few_enough() {
        let low = Vector2::new(-5.0, 10.0);
        let high = Vector2::new(995.0, 410.0);
        let grid = Grid::over(low, high, 10.0, 40_000);
        assert_eq!((grid.columns, grid.rows), (100, 40));
        assert_eq!(grid.centre(0), Vector2::new(0.0, 15.0));
        assert_eq!(grid.centre(101), Vector2::new(10.0, 25.0));
        let coarse = Grid::over(low, high, 10.0, 1000);
        assert!(coarse.len() <= 1000 && coarse.len() > 900, "{coarse:?}");
        assert!(f64::from(coarse.columns) * coarse.cell_m >= 1000.0);
        let middle = 0.5 * (coarse.centre(0) + coarse.centre(coarse.len() - 1));
        assert!((middle - Vector2::new(495.0, 210.0)).norm() < 1e-9);
    }

    #[test]
    fn moments_and_border_of_a_known_map() {
        let grid = Grid::over(Vector2::zeros(), Vector2::new(3.0, 4.0), 1.0, 100);
        let mut mass = alloc::vec![0.0; 12];
        (mass[4], mass[7], mass[11]) = (0.5, 0.25, 0.25); // (1, 1), (1, 2) inside; (2, 3) a corner
        let map = PosteriorMap::new(grid, mass);
        assert_abs_diff_eq!(map.border_mass(), 0.25, epsilon = 1e-15);
        let estimate = map.estimate();
        assert!((estimate.mean - Vector2::new(1.75, 2.25)).norm() < 1e-12);
        let twelfth = 1.0 / 12.0;
        let expected = Matrix2::new(0.1875 + twelfth, 0.3125, 0.3125, 0.6875 + twelfth);
        assert!((estimate.covariance - expected).norm() < 1e-12);
    }

    #[test]
    fn a_blur_adds_its_variance_and_loses_nothing() {
        let grid = Grid::over(Vector2::zeros(), Vector2::new(9.0, 9.0), 1.0, 100);
        let mut mass = alloc::vec![0.0; 81];
        (mass[4 * 9 + 2], mass[4 * 9 + 6]) = (0.5, 0.5);
        let map = PosteriorMap::new(grid, mass);
        let before = map.estimate();
        // Fine cells for a wide blur, and cells that are far larger than the blur.
        for (sigma_m, max_cells) in [(4.0, 10_000), (0.05, 10_000), (4.0, 9)] {
            let blurred = map.blurred(sigma_m, max_cells);
            assert_abs_diff_eq!(blurred.mass().iter().sum::<f64>(), 1.0, epsilon = 1e-12);
            let after = blurred.estimate();
            assert!((after.mean - before.mean).norm() < 1e-6, "{after:?}");
            let added = (after.covariance - before.covariance).diagonal();
            // A cell is as wide as it is, and its centre need not be that of an old one.
            let of_cells = blurred.cell_m() * blurred.cell_m() / 3.0;
            let least = sigma_m * sigma_m - 1.0 / 12.0;
            let most = sigma_m * sigma_m + of_cells;
            let fits = added.iter().all(|v| (least..=1.02 * most).contains(v));
            assert!(fits, "{sigma_m} m, {max_cells} cells: {added:?}");
        }
    }

    #[test]
    fn mass_far_off_moves_the_mean_and_not_the_median() {
        let grid = Grid::over(Vector2::zeros(), Vector2::new(100.0, 10.0), 1.0, 1000);
        let mut mass = alloc::vec![0.0; 1000];
        (mass[505], mass[599]) = (0.9, 0.1);
        let map = PosteriorMap::new(grid, mass);
        let mean = map.estimate().mean;
        assert!((mean - Vector2::new(14.9, 5.5)).norm() < 1e-9, "{mean}");
        let median = map.median();
        assert!((median - Vector2::new(5.5, 5.5)).norm() < 0.1, "{median}");
        // 0.1 · 94² away from the median along East, and a cell's own share.
        let about = map.about(Vector2::new(5.5, 5.5)).covariance;
        assert_abs_diff_eq!(about[(0, 0)] - 883.6, 1.0 / 12.0, epsilon = 1e-9);
    }

    #[test]
    fn a_mode_near_the_median_is_the_place() {
        let grid = Grid::over(Vector2::zeros(), Vector2::new(9.0, 9.0), 1.0, 100);
        let map = PosteriorMap::new(grid, alloc::vec![1.0 / 81.0; 81]);
        // 9 / √12 = 2.6 m is the σ on each axis.
        let middle = Vector2::repeat(4.5);
        let at = |east: f64| map.centre(middle + Vector2::new(east, 0.0)).x - middle.x;
        assert_abs_diff_eq!(at(0.2), 0.2, epsilon = 1e-6);
        assert_abs_diff_eq!(at(2.0), 0.0, epsilon = 1e-6);
        assert!(at(0.4) > 0.05 && at(0.4) < 0.4, "{}", at(0.4));
    }

    #[test]
    fn light_rows_and_columns_are_left_out_but_for_one() {
        let grid = Grid::over(Vector2::zeros(), Vector2::new(7.0, 7.0), 1.0, 100);
        let mut mass = [[0.0; 7]; 7];
        mass[2][2] = 0.001;
        mass[3][3..5].copy_from_slice(&[0.5, 0.4]);
        mass[4][3..5].copy_from_slice(&[0.01, 0.089]);
        let map = PosteriorMap::new(grid, mass.as_flattened().to_vec());
        let corners = |share| {
            let (low, high) = map.without(share);
            [low.x, low.y, high.x, high.y].map(|side| alloc::format!("{side:.0}")).join(" ")
        };
        assert_eq!(corners(0.0), "1 1 6 6");
        assert_eq!(corners(0.002), "2 2 6 6");
        assert_eq!(corners(0.11), "2 2 6 5");
    }

    #[test]
    fn the_region_of_highest_density_is_the_smallest() {
        let grid = Grid::over(Vector2::zeros(), Vector2::new(2.0, 2.0), 1.0, 100);
        let map = PosteriorMap::new(grid, alloc::vec![0.1, 0.4, 0.2, 0.3]);
        for (probability, least) in [(0.3, 0.4), (0.5, 0.3), (0.7, 0.3), (0.85, 0.2), (1.0, 0.1)] {
            assert!((map.highest_density(probability) - least).abs() < 1e-15, "{probability}");
        }
    }

    #[test]
    fn a_finer_grid_covers_the_mass_and_its_neighbours() {
        let grid = Grid::over(Vector2::zeros(), Vector2::new(100.0, 100.0), 1.0, 10_000);
        let mut mass = alloc::vec![0.0; 10_000];
        mass[5 * 100 + 3] = 1.0;
        let map = PosteriorMap::new(grid, mass);
        let finer = map.finer(2500).expect("a single cell is too coarse");
        assert_eq!((finer.columns, finer.rows), (12, 12));
        assert!((finer.centre(0) - Vector2::new(2.125, 4.125)).norm() < 1e-9);
        let even = PosteriorMap::new(grid, alloc::vec![1e-4; 10_000]);
        assert_eq!(even.finer(2500), None);
    }
}
