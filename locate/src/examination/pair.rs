use foxhunt_core::{Receptions, Remark};
use nalgebra::Vector2;

use super::{
    super::{Area, LocateConfig, Power, area::extent_m, path::is_of_network},
    law::{LevelAt, spread, square_about},
    paths::MOST_PER_HYPOTHESIS,
    shadowing::{FINER_STEP, Shadowed, Shape},
    shared::spoken,
};

/// Twice the logarithm of the likelihood ratio from which on there are two transmitters: χ² with
/// three degrees of freedom exceeds it once in 700,000. Some thousand pairs of places are tried.
const TWO: f64 = 30.0;

/// Twice the logarithm of the likelihood ratio from which on two places are moved to where they are
/// likelier.
const WORTHWHILE: f64 = 10.0;

/// Cells of the coarse search for two places, on either side of the area's middle.
const REACH: i32 = 4;

/// Rounds about the best places, each finer than the one before: by the squares of the residuals,
/// and by their likelihood.
const FINER: [u32; 2] = [6, 4];

/// Rounds in which levels are given to the transmitter that is the stronger one there.
const ROUNDS: usize = 4;

/// Fewer levels than this show no transmitter.
const LEAST_OF_ONE: usize = 8;

/// Levels of which each is the stronger transmitter's.
struct Levels<'a> {
    at: &'a [LevelAt],
    shape: Shape,
    power: Power,
}

/// Law of two transmitters, which share the exponent.
struct Fit {
    /// Residuals of all levels.
    residuals: Vec<f64>,
    /// Number of levels of each.
    counts: [usize; 2],
}

impl Fit {
    /// Sum of the squared residuals, each of 4 σ at most.
    fn square(&self) -> f64 {
        let limit = 4.0 * spread(self.residuals.iter().copied()).max(1.0);
        self.residuals.iter().map(|residual| residual.abs().min(limit).powi(2)).sum()
    }
}

impl Levels<'_> {
    fn losses(&self, place: &Vector2<f64>) -> Vec<f64> {
        self.shape.losses(self.at, place)
    }

    /// Returns the law of least squares with the losses from either place: at first each level is
    /// that of the nearer place. `None` where a place has no levels of its own, or levels do not
    /// fall with the distance.
    fn fit(&self, [first, second]: [&[f64]; 2]) -> Option<Fit> {
        let losses = || first.iter().zip(second);
        let mut is_second: Vec<bool> = losses().map(|(first, second)| second > first).collect();
        let mut references_dbm = [0.0; 2];
        let mut exponent = 0.0;
        for _ in 0..ROUNDS {
            // The count and the sums of loss, level, loss², and loss times level.
            let mut sums = [[0.0; 5]; 2];
            for ((at, (first, second)), &is_second) in self.at.iter().zip(losses()).zip(&is_second)
            {
                let loss = if is_second { second } else { first };
                let terms = [1.0, *loss, at.level, loss * loss, loss * at.level];
                let sums = &mut sums[usize::from(is_second)];
                sums.iter_mut().zip(terms).for_each(|(sum, term)| *sum += term);
            }
            if sums.iter().any(|[count, ..]| *count <= 0.0) {
                return None;
            }
            exponent = match self.power {
                Power::Free => {
                    let both = |of: fn(&[f64; 5]) -> f64| sums.iter().map(of).sum::<f64>();
                    both(|[count, loss, level, _, product]| product - loss * level / count)
                        / both(|[count, loss, _, square, _]| square - loss * loss / count)
                }
                Power::FreeReference { .. } | Power::Known { .. } | Power::Calibrated(_) => {
                    self.power.exponent()
                }
            };
            if exponent.is_nan() || exponent <= 0.0 {
                return None;
            }
            references_dbm = sums.map(|[count, loss, level, ..]| (level - exponent * loss) / count);
            let mut is_settled = true;
            for ((first, second), is_second) in losses().zip(&mut is_second) {
                let [first, second] = [first, second].map(|loss| exponent * loss);
                let now = references_dbm[1] + second > references_dbm[0] + first;
                is_settled &= now == *is_second;
                *is_second = now;
            }
            if is_settled {
                break;
            }
        }
        let residual = |(at, (first, second)): (&LevelAt, (&f64, &f64))| {
            let first = references_dbm[0] + exponent * first;
            at.level - first.max(references_dbm[1] + exponent * second)
        };
        let of_second = is_second.iter().filter(|is_second| **is_second).count();
        let counts = [is_second.len() - of_second, of_second];
        (counts.iter().all(|count| *count >= LEAST_OF_ONE)).then(|| Fit {
            residuals: self.at.iter().zip(losses()).map(residual).collect(),
            counts,
        })
    }

    /// Moves both places in turn to where they cost less, in ever finer steps.
    fn refine(
        &self,
        places: &mut [Vector2<f64>; 2],
        mut step: f64,
        rounds: u32,
        cost: impl Fn(&Fit) -> f64,
    ) {
        let mut least = f64::INFINITY;
        for _ in 0..rounds {
            for moved in [0, 1] {
                let centre = places[moved];
                let other = self.losses(&places[1 - moved]);
                for place in square_about(centre, step, 2) {
                    let own = self.losses(&place);
                    let both = if moved == 0 { [&own[..], &other] } else { [&other[..], &own] };
                    let cost = self.fit(both).map_or(f64::INFINITY, |fit| cost(&fit));
                    if cost < least {
                        least = cost;
                        places[moved] = place;
                    }
                }
            }
            step *= FINER_STEP;
        }
    }

    /// Returns the pair of cells with the least squared residuals.
    fn best_of_cells(&self, middle: Vector2<f64>, step: f64) -> Option<[Vector2<f64>; 2]> {
        let cells: Vec<(Vector2<f64>, Vec<f64>)> = square_about(middle, step, REACH)
            .into_iter()
            .map(|place| (place, self.losses(&place)))
            .collect();
        let mut best = (f64::INFINITY, None);
        for (number, (first, of_first)) in cells.iter().enumerate() {
            for (second, of_second) in cells.iter().skip(number + 1) {
                let Some(fit) = self.fit([of_first, of_second]) else { continue };
                let square = fit.square();
                if square < best.0 {
                    best = (square, Some([*first, *second]));
                }
            }
        }
        best.1
    }
}

/// Returns true where two transmitters may be looked for: walls between the receivers of a network,
/// antennas and terrain look like a second one.
pub(super) fn may_be_two(receptions: &Receptions, config: &LocateConfig) -> bool {
    let bends = config.pattern.is_some() || config.antenna.is_some() || config.terrain.is_some();
    !bends && !is_of_network(receptions, extent_m(receptions))
}

/// Returns a remark with twice the logarithm of its likelihood ratio if the levels fit two
/// transmitters far better than one, each level being that of the stronger one.
pub(super) fn two_transmitters(
    shadowed: &Shadowed<'_>,
    receptions: &Receptions,
    config: &LocateConfig,
) -> Option<(f64, Remark)> {
    let stride = receptions.len().div_ceil(MOST_PER_HYPOTHESIS);
    let few: Vec<LevelAt> = LevelAt::of(receptions, stride).collect();
    let levels_of = |at| Levels { at, shape: shadowed.shape, power: config.power };
    let (middle, half) = Area::about(receptions, 0.0).square();
    let step = half / f64::from(REACH);
    let mut places = levels_of(&few).best_of_cells(middle, step)?;
    let levels = levels_of(&shadowed.levels);
    let fit = |places: [Vector2<f64>; 2]| {
        let [first, second] = places.map(|place| levels.losses(&place));
        levels.fit([&first, &second])
    };
    let likelihood = |fit: &Fit| shadowed.log_likelihood(&fit.residuals);
    levels.refine(&mut places, 0.5 * step, FINER[0], Fit::square);
    if 2.0 * (likelihood(&fit(places)?) - shadowed.of_one) < WORTHWHILE {
        return None;
    }
    levels.refine(&mut places, 0.1 * step, FINER[1], |fit| -likelihood(fit));
    let fit = fit(places)?;
    let ratio = |of_one| 2.0 * (likelihood(&fit) - of_one);
    if ratio(shadowed.of_one) < TWO {
        return None;
    }
    let ratio = ratio(shadowed.of_likeliest());
    let share = |count| 100 * count / levels.at.len().max(1);
    let [first, second] = fit.counts.map(share);
    let text = format!(
        "the levels fit two transmitters on one frequency far better than one: one at {} that is \
         the stronger one for {first} % of the levels, and one at {} for {second} %; the place may \
         be of neither: locate each by the levels near it",
        spoken(&places[0]),
        spoken(&places[1]),
    );
    (ratio >= TWO).then(|| (ratio, Remark::new("two-transmitters", text)))
}
