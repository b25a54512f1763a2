use nalgebra::Vector2;

use crate::{recording::Recording, surrounding::surrounding};

/// Returns the true place of a beacon, if the recordings have it and it stayed there: East and
/// North in metres.
#[must_use]
pub fn recorded_truth(recordings: &[Recording], beacon: Option<&str>) -> Option<Vector2<f64>> {
    /// A truth that moves by more than this, in metres, is no single place.
    const STILL: f64 = 0.5;
    let records = recordings.iter().flat_map(Recording::records);
    let of_beacon = records.filter(|record| record.beacon.as_deref() == beacon);
    let mut truths = of_beacon.map(|record| record.truth);
    let first = truths.next()??;
    truths.all(|truth| truth.is_some_and(|t| (t - first).norm() < STILL)).then_some(first)
}

/// Returns the true places of a beacon at the times of its records, in their order: seconds, and
/// East and North in metres.
#[must_use]
pub fn recorded_way(recordings: &[Recording], beacon: Option<&str>) -> Vec<(f64, Vector2<f64>)> {
    let records = recordings.iter().flat_map(Recording::records);
    let of_beacon = records.filter(|record| record.beacon.as_deref() == beacon);
    let mut way: Vec<_> = of_beacon.filter_map(|record| record.time.zip(record.truth)).collect();
    way.sort_by(|a, b| a.0.total_cmp(&b.0));
    way
}

/// Interpolates the true place of a beacon at a time between the two truths about it; `None` where
/// they are more than `gap_s` apart, or one is missing.
#[must_use]
pub fn truth_at(way: &[(f64, Vector2<f64>)], time: f64, gap_s: f64) -> Option<Vector2<f64>> {
    surrounding(way, time, gap_s).map(|(from, to, share)| from.lerp(to, share))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_truth_lies_between_its_neighbours() {
        let way = [(10.0, Vector2::new(0.0, 0.0)), (20.0, Vector2::new(4.0, -8.0))];
        assert_eq!(truth_at(&way, 10.0, 60.0), Some(Vector2::zeros()));
        assert_eq!(truth_at(&way, 12.5, 60.0), Some(Vector2::new(1.0, -2.0)));
        assert_eq!(truth_at(&way, 12.5, 9.0), None, "too far apart");
        assert_eq!(truth_at(&way, 9.9, 60.0), None, "before the first");
        assert_eq!(truth_at(&way, 20.1, 60.0), None, "after the last");
    }
}
