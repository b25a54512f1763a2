use core::fmt;

use nalgebra::{Matrix2, Vector2, Vector3};

use crate::{Decision, Estimate, FormationPlanner, PlanError, Pose, Station};

/// The most drones that the laws are tried with.
const DRONES: usize = 8;

/// The most that may be given.
const MOST: usize = 64;

/// A planner's laws for one belief and one set of drones, and for 1 to 8 drones that come and go.
/// `fresh` makes the same planner each time, one that explains itself.
///
/// # Panics
///
/// On a breach, or for more than 64 stations.
pub fn formation_planner<P: FormationPlanner>(
    fresh: impl Fn() -> P,
    belief: &Estimate<2>,
    stations: &mut [Station],
) {
    one_by_one(&mut fresh(), belief, stations);
    drones_come_and_go(&mut fresh(), belief);
}

/// The goal of each drone; zero beyond the last drone.
fn goals(stations: &[Station]) -> [Vector3<f64>; MOST] {
    assert!(stations.len() <= MOST, "{} stations are more than {MOST}", stations.len());
    core::array::from_fn(|drone| {
        stations.get(drone).map_or_else(Vector3::zeros, |s| s.goal.position)
    })
}

fn finite(stations: &[Station]) -> bool {
    stations.iter().all(|s| s.goal.position.iter().all(|c| c.is_finite()))
}

fn one_by_one<P: FormationPlanner>(
    planner: &mut P,
    belief: &Estimate<2>,
    stations: &mut [Station],
) {
    let before = goals(stations);
    match planner.begin(stations) {
        Ok(()) => assert!(finite(stations), "the first goals are not finite"),
        Err(error) => assert_eq!(goals(stations), before, "goals were changed despite: {error}"),
    }
    let before = goals(stations);
    match planner.plan(belief, stations) {
        Ok(_) => assert!(finite(stations), "the goals are not finite"),
        Err(error) => assert_eq!(goals(stations), before, "goals were changed despite: {error}"),
    }
    let before = goals(stations);
    let none = planner.plan_together(&[], stations);
    assert_eq!(none, Err(PlanError::NoPlace), "it plans for no target");
    assert_eq!(goals(stations), before, "goals were changed where there is no target");
    let nowhere =
        Estimate { mean: Vector2::repeat(f64::NAN), covariance: Matrix2::repeat(f64::NAN) };
    for resumes in [false, true] {
        let before = goals(stations);
        let planned = match resumes {
            false => planner.plan(&nowhere, stations).map(|_| ()),
            true => planner.resume(&nowhere, stations),
        };
        if let Err(error) = planned {
            assert_eq!(goals(stations), before, "goals were changed despite: {error}");
        }
        assert!(finite(stations), "a belief that is not finite made goals that are not");
    }
}

/// Every number of drones plans after every other one, some of them not where they should be.
fn drones_come_and_go<P: FormationPlanner>(planner: &mut P, belief: &Estimate<2>) {
    let mut all: [Station; DRONES] = core::array::from_fn(|drone| {
        let east = 5.0 * f64::from(u8::try_from(drone).unwrap_or(u8::MAX));
        Station::holding(Pose::at(east, -0.5 * east, 2.0))
    });
    if let Err(error) = planner.begin(&mut all) {
        panic!("eight drones cannot begin: {error}");
    }
    for first in 1..=DRONES {
        for count in [first, DRONES + 1 - first, 1] {
            for station in all.iter_mut().step_by(2) {
                station.pose.position = station.goal.position;
            }
            let stations = &mut all[..count];
            match planner.plan(belief, stations) {
                Ok(decision) => {
                    assert!(finite(stations), "the goals of {count} drones are not finite");
                    explained(planner, &decision);
                    if let Decision::Finish(_) = decision
                        && let Err(error) = planner.begin(stations)
                    {
                        panic!("{count} drones cannot begin again: {error}");
                    }
                }
                Err(error) => panic!("{count} drones have no plan: {error}"),
            }
        }
    }
}

/// True if anything was written.
struct Written(bool);

impl fmt::Write for Written {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        self.0 |= !text.trim().is_empty();
        Ok(())
    }
}

fn explained<P: FormationPlanner>(planner: &P, decision: &Decision) {
    let mut written = Written(false);
    let written_out = planner.explain(&mut written);
    assert!(written_out.is_ok() && written.0, "no reason is given for {decision:?}");
}
