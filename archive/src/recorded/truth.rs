use nalgebra::Vector2;

use crate::recording::Recording;

/// Where a beacon truly was, if the recordings have it and it stayed there: East and North in
/// metres.
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
