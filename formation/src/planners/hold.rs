use core::fmt;

use foxhunt_core::{
    Belief, Decision, FormationPlanner, Outcome, PlanError, Stage, Station, Waypoint,
};

/// Everyone stays and listens for a number of turns: fixed stations, or one place judged well.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Hold {
    turns: u32,
    done: u32,
}

impl Hold {
    /// A planner that finishes a target after `turns` turns of the antenna; 0 counts as 1.
    #[must_use]
    pub const fn new(turns: u32) -> Self {
        Self { turns, done: 0 }
    }
}

impl FormationPlanner for Hold {
    fn begin(&mut self, stations: &mut [Station]) -> Result<(), PlanError> {
        self.done = 0;
        hold(stations);
        Ok(())
    }

    fn plan(
        &mut self,
        _belief: &dyn Belief,
        stations: &mut [Station],
    ) -> Result<Decision, PlanError> {
        self.done = self.done.saturating_add(1);
        hold(stations);
        Ok(if self.done >= self.turns {
            Decision::Finish(Outcome::MoveLimit)
        } else {
            Decision::Listen(Stage::Searching)
        })
    }

    fn explain(&self, to: &mut dyn fmt::Write) -> fmt::Result {
        write!(to, "turn {} of {}", self.done, self.turns.max(1))
    }
}

fn hold(stations: &mut [Station]) {
    for station in stations {
        station.goal = Waypoint { position: station.pose.position };
    }
}

#[cfg(test)]
mod tests {
    use foxhunt_core::{Estimate, Pose, laws};
    use nalgebra::Vector2;

    use super::*;

    #[test]
    fn it_listens_as_often_as_configured() {
        let belief = Estimate::isotropic(Vector2::new(50.0, 50.0), 10.0);
        let mut stations = [Station { pose: Pose::at(1.0, 2.0, 3.0), ..Station::default() }];
        laws::formation_planner(|| Hold::new(2), &belief, &mut stations);
        let mut hold = Hold::new(2);
        for _ in 0..2 {
            hold.begin(&mut stations).expect("holding needs nothing");
            assert_eq!(hold.plan(&belief, &mut stations), Ok(Decision::Listen(Stage::Searching)));
            assert_eq!(hold.plan(&belief, &mut stations), Ok(Decision::Finish(Outcome::MoveLimit)));
            assert_eq!(stations[0].goal.position, stations[0].pose.position);
        }
    }
}
