use foxhunt_hardware::ReportedHeight;
use foxhunt_hunt::hunt::Event;

/// Compares the height above the ground that a drone reports with that of an elevation model.
#[derive(Clone, Copy, Debug)]
pub(super) struct HeightWatch {
    tolerance_m: f64,
    /// Time since when they have been too far apart, in seconds.
    since: Option<f64>,
    /// True if the difference was reported.
    reported: bool,
}

/// A report that is older is of another place, in seconds: at 5 m/s of two metres away.
const FRESH_S: f64 = 0.4;

/// Duration of a difference until it is reported, in seconds: a tree or a roof is passed by then.
const LASTS_S: f64 = 3.0;

/// Heights agree again within this share of the tolerance.
const AGREEMENT: f64 = 0.5;

impl HeightWatch {
    pub(super) fn new(tolerance_m: f64) -> Self {
        Self { tolerance_m, since: None, reported: false }
    }

    /// Compares what was reported with what is expected, in metres; returns what is to be logged of
    /// the drone with this number: once, until they agree again.
    pub(super) fn compare(
        &mut self,
        time: f64,
        drone: usize,
        of: ReportedHeight,
        expected_m: f64,
    ) -> Option<Event> {
        if of.age_s > FRESH_S {
            return None;
        }
        let apart_m = (of.height.metres - expected_m).abs();
        if apart_m <= self.tolerance_m {
            self.since = None;
            self.reported &= apart_m > AGREEMENT * self.tolerance_m;
            return None;
        }
        let since = *self.since.get_or_insert(time);
        if self.reported || time - since < LASTS_S {
            return None;
        }
        self.reported = true;
        let reported = of.height;
        let tolerance_m = self.tolerance_m;
        Some(Event::HeightDiffers { time, drone, reported, expected_m, tolerance_m })
    }
}

#[cfg(test)]
mod tests {
    use foxhunt_core::{HeightAboveGround, HeightSource};

    use super::*;

    /// The times at which a watch of 4 m reports, of heights that are so far apart each second.
    fn reports(apart: &[f64], age_s: f64) -> Vec<f64> {
        let mut watch = HeightWatch::new(4.0);
        let compared = apart.iter().zip(0_u32..).filter_map(|(apart, second)| {
            let height =
                HeightAboveGround { metres: 10.0 + apart, source: HeightSource::Rangefinder };
            let event = watch.compare(second.into(), 0, ReportedHeight { height, age_s }, 10.0)?;
            Some(event.time())
        });
        compared.collect()
    }

    #[test]
    fn a_difference_is_reported_once_while_it_lasts() {
        assert_eq!(reports(&[4.5; 20], 0.1), [3.0]);
        assert_eq!(reports(&[-4.5; 20], 0.1), [3.0]);
        assert_eq!(reports(&[3.9; 20], 0.1), [0.0; 0]);
        assert_eq!(reports(&[4.5; 20], 0.5), [0.0; 0], "an old report");
        let passed = [4.5, 4.5, 4.5, 0.0, 4.5, 4.5, 4.5, 0.0];
        assert_eq!(reports(&passed, 0.1), [0.0; 0], "a tree");
        // 3 m are no agreement again, 1 m are.
        let apart = [5.0, 5.0, 5.0, 5.0, 3.0, 5.0, 5.0, 5.0, 5.0, 1.0, 5.0, 5.0, 5.0, 5.0, 5.0];
        assert_eq!(reports(&apart, 0.1), [3.0, 13.0]);
    }
}
