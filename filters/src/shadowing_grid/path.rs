use alloc::vec::Vec;

use foxhunt_core::{Pose, angle::Resultant, nalgebra::Vector3};

use super::ShadowingGridError;

/// A reading of [`ShadowingGrid`](super::ShadowingGrid).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShadowedReading {
    /// Where it was taken.
    pub receiver: Pose,
    /// What was read.
    pub value: f64,
    /// Whether nothing is known but that the true value lay below this one, as at the floor of a
    /// receiver.
    pub is_below: bool,
}

impl From<(Pose, f64)> for ShadowedReading {
    fn from((receiver, value): (Pose, f64)) -> Self {
        Self { receiver, value, is_below: false }
    }
}

/// A path's readings, made one per segment.
#[derive(Clone, Debug)]
pub(crate) struct Segments {
    /// The mean pose of each segment.
    pub(crate) receivers: Vec<Pose>,
    /// The value of each segment, a quantile of its readings.
    pub(crate) values: Vec<f64>,
    /// The segments whose quantile is but a limit, below which it lay.
    pub(crate) silences: Vec<(Pose, f64)>,
    /// The length of a segment in metres, after it was made long enough for the cap.
    pub(crate) segment_m: f64,
}

impl Segments {
    /// Cuts the path at every `segment_m` metres flown, counted from its start.
    ///
    /// A jump, or a slow receiver, moves on by as many segments as it flew; one that hovers
    /// stays in its own. A segment's value is a quantile: one bad reading does not move its median.
    pub(crate) fn along<R>(
        readings: &[R],
        segment_m: f64,
        max_segments: usize,
        quantile: f64,
    ) -> Result<Self, ShadowingGridError>
    where
        R: Copy + Into<ShadowedReading>,
    {
        let readings: Vec<ShadowedReading> = readings.iter().map(|r| (*r).into()).collect();
        let readings = readings.as_slice();
        for (index, ShadowedReading { receiver, value, .. }) in readings.iter().enumerate() {
            if !value.is_finite() {
                return Err(ShadowingGridError::Value { index, value: *value });
            }
            if !receiver.is_finite() {
                return Err(ShadowingGridError::Receiver { index });
            }
        }
        let flown_m = distances_flown(readings);
        if let [first, _, _, _, ..] = readings
            && readings.iter().all(|r| r.receiver.position.xy() == first.receiver.position.xy())
        {
            let (east, north) = (first.receiver.position.x, first.receiver.position.y);
            return Err(ShadowingGridError::OnePlace { east, north });
        }
        let mut segment_m = segment_m;
        let mut groups = cut(&flown_m, segment_m);
        if groups.len() > max_segments {
            #[expect(clippy::cast_precision_loss, reason = "a length need not be exact")]
            let fewest = flown_m.last().unwrap_or(&0.0) / max_segments as f64;
            segment_m = segment_m.max(fewest);
            groups = cut(&flown_m, segment_m);
            // Where the cuts fall decides the last few.
            while groups.len() > max_segments && segment_m > 0.0 {
                segment_m *= 1.02;
                groups = cut(&flown_m, segment_m);
            }
        }
        let (receivers, values, silences) = <(Vec<_>, Vec<_>, Vec<_>)>::default();
        let mut thinned = Self { receivers, values, silences, segment_m };
        for group in groups {
            let readings = readings.get(group).unwrap_or_default();
            let (value, is_below) = quantile_of(readings, quantile);
            if is_below {
                thinned.silences.push((mean_pose(readings), value));
            } else {
                thinned.receivers.push(mean_pose(readings));
                thinned.values.push(value);
            }
        }
        let segments = thinned.receivers.len();
        if segments < 4 {
            return Err(ShadowingGridError::TooFew { segments, segment_m });
        }
        Ok(thinned)
    }
}

/// The distance flown until each reading.
fn distances_flown(readings: &[ShadowedReading]) -> Vec<f64> {
    let (mut flown_m, mut last) = (0.0, readings.first().map(|r| r.receiver.position));
    let mut distances = Vec::with_capacity(readings.len());
    for reading in readings {
        let here = reading.receiver.position;
        flown_m += last.map_or(0.0, |last| (here - last).norm());
        distances.push(flown_m);
        last = Some(here);
    }
    distances
}

/// The readings of each segment.
fn cut(flown_m: &[f64], segment_m: f64) -> Vec<core::ops::Range<usize>> {
    let (mut groups, mut begin, mut number) = (Vec::new(), 0, 0.0);
    for (i, &flown_m) in flown_m.iter().enumerate() {
        let here = libm::floor(flown_m / segment_m);
        // With a length of 0 every quotient is ∞ or NaN, and every reading its own segment.
        if i > 0 && (here > number || !here.is_finite()) {
            groups.push(begin..i);
            begin = i;
        }
        number = here;
    }
    if !flown_m.is_empty() {
        groups.push(begin..flown_m.len());
    }
    groups
}

/// The mean place, and the mean direction of the nose; that of the first where they cancel.
fn mean_pose(readings: &[ShadowedReading]) -> Pose {
    #[expect(clippy::cast_precision_loss, reason = "readings do not come by the quadrillion")]
    let count = readings.len() as f64;
    let sum: Vector3<f64> = readings.iter().map(|r| r.receiver.position).sum();
    let headings: Resultant = readings.iter().map(|r| r.receiver.heading).collect();
    let first = readings.first().map_or(0.0, |r| r.receiver.heading);
    Pose::level(sum / count, headings.direction(1e-9).unwrap_or(first))
}

/// A quantile of the values, between two of them by a straight line (Hyndman & Fan 1996, type 7).
///
/// What lay below a limit is below all else. Whether the quantile itself is but a limit.
fn quantile_of(readings: &[ShadowedReading], quantile: f64) -> (f64, bool) {
    let mut values: Vec<_> = readings.iter().map(|r| (r.value, r.is_below)).collect();
    values.sort_unstable_by(|a, b| b.1.cmp(&a.1).then(a.0.total_cmp(&b.0)));
    #[expect(clippy::cast_precision_loss, reason = "readings do not come by the quadrillion")]
    let at = quantile * values.len().saturating_sub(1) as f64;
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "within the values, as the quantile is in [0, 1]"
    )]
    let below = at as usize;
    let low = values.get(below).copied().unwrap_or((f64::NAN, false));
    let high = values.get(below + 1).filter(|_| !low.1).map_or(low.0, |high| high.0);
    (low.0 + (at - libm::floor(at)) * (high - low.0), low.1)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Readings along East at the given places, each with its own value.
    fn path(points: &[(f64, f64)]) -> Vec<ShadowedReading> {
        points.iter().map(|&(east, value)| (Pose::at(east, 3.0, 20.0), value).into()).collect()
    }

    #[test]
    fn a_segment_is_its_mean_place_and_its_median() {
        let readings = path(&[
            (0.0, 1.0),
            (4.0, 2.0),
            (8.0, 60.0), // an outlier: the median of the first segment stays at 2
            (12.0, 5.0),
            (14.0, 6.0), // two readings: the mean of both
            (20.0, 7.0), // on the cut: the next segment
            (55.0, 8.0), // a jump over two segments
            (53.0, 9.0), // flying back counts as flown: still 57 of 60 m
        ]);
        let segments = Segments::along(&readings, 10.0, 300, 0.5).expect("proper");
        let east: Vec<f64> = segments.receivers.iter().map(|r| r.position.x).collect();
        let expected = [4.0, 13.0, 20.0, 54.0];
        assert_eq!(east.len(), expected.len());
        assert!(east.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12), "{east:?}");
        let expected = [2.0, 5.5, 7.0, 8.5];
        assert!(segments.values.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12));
        assert!(segments.receivers.iter().all(|r| (r.position.z - 20.0).abs() < 1e-12));
    }

    #[test]
    fn a_high_quantile_passes_over_fades() {
        let readings =
            path(&[(0.0, -60.0), (1.0, -50.0), (2.0, -90.0), (3.0, -52.0), (4.0, -85.0)]);
        let quantile = |q| quantile_of(&readings, q).0;
        assert!((quantile(0.9) - -50.8).abs() < 1e-12 && (quantile(1.0) - -50.0).abs() < 1e-12);
        assert!((quantile(0.5) - -60.0).abs() < 1e-12 && (quantile(0.0) - -90.0).abs() < 1e-12);
    }

    #[test]
    fn climbing_is_flying() {
        let climb = |up| (Pose::at(if up > 40 { 1.0 } else { 0.0 }, 0.0, f64::from(up)), 0.0);
        let readings: Vec<_> = (0..50).map(climb).collect();
        let segments = Segments::along(&readings, 10.0, 300, 0.5).expect("proper");
        assert_eq!(segments.values.len(), 5);
    }

    #[test]
    fn a_length_of_zero_keeps_every_reading() {
        let readings = path(&[(0.0, 1.0), (0.0, 2.0), (1.0, 3.0), (1.0, 4.0), (1.0, 5.0)]);
        let segments = Segments::along(&readings, 0.0, 300, 0.5).expect("proper");
        assert_eq!(segments.values, [1.0, 2.0, 3.0, 4.0, 5.0]);
    }

    #[test]
    fn the_cap_makes_segments_longer() {
        let readings: Vec<_> = (0..1000).map(|i| (f64::from(i), f64::from(i))).collect();
        for wanted in [0.0, 1.0, 3.0] {
            let segments = Segments::along(&path(&readings), wanted, 40, 0.5).expect("proper");
            assert!((36..=40).contains(&segments.values.len()), "{}", segments.values.len());
            assert!(segments.segment_m > 24.9 && segments.segment_m < 28.0);
        }
    }

    #[test]
    fn headings_are_averaged_across_the_cut() {
        let pose = |heading| (Pose { heading, ..Pose::default() }, 0.0);
        let mean = mean_pose(&[pose(3.1).into(), pose(-3.1).into()]);
        assert!(foxhunt_core::angle::distance(mean.heading, core::f64::consts::PI) < 1e-12);
    }
}
