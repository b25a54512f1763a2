use foxhunt_core::Sweep;
use foxhunt_sensors::{Antenna, Pattern};

/// One turn of the antenna, as a polar plot shows it: angles in radians counter-clockwise from
/// East, levels in dBm.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Turn {
    /// Each sample: where the antenna looked, and the level.
    pub samples: Vec<[f64; 2]>,
    /// The preprocessed pattern: the mean of each position, and of three on either side (Pritzl
    /// 2018, §4.1).
    pub smoothed: Vec<[f64; 2]>,
    /// The known antenna, turned to the bearing and at the level that fits the positions' means
    /// best; empty where the antenna is not known or there is no bearing.
    pub fitted: Vec<[f64; 2]>,
}

/// The antenna that an extractor knows.
#[derive(Clone, Copy, Debug)]
pub struct KnownAntenna<'a> {
    /// Gain of the antenna.
    pub antenna: &'a dyn Antenna,
    /// Elevation of beacons above the horizon, in radians.
    pub elevation: f64,
}

/// Number of positions that the reference averages.
const WINDOW: u16 = 7;

impl Turn {
    /// The turn of a sweep; `bearing` is where the antenna is put.
    #[must_use]
    pub fn new(sweep: &Sweep<'_>, known: Option<KnownAntenna<'_>>, bearing: Option<f64>) -> Self {
        let samples = sweep.samples.iter().map(|s| [s.boresight, s.rss_dbm]).collect();
        let Ok(pattern) = Pattern::new(sweep, WINDOW) else {
            return Self { samples, ..Self::default() };
        };
        let smoothed = pattern.cells().iter();
        let smoothed = smoothed.filter_map(|c| Some([c.angle(), c.smoothed_dbm()?])).collect();
        let fitted = known.zip(bearing).map(|(known, bearing)| fit(&pattern, known, bearing));
        Self { samples, smoothed, fitted: fitted.unwrap_or_default() }
    }
}

/// The antenna, turned to the bearing, at the level that is best in the least squares.
fn fit(pattern: &Pattern, known: KnownAntenna<'_>, bearing: f64) -> Vec<[f64; 2]> {
    // A bearing that lies to the left of the boresight is at a positive azimuth.
    let gain = |boresight: f64| known.antenna.gain_dbi(bearing - boresight, known.elevation);
    let mut sum = 0.0;
    let mut count = 0.0;
    for cell in pattern.cells() {
        if let Some(mean_dbm) = cell.mean_dbm() {
            sum += mean_dbm - gain(cell.angle());
            count += 1.0;
        }
    }
    let offset = if count > 0.0 { sum / count } else { return Vec::new() };
    let at = |degree: u16| {
        let angle = f64::from(2 * degree).to_radians();
        [angle, offset + gain(angle)]
    };
    (0..180).map(at).collect()
}

#[cfg(test)]
mod tests {
    use foxhunt_core::{BeaconId, MeasuredList, Pose, Sample};
    use foxhunt_sensors::PatternTable;

    use super::*;

    #[test]
    fn a_clean_turn_is_its_own_fit() {
        let patch = PatternTable::reference_patch();
        let bearing = 1.0;
        let sample = |position: u16| {
            let boresight = f64::from(position) * std::f64::consts::TAU / 128.0;
            let rss_dbm = -60.0 + patch.gain_dbi(bearing - boresight, 0.0);
            Sample { time: 0.0, receiver: Pose::at(0.0, 0.0, 4.0), boresight, position, rss_dbm }
        };
        let samples: Vec<Sample> = (0..128).map(sample).collect();
        let sweep = Sweep {
            beacon: BeaconId(0),
            time: 0.0,
            receiver: Pose::at(0.0, 0.0, 4.0),
            positions: 128,
            samples: &samples,
            unanswered: &[],
            floor_dbm: None,
            receiver_sigma_m: None,
            measured: MeasuredList::default(),
        };
        let known = KnownAntenna { antenna: &patch, elevation: 0.0 };
        let turn = Turn::new(&sweep, Some(known), Some(bearing));
        assert_eq!((turn.samples.len(), turn.smoothed.len(), turn.fitted.len()), (128, 128, 180));
        for [angle, level] in &turn.fitted {
            // What is left is rounding of sums.
            let true_dbm = -60.0 + patch.gain_dbi(bearing - angle, 0.0);
            assert!((level - true_dbm).abs() < 1e-6, "{angle}: {level}, not {true_dbm}");
        }
        assert!(Turn::new(&sweep, None, Some(bearing)).fitted.is_empty());
        assert!(Turn::new(&sweep, Some(known), None).fitted.is_empty());
    }
}
