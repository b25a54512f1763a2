use nalgebra::{Matrix2, Vector2};

use crate::{Estimate, FormationPlanner, Station};

/// A planner's laws for one belief and one set of drones. `fresh` makes the same planner each
/// time.
///
/// # Panics
///
/// On a breach.
pub fn formation_planner<P: FormationPlanner>(
    fresh: impl Fn() -> P,
    belief: &Estimate<2>,
    stations: &mut [Station],
) {
    let finite = |stations: &[Station]| {
        stations.iter().all(|s| s.goal.position.iter().all(|c| c.is_finite()))
    };
    let mut planner = fresh();
    if planner.begin(stations).is_ok() {
        assert!(finite(stations), "the first goals are not finite");
    }
    if planner.plan(belief, stations).is_ok() {
        assert!(finite(stations), "the goals are not finite");
    }
    let nowhere =
        Estimate { mean: Vector2::repeat(f64::NAN), covariance: Matrix2::repeat(f64::NAN) };
    let _ = fresh().plan(&nowhere, stations);
    assert!(finite(stations), "a belief that is not finite made goals that are not");
}
