use alloc::vec::Vec;
use core::cell::OnceCell;

use foxhunt_core::{
    Pose,
    angle::Resultant,
    nalgebra::{Vector2, Vector3},
};

use super::{ShadowingGridError, cells::Cells};
use crate::count::{median, number};

/// The side on which a value is censored: a receiver at its floor, or at its ceiling, shows a limit
/// instead of the level.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub enum Censoring {
    /// The true value lay below.
    Below,
    /// The value is the true one, with its noise.
    #[default]
    None,
    /// The true value lay above.
    Above,
}

/// A reading of [`ShadowingGrid`](super::ShadowingGrid).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShadowedReading {
    /// The receiver's pose.
    pub receiver: Pose,
    /// The value, or the limit of a censored one.
    pub value: f64,
    /// The side on which the true value lay, where the receiver's limit hides it.
    pub censoring: Censoring,
}

impl ShadowedReading {
    /// Returns true if the value is more than a limit.
    #[must_use]
    pub fn is_exact(&self) -> bool {
        self.censoring == Censoring::None
    }
}

impl From<(Pose, f64)> for ShadowedReading {
    fn from((receiver, value): (Pose, f64)) -> Self {
        Self { receiver, value, censoring: Censoring::None }
    }
}

impl From<&ShadowedReading> for ShadowedReading {
    fn from(reading: &ShadowedReading) -> Self {
        *reading
    }
}

impl From<&(Pose, f64)> for ShadowedReading {
    fn from(reading: &(Pose, f64)) -> Self {
        (*reading).into()
    }
}

/// Readings whose numbers are finite, in the order in which they were taken.
#[derive(Clone, Debug)]
pub(crate) struct Path {
    readings: Vec<Reading>,
    /// Poses without place and heading, one for all readings of it that follow each other.
    attitudes: Vec<Pose>,
    /// The readings by their places, once a path is too long for its segments.
    cells: OnceCell<Cells>,
}

/// A reading of a path in little memory: there may be millions.
#[derive(Clone, Copy, Debug)]
struct Reading {
    position: Vector3<f64>,
    heading: f64,
    value: f64,
    censoring: Censoring,
    /// Index of the rest of the pose.
    attitude: u32,
}

impl Reading {
    fn is_exact(&self) -> bool {
        self.censoring == Censoring::None
    }
}

/// A path's readings, made one per segment.
#[derive(Clone, Debug)]
pub(crate) struct Segments {
    /// The mean pose of each segment.
    pub receivers: Vec<Pose>,
    /// The value of each segment, a summary of its readings.
    pub values: Vec<f64>,
    /// The number of independent readings behind each value.
    pub counts: Vec<f64>,
    /// The segments whose quantile is censored, with the number of independent readings of each.
    pub censored: Vec<(ShadowedReading, f64)>,
    /// The factor by which segments were made longer for the cap: 1 where none was needed.
    pub stretch: f64,
}

impl Segments {
    fn with_capacity(count: usize, stretch: f64) -> Self {
        Self {
            receivers: Vec::with_capacity(count),
            values: Vec::with_capacity(count),
            counts: Vec::with_capacity(count),
            censored: Vec::new(),
            stretch,
        }
    }

    /// Adds a segment of a path; `sorted` is scratch space.
    fn add(
        &mut self,
        path: &Path,
        readings: &[Reading],
        summary: Summary,
        sorted: &mut Vec<(Censoring, f64)>,
    ) {
        let (value, censoring) = summary.of(readings, sorted);
        let receiver = path.mean_pose(readings);
        if censoring == Censoring::None {
            self.receivers.push(receiver);
            self.values.push(value);
            self.counts.push(summary.independent(readings));
        } else {
            let count = summary.independent(readings);
            self.censored.push((ShadowedReading { receiver, value, censoring }, count));
        }
    }
}

impl Path {
    /// Takes readings whose values and places are finite.
    pub(crate) fn new<R>(readings: R) -> Result<Self, ShadowingGridError>
    where
        R: IntoIterator<Item: Into<ShadowedReading>>,
    {
        let given = readings.into_iter();
        let mut readings = Vec::with_capacity(given.size_hint().0);
        let mut attitudes: Vec<Pose> = Vec::new();
        for (index, reading) in given.enumerate() {
            let ShadowedReading { receiver, value, censoring } = reading.into();
            if !value.is_finite() {
                return Err(ShadowingGridError::Value { index, value });
            }
            if !receiver.is_finite() {
                return Err(ShadowingGridError::Receiver { index });
            }
            let Pose { position, heading, .. } = receiver;
            let rest = Pose { position: Vector3::zeros(), heading: 0.0, ..receiver };
            if attitudes.last() != Some(&rest) {
                attitudes.push(rest);
            }
            let attitude = u32::try_from(attitudes.len() - 1).unwrap_or(u32::MAX);
            readings.push(Reading { position, heading, value, censoring, attitude });
        }
        Ok(Self { readings, attitudes, cells: OnceCell::new() })
    }

    /// The East and North that all readings share; `None` where there are several places.
    pub(crate) fn only_place(&self) -> Option<Vector2<f64>> {
        let mut places = self.places().map(|place| place.xy());
        let first = places.next()?;
        places.all(|place| place == first).then_some(first)
    }

    /// The mean place, and the mean direction of the nose; that of the first where they cancel.
    fn mean_pose(&self, readings: &[Reading]) -> Pose {
        if let [reading] = readings {
            return self.pose(reading);
        }
        #[expect(clippy::cast_precision_loss, reason = "fewer readings than 2⁵³")]
        let count = readings.len() as f64;
        let sum: Vector3<f64> = readings.iter().map(|r| r.position).sum();
        let headings: Resultant = readings.iter().map(|r| r.heading).collect();
        let first = readings.first().map_or(0.0, |r| r.heading);
        Pose::level(sum / count, headings.direction(1e-9).unwrap_or(first))
    }

    /// Returns the segments: each ends where the receiver has moved by `length_m` of its first
    /// place or more from there.
    ///
    /// A receiver that hovers, and the jitter of its position, stay in one segment; a place that
    /// is visited again begins another. Where there would be more than `max_segments`, all are
    /// stretched by one factor; where cells of the area are clearly shorter than that, as of lanes
    /// closer together than a segment is long, the segments are such cells instead.
    pub(crate) fn segments(
        &self,
        length_m: impl Fn(&Vector2<f64>) -> f64,
        max_segments: usize,
        summary: Summary,
    ) -> Segments {
        let mut stretch = 1.0;
        let mut sorted = Vec::new();
        let mut groups = self.cut(&length_m);
        let is_zero = || self.places().all(|place| length_m(&place.xy()) <= 0.0);
        if groups.len() > max_segments && is_zero() {
            // Lengths of 0 do not grow by any factor: the extent of the path replaces them.
            let whole_m = self.extent_m();
            let mut share = 1e-4;
            while groups.len() > max_segments && share < 2.0 {
                groups = self.cut(|_| share * whole_m);
                share *= 1.25;
            }
        }
        if groups.len() > max_segments {
            let cells = self.cells.get_or_init(|| Cells::new(self.places()));
            let (leaves, of_cells) = cells.leaves(&length_m, max_segments);
            while groups.len() > max_segments && stretch < (SHORTER * of_cells).min(1e9) {
                stretch *= 1.25;
                groups = self.cut(|place| stretch * length_m(place));
            }
            if groups.len() > max_segments {
                let mut segments = Segments::with_capacity(leaves.len(), of_cells);
                let mut held = Vec::new();
                for leaf in leaves {
                    held.clear();
                    let indices = cells.indices(leaf);
                    held.extend(indices.iter().filter_map(|index| self.readings.get(*index)));
                    segments.add(self, &held, summary, &mut sorted);
                }
                return segments;
            }
        }
        let mut segments = Segments::with_capacity(groups.len(), stretch);
        for group in groups {
            let readings = self.readings.get(group).unwrap_or_default();
            segments.add(self, readings, summary, &mut sorted);
        }
        segments
    }

    /// Returns true if the readings scatter as noise of their own does, with few wild ones. Where
    /// they fade, or an antenna's lobes pass over, many are: the scatter changes along the path.
    ///
    /// Each reading is compared with the middle of its two neighbours in the segment, so that a
    /// level that falls with the distance is no scatter.
    pub(crate) fn is_noisy(&self, length_m: impl Fn(&Vector2<f64>) -> f64) -> bool {
        let mut sizes = Vec::new();
        for group in self.cut(length_m) {
            let readings = self.readings.get(group).unwrap_or_default();
            for neighbours in readings.windows(3) {
                if let [before, reading, after] = neighbours
                    && neighbours.iter().all(Reading::is_exact)
                {
                    sizes.push((reading.value - 0.5 * (before.value + after.value)).abs());
                }
            }
        }
        // Segments of too few readings are hardly summarised, and tell nothing.
        let half = sizes.len() / 2;
        if half >= sizes.len() {
            return true;
        }
        let (_, median, _) = sizes.select_nth_unstable_by(half, f64::total_cmp);
        let limit = WILD * *median;
        let tame = sizes.iter().filter(|size| **size <= limit).count();
        #[expect(clippy::cast_precision_loss, reason = "fewer readings than 2⁵³")]
        let [tame, count] = [tame, sizes.len()].map(|count| count as f64);
        let wild = 1.0 - tame / count;
        wild - 2.0 * libm::sqrt(wild * (1.0 - wild) / count) < MOST_WILD
    }

    /// Returns the readings that are gross errors on either side, in order: those whose residual
    /// from a law is far from the median of their neighbours' along the path (Hampel 1974). None
    /// where those are nearly all on one side, as fades are, fewer than 1 % or more than 25 %.
    /// Twice `sigma` is the least size of a gross error.
    pub(crate) fn outliers(&self, law: impl Fn(&Pose) -> f64, sigma: f64) -> Vec<usize> {
        let exact = self.readings.iter().enumerate().filter(|(_, reading)| reading.is_exact());
        let residual = |(index, r): (usize, &Reading)| (index, r.value - law(&self.pose(r)));
        let residuals: Vec<(usize, f64)> = exact.map(residual).collect();
        let mut window = Vec::with_capacity(2 * BESIDE);
        let mut off = Vec::with_capacity(residuals.len());
        for (i, &(index, residual)) in residuals.iter().enumerate() {
            let before = residuals.get(i.saturating_sub(BESIDE)..i).unwrap_or_default();
            let after = residuals.iter().skip(i + 1).take(BESIDE);
            window.clear();
            window.extend(before.iter().chain(after).map(|(_, residual)| *residual));
            if let Some(middle) = median(&mut window) {
                off.push((index, residual - middle));
            }
        }
        let mut sizes: Vec<f64> = off.iter().map(|(_, off)| off.abs()).collect();
        let Some(usual) = median(&mut sizes) else { return Vec::new() };
        let count = number(off.len());
        let largest = libm::sqrt(2.0 * libm::log(count));
        let limit = ((GROSS + largest) * usual / QUARTILE).max(2.0 * sigma);
        let is_gross = |(_, off): &&(usize, f64)| off.abs() > limit;
        let gross: Vec<(usize, f64)> = off.iter().filter(is_gross).copied().collect();
        let above = gross.iter().filter(|(_, off)| *off > 0.0).count();
        let is_one_sided = ONE_SIDED * above.min(gross.len() - above) < gross.len();
        let share = number(gross.len()) / count;
        if is_one_sided || !FEW_TO_MANY.contains(&share) {
            return Vec::new();
        }
        gross.into_iter().map(|(index, _)| index).collect()
    }

    /// The path without some readings, whose indices are in order.
    pub(crate) fn without(&self, left_out: &[usize]) -> Self {
        let readings = self.readings.iter().enumerate();
        let kept = readings.filter(|(index, _)| left_out.binary_search(index).is_err());
        Self {
            readings: kept.map(|(_, reading)| *reading).collect(),
            attitudes: self.attitudes.clone(),
            cells: OnceCell::new(),
        }
    }

    /// The pose of a reading's receiver.
    fn pose(&self, &Reading { position, heading, attitude, .. }: &Reading) -> Pose {
        let rest = self.attitudes.get(attitude as usize).copied().unwrap_or_default();
        Pose { position, heading, ..rest }
    }

    /// The ranges of readings of each segment.
    fn cut(&self, length_m: impl Fn(&Vector2<f64>) -> f64) -> Vec<core::ops::Range<usize>> {
        let mut groups = Vec::new();
        let Some(first) = self.readings.first() else { return groups };
        let mut begin = 0;
        let mut from = first.position;
        let mut length = length_m(&from.xy());
        for (i, reading) in self.readings.iter().enumerate().skip(1) {
            let here = reading.position;
            if (here - from).norm() >= length {
                groups.push(begin..i);
                begin = i;
                from = here;
                length = length_m(&from.xy());
            }
        }
        groups.push(begin..self.readings.len());
        groups
    }

    /// The receivers' places.
    pub(crate) fn places(&self) -> impl Iterator<Item = Vector3<f64>> + Clone {
        self.readings.iter().map(|reading| reading.position)
    }

    /// The diagonal of the box that holds all receivers, in metres.
    fn extent_m(&self) -> f64 {
        let nowhere = Vector3::repeat(f64::INFINITY);
        let (low, high) = (self.places())
            .fold((nowhere, -nowhere), |(low, high), place| (low.inf(&place), high.sup(&place)));
        (high - low).norm()
    }
}

/// Stretch of the path's segments over that of cells from which on segments are cells: a cell's
/// diagonal is 1.4 of its side.
const SHORTER: f64 = 1.5;

/// Size of a wild reading's deviation over the median size: 2.7 standard deviations.
const WILD: f64 = 4.0;

/// Share of wild readings, less two of its standard errors, at which noise ends: of normal noise
/// they are 0.7 %, of flights over real transmitters 8 to 23 %.
const MOST_WILD: f64 = 0.05;

/// Neighbours along the path on either side that show what a reading's residual should be.
const BESIDE: usize = 4;

/// Size of a gross error beyond that of the largest of normal errors, √(2 ln n), in standard
/// deviations: shadows have longer tails.
const GROSS: f64 = 1.5;

/// Median of the absolute value of a standard normal.
const QUARTILE: f64 = 0.674_49;

/// Shares of gross errors that are left out: fewer count for little, and more are no errors.
const FEW_TO_MANY: core::ops::RangeInclusive<f64> = 0.01..=0.25;

/// Gross errors over those on the rarer side, at most: of fades less than a third are above.
const ONE_SIDED: usize = 3;

/// Number that stands for the readings of a segment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Summary {
    /// A quantile, of readings that fade together: one value, however many they are.
    Quantile(f64),
    /// The mean without the least and the greatest tenth, of readings with noise of their own.
    TrimmedMean,
}

impl Summary {
    /// The value of a segment, and its censoring; `sorted` is scratch space.
    fn of(self, readings: &[Reading], sorted: &mut Vec<(Censoring, f64)>) -> (f64, Censoring) {
        match self {
            Self::Quantile(quantile) => quantile_of(readings, quantile, sorted),
            Self::TrimmedMean => {
                let median = quantile_of(readings, 0.5, sorted);
                let trimmed = sorted.len() / 10;
                let middle = sorted.get(trimmed..sorted.len() - trimmed).unwrap_or_default();
                if middle.iter().any(|(censoring, _)| *censoring != Censoring::None) {
                    return median;
                }
                #[expect(clippy::cast_precision_loss, reason = "fewer readings than 2⁵³")]
                let count = middle.len() as f64;
                (middle.iter().map(|(_, value)| value).sum::<f64>() / count, Censoring::None)
            }
        }
    }

    /// The number of independent readings behind a value.
    fn independent(self, readings: &[Reading]) -> f64 {
        #[expect(clippy::cast_precision_loss, reason = "fewer readings than 2⁵³")]
        let count = readings.len() as f64;
        if self == Self::TrimmedMean { count } else { 1.0 }
    }
}

/// A quantile of the values, between two of them by a straight line (Hyndman & Fan 1996, type 7),
/// and its censoring.
///
/// A value below a limit counts as the least of all, one above a limit as the greatest.
fn quantile_of(
    readings: &[Reading],
    quantile: f64,
    values: &mut Vec<(Censoring, f64)>,
) -> (f64, Censoring) {
    values.clear();
    values.extend(readings.iter().map(|r| (r.censoring, r.value)));
    values.sort_unstable_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
    #[expect(clippy::cast_precision_loss, reason = "fewer readings than 2⁵³")]
    let at = quantile * values.len().saturating_sub(1) as f64;
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "within the values, as the quantile is in [0, 1]"
    )]
    let below = at as usize;
    let (censoring, low) = values.get(below).copied().unwrap_or((Censoring::None, f64::NAN));
    let next = values.get(below + 1).filter(|next| next.0 == censoring);
    let high = next.filter(|_| censoring == Censoring::None).map_or(low, |next| next.1);
    (low + (at - libm::floor(at)) * (high - low), censoring)
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_abs_diff_eq;

    const MEDIAN: Summary = Summary::Quantile(0.5);

    /// Readings along East at the given places, each with its own value.
    fn path(points: &[(f64, f64)]) -> Path {
        let readings: Vec<_> =
            points.iter().map(|&(east, value)| (Pose::at(east, 3.0, 20.0), value)).collect();
        Path::new(&readings).expect("finite")
    }

    fn reading(value: f64, censoring: Censoring) -> Reading {
        Reading { position: Vector3::zeros(), heading: 0.0, value, censoring, attitude: 0 }
    }

    #[test]
    fn a_reading_takes_48_bytes() {
        assert_eq!(size_of::<Reading>(), 48);
    }

    #[test]
    fn a_segment_is_its_mean_place_and_its_median() {
        let readings = path(&[
            (0.0, 1.0),
            (4.0, 2.0),
            (8.0, 60.0), // an outlier: the median of the first segment stays at 2
            (12.0, 5.0),
            (14.0, 6.0), // two readings: the mean of both
            (22.0, 7.0), // ten metres from the first of the segment before: the next one
            (55.0, 8.0), // a jump
            (53.0, 9.0), // back again, two metres from the jump
        ]);
        let segments = readings.segments(|_| 10.0, 300, MEDIAN);
        let east: Vec<f64> = segments.receivers.iter().map(|r| r.position.x).collect();
        assert_eq!(east, [4.0, 13.0, 22.0, 54.0]);
        assert_eq!(segments.values, [2.0, 5.5, 7.0, 8.5]);
        assert!(segments.receivers.iter().all(|r| (r.position.z - 20.0).abs() < 1e-12));
    }

    #[test]
    fn a_receiver_that_hovers_stays_in_its_segment() {
        // Jitter of 3 m flies 1,200 m, and comes nowhere.
        let jitter: Vec<_> = (0..400_u16).map(|i| (f64::from(i % 2) * 3.0, 1.0)).collect();
        assert_eq!(path(&jitter).segments(|_| 10.0, 300, MEDIAN).values.len(), 1);
    }

    #[test]
    fn segments_are_as_long_as_their_place_has_them() {
        let readings: Vec<_> = (0..200_u16).map(|i| (f64::from(i), 0.0)).collect();
        let segments = path(&readings).segments(|place| 1.0 + 0.2 * place.x, 300, MEDIAN);
        let ends: Vec<f64> = segments.receivers.iter().map(|r| r.position.x).collect();
        assert!(ends.windows(2).all(|w| w[1] - w[0] > 0.15 * w[0]), "{ends:?}");
    }

    #[test]
    fn a_high_quantile_passes_over_fades() {
        let values = [-60.0, -50.0, -90.0, -52.0, -85.0];
        let readings = values.map(|value| reading(value, Censoring::None));
        let quantile = |q| Summary::Quantile(q).of(&readings, &mut Vec::new()).0;
        assert_abs_diff_eq!(quantile(0.9), -50.8, epsilon = 1e-12);
        assert_abs_diff_eq!(quantile(1.0), -50.0, epsilon = 1e-12);
        assert_abs_diff_eq!(quantile(0.5), -60.0, epsilon = 1e-12);
        assert_abs_diff_eq!(quantile(0.0), -90.0, epsilon = 1e-12);
    }

    #[test]
    fn a_trimmed_mean_leaves_out_a_tenth_on_either_side() {
        let mut readings: Vec<_> =
            (1..=10_u8).map(|i| reading(f64::from(i), Censoring::None)).collect();
        readings[9].value = 1e6;
        let of = |readings: &[_]| Summary::TrimmedMean.of(readings, &mut Vec::new());
        assert_eq!(of(&readings), (5.5, Censoring::None));
        assert_eq!(of(&readings[..2]), (1.5, Censoring::None));
        // One of three at the ceiling: the median is known, the mean is not.
        readings[2].censoring = Censoring::Above;
        assert_eq!(of(&readings[..3]), (2.0, Censoring::None));
        readings[1].censoring = Censoring::Above;
        assert_eq!(of(&readings[..3]), (2.0, Censoring::Above));
    }

    #[test]
    fn fades_are_told_from_noise() {
        let is_noisy = |value: &dyn Fn(u32, f64) -> f64| {
            let uniform = |i: u32| (f64::from((i * 149) % 401) + 0.5) / 401.0;
            let readings: Vec<_> = (0..400).map(|i| (f64::from(i), value(i, uniform(i)))).collect();
            path(&readings).is_noisy(|_| 25.0)
        };
        // The logistic distribution is close to the normal one; a trend is no scatter.
        let noise = |u: f64| 2.0 * libm::log(u / (1.0 - u));
        assert!(is_noisy(&|_, u| noise(u)));
        assert!(is_noisy(&|i, u| noise(u) + 0.5 * f64::from(i)));
        // One outlier in a hundred is no fading; lobes that pass over by turns are.
        assert!(is_noisy(&|_, u| if u < 0.01 { -200.0 } else { 8.0 * (u - 0.5) }));
        assert!(!is_noisy(&|i, u| noise(u) * if i % 80 < 15 { 12.0 } else { 1.0 }));
        assert!(path(&[(0.0, 1.0), (30.0, 2.0)]).is_noisy(|_| 25.0));
    }

    #[test]
    fn gross_errors_lie_on_either_side_and_fades_below() {
        let uniform = |i: u32| (f64::from((i * 149) % 401) + 0.5) / 401.0;
        let noise = |i: u32| 2.0 * libm::log(uniform(i) / (1.0 - uniform(i)));
        // The law falls by 0.3 per metre from 10 m on.
        let law = |receiver: &Pose| -0.3 * (receiver.position.x - 10.0).abs();
        let of = |error: &dyn Fn(u32) -> f64| {
            let point = |i: u32| {
                let east = f64::from(i);
                (east, law(&Pose::at(east, 0.0, 0.0)) + noise(i) + error(i))
            };
            path(&(0..200).map(point).collect::<Vec<_>>()).outliers(law, 4.0)
        };
        let every = |step: u32, i: u32, size: f64| match i % step {
            5 if (i / step).is_multiple_of(2) => size,
            5 => -size,
            _ => 0.0,
        };
        assert_eq!(of(&|_| 0.0), [0_usize; 0]);
        let planted: Vec<usize> = (5..200).step_by(20).collect();
        assert_eq!(of(&|i| every(20, i, 45.0)), planted);
        assert_eq!(of(&|i| -every(20, i, 45.0).abs()), [0_usize; 0], "fades");
        // A third of all, of errors as large: no few that err.
        let third = |i: u32| if i.is_multiple_of(3) { 90.0 * f64::from(i % 2) - 45.0 } else { 0.0 };
        assert_eq!(of(&third), [0_usize; 0]);
        let eighth = |i: u32| if i % 8 == 3 { 90.0 * f64::from(i / 8 % 2) - 45.0 } else { 0.0 };
        assert_eq!(of(&eighth), (3..200).step_by(8).collect::<Vec<_>>());
        // Of whole numbers most are equal: the least that counts is twice σ.
        let whole =
            |i: u32| (f64::from(i), if i % 20 == 5 { f64::from(i % 40) - 15.0 } else { 0.0 });
        let constant = path(&(0..200).map(whole).collect::<Vec<_>>());
        assert_eq!(constant.outliers(|_| 0.0, 4.0), planted);
        assert_eq!(constant.outliers(|_| 0.0, 8.0), [0_usize; 0]);
        let rest = constant.without(&planted);
        assert_eq!(rest.readings.len(), 190);
        assert!(rest.readings.iter().all(|reading| reading.value == 0.0));
    }

    #[test]
    fn climbing_is_flying() {
        let climb = |up| (Pose::at(if up > 40 { 1.0 } else { 0.0 }, 0.0, f64::from(up)), 0.0);
        let readings: Vec<_> = (0..50).map(climb).collect();
        let path = Path::new(&readings).expect("finite");
        assert_eq!(path.segments(|_| 10.0, 300, MEDIAN).values.len(), 5);
    }

    #[test]
    fn a_length_of_zero_keeps_every_reading() {
        let readings = path(&[(0.0, 1.0), (0.0, 2.0), (1.0, 3.0), (1.0, 4.0), (1.0, 5.0)]);
        let segments = readings.segments(|_| 0.0, 300, MEDIAN);
        assert_eq!(segments.values, [1.0, 2.0, 3.0, 4.0, 5.0]);
    }

    #[test]
    fn the_cap_makes_segments_longer() {
        let readings: Vec<_> = (0..1000).map(|i| (f64::from(i), f64::from(i))).collect();
        for wanted in [0.0, 1.0, 3.0] {
            let segments = path(&readings).segments(|_| wanted, 40, MEDIAN);
            assert!((30..=40).contains(&segments.values.len()), "{}", segments.values.len());
        }
    }

    #[test]
    fn headings_are_averaged_across_the_cut() {
        let pose = |heading| (Pose { heading, ..Pose::default() }, 0.0);
        let path = Path::new([pose(3.1), pose(-3.1)]).expect("finite");
        let mean = path.mean_pose(&path.readings);
        assert!(foxhunt_core::angle::distance(mean.heading, core::f64::consts::PI) < 1e-12);
    }
}
