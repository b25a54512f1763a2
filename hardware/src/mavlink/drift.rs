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

#[cfg(test)]
mod tests {
    use super::*;

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
