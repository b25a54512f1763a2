use alloc::vec::Vec;
use core::f64::consts::FRAC_PI_3;

use foxhunt_core::{BeaconId, Belief, PlanError, Station};
use nalgebra::{Matrix2, Vector2, Vector3};

use super::{
    Criterion, InformationConfig, Objective, TurnInformation,
    cells::Cells,
    power::{LevelRecord, Power},
    rollout::{Course, Rollout},
    shapes::{Candidate, Drawing, Form, apart},
    travel::{exchanged, farthest},
    worth::ExpectedPosterior,
};
use crate::shape::number;

/// Number of formations that are refined.
const REFINED: usize = 2;

/// A target that is not done.
struct Aim {
    belief: Cells,
    /// P⁻¹, where its moments are all that is known.
    information: Option<Matrix2<f64>>,
    power: Power,
    /// Expected posterior after the formation looked at last.
    posterior: ExpectedPosterior,
}

/// A formation and what is expected of it.
#[derive(Clone, Debug)]
pub(super) struct Plan {
    pub(super) candidate: Candidate,
    /// True if drones were moved from where its form has them.
    pub(super) refined: bool,
    /// Smaller is better.
    cost: f64,
    /// Expected information of its turn, in nats.
    pub(super) nats: f64,
    /// Duration of the move and the turn.
    pub(super) seconds: f64,
}

/// The choice among formations for one position.
pub(super) struct Search<'a, S: ?Sized> {
    turn: &'a S,
    config: &'a InformationConfig,
    from: Vec<Vector3<f64>>,
    aims: Vec<Aim>,
    rollout: Rollout,
}

impl<'a, S: TurnInformation + ?Sized> Search<'a, S> {
    pub(super) fn new(
        turn: &'a S,
        config: &'a InformationConfig,
        levels: &LevelRecord,
        beliefs: &[(Option<BeaconId>, &dyn Belief)],
        stations: &[Station],
    ) -> Result<Self, PlanError> {
        let aim = |(beacon, belief): &(Option<BeaconId>, &dyn Belief)| {
            aim(turn, config, levels.places(*beacon), *belief)
        };
        let aims = beliefs.iter().map(aim).collect::<Result<_, _>>()?;
        let from = stations.iter().map(|station| station.pose.position).collect();
        let rollout = Rollout::new(turn, config, stations.len());
        Ok(Self { turn, config, from, aims, rollout })
    }

    /// The best formation, and what turning again where everyone is would be worth.
    pub(super) fn best(&mut self) -> (Plan, Plan) {
        let stay = self.look(Candidate { form: Form::Stay, places: self.from.clone() });
        let mut candidates = Vec::new();
        for aim in &self.aims {
            self.drawing(aim).candidates(&mut candidates);
        }
        let mut plans: Vec<Plan> = candidates.into_iter().map(|c| self.look(c)).collect();
        plans.push(stay.clone());
        plans.sort_by(|a, b| a.cost.total_cmp(&b.cost));
        plans.truncate(REFINED);
        let refined = plans.into_iter().map(|plan| self.refine(plan));
        let best = refined.min_by(|a, b| a.cost.total_cmp(&b.cost)).unwrap_or_else(|| stay.clone());
        let saving = match self.config.objective {
            Objective::TimeToEllipse => self.config.least_saving_s,
            Objective::InformationRate => 0.0,
        };
        if best.cost < stay.cost - saving { (best, stay) } else { (stay.clone(), stay) }
    }

    fn drawing<'b>(&'b self, aim: &'b Aim) -> Drawing<'b> {
        Drawing {
            rule: self.config.altitude,
            count: self.from.len(),
            from: middle(&self.from),
            separation_m: self.config.separation_m,
            best_m: self.rollout.best_m(),
            belief: &aim.belief,
        }
    }

    /// Returns the expectation of a formation.
    fn look(&mut self, candidate: Candidate) -> Plan {
        let travel = farthest(&self.from, &exchanged(&self.from, &candidate.places));
        let moved = (travel.over_ground_m / self.config.speed_mps)
            .max(travel.height_m / self.config.climb_mps);
        let seconds = moved + self.config.turn_s;
        let mut nats = 0.0;
        let mut total = Course::default();
        let turn = self.turn;
        let places = &candidate.places;
        for Aim { belief, information, power, posterior } in &mut self.aims {
            match information {
                Some(prior) => posterior.by_fisher(turn, belief, power, prior, places),
                None => posterior.by_entropy(turn, belief, power, places),
            }
            let course = self.rollout.after(posterior, &belief.blocks);
            nats += posterior.nats;
            total.nats += course.nats;
            // One turn serves all targets.
            total.seconds = total.seconds.max(course.seconds);
            total.to_ellipse_s += course.to_ellipse_s;
        }
        let refined = false;
        Plan { candidate, refined, cost: self.rollout.cost(seconds, &total), nats, seconds }
    }

    /// Moves single drones, and the whole formation, as long as that helps (coordinate ascent).
    fn refine(&mut self, mut plan: Plan) -> Plan {
        let moments = self.aims.first().map(|aim| aim.belief.moments);
        let Some(moments) = moments.filter(|_| plan.candidate.form != Form::Stay) else {
            return plan;
        };
        let sigma = libm::sqrt(0.5 * moments.covariance.trace());
        let mut step = 0.5 * sigma.max(self.rollout.best_m());
        for _ in 0..HALVINGS {
            for drone in 0..=self.from.len() {
                for direction in 0..6_u8 {
                    let angle = f64::from(direction) * FRAC_PI_3;
                    let shift = Vector2::new(libm::cos(angle), libm::sin(angle)) * step;
                    let mut places = plan.candidate.places.clone();
                    for (index, place) in places.iter_mut().enumerate() {
                        // One drone, or after the last one all of them.
                        if index == drone || drone == self.from.len() {
                            *place = self.raised(&(place.xy() + shift));
                        }
                    }
                    self.improve(&mut plan, places);
                }
            }
            for scale in [1.4, 0.7] {
                let centre = middle(&plan.candidate.places);
                let scaled = |p: &Vector3<f64>| self.raised(&(centre + (p.xy() - centre) * scale));
                let places = plan.candidate.places.iter().map(scaled).collect();
                self.improve(&mut plan, places);
            }
            step *= 0.5;
        }
        plan
    }

    /// Takes other places for the plan's where they are allowed and better.
    fn improve(&mut self, plan: &mut Plan, places: Vec<Vector3<f64>>) {
        if apart(&places, self.config.separation_m) {
            let moved = self.look(Candidate { form: plan.candidate.form, places });
            if moved.cost < plan.cost {
                *plan = Plan { refined: true, ..moved };
            }
        }
    }

    /// A place at the altitude for the nearest target.
    fn raised(&self, place: &Vector2<f64>) -> Vector3<f64> {
        let raised = self.aims.iter().map(|aim| self.drawing(aim).raise(place));
        raised.min_by(|a, b| a.z.total_cmp(&b.z)).unwrap_or_else(|| place.push(0.0))
    }
}

/// The middle of places over ground.
fn middle(places: &[Vector3<f64>]) -> Vector2<f64> {
    places.iter().map(|place| place.xy()).sum::<Vector2<f64>>() / number(places.len())
}

/// Number of times that the steps of a refinement are halved.
const HALVINGS: u8 = 4;

fn aim<S: TurnInformation + ?Sized>(
    turn: &S,
    config: &InformationConfig,
    received_at: &[Vector3<f64>],
    belief: &dyn Belief,
) -> Result<Aim, PlanError> {
    let count = usize::try_from(config.places).unwrap_or(usize::MAX);
    let fisher = |gaussian| match config.criterion {
        Criterion::Automatic => gaussian,
        Criterion::Fisher => true,
        Criterion::Entropy => false,
    };
    // Every pair of cells counts by entropy: twice as many take four times as long.
    let belief =
        Cells::of(belief, |gaussian| if fisher(gaussian) { count } else { count.div_ceil(2) })?;
    // A belief that is flat or a point has no information matrix; its cells still differ in place.
    let factor = belief.moments.covariance.cholesky().filter(|_| fisher(belief.gaussian));
    let information = factor.map(|factor| factor.solve(&Matrix2::identity()));
    let power = Power::of(turn, &belief, received_at, config.power_sigma_db);
    Ok(Aim { belief, information, power, posterior: ExpectedPosterior::default() })
}

#[cfg(test)]
mod tests {
    use foxhunt_core::{Estimate, Pose};

    use super::*;

    /// Two targets at one place: every turn teaches twice as much, in the same time.
    #[test]
    fn a_turn_serves_all_targets_at_once() {
        let config = InformationConfig {
            objective: Objective::InformationRate,
            ..InformationConfig::default()
        };
        let turn = config.turn().expect("in range");
        let belief = Estimate::isotropic(Vector2::new(40.0, 10.0), 12.0);
        let stations = [0.0, 5.0, 10.0].map(|e| Station::holding(Pose::at(e, 0.0, 4.0)));
        let cost = |beliefs: &[(Option<BeaconId>, &dyn Belief)]| {
            let levels = LevelRecord::default();
            let mut search =
                Search::new(&turn, &config, &levels, beliefs, &stations).expect("a belief");
            let places = search.from.clone();
            search.look(Candidate { form: Form::Stay, places }).cost
        };
        let one = cost(&[(None, &belief)]);
        let two = cost(&[(None, &belief), (None, &belief)]);
        assert!(one < 0.0 && (two - 2.0 * one).abs() < 1e-12, "{one} and {two}");
    }
}
