use foxhunt_core::{Reception, ReceptionView, Receptions};
use nalgebra::Vector2;

use super::{
    super::{
        Area, AtEnds, LocateConfig, Located, Paths,
        clocks::{ClockSearch, Clocks, HeardLevel},
    },
    law::{LEAST_TO_COMPARE, Law, LevelAt, Row, best_place, residuals, rows_at},
};

/// Largest number of levels at which hypotheses are compared.
pub(super) const MOST_PER_HYPOTHESIS: usize = 120;

/// Largest number of levels by which the best hypothesis is refined.
pub(super) const MOST_OF_BEST: usize = 1000;

/// Largest offset of clocks that is looked for, in seconds, and its share of all that was recorded.
pub(super) const MOST_OFFSET_S: f64 = 120.0;
pub(super) const MOST_SHARE: f64 = 0.25;

/// Cells of the coarse search for a place, on either side of its middle.
const REACH: i32 = 5;

/// Levels along paths of receivers, for hypotheses on where the receivers or the transmitter were.
pub(super) struct Hypotheses<'a> {
    levels: &'a Receptions,
    paths: Paths<'a>,
    /// Paths through all receptions, of which some may have no level.
    whole: Paths<'a>,
    config: &'a LocateConfig,
    start: Vector2<f64>,
    area: Area,
    pub area_without_margin: Area,
    pub duration_s: f64,
}

/// Best place under one hypothesis.
pub(super) struct Fit<T> {
    pub hypothesis: T,
    pub place: Vector2<f64>,
    pub residuals: Vec<f64>,
    pub sigma_db: f64,
    cost: f64,
}

/// Returns the fit of least cost.
pub(super) fn least<T>(tried: &[Fit<T>]) -> Option<&Fit<T>> {
    tried.iter().min_by(|a, b| a.cost.total_cmp(&b.cost))
}

impl<'a> Hypotheses<'a> {
    /// Returns the levels as hypotheses take them; `None` where they are too few, have no times, or
    /// no receiver moves. All of `levels` have a level.
    pub(super) fn new(
        located: &Located,
        levels: &'a Receptions,
        receptions: &'a Receptions,
        config: &'a LocateConfig,
    ) -> Option<Self> {
        if levels.len() < LEAST_TO_COMPARE || !config.is_timed {
            return None;
        }
        let paths = Paths::new(levels);
        let length_m = paths.length_m();
        let times = levels.views().map(|reception| reception.time);
        let first = times.clone().fold(f64::INFINITY, f64::min);
        let duration_s = times.fold(f64::NEG_INFINITY, f64::max) - first;
        (length_m > 0.0 && duration_s > 0.0).then(|| Self {
            levels,
            paths,
            whole: Paths::new(receptions),
            config,
            start: located.estimate.mean,
            area: Area::about(levels, config.margin_m),
            area_without_margin: Area::about(levels, 0.0),
            duration_s,
        })
    }

    /// Returns the fit with the receivers where they were `offset_s` later.
    pub(super) fn delayed(&self, offset_s: f64, most: usize) -> Option<Fit<f64>> {
        let stride = self.levels.len().div_ceil(most);
        self.fit(offset_s, &self.paths.shifted(offset_s, stride, AtEnds::There))
    }

    /// Compares the clock of the levels with that of the places, as of two files; `None` where an
    /// offset is stated, and where there is more than levels that go through free space. The path
    /// of one receiver alone shows it.
    pub(super) fn clocks(&self) -> Option<Clocks> {
        let config = self.config;
        let is_level = |kind: &Reception| !kind.has_bearing() && kind.measured.is_empty();
        if config.clock_offset_s.is_some()
            || config.terrain.is_some()
            || config.pattern.is_some()
            || config.antenna.is_some()
            || !self.whole.receptions().kinds().iter().all(is_level)
        {
            return None;
        }
        let search = ClockSearch {
            within_s: MOST_OFFSET_S.min(MOST_SHARE * self.duration_s),
            margin_m: self.config.margin_m,
            target_up_m: self.config.target_up_m,
        };
        let heard = |view: ReceptionView<'_>| {
            Some(HeardLevel { time_s: view.time, level_db: view.level_dbm()? })
        };
        let heard: Vec<HeardLevel> = self.levels.views().filter_map(heard).collect();
        Some(search.compare(&heard, &|time_s| self.whole.place_of_one(time_s)))
    }

    /// Returns the fit of a transmitter with a velocity in m/s: in its frame the receivers drift
    /// the other way.
    pub(super) fn drifting(
        &self,
        velocity: Vector2<f64>,
        most: usize,
    ) -> Option<Fit<Vector2<f64>>> {
        let stride = self.levels.len().div_ceil(most);
        let begin = self.levels.get(0)?.time;
        let drifted = |mut own: Reception| {
            own.receiver.position -= (velocity * (own.time - begin)).push(0.0);
            own
        };
        let drifted: Receptions = self.levels.iter().step_by(stride).map(drifted).collect();
        self.fit(velocity, &drifted)
    }

    fn fit<T>(&self, hypothesis: T, receptions: &Receptions) -> Option<Fit<T>> {
        let config = self.config;
        let compared: Vec<_> = LevelAt::of(receptions, 1).collect();
        let cost = |place: &Vector2<f64>| cost(&rows_at(&compared, place, config), config);
        let (place, cost) = best_place(&self.area, &self.start, REACH, cost);
        let rows = rows_at(&compared, &place, config);
        let residuals = residuals(&rows, config)?;
        let sigma_db = Law::of(&rows, config)?.sigma_db;
        cost.is_finite().then_some(Fit { hypothesis, place, residuals, sigma_db, cost })
    }
}

/// Returns the sum of the squared residuals, each of 4 σ at most, about the law that fits the
/// levels; `None` where they do not fall with the distance.
fn cost(rows: &[Row], config: &LocateConfig) -> Option<f64> {
    let law = Law::fit(rows.iter(), config)?;
    let limit = (4.0 * law.spread(rows).max(1.0)).powi(2);
    let square = |row: &Row| law.residual(row).powi(2).min(limit);
    (law.exponent > 0.0).then(|| rows.iter().map(square).sum())
}
