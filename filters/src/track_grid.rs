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
    vectorised::{Largest, Map, Sum, run},
};

/// A model that explains what was received of a moving target, however the target walks.
pub trait TrackModel {
    /// Prior weight of the model; the weights of all models need not sum to 1.
    fn weight(&self) -> f64 {
        1.0
    }

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
/// nothing drawn. Where several models or walks may hold, the answer is their average by their
/// evidence (Hoeting et al. 1999); a model's likelihoods are computed once for all walks. At the
/// first time the target may be anywhere between the receivers, and beyond them with a Cauchy
/// distribution of half their extent, or 1 km if that is more: one in ten is then ten times as far
/// away.
///
/// It holds 24 bytes for each cell and time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrackGrid {
    /// Initial reach of the search beyond the receivers, in metres: without a network at least
    /// twice the scale of the first place. It goes farther where the target does.
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
    /// The posterior probability of each model with each walk, model by model.
    pub probabilities: Vec<f64>,
    /// The probability of the outermost ring of all cells that were searched, averaged over time.
    pub border_mass: f64,
}

/// A model with a walk that is less probable does not move the answer.
const NEGLIGIBLE: f64 = 1e-3;

/// A model with a walk that is less probable is not looked at again.
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

/// Scales of that prior over which the search begins without a network, at least: a track beside
/// the one receiver of a transmitter of any power fits as well as one that is larger and faster.
const WITHIN: f64 = 2.0;

impl TrackGrid {
    /// The places at each of some times in seconds, ascending, from receivers that were at some
    /// places. Each of the `walks`, equally likely before, has the variance of the target's
    /// displacement over some seconds, on each axis, in m². `common` adds the part of the log
    /// likelihoods that all models share, as [`TrackModel::add_log_likelihoods`] does. It is
    /// evaluated once.
    ///
    /// # Errors
    ///
    /// [`BatchError::TooFew`] without a receiver, a time, a model or a walk, [`BatchError::Order`]
    /// where times do not ascend, [`BatchError::Flat`] where no place fits under any model, and
    /// [`BatchError::Parameter`] for a setting that is out of range.
    pub fn smooth(
        &self,
        receivers: &[Pose],
        times: &[f64],
        models: &[impl TrackModel],
        walks: &[impl Fn(f64) -> f64],
        common: impl Fn(usize, &Places<'_>, &mut [f64]),
    ) -> Result<TrackGridFix, BatchError> {
        self.smooth_watched(receivers, times, models, walks, common, &|_, _| {})
    }

    /// [`smooth`](Self::smooth) with a `watch` that is given how many steps are done, and how many
    /// there are at most. A step is one model with one walk at one time on the fine cells; those
    /// that turn out improbable take half as many.
    ///
    /// # Errors
    ///
    /// As [`smooth`](Self::smooth).
    pub fn smooth_watched(
        &self,
        receivers: &[Pose],
        times: &[f64],
        models: &[impl TrackModel],
        walks: &[impl Fn(f64) -> f64],
        common: impl Fn(usize, &Places<'_>, &mut [f64]),
        watch: &dyn Fn(usize, usize),
    ) -> Result<TrackGridFix, BatchError> {
        positive("margin_m", self.margin_m)?;
        require(self.max_cells >= 100, "max_cells", self.max_cells.into(), "at least 100")?;
        for (what, have) in [
            ("receivers", receivers.len()),
            ("times", times.len()),
            ("models", models.len()),
            ("walks", walks.len()),
        ] {
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
        let (searched, margin_m) = if is_network(receivers) {
            (SEARCHED_IN_A_NETWORK, self.margin_m)
        } else {
            (SEARCHED, self.margin_m.max(WITHIN * scale_m))
        };
        let search = Search {
            low,
            high,
            place: PlacePrior::NearReceivers { far_share: 0.0, reach: 1.0 },
            margin_m,
            cell_m: side_m / 64.0,
            max_cells: (self.max_cells / searched).max(100),
        };
        let every: Vec<usize> = (0..models.len() * walks.len()).collect();
        let coarse = search.cover(
            |grid| {
                Passes::over(grid, &log_prior, times, models, walks, &common, &|| {}).all(&every)
            },
            |smoothed| &smoothed.overall,
        )?;
        // What is far from likely on coarse cells is not on finer ones.
        let likely = |which: &usize| coarse.probabilities[*which] > UNLIKELY;
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
        let fine =
            Passes::over(grid, &log_prior, times, models, walks, &common, &step).all(&kept)?;
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
struct Passes<'a, M, W> {
    cells: Cells,
    times: &'a [f64],
    models: &'a [M],
    walks: &'a [W],
    /// The part of the log likelihoods that all models share, time by time.
    common: Vec<f64>,
    /// Called after each time of each pass.
    step: &'a dyn Fn(),
}

impl<'a, M: TrackModel, W: Fn(f64) -> f64> Passes<'a, M, W> {
    fn over(
        grid: Grid,
        log_prior: &impl Fn(&Vector2<f64>) -> f64,
        times: &'a [f64],
        models: &'a [M],
        walks: &'a [W],
        add_common: &impl Fn(usize, &Places<'_>, &mut [f64]),
        step: &'a dyn Fn(),
    ) -> Self {
        let cells = Cells::of(grid, log_prior);
        let mut common = vec![0.0; grid.len() * times.len()];
        for (time, common) in common.chunks_exact_mut(grid.len()).enumerate() {
            add_common(time, &cells.places(), common);
        }
        Self { cells, times, models, walks, common, step }
    }

    /// The average over some models with some walks, the others having no weight. They count
    /// walk by walk within each model, and ascend.
    fn all(&self, which: &[usize]) -> Result<Smoothed, BatchError> {
        let count = self.walks.len();
        let mut log_weights = vec![f64::NEG_INFINITY; self.models.len() * count];
        for which in which.chunk_by(|a, b| a / count == b / count) {
            let evidences = self.forwards(which, |_| {});
            for (&which, evidence) in which.iter().zip(evidences) {
                log_weights[which] = libm::log(self.models[which / count].weight()) + evidence;
            }
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
        for (which, &probability) in probabilities.iter().enumerate() {
            if probability >= NEGLIGIBLE {
                self.add_smoothed(which, probability / held, &mut sums);
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

    /// The variance of a walk's displacement from the time before.
    fn variance(&self, which: usize, time: usize) -> f64 {
        self.walks[which % self.walks.len()](self.times[time] - self.times[time - 1])
    }

    /// The logarithms of the evidence of one model with some walks; `keep` is given
    /// the masses at each time, walk by walk, given what was received until then.
    fn forwards(&self, which: &[usize], mut keep: impl FnMut(&[f64])) -> Vec<f64> {
        let Some(first) = which.first() else { return Vec::new() };
        let model = &self.models[first / self.walks.len()];
        let cells = &self.cells;
        let count = self.cells.grid.len();
        let mut masses = vec![cells.prior.clone(); which.len()];
        let mut before = vec![0.0; count];
        let mut scratch = vec![0.0; count];
        let mut likelihood = vec![0.0; count];
        let mut evidences = vec![0.0; which.len()];
        for time in 0..self.times.len() {
            likelihood.copy_from_slice(&self.common[time * count..][..count]);
            model.add_log_likelihoods(time, &cells.places(), &mut likelihood);
            let peak = run(Largest(&likelihood));
            let relative = |[]: [f64; 0], log: f64| elementary::exp(log - peak);
            run(Map { columns: [], of: relative, out: &mut likelihood });
            for ((&which, mass), evidence) in which.iter().zip(&mut masses).zip(&mut evidences) {
                if time > 0 {
                    before.copy_from_slice(mass);
                    cells.spread(&before, self.variance(which, time), &mut scratch, mass);
                }
                run(Map {
                    columns: [&likelihood],
                    of: |[factor]: [f64; 1], mass| mass * factor,
                    out: mass,
                });
                let total = normalise(mass);
                *evidence += if peak.is_finite() && total > 0.0 {
                    peak + libm::log(total)
                } else {
                    f64::NEG_INFINITY
                };
                keep(mass);
                (self.step)();
            }
        }
        evidences
    }

    /// Adds to `sums`, time by time, the masses given what was received at all times.
    fn add_smoothed(&self, which: usize, weight: f64, sums: &mut [f64]) {
        let cells = &self.cells;
        let count = self.cells.grid.len();
        let mut filtered = Vec::with_capacity(sums.len());
        self.forwards(&[which], |mass| filtered.extend_from_slice(mass));
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
            let variance = self.variance(which, time);
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
    let total = run(Sum(mass));
    if total > 0.0 {
        run(Map { columns: [], of: |[]: [f64; 0], mass| mass / total, out: mass });
    }
    total
}
