use alloc::{collections::BTreeMap, vec::Vec};
use core::f64::consts::{PI, TAU};

use foxhunt_core::{
    Sweep,
    angle::{self, Resultant},
};

use super::{
    LearnPatternError,
    series::{Direction, Series},
};
use crate::PatternTable;

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

/// Minimum number of positions to learn from.
const FEWEST: usize = 16;

/// Minimum number of positions of a turn.
const FEWEST_OF_TURN: usize = 4;

/// Maximum number of harmonics: no stepper's antenna is finer than 7.5°.
const MOST_HARMONICS: u16 = 24;

/// A sector of this width without a reading leaves three harmonics.
const WIDEST_GAP: f64 = PI / 3.0;

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
