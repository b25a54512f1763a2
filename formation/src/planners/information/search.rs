//! Formations to choose from, and the search for the best of them.

use alloc::vec::Vec;
use core::{
    f64::consts::{FRAC_PI_2, FRAC_PI_3, PI, TAU},
    fmt,
};

use foxhunt_core::{BeaconId, Belief, Estimate, PlanError, Station};
use nalgebra::{Matrix2, Vector2, Vector3};

use super::{
    Cell, Cells, Criterion, InformationConfig, LevelRecord, Objective, Power, TurnInformation,
    rollout::{Course, Rollout},
    worth::ExpectedPosterior,
};
use crate::{
    planners::AltitudeRule,
    shape::{Polygon, number},
};

/// The distance that a target at a Gaussian place about the drone is within with 10 %, over the
/// root mean square distance: √(−ln 0.9).
const NEAR: f64 = 0.324_592_845_974_501_2;

/// Number of formations that are refined.
const REFINED: usize = 2;

/// Number of times that the steps of a refinement are halved.
const HALVINGS: u8 = 4;

/// Shape of a formation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Form {
    /// Everyone stays.
    Stay,
    /// A regular polygon of this circumradius in metres.
    Polygon(f64),
    /// A straight line of this length in metres.
    Line(f64),
    /// Half a circle of this radius in metres.
    Arc(f64),
    /// Each at a part of the belief.
    Scattered,
}

impl fmt::Display for Form {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Stay => f.write_str("turn again"),
            Self::Polygon(radius) => write!(f, "polygon of {radius:.1} m"),
            Self::Line(length) => write!(f, "line of {length:.1} m"),
            Self::Arc(radius) => write!(f, "arc of {radius:.1} m"),
            Self::Scattered => f.write_str("scattered"),
        }
    }
}

/// A formation that might be flown.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Candidate {
    pub form: Form,
    pub places: Vec<Vector3<f64>>,
}

/// Data that candidates are made of.
struct Drawing<'a> {
    rule: AltitudeRule,
    count: usize,
    /// Mean place of the drones now.
    from: Vector2<f64>,
    separation_m: f64,
    /// The distance at which a drone measures a target best.
    best_m: f64,
    belief: &'a Cells,
}

impl Drawing<'_> {
    /// A place at the altitude for a target that is near.
    fn raise(&self, place: &Vector2<f64>) -> Vector3<f64> {
        low_over(&self.rule, &self.belief.moments, place)
    }

    /// Every formation that is worth a look, over the belief of one target.
    fn candidates(&self, all: &mut Vec<Candidate>) {
        let moments = &self.belief.moments;
        let covariance = &moments.covariance;
        let [large, small] = super::worth::axes(covariance).map(libm::sqrt);
        let along =
            0.5 * libm::atan2(2.0 * covariance[(0, 1)], covariance[(0, 0)] - covariance[(1, 1)]);
        let sigma = libm::sqrt(0.5 * covariance.trace());
        let mean = moments.mean;
        let towards = self.from - mean;
        let bearing = if towards.norm() > 1e-9 { libm::atan2(towards.y, towards.x) } else { 0.0 };

        let mut radii: Vec<f64> = Vec::new();
        let side = 2.0 * libm::sin(PI / number(self.count.max(2)));
        let least = if self.count > 1 { self.separation_m / side } else { 0.0 };
        for radius in [self.best_m, 1.4 * self.best_m, 0.6 * sigma, sigma, 1.5 * sigma] {
            let radius = radius.max(least);
            if radii.iter().all(|known| (known - radius).abs() > 0.1 * known) {
                radii.push(radius);
            }
        }
        for centre in self.centres(along, large) {
            for &radius in &radii {
                for turned in self.rotations() {
                    self.polygon(&centre, radius, along + turned, all);
                }
            }
        }
        for (direction, length) in [
            (along, 2.0 * large),
            (along, 3.0 * large),
            (along + FRAC_PI_2, 2.0 * small.max(self.best_m)),
            (along + FRAC_PI_2, 2.0 * large),
        ] {
            self.line(&mean, direction, length, all);
        }
        for radius in [sigma, 1.5 * sigma, 2.0 * sigma] {
            self.arc(&mean, bearing, radius.max(self.best_m), all);
        }
        self.scattered(all);
        // Abreast on the way, and as wide triangles the other way round.
        for share in [0.5, 0.65, 0.8, 0.9] {
            let centre = self.from + (mean - self.from) * share;
            for length in [sigma, 2.0 * sigma, 3.0 * sigma] {
                self.line(&centre, bearing + FRAC_PI_2, length, all);
            }
        }
        for radius in [sigma, 1.5 * sigma] {
            for rotation in [bearing + FRAC_PI_2, bearing + PI] {
                self.polygon(&mean, radius, rotation, all);
            }
        }
    }

    /// The mean, places about it along the major axis, on the way to it, and modes.
    fn centres(&self, along: f64, large: f64) -> Vec<Vector2<f64>> {
        let mean = self.belief.moments.mean;
        let axis = Vector2::new(libm::cos(along), libm::sin(along)) * large;
        let mut centres = alloc::vec![mean, mean + axis * 0.7, mean - axis * 0.7];
        let way = mean - self.from;
        if way.norm() > 4.0 * self.best_m {
            centres.extend([0.4, 0.6, 0.8].map(|share| self.from + way * share));
        }
        if !self.belief.gaussian {
            centres.extend(self.spread(3).map(|cell| cell.mean));
        }
        centres
    }

    /// Angles that turn a polygon into something else.
    fn rotations(&self) -> impl Iterator<Item = f64> {
        let count = number(self.count.max(1));
        let steps: u8 = if self.count > 4 { 1 } else { 3 };
        (0..steps).map(move |step| f64::from(step) * TAU / count / 3.0)
    }

    /// Returns the densest cell, then cells that are far from all before.
    fn spread(&self, count: usize) -> impl Iterator<Item = &Cell> {
        let cells = &self.belief.cells;
        let density = |cell: &Cell| cell.weight / (cell.covariance.determinant() + 1e-6);
        let densest = cells.iter().max_by(|a, b| density(a).total_cmp(&density(b)));
        let mut chosen: Vec<&Cell> = densest.into_iter().collect();
        while chosen.len() < count.min(cells.len()) {
            let far = |cell: &Cell| {
                let square = |known: &&Cell| (known.mean - cell.mean).norm_squared();
                chosen.iter().map(square).fold(f64::INFINITY, f64::min) * cell.weight
            };
            match cells.iter().max_by(|a, b| far(a).total_cmp(&far(b))) {
                Some(next) => chosen.push(next),
                None => break,
            }
        }
        chosen.into_iter()
    }

    fn push(&self, form: Form, places: Vec<Vector2<f64>>, all: &mut Vec<Candidate>) {
        let places: Vec<_> = places.iter().map(|place| self.raise(place)).collect();
        if apart(&places, self.separation_m) {
            all.push(Candidate { form, places });
        }
    }

    fn polygon(&self, centre: &Vector2<f64>, radius: f64, rotation: f64, all: &mut Vec<Candidate>) {
        let polygon = Polygon { circumradius: radius };
        let place = |index| polygon.vertex(centre, rotation, 0.0, index, self.count).xy();
        self.push(Form::Polygon(radius), (0..self.count).map(place).collect(), all);
    }

    fn line(&self, centre: &Vector2<f64>, direction: f64, length: f64, all: &mut Vec<Candidate>) {
        let between = number(self.count.max(2) - 1);
        let length = length.max(self.separation_m * between * 1.001);
        let along = Vector2::new(libm::cos(direction), libm::sin(direction));
        // A drone alone is at its end.
        let place = |index: usize| centre + along * length * (number(index) / between - 0.5);
        self.push(Form::Line(length), (0..self.count).map(place).collect(), all);
    }

    fn arc(&self, centre: &Vector2<f64>, bearing: f64, radius: f64, all: &mut Vec<Candidate>) {
        let between = number(self.count.max(2) - 1);
        let place = |index: usize| {
            let angle = bearing + PI * (number(index) / between - 0.5);
            centre + Vector2::new(libm::cos(angle), libm::sin(angle)) * radius
        };
        self.push(Form::Arc(radius), (0..self.count).map(place).collect(), all);
    }

    /// Each at its own part of the belief, beside it on the side of the drones.
    fn scattered(&self, all: &mut Vec<Candidate>) {
        let beside = |cell: &Cell| {
            let way = self.from - cell.mean;
            let norm = way.norm();
            let unit = if norm > 1e-9 { way / norm } else { Vector2::x() };
            cell.mean + unit * self.best_m.min(norm)
        };
        let places: Vec<_> = self.spread(self.count).map(beside).collect();
        if places.len() == self.count {
            self.push(Form::Scattered, places, all);
        }
    }
}

/// Farthest distances that any drone flies, in metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Farthest {
    pub over_ground_m: f64,
    height_m: f64,
}

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
    pub candidate: Candidate,
    /// True if drones were moved from where its form has them.
    pub refined: bool,
    /// Smaller is better.
    cost: f64,
    /// Expected information of its turn, in nats.
    pub nats: f64,
    /// Duration of the move and the turn.
    pub seconds: f64,
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

/// A place at the altitude for a target that is near.
pub(super) fn low_over(
    rule: &AltitudeRule,
    belief: &Estimate<2>,
    place: &Vector2<f64>,
) -> Vector3<f64> {
    let square = (place - belief.mean).norm_squared() + belief.covariance.trace();
    place.push(rule.altitude(NEAR * libm::sqrt(square)))
}

/// Returns true if no two places are nearer to each other over ground than the separation.
pub(super) fn apart(places: &[Vector3<f64>], separation_m: f64) -> bool {
    let least = separation_m * separation_m * (1.0 - 1e-9);
    places
        .iter()
        .enumerate()
        .all(|(index, a)| places[..index].iter().all(|b| (a.xy() - b.xy()).norm_squared() >= least))
}

/// The farthest flight between places in the same order.
pub(super) fn farthest(from: &[Vector3<f64>], to: &[Vector3<f64>]) -> Farthest {
    from.iter().zip(to).fold(Farthest { over_ground_m: 0.0, height_m: 0.0 }, |far, (a, b)| {
        let off = b - a;
        Farthest {
            over_ground_m: far.over_ground_m.max(off.xy().norm()),
            height_m: far.height_m.max(off.z.abs()),
        }
    })
}

/// The places in an order in which no two drones would make the sum of squared distances over
/// ground smaller by exchanging theirs. Squares keep the longest way short, which is what a plan
/// waits for.
///
/// An estimate of how long a move takes, for hundreds of formations per decision: no drone is
/// assigned by it. Which drone flies where is decided by the fleet, over the ways that are
/// permitted.
pub(super) fn exchanged(from: &[Vector3<f64>], to: &[Vector3<f64>]) -> Vec<Vector3<f64>> {
    let mut to = to.to_vec();
    // Σ |a − b|² differs by the mixed products only.
    let saving = |from: &[Vector3<f64>], to: &[Vector3<f64>], i: usize, j: usize| {
        (from[i].xy() - from[j].xy()).dot(&(to[j].xy() - to[i].xy()))
    };
    let count = from.len().min(to.len());
    for _ in 0..count * count {
        let mut exchanged = false;
        for i in 0..count {
            for j in 0..i {
                if saving(from, &to, i, j) > 1e-9 {
                    to.swap(i, j);
                    exchanged = true;
                }
            }
        }
        if !exchanged {
            break;
        }
    }
    to
}

/// The middle of places over ground.
fn middle(places: &[Vector3<f64>]) -> Vector2<f64> {
    places.iter().map(|place| place.xy()).sum::<Vector2<f64>>() / number(places.len())
}

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
    use approx::abs_diff_eq;
    use foxhunt_core::{Estimate, Pose};

    use super::*;

    #[test]
    fn neighbours_keep_their_sides() {
        let from: Vec<_> = [0.0, 10.0, 20.0].map(|east| Vector3::new(east, 0.0, 2.0)).to_vec();
        let to: Vec<_> = [21.0, 1.0, 11.0].map(|east| Vector3::new(east, 0.0, 4.0)).to_vec();
        let assigned = exchanged(&from, &to);
        assert_eq!(assigned.iter().map(|place| place.x).collect::<Vec<_>>(), [1.0, 11.0, 21.0]);
        let far = farthest(&from, &assigned);
        assert_eq!(far, Farthest { over_ground_m: 1.0, height_m: 2.0 });
    }

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
        assert!(one < 0.0 && abs_diff_eq!(two, 2.0 * one, epsilon = 1e-12), "{one} and {two}");
    }
}
