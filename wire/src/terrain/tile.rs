use std::path::PathBuf;

/// A rectangle in degrees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Area {
    pub(super) south: f64,
    pub(super) north: f64,
    pub(super) west: f64,
    pub(super) east: f64,
}

/// Layout of a tile's samples.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Grid {
    /// Latitude of the first row and longitude of the first column, in degrees.
    pub(super) north: f64,
    pub(super) west: f64,
    /// Steps from row to row southwards and from column to column eastwards, in degrees.
    pub(super) lat_step: f64,
    pub(super) lon_step: f64,
    pub(super) rows: usize,
    pub(super) columns: usize,
}

/// The samples of a tile within an area, row by row from the North.
#[derive(Clone, Debug)]
pub(super) struct Tile {
    pub(super) path: PathBuf,
    grid: Grid,
    heights: Vec<f32>,
}

/// Extent of a tile beyond its outermost samples, in steps: tiles of areas share no samples, and
/// half a step to either side of the border belongs to each.
const HALF: f64 = 0.5 + 1e-6;

impl Grid {
    /// Returns true if it has samples within half a step of an area.
    pub(super) fn meets(&self, area: &Area) -> bool {
        let south = self.north - self.lat_step * count(self.rows - 1);
        let east = self.west + self.lon_step * count(self.columns - 1);
        let lat = HALF * self.lat_step;
        let lon = HALF * self.lon_step;
        south - lat <= area.north
            && self.north + lat >= area.south
            && self.west - lon <= area.east
            && east + lon >= area.west
    }

    /// Row and column of a place, in steps, where it is within `beyond` steps of the samples; the
    /// samples at the border stand for the places beyond them.
    fn index(&self, lat_deg: f64, lon_deg: f64, beyond: f64) -> Option<(f64, f64)> {
        let row = (self.north - lat_deg) / self.lat_step;
        let column = (lon_deg - self.west) / self.lon_step;
        let last_row = count(self.rows - 1);
        let last_column = count(self.columns - 1);
        let inside = |at: f64, last: f64| (-beyond..=last + beyond).contains(&at);
        (inside(row, last_row) && inside(column, last_column))
            .then(|| (row.clamp(0.0, last_row), column.clamp(0.0, last_column)))
    }
}

impl Tile {
    /// Keeps the samples of `all` that are needed within `area`, which the grid meets.
    pub(super) fn cut(path: PathBuf, grid: Grid, area: &Area, all: impl Fn(usize) -> f32) -> Self {
        let span = |from: f64, to: f64, samples: usize| {
            let last = samples - 1;
            let first = whole(from.floor() - 1.0).min(last);
            (first, whole(to.ceil() + 1.0).min(last))
        };
        let row = |lat: f64| (grid.north - lat) / grid.lat_step;
        let column = |lon: f64| (lon - grid.west) / grid.lon_step;
        let (top, bottom) = span(row(area.north), row(area.south), grid.rows);
        let (left, right) = span(column(area.west), column(area.east), grid.columns);
        let heights = (top..=bottom)
            .flat_map(|row| (left..=right).map(move |column| row * grid.columns + column))
            .map(all)
            .collect();
        let grid = Grid {
            north: grid.north - grid.lat_step * count(top),
            west: grid.west + grid.lon_step * count(left),
            rows: bottom - top + 1,
            columns: right - left + 1,
            ..grid
        };
        Self { path, grid, heights }
    }

    /// The height at a place within `beyond` half steps of the samples, bilinear between them.
    pub(super) fn height(&self, lat_deg: f64, lon_deg: f64, beyond: bool) -> Option<f64> {
        let beyond = if beyond { HALF } else { 1e-9 };
        let (row, column) = self.grid.index(lat_deg, lon_deg, beyond)?;
        let top = whole(row.floor());
        let left = whole(column.floor());
        let down = row.fract();
        let along = column.fract();
        let at = |row: usize, column: usize| {
            let row = row.min(self.grid.rows - 1);
            let column = column.min(self.grid.columns - 1);
            f64::from(self.heights[row * self.grid.columns + column])
        };
        let upper = at(top, left) * (1.0 - along) + at(top, left + 1) * along;
        let lower = at(top + 1, left) * (1.0 - along) + at(top + 1, left + 1) * along;
        Some(upper * (1.0 - down) + lower * down)
    }

    /// The heights of its samples.
    pub(super) fn heights(&self) -> impl Iterator<Item = f64> + '_ {
        self.heights.iter().map(|height| f64::from(*height))
    }

    /// Latitude and longitude of the first void sample, if there is one.
    pub(super) fn void(&self) -> Option<(f64, f64)> {
        let index = self.heights.iter().position(|height| !height.is_finite())?;
        let row = index / self.grid.columns;
        let column = index % self.grid.columns;
        Some((
            self.grid.north - self.grid.lat_step * count(row),
            self.grid.west + self.grid.lon_step * count(column),
        ))
    }

    /// Steps from sample to sample, southwards and eastwards in degrees.
    pub(super) fn steps(&self) -> (f64, f64) {
        (self.grid.lat_step, self.grid.lon_step)
    }
}

#[expect(clippy::cast_precision_loss, reason = "far below 2⁵³ samples to a side")]
pub(super) fn count(samples: usize) -> f64 {
    samples as f64
}

#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "the cast saturates, which is the clamp that is wanted"
)]
fn whole(index: f64) -> usize {
    index as usize
}
