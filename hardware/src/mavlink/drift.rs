use nalgebra::Vector3;

/// Distances between a vehicle and its goal, to notice that it goes somewhere else: another station
/// may send it velocities or attitudes, of which it reports no target.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Drift {
    nearest_m: f64,
    /// Distance that it may still go in its old direction, in metres.
    braking_m: f64,
    last: Option<(f64, Vector3<f64>)>,
    away_since: Option<f64>,
}

/// Distance in metres, besides its braking, from which it has gone away from its goal: gusts and
/// overshoots are less.
const AWAY_M: f64 = 4.0;

/// Time for which it has to be away, in seconds.
const AWAY_S: f64 = 1.0;

/// The least deceleration when it is sent elsewhere in flight, in m/s²: autopilots plan with 2.5.
const BRAKES_MPS2: f64 = 1.5;

/// Faster from one report to the next is a position that jumps, not a flight, in m/s.
const JUMPS_MPS: f64 = 30.0;

impl Drift {
    /// Takes a report of its place and its speed in m/s; returns how far it has gone away from the
    /// goal in metres once that is beyond doubt.
    pub(super) fn see(
        &mut self,
        at: f64,
        place: Vector3<f64>,
        speed: f64,
        goal: &Vector3<f64>,
    ) -> Option<f64> {
        let distance = (place - goal).norm();
        let last = self.last.replace((at, place));
        let Some((before, there)) = last else {
            self.nearest_m = distance;
            self.braking_m = speed * speed / (2.0 * BRAKES_MPS2);
            return None;
        };
        if at <= before {
            return None;
        }
        if (place - there).norm() > 1.0 + JUMPS_MPS * (at - before) {
            self.nearest_m = distance;
        }
        self.nearest_m = self.nearest_m.min(distance);
        let away_m = distance - self.nearest_m;
        if away_m <= AWAY_M + self.braking_m {
            self.away_since = None;
            return None;
        }
        (at - *self.away_since.get_or_insert(at) >= AWAY_S).then_some(away_m)
    }
}

/// Reports of the autopilot's own target that are not its goal: all in a row for a while, or some
/// of the last ones, as when set-points of another station alternate with ours.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct OtherTargets {
    /// Time of the last report, in seconds.
    at: f64,
    /// Bits of the last reports, the newest the lowest, 1 for another target.
    recent: u8,
    /// Time since which some of them have had another target, in seconds.
    some_since: Option<f64>,
    /// Time since which all reports have had another target, in seconds.
    all_since: Option<f64>,
}

/// Time in seconds after which another target has replaced the goal.
const REPLACED_S: f64 = 0.9;

/// The last six reports, and the number of other targets among them beyond which one station alone
/// does not explain them.
const LAST: u8 = 0b11_1111;
const OFTEN: u32 = 3;

impl Default for OtherTargets {
    fn default() -> Self {
        Self { at: f64::NEG_INFINITY, recent: 0, some_since: None, all_since: None }
    }
}

impl OtherTargets {
    /// Takes a report, which may be the last one again; returns true if another target has
    /// replaced the goal.
    pub(super) fn see(&mut self, at: f64, other: bool) -> bool {
        if at > self.at {
            self.at = at;
            self.recent = (self.recent << 1 | u8::from(other)) & LAST;
        }
        let since = |since: Option<f64>, holds: bool| holds.then(|| since.unwrap_or(at));
        self.some_since = since(self.some_since, self.recent != 0);
        self.all_since = since(self.all_since, other);
        let lasts = |since: Option<f64>| since.is_some_and(|since| at - since >= REPLACED_S);
        let often = self.recent.count_ones() >= OFTEN && lasts(self.some_since);
        other && (lasts(self.all_since) || often)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Sees two reports a second, ours and others by their letters; when the goal was replaced.
    fn replaced(reports: &str) -> Option<f64> {
        let mut others = OtherTargets::default();
        reports.chars().zip(0..).find_map(|(report, half)| {
            let at = 0.5 * f64::from(half);
            // Each is looked at twice.
            others.see(at, report == 'x');
            others.see(at, report == 'x').then_some(at)
        })
    }

    #[test]
    fn targets_that_alternate_with_ours_are_noticed_and_single_ones_are_not() {
        assert_eq!(replaced("oooooxxx"), Some(3.5));
        assert_eq!(replaced("oxoxoxox"), Some(2.5));
        assert_eq!(replaced("ooxoxxo"), Some(2.5));
        assert_eq!(replaced("xooooooxoooooxoooooxxo"), None);
    }

    /// Flies along North at a speed from a place, 10 reports a second; when that was noticed.
    fn noticed(north: f64, mps: f64, first_mps: f64, seconds: u32) -> Option<f64> {
        let mut drift = Drift::default();
        (0..seconds * 10).find_map(|tenth| {
            let at = f64::from(tenth) * 0.1;
            let place = Vector3::new(0.0, north + mps * at, 5.0);
            drift.see(at, place, first_mps, &Vector3::new(0.0, 0.0, 5.0)).map(|_| at)
        })
    }

    #[test]
    fn going_away_is_noticed_and_braking_and_jumps_are_not() {
        let at = noticed(0.0, 2.0, 0.0, 20).expect("it goes away");
        assert!((3.0..3.4).contains(&at), "4 m at 2 m/s and a second: {at} s");
        assert_eq!(noticed(-50.0, 2.0, 0.0, 20), None, "it comes nearer");
        assert_eq!(noticed(5.0, 8.0, 8.0, 2), None, "it brakes from 8 m/s");
        let mut drift = Drift::default();
        let goal = Vector3::zeros();
        for tenth in 0..100 {
            let place = Vector3::new(if tenth < 30 { 0.0 } else { 55.0 }, 0.0, 0.0);
            assert_eq!(drift.see(f64::from(tenth) * 0.1, place, 0.0, &goal), None);
        }
    }
}
