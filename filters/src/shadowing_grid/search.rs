#[cfg(any(feature = "batch", test))]
use nalgebra::Matrix2;
use nalgebra::Vector2;

use super::{
    PlacePrior,
    grid::{Grid, PosteriorMap},
};

/// Area and resolution of a grid search.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Search {
    /// The corners of the receivers' bounding box.
    pub low: Vector2<f64>,
    pub high: Vector2<f64>,
    pub place: PlacePrior,
    pub margin_m: f64,
    pub cell_m: f64,
    pub max_cells: u32,
}

impl Search {
    /// The posterior over the whole area that has to be searched, and on finer cells around the
    /// mass where the first are too coarse for it. Where the prior of the place reaches beyond the
    /// margin and there is mass on the border, up to six wider grids come first.
    #[cfg(any(feature = "batch", test))]
    pub(crate) fn run<P, E>(
        &self,
        mut posterior: impl FnMut(Grid) -> Result<P, E>,
        map: impl Fn(&P) -> &PosteriorMap,
    ) -> Result<(P, Option<P>), E> {
        let searched = self.cover(&mut posterior, &map)?;
        let mut refined = None;
        for _ in 0..REFINEMENTS {
            let last = refined.as_ref().unwrap_or(&searched);
            let Some(finer) = map(last).finer(self.max_cells / 4) else { break };
            refined = Some(posterior(finer)?);
        }
        Ok((searched, refined))
    }

    /// The posterior over a part of the area, which is widened while there is mass on its border,
    /// up to the border of the whole area under an even prior.
    pub(crate) fn within<P, E>(
        &self,
        (low, high): (Vector2<f64>, Vector2<f64>),
        cell_m: f64,
        mut posterior: impl FnMut(Grid) -> Result<P, E>,
        map: impl Fn(&P) -> &PosteriorMap,
    ) -> Result<P, E> {
        let middle = 0.5 * (low + high);
        let mut half = 0.5 * (high - low);
        let margin = Vector2::repeat(self.margin_m);
        let clamped = |low: Vector2<f64>, high: Vector2<f64>| match self.place {
            PlacePrior::Even => (low.sup(&(self.low - margin)), high.inf(&(self.high + margin))),
            PlacePrior::NearReceivers { .. } => (low, high),
        };
        let mut last = None;
        let mut cells = self.max_cells / 2;
        for _ in 0..WIDENINGS {
            let (low, high) = clamped(middle - half, middle + half);
            let found = posterior(Grid::over(low, high, cell_m, cells))?;
            let done = map(&found).border_mass() < LITTLE_ON_BORDER || last == Some((low, high));
            if done {
                return Ok(found);
            }
            last = Some((low, high));
            half *= 2.0;
            cells = self.max_cells;
        }
        let (low, high) = clamped(middle - half, middle + half);
        posterior(Grid::over(low, high, cell_m, cells))
    }

    /// The posterior over the whole area that has to be searched, as [`run`](Self::run) begins.
    pub(crate) fn cover<P, E>(
        &self,
        mut posterior: impl FnMut(Grid) -> Result<P, E>,
        map: impl Fn(&P) -> &PosteriorMap,
    ) -> Result<P, E> {
        let mut within = |margin_m: f64| {
            let margin = Vector2::repeat(margin_m);
            let low = self.low - margin;
            let high = self.high + margin;
            posterior(Grid::over(low, high, self.cell_m, self.max_cells))
        };
        let mut margin_m = self.margin_m;
        let mut searched = within(margin_m)?;
        if matches!(self.place, PlacePrior::NearReceivers { .. }) {
            for _ in 0..WIDENINGS {
                if map(&searched).border_mass() < LITTLE_ON_BORDER {
                    break;
                }
                margin_m = 2.0 * margin_m.max(0.25 * (self.high - self.low).norm());
                let wider = within(margin_m)?;
                // Wider cells may miss a narrow mass: what is beyond counts beside all of it.
                if let Some((still, beyond)) = map(&searched).within_and_beyond(map(&wider))
                    && (beyond < LITTLE_ON_BORDER || (still < 0.5 && beyond < 1.0))
                {
                    break;
                }
                searched = wider;
            }
            // Cells where the mass is, however wide the search was.
            for _ in 0..TRIMMINGS {
                let (from, to) = map(&searched).without(LITTLE_ON_BORDER);
                if (to - from).product() > 0.8 * map(&searched).area_m2() {
                    break;
                }
                searched = posterior(Grid::over(from, to, self.cell_m, self.max_cells))?;
            }
        }
        Ok(searched)
    }
}

/// Climbs from a place to the maximum of a smooth density's logarithm near it, with steps of
/// `step_m` at first: to the vertex of a parabola through seven places, or to the best of them.
#[cfg(any(feature = "batch", test))]
pub(crate) fn climb(
    start: Vector2<f64>,
    step_m: f64,
    log_density: impl Fn(&Vector2<f64>) -> f64,
) -> Vector2<f64> {
    let mut best = (start, log_density(&start));
    let mut step = step_m;
    for _ in 0..CLIMBS {
        let at = |east: f64, north: f64| {
            let place = best.0 + Vector2::new(east, north) * step;
            (place, log_density(&place))
        };
        let [east, west] = [at(1.0, 0.0), at(-1.0, 0.0)];
        let [north, south] = [at(0.0, 1.0), at(0.0, -1.0)];
        let [both, neither] = [at(1.0, 1.0), at(-1.0, -1.0)];
        let gradient = 0.5 * Vector2::new(east.1 - west.1, north.1 - south.1);
        let along =
            Vector2::new(east.1 + west.1, north.1 + south.1) - Vector2::repeat(2.0 * best.1);
        let across = 0.5 * (both.1 + neither.1 - 2.0 * best.1 - along.sum());
        let curvature = Matrix2::new(-along.x, -across, -across, -along.y);
        let vertex = curvature.cholesky().map(|factor| factor.solve(&gradient));
        let vertex = vertex.filter(|way| way.amax() < 2.0).map(|way| at(way.x, way.y));
        let tried = [east, west, north, south, both, neither].into_iter().chain(vertex);
        let next = tried.fold(best, |best, other| if other.1 > best.1 { other } else { best });
        // Along a ridge the steps grow again.
        let moved = (next.0 - best.0).amax() / step;
        if moved < 0.5 {
            step *= 0.25;
        } else if moved >= 1.0 {
            step *= 2.0;
        }
        best = next;
        if step < LEAST_STEP * step_m {
            break;
        }
    }
    best.0
}

/// Largest number of steps to a maximum.
#[cfg(any(feature = "batch", test))]
const CLIMBS: u8 = 200;

/// Last step to a maximum over the first one: below it differences of logarithms are rounding.
#[cfg(any(feature = "batch", test))]
const LEAST_STEP: f64 = 1e-4;

/// Each refinement makes cells up to four times smaller: six reach 4096.
pub(super) const REFINEMENTS: u8 = 6;

/// Each widening doubles the margin: six reach 64 times.
const WIDENINGS: u8 = 6;

/// Each trimming shows on finer cells where there is more to trim.
const TRIMMINGS: u8 = 3;

/// A border with less probability does not move the answer.
const LITTLE_ON_BORDER: f64 = 2e-3;

#[cfg(test)]
mod tests {
    use alloc::vec::Vec;
    use approx::assert_abs_diff_eq;

    use super::*;

    /// A part of the area that misses the mass is widened until it holds it, or all of the area.
    #[test]
    fn a_part_is_widened_up_to_the_mass() {
        let search = Search {
            low: Vector2::repeat(-50.0),
            high: Vector2::repeat(50.0),
            place: PlacePrior::Even,
            margin_m: 20.0,
            cell_m: 5.0,
            max_cells: 4000,
        };
        let map = |place: Vector2<f64>| {
            let posterior = move |grid: Grid| {
                let density = |i| (-0.5 * (grid.centre(i) - place).norm_squared() / 9.0).exp();
                let mut mass: Vec<f64> = (0..grid.len()).map(density).collect();
                let total: f64 = mass.iter().sum();
                mass.iter_mut().for_each(|mass| *mass /= total);
                Ok::<_, ()>(PosteriorMap::new(grid, mass))
            };
            let part = (Vector2::repeat(-5.0), Vector2::repeat(5.0));
            search.within(part, 2.0, posterior, |map| map).expect("it never fails")
        };
        let found = map(Vector2::new(30.0, -12.0));
        assert!(found.border_mass() < LITTLE_ON_BORDER);
        assert!((found.estimate().mean - Vector2::new(30.0, -12.0)).norm() < 0.1);
        // Beyond the prior's border there is nothing to be found.
        let beyond = map(Vector2::new(90.0, 0.0));
        assert!(beyond.estimate().mean.x < 71.0 && beyond.border_mass() > LITTLE_ON_BORDER);
    }

    /// A narrow mass over an even floor, so low that the border has a share of 0.007. The third
    /// grid has no cell at the mass.
    #[test]
    fn a_mass_that_wider_cells_miss_is_kept() {
        let place = Vector2::new(5.0, 5.0);
        let search = Search {
            low: Vector2::repeat(-50.0),
            high: Vector2::repeat(50.0),
            place: PlacePrior::default(),
            margin_m: 50.0,
            cell_m: 5.0,
            max_cells: 400,
        };
        let posterior = |grid: Grid| {
            let density = |i| (-0.5 * (grid.centre(i) - place).norm_squared() / 4.0).exp() + 1e-4;
            let mut mass: Vec<f64> = (0..grid.len()).map(density).collect();
            let total: f64 = mass.iter().sum();
            mass.iter_mut().for_each(|mass| *mass /= total);
            Ok::<_, ()>(PosteriorMap::of_densities(grid, mass, libm::log(total)))
        };
        let found = search.cover(posterior, |map| map).expect("it never fails");
        assert!((found.highest() - place).norm() < 8.0, "{}", found.highest());
        assert!((found.estimate().mean - place).norm() < 8.0, "{}", found.estimate().mean);
    }

    /// A long, skewed ridge; differences below the rounding of its logarithm are not resolved.
    #[test]
    fn the_maximum_is_found_from_some_way_off() {
        let top = Vector2::new(312.0, -71.5);
        let log_density = |place: &Vector2<f64>| {
            let away = place - top;
            let along = 0.8 * away.x + 0.6 * away.y;
            let across = 0.8 * away.y - 0.6 * away.x + 1e-3 * along * along;
            -libm::log1p(along * along / 1e4 + across * across / 25.0)
        };
        for start in [Vector2::new(300.0, -60.0), Vector2::new(380.0, 20.0), top] {
            let found = climb(start, 8.0, log_density);
            assert!((found - top).norm() < 0.01, "{found}");
        }
    }

    /// A circular normal of σ 1.5 m about (31, −17): a third of a cell, far from all borders.
    #[test]
    fn a_mass_of_one_cell_is_not_on_the_border() {
        let place = Vector2::new(31.0, -17.0);
        let search = Search {
            low: Vector2::repeat(-50.0),
            high: Vector2::repeat(50.0),
            place: PlacePrior::NearReceivers { far_share: 0.0, reach: 1.0 },
            margin_m: 200.0,
            cell_m: 5.0,
            max_cells: 40_000,
        };
        let posterior = |grid: Grid| {
            let density = |i| (-0.5 * (grid.centre(i) - place).norm_squared() / 2.25).exp();
            let mut mass: Vec<f64> = (0..grid.len()).map(density).collect();
            let total: f64 = mass.iter().sum();
            mass.iter_mut().for_each(|mass| *mass /= total);
            Ok::<_, ()>(PosteriorMap::new(grid, mass))
        };
        let (searched, refined) = search.run(posterior, |map| map).expect("it never fails");
        assert!(searched.border_mass() < LITTLE_ON_BORDER, "{}", searched.border_mass());
        let found = refined.expect("cells are too coarse").estimate();
        assert!((found.mean - place).norm() < 0.01, "{}", found.mean);
        assert_abs_diff_eq!(found.covariance[(0, 0)].sqrt(), 1.5, epsilon = 0.02);
    }
}
