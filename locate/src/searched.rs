use std::collections::BTreeMap;

use foxhunt_core::{Receptions, noise::log_normal_cdf};
use nalgebra::{Vector2, Vector3};
use serde::Serialize;

use super::{LocateConfig, Power, area::Area, loss_db};

/// Side of a square in which shadowing is common, in metres: its silences count as one.
const SQUARE_M: f64 = 25.0;

/// Number of squares; beyond, they are larger.
const MOST_SQUARES: usize = 400;

/// Number of cells along a side of the area.
const SIDE: u32 = 64;

/// Number of blocks of cells along a side of the area.
const BLOCKS: u32 = 16;

/// Number of places along a side of the area among which the next one is chosen.
const PLACES: u32 = 32;

/// Ranges of an unknown power: the least and the largest in metres, and how many to a decade.
const RANGES: (f64, f64, f64) = (10.0, 10_000.0, 8.0);

/// Log-probability of silence below which more silences change nothing.
const SURE: f64 = -12.0;

/// σ of levels below which they are rounding, in dB.
const LEAST_SIGMA_DB: f64 = 1.0;

/// Area that was searched without a reception, in the words of search and rescue (Koopman 1980):
/// the probability that the transmitter is in a cell (POA), that it would have been received from
/// there (POD), and both (POS).
#[derive(Clone, Debug, PartialEq)]
pub struct Searched {
    /// The corner of all cells that is farthest south and west, in metres.
    pub corner: Vector2<f64>,
    /// Side of a cell in metres.
    pub cell_m: f64,
    /// Number of cells from west to east, and from south to north.
    pub columns: usize,
    /// Probability that a transmitter in each cell would have been received, row by row from the
    /// south.
    pub pod: Vec<f64>,
    /// Probability of success: that it would have been received, wherever it is in the area.
    pub pos: f64,
    /// Probability of success for each power, by the range at which its level meets the floor.
    pub by_range: Vec<RangeSearched>,
    /// Path-loss exponent that levels were taken to fall by.
    pub exponent: f64,
    /// Number of silences.
    pub silences: usize,
    /// Number of squares of 25 m that they count as.
    pub segments: usize,
    /// Probability that the transmitter is in a block of cells, has a power and was missed: block
    /// by block from the south-west, power by power.
    missed: Vec<f64>,
    /// Reference powers of a transmitter, in dBm.
    powers_dbm: Vec<f64>,
    /// Mean silence of the search.
    like: Silent,
    /// Height of a transmitter in metres.
    target_up_m: f64,
}

/// Place where the next turn is worth most.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NextPlace {
    /// East and North in metres.
    pub place: Vector2<f64>,
    /// Probability that a transmitter that was missed would be received there.
    pub pod: f64,
}

/// Probability of success for a transmitter of a given power.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct RangeSearched {
    /// Range at which its level meets the floor, in metres.
    pub range_m: f64,
    /// Probability that it would have been received, wherever it is in the area.
    pub pos: f64,
    /// Share of the area in which it would have been received with 95 %.
    pub searched_95: f64,
}

/// Silence of a receiver.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Silent {
    pub place: Vector3<f64>,
    floor_dbm: f64,
    sigma_db: f64,
}

impl Searched {
    /// Returns what a search has looked through in which nothing was received: no level, no
    /// bearing, nothing else. `None` if something was, or if there is no silence.
    ///
    /// The transmitter may be anywhere within [`LocateConfig::margin_m`] of the receivers. A power
    /// that is not known is one of all ranges from 10 m to 10 km, each decade as probable as the
    /// others. Levels fade by the σ of each silence, alike within squares of 25 m.
    #[must_use]
    pub fn in_silence(receptions: &Receptions, config: &LocateConfig) -> Option<Self> {
        let (segments, silences) = silences(receptions)?;
        let (centre, half_side) = Area::about(receptions, config.margin_m).square();
        let columns = SIDE as usize;
        let cell_m = 2.0 * half_side / f64::from(SIDE);
        let corner = centre - Vector2::repeat(half_side);
        let exponent = config.power.exponent();
        let floor_dbm = mean(segments.iter().map(|silent| silent.floor_dbm));
        // Reference powers, each with its range at the mean floor.
        let powers = powers(config.power, floor_dbm, exponent);
        let mut pod = Vec::with_capacity(columns * columns);
        let mut by_range: Vec<RangeSearched> = (powers.iter())
            .map(|(range_m, _)| RangeSearched { range_m: *range_m, pos: 0.0, searched_95: 0.0 })
            .collect();
        let share = 1.0 / (f64::from(SIDE) * f64::from(SIDE));
        let mut missed = vec![0.0; powers.len() * (BLOCKS * BLOCKS) as usize];
        #[expect(clippy::cast_precision_loss, reason = "few powers")]
        let of_power = share / powers.len() as f64;
        for row in 0..SIDE {
            for column in 0..SIDE {
                let away = Vector2::new(f64::from(column) + 0.5, f64::from(row) + 0.5) * cell_m;
                let cell = (corner + away).push(config.target_up_m);
                let losses: Vec<f64> =
                    segments.iter().map(|s| exponent * loss_db(&(cell - s.place))).collect();
                let mut sum = 0.0;
                let block = row / (SIDE / BLOCKS) * BLOCKS + column / (SIDE / BLOCKS);
                let of_block = missed.iter_mut().skip(block as usize * powers.len());
                let of_powers = by_range.iter_mut().zip(&powers).zip(of_block);
                for ((of_range, (_, power_dbm)), missed) in of_powers {
                    let detected = detected(&segments, &losses, *power_dbm);
                    *missed += of_power * (1.0 - detected);
                    sum += detected;
                    of_range.pos += share * detected;
                    of_range.searched_95 += if detected >= 0.95 { share } else { 0.0 };
                }
                #[expect(clippy::cast_precision_loss, reason = "few powers")]
                pod.push(sum / powers.len() as f64);
            }
        }
        let pos = pod.iter().sum::<f64>() * share;
        Some(Self {
            corner,
            cell_m,
            columns,
            pod,
            pos,
            by_range,
            exponent,
            silences,
            segments: segments.len(),
            missed,
            powers_dbm: powers.iter().map(|(_, power_dbm)| *power_dbm).collect(),
            like: Silent {
                place: Vector3::new(0.0, 0.0, mean(segments.iter().map(|s| s.place.z))),
                floor_dbm,
                sigma_db: mean(segments.iter().map(|silent| silent.sigma_db)),
            },
            target_up_m: config.target_up_m,
        })
    }

    /// Returns the probability that the transmitter is in each cell after the search, if it is in
    /// the area at all; before, all cells are as probable.
    #[must_use]
    pub fn poa(&self) -> Vec<f64> {
        let missed: f64 = self.pod.iter().map(|pod| 1.0 - pod).sum();
        self.pod.iter().map(|pod| (1.0 - pod) / missed.max(f64::MIN_POSITIVE)).collect()
    }

    /// Returns the probability that a transmitter that was missed would be received at a place, by
    /// a receiver as in the search.
    #[must_use]
    pub fn pod_at(&self, place: &Vector2<f64>) -> f64 {
        let receiver = place.push(self.like.place.z);
        let block_m = self.cell_m * f64::from(SIDE / BLOCKS);
        let blocks = self.missed.chunks(self.powers_dbm.len().max(1)).zip(0_u32..);
        let mut sums = (0.0, 0.0);
        for (missed, block) in blocks {
            let [column, row] = [block % BLOCKS, block / BLOCKS].map(f64::from);
            let centre = self.corner + Vector2::new(column + 0.5, row + 0.5) * block_m;
            let loss = self.exponent * loss_db(&(centre.push(self.target_up_m) - receiver));
            for (missed, power_dbm) in missed.iter().zip(&self.powers_dbm) {
                let above = (power_dbm + loss - self.like.floor_dbm) / self.like.sigma_db;
                sums.0 += missed * libm::exp(log_normal_cdf(above));
                sums.1 += missed;
            }
        }
        if sums.1 > 0.0 { sums.0 / sums.1 } else { 0.0 }
    }

    /// Returns the place in the area where a receiver as in the search would most probably
    /// receive a transmitter that was missed.
    #[must_use]
    pub fn next_place(&self) -> NextPlace {
        let step_m = self.cell_m * f64::from(SIDE) / f64::from(PLACES);
        let mut best = NextPlace { place: self.corner, pod: 0.0 };
        for number in 0..PLACES * PLACES {
            let [column, row] = [number % PLACES, number / PLACES].map(f64::from);
            let place = self.corner + Vector2::new(column + 0.5, row + 0.5) * step_m;
            let pod = self.pod_at(&place);
            if pod > best.pod {
                best = NextPlace { place, pod };
            }
        }
        best
    }

    /// Returns the area in square metres.
    #[must_use]
    pub fn area_m2(&self) -> f64 {
        self.pod.iter().map(|_| self.cell_m * self.cell_m).sum()
    }
}

/// Probability that any of the segments had a level above its floor.
pub(super) fn detected(segments: &[Silent], losses: &[f64], power_dbm: f64) -> f64 {
    let mut log_silent = 0.0;
    for (silent, loss) in segments.iter().zip(losses) {
        let below = (silent.floor_dbm - power_dbm - loss) / silent.sigma_db;
        // Beyond 4 σ below the floor a silence says nothing.
        if below < 4.0 {
            log_silent += log_normal_cdf(below);
        }
        if log_silent < SURE {
            return 1.0;
        }
    }
    1.0 - libm::exp(log_silent)
}

/// Ranges at a floor, each with its reference power.
fn powers(power: Power, floor_dbm: f64, exponent: f64) -> Vec<(f64, f64)> {
    if let Some((reference_dbm, exponent)) = power.law() {
        let range_m = libm::pow(10.0, (reference_dbm - floor_dbm) / (10.0 * exponent));
        return vec![(range_m, reference_dbm)];
    }
    let (least, largest, to_a_decade) = RANGES;
    let steps = (to_a_decade * libm::log10(largest / least)).round();
    let mut ranges = Vec::new();
    let mut step = 0.0;
    while step <= steps {
        let range_m = least * libm::pow(10.0, step / to_a_decade);
        ranges.push((range_m, floor_dbm + 10.0 * exponent * libm::log10(range_m)));
        step += 1.0;
    }
    ranges
}

fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0.0), |(sum, count), value| (sum + value, count + 1.0));
    sum / count
}

/// Returns one silence for each square in which there are some, the one with the lowest floor, and
/// the number of all; `None` if anything was received, or nothing was silent.
pub(super) fn silences(receptions: &Receptions) -> Option<(Vec<Silent>, usize)> {
    let mut silences = Vec::new();
    for reception in receptions.iter() {
        let is_heard = reception.level.is_some()
            || reception.saturation.is_some()
            || reception.has_bearing()
            || !reception.measured.is_empty();
        if is_heard {
            return None;
        }
        silences.extend(reception.silence.map(|floor| Silent {
            place: reception.receiver.position,
            floor_dbm: floor.rss_dbm,
            sigma_db: floor.sigma_db.max(LEAST_SIGMA_DB),
        }));
    }
    let mut side_m = SQUARE_M;
    while !silences.is_empty() {
        let mut squares: BTreeMap<[i64; 2], Silent> = BTreeMap::new();
        for silent in &silences {
            #[expect(clippy::cast_possible_truncation, reason = "saturates far off")]
            let square = [silent.place.x, silent.place.y].map(|m| (m / side_m).floor() as i64);
            let lowest = squares.entry(square).or_insert(*silent);
            if silent.floor_dbm < lowest.floor_dbm {
                *lowest = *silent;
            }
        }
        if squares.len() <= MOST_SQUARES {
            return Some((squares.into_values().collect(), silences.len()));
        }
        side_m *= 1.5;
    }
    None
}

#[cfg(test)]
mod tests {
    use approx::assert_abs_diff_eq;
    use foxhunt_core::{Level, Pose, Reception};

    use super::*;

    const FLOOR: Level = Level { rss_dbm: -100.0, sigma_db: 6.0 };

    fn silence(east: f64, north: f64) -> Reception {
        Reception {
            receiver: Pose::at(east, north, 0.0),
            silence: Some(FLOOR),
            ..Reception::default()
        }
    }

    fn walk() -> Receptions {
        (0..=40_u8).map(|step| silence(10.0 * f64::from(step), 0.0)).collect()
    }

    /// A power whose level meets the floor at 100 m.
    fn known() -> LocateConfig {
        let power = Power::Known { reference_dbm: -50.0, exponent: 2.5 };
        LocateConfig { power, ..LocateConfig::default() }
    }

    fn at(searched: &Searched, east: f64, north: f64) -> f64 {
        let cell = (Vector2::new(east, north) - searched.corner) / searched.cell_m;
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "inside")]
        let [column, row] = [cell.x, cell.y].map(|along| along as usize);
        searched.pod[row * searched.columns + column]
    }

    #[test]
    fn one_silence_at_the_range_of_its_power_is_worth_a_half() {
        let searched = Searched::in_silence(&[silence(0.0, 0.0)].into_iter().collect(), &known());
        let searched = searched.expect("nothing was received");
        assert_abs_diff_eq!(at(&searched, 100.0, 0.0), 0.5, epsilon = 0.03);
        assert!(at(&searched, 5.0, 5.0) > 0.99);
        // At twice the range the level is 7.5 dB below the floor: Φ(−1.25).
        assert_abs_diff_eq!(at(&searched, 195.0, 0.0), 0.106, epsilon = 0.02);
        assert_eq!((searched.silences, searched.segments), (1, 1));
        assert_abs_diff_eq!(searched.by_range[0].range_m, 100.0, epsilon = 1e-9);
        assert_abs_diff_eq!(searched.by_range[0].pos, searched.pos, epsilon = 1e-12);
    }

    #[test]
    fn more_silences_search_more_and_what_is_left_lies_farther_off() {
        let some = Searched::in_silence(&walk(), &known()).expect("silence");
        let one = Searched::in_silence(&[silence(200.0, 0.0)].into_iter().collect(), &known());
        let one = one.expect("silence");
        assert!(some.pos > one.pos, "{} > {}", some.pos, one.pos);
        let poa = some.poa();
        assert_abs_diff_eq!(poa.iter().sum::<f64>(), 1.0, epsilon = 1e-9);
        let near = (some.pod.iter().zip(&poa)).filter(|(pod, _)| **pod > 0.9);
        assert!(near.map(|(_, poa)| poa).sum::<f64>() < 0.05);
        // Readings of one place are one.
        let twice = walk();
        let twice = twice.iter().flat_map(|reception| [reception, reception]);
        let twice: Receptions = twice.collect();
        let twice = Searched::in_silence(&twice, &known()).expect("silence");
        assert_abs_diff_eq!(twice.pos, some.pos, epsilon = 1e-12);
        assert_eq!((twice.silences, twice.segments), (82, some.segments));
    }

    #[test]
    fn the_next_place_is_away_from_what_was_searched() {
        for config in [known(), LocateConfig::default()] {
            let searched = Searched::in_silence(&walk(), &config).expect("silence");
            let next = searched.next_place();
            // The walk is along the East axis from 0 to 400 m.
            let away_m = (next.place.x - next.place.x.clamp(0.0, 400.0)).hypot(next.place.y);
            assert!(away_m > 100.0, "{next:?}");
            assert_abs_diff_eq!(next.pod, searched.pod_at(&next.place), epsilon = 1e-12);
            assert!(next.pod > searched.pod_at(&Vector2::new(200.0, 0.0)));
            assert!((0.0..=1.0).contains(&next.pod));
        }
    }

    #[test]
    fn a_power_that_is_not_known_lies_between_the_weak_and_the_strong() {
        let searched = Searched::in_silence(&walk(), &LocateConfig::default()).expect("silence");
        assert!(searched.by_range.is_sorted_by(|a, b| a.pos <= b.pos));
        let [weak, strong] = [searched.by_range.first(), searched.by_range.last()];
        let [weak, strong] = [weak, strong].map(|one| one.expect("ranges").pos);
        assert!(weak < 0.1 && strong > 0.99, "{weak} {strong}");
        assert!(weak < searched.pos && searched.pos < strong);
    }

    #[test]
    fn what_was_received_is_no_silent_search() {
        let heard = Reception { level: Some(FLOOR), silence: None, ..silence(0.0, 0.0) };
        let some: Receptions = walk().iter().chain([heard]).collect();
        assert_eq!(Searched::in_silence(&some, &known()), None);
        assert_eq!(Searched::in_silence(&Receptions::default(), &known()), None);
    }
}
