//! An antenna's pattern out of recorded turns.

use alloc::{collections::BTreeMap, vec::Vec};
use core::f64::consts::{PI, TAU};

use foxhunt_core::{
    Sweep,
    angle::{self, Resultant},
};
use nalgebra::{DMatrix, DVector};

use crate::{PatternTable, PatternTableError};

/// Minimum number of positions to learn from.
const FEWEST: usize = 16;

/// Minimum number of positions of a turn.
const FEWEST_OF_TURN: usize = 4;

/// Maximum number of harmonics: no stepper's antenna is finer than 7.5°.
const MOST_HARMONICS: u16 = 24;

/// A sector of this width without a reading leaves three harmonics.
const WIDEST_GAP: f64 = PI / 3.0;

/// Reason that no pattern can be learned from recorded turns.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum LearnPatternError {
    /// A number is NaN or infinite.
    #[error("turn {turn} has the {field} {value}, not a finite number")]
    NotFinite {
        /// Index of the turn, from 0.
        turn: usize,
        /// Name of the field.
        field: &'static str,
        /// Value of the field.
        value: f64,
    },
    /// There are too few directions to fit anything to.
    #[error("{directions} directions have readings; at least {needed} are needed")]
    TooFew {
        /// Number of positions with a reading, in all turns together.
        directions: usize,
        /// Number of positions that are needed.
        needed: usize,
    },
    /// Too wide a sector has no reading in any of the turns.
    #[error(
        "no readings over {gap_deg:.1}° off boresight on; at most {limit_deg:.1}° may be \
         missing"
    )]
    Gap {
        /// Width of the widest sector without a reading, in degrees.
        gap_deg: f64,
        /// Largest width that is allowed, in degrees.
        limit_deg: f64,
    },
    /// The level does not depend on the direction, as far as the noise lets see.
    #[error("the turns show no direction: a flat pattern explains them best")]
    Flat,
    /// The levels swing by more than an antenna's can.
    #[error("the fitted pattern is not a valid antenna pattern: {0}")]
    Pattern(#[from] PatternTableError),
}

/// A pattern out of recorded turns.
#[derive(Clone, Debug, PartialEq)]
pub struct LearnedPattern {
    /// The gain in dB about its mean over the turn, in rows of 1°.
    pub table: PatternTable,
    /// Number of harmonics.
    pub harmonics: u16,
    /// The standard deviation in dB of the positions' levels about it.
    pub sigma_db: f64,
    /// Number of positions with a reading that it was learned from, in all turns together.
    pub directions: usize,
}

/// One direction that was received in one turn.
#[derive(Clone, Copy, Debug)]
struct Direction {
    /// Direction of the transmitter, in radians counter-clockwise of the boresight.
    azimuth: f64,
    /// Level in dB, about the mean of its turn.
    level_db: f64,
    /// Index of the turn.
    turn: usize,
}

/// A Fourier series without a constant, aₖ cos kα + bₖ sin kα.
#[derive(Clone, Debug)]
struct Series {
    /// a₁, b₁, a₂, b₂, …
    coefficients: Vec<f64>,
    harmonics: u16,
    /// Standard deviation of the residuals, in dB.
    sigma_db: f64,
}

impl Series {
    /// The least-squares series with the number of harmonics, at most `most`, that minimises the
    /// generalised cross-validation n RSS / (n − p)² (Golub, Heath & Wahba 1979); [`None`] where
    /// that number is zero. Each turn has a level of its own, which is one of the p parameters.
    fn fit(directions: &[Direction], turns: usize, most: u16) -> Option<Self> {
        let columns = 2 * usize::from(most);
        let mut design = DMatrix::zeros(directions.len(), columns);
        for (i, direction) in directions.iter().enumerate() {
            for (j, value) in harmonics(direction.azimuth, most).enumerate() {
                design[(i, j)] = value;
            }
        }
        // Regressors about their turns' means stand for the turns' own levels (Frisch & Waugh
        // 1933).
        for mut column in design.column_iter_mut() {
            centre(directions, turns, |i| column[i])
                .into_iter()
                .enumerate()
                .for_each(|(i, centred)| column[i] = centred);
        }
        let levels = DVector::from_vec(centre(directions, turns, |i| directions[i].level_db));
        let total = levels.norm_squared();
        let qr = design.qr();
        // One factorisation serves every number of harmonics: RSS falls by the squares of Qᵀy.
        let mut rotated = levels;
        qr.q_tr_mul(&mut rotated);
        let count = real(directions.len());
        let validate = |explained: f64, parameters: usize| {
            let freedom = count - real(parameters + turns);
            count * (total - explained).max(0.0) / (freedom * freedom)
        };
        let mut best = (validate(0.0, 0), 0, 0.0);
        let mut explained = 0.0;
        for harmonics in 1..=most {
            let parameters = 2 * usize::from(harmonics);
            explained += rotated.rows(parameters - 2, 2).norm_squared();
            let score = validate(explained, parameters);
            if score < best.0 {
                best = (score, harmonics, explained);
            }
        }
        let (_, harmonics, explained) = best;
        let parameters = 2 * usize::from(harmonics);
        let upper = qr.r().view((0, 0), (parameters, parameters)).into_owned();
        let solved = upper.solve_upper_triangular(&rotated.rows(0, parameters).into_owned())?;
        let freedom = count - real(parameters + turns);
        let sigma_db = libm::sqrt((total - explained).max(0.0) / freedom);
        let coefficients = solved.iter().copied().collect();
        (harmonics > 0).then_some(Self { coefficients, harmonics, sigma_db })
    }

    fn at(&self, azimuth: f64) -> f64 {
        harmonics(azimuth, self.harmonics).zip(&self.coefficients).map(|(h, c)| h * c).sum()
    }
}

/// Learns an antenna's pattern from turns whose transmitter lies in a known direction: pairs of a
/// turn and its true bearing, in radians in the world frame.
///
/// The level over the angle off boresight is a Fourier series in dB, fitted to the mean levels of
/// all positions with a level of its own for each turn, so that turns at different ranges may be
/// put together. Generalised cross-validation chooses the number of harmonics (Golub, Heath & Wahba
/// 1979); at most π over the width of the widest sector without a reading, which resolves no more.
///
/// # Errors
///
/// [`LearnPatternError`] where a number is not finite, too little of the circle was received, or
/// the turns show no direction.
pub fn learn_pattern(turns: &[(Sweep<'_>, f64)]) -> Result<LearnedPattern, LearnPatternError> {
    let mut directions = Vec::new();
    for (turn, (sweep, bearing)) in turns.iter().enumerate() {
        let before = directions.len();
        measured(turn, sweep, *bearing, &mut directions)?;
        // A turn has a level of its own, so that few positions of it do not show the shape.
        if directions.len() - before < FEWEST_OF_TURN {
            directions.truncate(before);
        }
    }
    let count = directions.len();
    if count < FEWEST {
        return Err(LearnPatternError::TooFew { directions: count, needed: FEWEST });
    }
    let gap = widest_gap(&directions);
    if gap > WIDEST_GAP {
        let gap_deg = gap.to_degrees();
        let limit_deg = WIDEST_GAP.to_degrees();
        return Err(LearnPatternError::Gap { gap_deg, limit_deg });
    }
    // Half as many parameters as directions at most, the turns' levels among them.
    let spare = count.saturating_sub(2 * turns.len()) / 4;
    let most = (1..=MOST_HARMONICS)
        .take_while(|k| f64::from(*k) * gap <= PI && usize::from(*k) <= spare)
        .last()
        .ok_or(LearnPatternError::TooFew { directions: count, needed: 2 * turns.len() + 4 })?;
    let series = Series::fit(&directions, turns.len(), most).ok_or(LearnPatternError::Flat)?;
    let gains: Vec<f64> =
        (0..360_u16).map(|degree| series.at(f64::from(degree).to_radians())).collect();
    Ok(LearnedPattern {
        table: PatternTable::equally_spaced(&gains)?,
        harmonics: series.harmonics,
        sigma_db: series.sigma_db,
        directions: count,
    })
}

/// Adds each position of a turn with its mean level and direction.
fn measured(
    turn: usize,
    sweep: &Sweep<'_>,
    bearing: f64,
    directions: &mut Vec<Direction>,
) -> Result<(), LearnPatternError> {
    let finite = |field, value: f64| {
        let refused = LearnPatternError::NotFinite { turn, field, value };
        if value.is_finite() { Ok(value) } else { Err(refused) }
    };
    finite("true bearing", bearing)?;
    let mut positions: BTreeMap<u16, (Resultant, f64, f64)> = BTreeMap::new();
    for sample in sweep.samples {
        let level = finite("rss_dbm", sample.rss_dbm)?;
        let boresight = finite("boresight", sample.boresight)?;
        let (towards, sum, count) = positions.entry(sample.position).or_default();
        towards.add(bearing - boresight, 1.0);
        *sum += level;
        *count += 1.0;
    }
    directions.extend(positions.into_values().filter_map(|(towards, sum, count)| {
        Some(Direction { azimuth: towards.direction(1e-9)?, level_db: sum / count, turn })
    }));
    Ok(())
}

/// The widest sector without a direction, in radians.
fn widest_gap(directions: &[Direction]) -> f64 {
    let mut azimuths: Vec<f64> = directions.iter().map(|d| angle::wrap(d.azimuth)).collect();
    azimuths.sort_by(f64::total_cmp);
    let across = azimuths.first().zip(azimuths.last()).map_or(TAU, |(a, b)| a + TAU - b);
    azimuths.windows(2).map(|pair| pair[1] - pair[0]).fold(across, f64::max)
}

/// cos α, sin α, cos 2α, sin 2α, …
fn harmonics(azimuth: f64, count: u16) -> impl Iterator<Item = f64> {
    (1..=count).flat_map(move |k| {
        let angle = f64::from(k) * azimuth;
        [libm::cos(angle), libm::sin(angle)]
    })
}

#[expect(clippy::cast_precision_loss, reason = "far fewer than 2^52 rows and columns")]
fn real(count: usize) -> f64 {
    count as f64
}

/// A value of each direction about its mean over the direction's turn.
fn centre(directions: &[Direction], turns: usize, value: impl Fn(usize) -> f64) -> Vec<f64> {
    let mut sums = alloc::vec![(0.0, 0.0); turns];
    for (i, direction) in directions.iter().enumerate() {
        let (sum, count) = &mut sums[direction.turn];
        *sum += value(i);
        *count += 1.0;
    }
    let about = |(i, direction): (usize, &Direction)| {
        let (sum, count) = sums[direction.turn];
        value(i) - sum / count
    };
    directions.iter().enumerate().map(about).collect()
}
