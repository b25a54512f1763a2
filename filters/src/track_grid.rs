use alloc::{vec, vec::Vec};
use core::cell::Cell;

use foxhunt_core::{
    Pose, elementary,
    parameter::{positive, require},
};
use nalgebra::Vector2;

use crate::{
    BatchError, PlacePrior, PosteriorMap,
    grid::blur,
    shadowing_grid::{Grid, Search, bounds},
};

/// A model that explains what was received of a moving target.
pub trait TrackModel {
    /// Prior weight of the model; the weights of all models need not sum to 1.
    fn weight(&self) -> f64 {
        1.0
    }

    /// The variance of the target's displacement over some seconds, on each axis, in m².
    fn variance(&self, seconds: f64) -> f64;

    /// Adds to `out`, for each place, the logarithm of the likelihood of what was received at a
    /// time, counted from 0.
    fn add_log_likelihoods(&self, time: usize, places: &Places<'_>, out: &mut [f64]);
}

/// Places that likelihoods are wanted of.
#[derive(Clone, Copy, Debug)]
pub struct Places<'a> {
    /// East in metres.
    pub east: &'a [f64],
    /// North in metres.
    pub north: &'a [f64],
    /// Each place stands for a square of this side, in metres, about it. While a wide area is
    /// searched cells may be larger than what a sharp likelihood is at: it has to be that of the
    /// square then, or it is missed between the places.
    pub cell_m: f64,
}

impl Places<'_> {
    /// The variance of a place within its square on each axis, in m².
    #[must_use]
    pub fn variance_m2(&self) -> f64 {
        self.cell_m * self.cell_m / 12.0
    }
}

/// Localiser of a moving target at each of some times, from all that was received: a hidden Markov
/// model over the cells of a grid (Rabiner 1989, section III; for tagged animals Pedersen,
/// Patterson, Thygesen & Madsen 2011).
///
/// The target walks at random; at each time a place has the likelihood that a [`TrackModel`]
/// gives it, of any shape. Filtered forwards and smoothed backwards, nothing is linearised and
/// nothing drawn. Where several models may hold, the answer is their average by their evidence
/// (Hoeting et al. 1999). At the first time the target may be anywhere between the receivers,
/// and beyond them with a Cauchy distribution of half their extent, or 1 km if that is more: one in
/// ten is then ten times as far away.
///
/// It holds 24 bytes for each cell and time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrackGrid {
    /// Initial reach of the search beyond the receivers, in metres; it goes farther where the
    /// target does.
    pub margin_m: f64,
    /// The most cells, at least 100; the search for the area has a quarter of
    /// them among three receivers or more, else a sixteenth.
    pub max_cells: u32,
}

/// A margin of 200 m, 6400 cells.
impl Default for TrackGrid {
    fn default() -> Self {
        Self { margin_m: 200.0, max_cells: 6400 }
    }
}

/// The result of a [`TrackGrid`].
#[derive(Clone, Debug, PartialEq)]
pub struct TrackGridFix {
    /// The posterior at each time, given what was received at all of them.
    pub maps: Vec<PosteriorMap>,
    /// The posterior probability of each model.
    pub probabilities: Vec<f64>,
    /// The probability of the outermost ring of all cells that were searched, averaged over time.
    pub border_mass: f64,
}

/// A model that is less probable does not move the answer.
const NEGLIGIBLE: f64 = 1e-3;

/// A model that is less probable is not looked at again.
const UNLIKELY: f64 = 1e-4;

/// Factor by which the search for the area has fewer cells among the receivers of a network. On
/// cells as large as the receivers are apart, a target among them looks no more probable than one
/// far away.
const SEARCHED_IN_A_NETWORK: u32 = 4;

/// The factor with one or two receivers, whose levels and bearings leave a ridge: the wide cells
/// cover what no single law of propagation explains.
const SEARCHED: u32 = 16;

/// Receivers farther apart than this, in metres, are different ones.
const APART_M: f64 = 50.0;

/// Returns true if the receivers were at three places or more.
fn is_network(receivers: &[Pose]) -> bool {
    let mut places: Vec<Vector2<f64>> = Vec::new();
    receivers.iter().any(|receiver| {
        let here = receiver.position.xy();
        if places.iter().all(|place| (place - here).norm() > APART_M) {
            places.push(here);
        }
        places.len() >= 3
    })
}

/// The least scale of the prior of the first place.
const NEAR_M: f64 = 1000.0;

impl TrackGrid {
    /// The places at each of some times in seconds, ascending, from receivers that were at some
    /// places. `common` adds the part of the log likelihoods that all models share, as
    /// [`TrackModel::add_log_likelihoods`] does; it is evaluated once.
    ///
    /// # Errors
    ///
    /// [`BatchError::TooFew`] without a receiver, a time or a model, [`BatchError::Order`] where
    /// times do not ascend, [`BatchError::Flat`] where no place fits under any model, and
    /// [`BatchError::Parameter`] for a setting that is out of range.
    pub fn smooth(
        &self,
        receivers: &[Pose],
        times: &[f64],
        models: &[impl TrackModel],
        common: impl Fn(usize, &Places<'_>, &mut [f64]),
    ) -> Result<TrackGridFix, BatchError> {
        self.smooth_watched(receivers, times, models, common, &|_, _| {})
    }

    /// [`smooth`](Self::smooth) with a `watch` that is given how many steps are done, and how many
    /// there are at most. A step is one model at one time on the fine cells, which is nearly all
    /// of the work; models that turn out improbable take half as many.
    ///
    /// # Errors
    ///
    /// As [`smooth`](Self::smooth).
    pub fn smooth_watched(
        &self,
        receivers: &[Pose],
        times: &[f64],
        models: &[impl TrackModel],
        common: impl Fn(usize, &Places<'_>, &mut [f64]),
        watch: &dyn Fn(usize, usize),
    ) -> Result<TrackGridFix, BatchError> {
        positive("margin_m", self.margin_m)?;
        require(self.max_cells >= 100, "max_cells", self.max_cells.into(), "at least 100")?;
        for (what, have) in
            [("receivers", receivers.len()), ("times", times.len()), ("models", models.len())]
        {
            crate::batch::at_least(what, have, 1)?;
        }
        for (index, pair) in (1..).zip(times.windows(2)) {
            let seconds = pair[1] - pair[0];
            if !(seconds > 0.0 && seconds.is_finite()) {
                return Err(BatchError::Order { index, seconds });
            }
        }
        let (low, high) = bounds(receivers.iter().map(|receiver| receiver.position.xy()));
        let scale_m = (0.5 * (high - low).norm()).max(NEAR_M);
        let log_prior = |place: &Vector2<f64>| {
            let beyond = (low - place).sup(&(place - high)).sup(&Vector2::zeros()).norm();
            -1.5 * libm::log1p((beyond / scale_m) * (beyond / scale_m))
        };
        let side_m = (high - low).norm() + self.margin_m;
        let searched = if is_network(receivers) { SEARCHED_IN_A_NETWORK } else { SEARCHED };
        let search = Search {
            low,
            high,
            place: PlacePrior::NearReceivers,
            margin_m: self.margin_m,
            cell_m: side_m / 64.0,
            max_cells: (self.max_cells / searched).max(100),
        };
        let every: Vec<usize> = (0..models.len()).collect();
        let coarse = search.cover(
            |grid| Passes::over(grid, &log_prior, times, models, &common, &|| {}).all(&every),
            |smoothed| &smoothed.overall,
        )?;
        // What is far from likely on coarse cells is not on finer ones.
        let likely = |m: &usize| coarse.probabilities[*m] > UNLIKELY;
        let kept: Vec<usize> = every.into_iter().filter(likely).collect();
        let border_mass = coarse.overall.border_mass();
        let (from, to) = coarse.overall.without(0.0);
        let grid = Grid::over(from, to, side_m / 256.0, self.max_cells);
        let most = 2 * kept.len() * times.len();
        let done = Cell::new(0);
        let step = || {
            done.set(done.get() + 1);
            watch(done.get(), most);
        };
        let fine = Passes::over(grid, &log_prior, times, models, &common, &step).all(&kept)?;
        Ok(TrackGridFix { maps: fine.maps, probabilities: fine.probabilities, border_mass })
    }
}

/// The cells of a grid, as columns.
struct Cells {
    grid: Grid,
    east: Vec<f64>,
    north: Vec<f64>,
    prior: Vec<f64>,
}

impl Cells {
    fn of(grid: Grid, log_prior: &impl Fn(&Vector2<f64>) -> f64) -> Self {
        let places: Vec<Vector2<f64>> = (0..grid.len()).map(|cell| grid.centre(cell)).collect();
        let mut prior: Vec<f64> = places.iter().map(|place| libm::exp(log_prior(place))).collect();
        normalise(&mut prior);
        let (east, north) = places.iter().map(|place| (place.x, place.y)).unzip();
        Self { grid, east, north, prior }
    }

    fn places(&self) -> Places<'_> {
        Places { east: &self.east, north: &self.north, cell_m: self.grid.cell_m() }
    }

    /// Spreads masses by a random walk; the variance is in m².
    fn spread(&self, from: &[f64], variance_m2: f64, scratch: &mut [f64], into: &mut [f64]) {
        let columns = self.grid.columns();
        let variance = variance_m2 / self.grid.cell_m().powi(2);
        blur(from, scratch, columns, 0, variance);
        blur(scratch, into, columns, 1, variance);
    }
}

/// Result of all models together on one grid.
struct Smoothed {
    maps: Vec<PosteriorMap>,
    /// The mean of the maps.
    overall: PosteriorMap,
    probabilities: Vec<f64>,
}

/// Forward and backward passes over one grid.
struct Passes<'a, M> {
    cells: Cells,
    times: &'a [f64],
    models: &'a [M],
    /// The part of the log likelihoods that all models share, time by time.
    common: Vec<f64>,
    /// Called after each time of each pass.
    step: &'a dyn Fn(),
}

impl<'a, M: TrackModel> Passes<'a, M> {
    fn over(
        grid: Grid,
        log_prior: &impl Fn(&Vector2<f64>) -> f64,
        times: &'a [f64],
        models: &'a [M],
        add_common: &impl Fn(usize, &Places<'_>, &mut [f64]),
        step: &'a dyn Fn(),
    ) -> Self {
        let cells = Cells::of(grid, log_prior);
        let mut common = vec![0.0; grid.len() * times.len()];
        for (time, common) in common.chunks_exact_mut(grid.len()).enumerate() {
            add_common(time, &cells.places(), common);
        }
        Self { cells, times, models, common, step }
    }

    /// The average over some models, the others having no weight.
    fn all(&self, which: &[usize]) -> Result<Smoothed, BatchError> {
        let mut log_weights = vec![f64::NEG_INFINITY; self.models.len()];
        for &m in which {
            let model = &self.models[m];
            log_weights[m] = libm::log(model.weight()) + self.forwards(model, |_| {});
        }
        let best = log_weights.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        if !best.is_finite() {
            return Err(BatchError::Flat { rcond: 0.0 });
        }
        let mut probabilities: Vec<f64> =
            log_weights.iter().map(|log| libm::exp(log - best)).collect();
        normalise(&mut probabilities);
        let cells = self.cells.grid.len();
        let mut sums = vec![0.0; cells * self.times.len()];
        let held: f64 = probabilities.iter().filter(|&&weight| weight >= NEGLIGIBLE).sum();
        for (model, &probability) in self.models.iter().zip(&probabilities) {
            if probability >= NEGLIGIBLE {
                self.add_smoothed(model, probability / held, &mut sums);
            }
        }
        let mut overall = vec![0.0; cells];
        for sums in sums.chunks_exact(cells) {
            overall.iter_mut().zip(sums).for_each(|(overall, mass)| *overall += mass);
        }
        normalise(&mut overall);
        let map = |mass: Vec<f64>| PosteriorMap::new(self.cells.grid, mass);
        let maps = sums.chunks_exact(cells).map(|mass| map(mass.to_vec())).collect();
        Ok(Smoothed { maps, overall: map(overall), probabilities })
    }

    /// The logarithm of the evidence of a model; `keep` is given the masses at each time, given
    /// what was received until then.
    fn forwards(&self, model: &M, mut keep: impl FnMut(&[f64])) -> f64 {
        let cells = &self.cells;
        let count = self.cells.grid.len();
        let mut mass = cells.prior.clone();
        let mut scratch = vec![0.0; count];
        let mut log = vec![0.0; count];
        let mut evidence = 0.0;
        for (time, &seconds) in self.times.iter().enumerate() {
            if time > 0 {
                let before = mass.clone();
                let variance = model.variance(seconds - self.times[time - 1]);
                cells.spread(&before, variance, &mut scratch, &mut mass);
            }
            log.copy_from_slice(&self.common[time * count..][..count]);
            model.add_log_likelihoods(time, &cells.places(), &mut log);
            let peak = log.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            let weigh = |(mass, log): (&mut f64, &f64)| *mass *= elementary::exp(log - peak);
            mass.iter_mut().zip(&log).for_each(weigh);
            let total = normalise(&mut mass);
            if !(peak.is_finite() && total > 0.0) {
                return f64::NEG_INFINITY;
            }
            evidence += peak + libm::log(total);
            keep(&mass);
            (self.step)();
        }
        evidence
    }

    /// Adds to `sums`, time by time, the masses given what was received at all times.
    fn add_smoothed(&self, model: &M, weight: f64, sums: &mut [f64]) {
        let cells = &self.cells;
        let count = self.cells.grid.len();
        let mut filtered = Vec::with_capacity(sums.len());
        self.forwards(model, |mass| filtered.extend_from_slice(mass));
        let mut later = vec![1.0; count];
        let mut scratch = vec![0.0; count];
        let mut predicted = vec![0.0; count];
        for (time, sums) in sums.chunks_exact_mut(count).enumerate().rev() {
            // `later` is what the times after this one multiply its filtered masses by.
            let (before, here) = filtered.split_at(time * count);
            let mut mass: Vec<f64> = here.iter().zip(&later).map(|(f, l)| f * l).collect();
            normalise(&mut mass);
            sums.iter_mut().zip(&mass).for_each(|(sum, mass)| *sum += weight * mass);
            if time == 0 {
                break;
            }
            let variance = model.variance(self.times[time] - self.times[time - 1]);
            let before = &before[(time - 1) * count..];
            cells.spread(before, variance, &mut scratch, &mut predicted);
            for (mass, predicted) in mass.iter_mut().zip(&predicted) {
                *mass = if *predicted > 0.0 { *mass / predicted } else { 0.0 };
            }
            cells.spread(&mass, variance, &mut scratch, &mut later);
        }
    }
}

/// Divides by the sum, which it returns; leaves what sums to nothing.
fn normalise(mass: &mut [f64]) -> f64 {
    let total: f64 = mass.iter().sum();
    if total > 0.0 {
        mass.iter_mut().for_each(|mass| *mass /= total);
    }
    total
}
