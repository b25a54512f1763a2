use nalgebra::{Matrix2, Vector2, Vector3};

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
    let sum = |stations: &[Station]| stations.iter().map(|s| s.goal.position).sum::<Vector3<f64>>();
    let mut planner = fresh();
    let before = sum(stations);
    match planner.begin(stations) {
        Ok(()) => assert!(finite(stations), "the first goals are not finite"),
        Err(error) => assert_eq!(sum(stations), before, "goals were changed despite: {error}"),
    }
    let before = sum(stations);
    match planner.plan(belief, stations) {
        Ok(_) => assert!(finite(stations), "the goals are not finite"),
        Err(error) => assert_eq!(sum(stations), before, "goals were changed despite: {error}"),
    }
    let nowhere =
        Estimate { mean: Vector2::repeat(f64::NAN), covariance: Matrix2::repeat(f64::NAN) };
    let before = sum(stations);
    if let Err(error) = planner.plan(&nowhere, stations) {
        assert_eq!(sum(stations), before, "goals were changed despite: {error}");
    }
    assert!(finite(stations), "a belief that is not finite made goals that are not");
}
