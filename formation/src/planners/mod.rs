//! Planners: where the drones of a formation listen next.

#[cfg(feature = "alloc")]
mod coverage;
#[cfg(feature = "alloc")]
mod detection;
#[cfg(feature = "alloc")]
mod emulate;
#[cfg(test)]
mod fake;
mod follow_estimate;
#[cfg(feature = "alloc")]
mod information;
mod orbit;
mod surge_cast;
mod waypoints;

#[cfg(feature = "alloc")]
pub use coverage::{Coverage, CoverageConfig, CoverageError};
#[cfg(feature = "alloc")]
pub use detection::{Detection, DetectionConfig};
#[cfg(feature = "alloc")]
pub use emulate::Emulate;
pub use follow_estimate::{FollowConfig, FollowEstimate};
#[cfg(feature = "alloc")]
pub use information::{
    Criterion, ExpectedReading, ExpectedReadings, Information, InformationConfig, Objective,
    RssBearingTurn, SteepestDescent, SteepestDescentConfig, TARGETS, TurnFisher, TurnFishers,
    TurnInformation,
};
pub use orbit::{Arcs, ArcsConfig, Orbit, OrbitConfig};
pub use surge_cast::{SurgeCast, SurgeCastConfig};
pub use waypoints::{Hold, Waypoints};

use core::{
    f64::consts::{FRAC_PI_2, FRAC_PI_6, TAU},
    fmt,
};

use foxhunt_core::{
    Belief, Decision, Estimate, Outcome, PlanError, Stage, Station, angle,
    parameter::{ParameterError, at_least_one, finite, positive, require},
};
use nalgebra::Vector2;

use crate::shape::{Polygon, arrange, number};

/// The drones are on their circle within this factor.
const NEAR: f64 = 1.5;

/// Altitude of a drone at a horizontal distance from where the target is believed to be.
///
/// Near and high spoils bearings: from the target, a drone stays below a limit of elevation, in
/// which the antenna's horizontal pattern still holds and the level still depends on the distance.
/// Far away it flies as high as its band allows.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct AltitudeRule {
    /// The largest elevation of the drone from the target, in radians, above 0 and below π/2.
    #[cfg_attr(feature = "serde", serde(rename = "elevation_limit_rad"))]
    pub elevation_limit: f64,
    /// The lowest altitude in metres, which is kept even where the limit is broken by it.
    pub least_m: f64,
    /// The highest altitude in metres.
    pub most_m: f64,
}

impl Default for AltitudeRule {
    /// A limit of 30°, and the band between the reference's two altitudes, 3 m and 4 m
    /// (Pritzl 2018, §5.2).
    fn default() -> Self {
        Self { elevation_limit: FRAC_PI_6, least_m: 3.0, most_m: 4.0 }
    }
}

impl AltitudeRule {
    /// Checks that the rule can be kept.
    ///
    /// # Errors
    ///
    /// [`ParameterError`] names the first field that is out of its range.
    pub fn check(&self) -> Result<(), ParameterError> {
        let limit = self.elevation_limit;
        let in_range = limit > 0.0 && limit < FRAC_PI_2;
        require(in_range, "elevation_limit_rad", limit, "above 0 and below π/2")?;
        finite("least_m", self.least_m)?;
        let banded = self.most_m.is_finite() && self.most_m >= self.least_m;
        require(banded, "most_m", self.most_m, "finite and not below least_m").map(|_| ())
    }

    /// The altitude in metres at a horizontal distance in metres: d tan ε in the band.
    #[must_use]
    pub fn altitude(&self, distance_m: f64) -> f64 {
        // Unlike `clamp` this cannot panic on a rule that was not checked.
        (distance_m * libm::tan(self.elevation_limit)).min(self.most_m).max(self.least_m)
    }
}

/// Rule that ends a search that circles its estimate: the estimate has settled, and the drones have
/// then been all around it.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct SettlingRule {
    /// The estimate has settled when one formation position moves it by less than this many metres
    /// …
    pub settled_m: f64,
    /// … and at least this many formation positions changed the belief.
    pub least_positions: u32,
    /// Number of rounds that follow then; in one round the drones together pass every direction
    /// from the estimate once.
    pub laps: u32,
    /// The search ends with [`Outcome::MoveLimit`] after this many formation positions.
    pub most_positions: u32,
}

impl Default for SettlingRule {
    /// As in the reference (Pritzl 2018, §5.2): settled below 1 m after 3 positions, then one
    /// round; at most 60 positions.
    fn default() -> Self {
        Self { settled_m: 1.0, least_positions: 3, laps: 1, most_positions: 60 }
    }
}

impl SettlingRule {
    /// Checks that the rule makes sense.
    ///
    /// # Errors
    ///
    /// [`ParameterError`] names the first field that is out of its range.
    pub fn check(&self) -> Result<(), ParameterError> {
        positive("settled_m", self.settled_m)?;
        at_least_one("most_positions", self.most_positions)?;
        Ok(())
    }
}

/// State of a search under a [`SettlingRule`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Settling {
    last: Option<Estimate<2>>,
    shift: Option<f64>,
    measured: u32,
    informative: u32,
    turned: f64,
    stage: Stage,
}

impl Settling {
    /// Takes the estimate after one more formation position of `count` drones, who turn by `step`
    /// radians from one to the next. The estimate can settle, and a step of the round be done, only
    /// where they are `near`.
    ///
    /// A position after which the belief is what it was, to the bit, taught nothing: it counts
    /// towards the cap alone.
    fn take(
        &mut self,
        rule: &SettlingRule,
        estimate: Estimate<2>,
        step: f64,
        count: usize,
        near: bool,
    ) -> Decision {
        self.measured = self.measured.saturating_add(1);
        let silent = self.last == Some(estimate);
        self.shift = self.last.map(|last| (estimate.mean - last.mean).norm());
        self.last = Some(estimate);
        if !silent {
            self.informative = self.informative.saturating_add(1);
            let settled = self.shift.is_some_and(|shift| shift < rule.settled_m);
            match self.stage {
                Stage::Finishing if near => {
                    self.turned += step.abs();
                    // Steps that divide the circle must not miss its end by rounding.
                    let round = f64::from(rule.laps) * TAU / number(count.max(1)) - 1e-9;
                    if self.turned >= round {
                        return Decision::Finish(Outcome::Converged);
                    }
                }
                Stage::Searching if near && settled && self.informative >= rule.least_positions => {
                    if rule.laps == 0 {
                        return Decision::Finish(Outcome::Converged);
                    }
                    self.stage = Stage::Finishing;
                }
                Stage::Finishing | Stage::Searching => {}
            }
        }
        if self.measured >= rule.most_positions {
            Decision::Finish(Outcome::MoveLimit)
        } else {
            Decision::Listen(self.stage)
        }
    }
}

impl fmt::Display for Settling {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.shift {
            Some(shift) => write!(f, "the estimate moved {shift:.2} m")?,
            None => f.write_str("the first estimate")?,
        }
        write!(f, ", position {}", self.measured)?;
        match self.stage {
            Stage::Searching => Ok(()),
            Stage::Finishing => write!(f, ", {:.0}° of the round done", self.turned.to_degrees()),
        }
    }
}

/// Drones evenly around a place, who go round it step by step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Circle {
    /// The direction of the first drone from the place, in radians; none before the first step.
    direction: Option<f64>,
}

impl Circle {
    /// Sets the goals of the next step, of `step_rad` radians; of the first, from where the nearest
    /// drone is.
    fn advance(
        &mut self,
        centre: &Vector2<f64>,
        radius_m: f64,
        step_rad: f64,
        rule: &AltitudeRule,
        stations: &mut [Station],
    ) {
        let direction = match self.direction {
            Some(direction) => angle::wrap(direction + step_rad),
            None => nearest_direction(centre, stations),
        };
        self.direction = Some(direction);
        let ring = Polygon { circumradius: radius_m };
        arrange(&ring, centre, direction, rule.altitude(radius_m), stations);
    }
}

/// A place that can be gone to.
fn finite_place(place: Vector2<f64>) -> Result<Vector2<f64>, PlanError> {
    if place.x.is_finite() && place.y.is_finite() {
        Ok(place)
    } else {
        Err(PlanError::NotFinite { east: place.x, north: place.y })
    }
}

/// Returns the centroid of the drones, of which there must be at least one.
fn centroid(stations: &[Station]) -> Result<Vector2<f64>, PlanError> {
    if stations.is_empty() {
        return Err(PlanError::TooFew { needed: 1, have: 0 });
    }
    let sum: Vector2<f64> = stations.iter().map(|s| s.pose.position.xy()).sum();
    finite_place(sum / number(stations.len()))
}

/// The estimate and the centroid of the drones, where there are both.
fn estimate_and_centroid(
    belief: &dyn Belief,
    stations: &[Station],
) -> Result<(Estimate<2>, Vector2<f64>), PlanError> {
    let estimate = belief.position();
    finite_place(estimate.mean)?;
    Ok((estimate, centroid(stations)?))
}

/// The direction from `from` to `to`, in radians.
fn direction(from: &Vector2<f64>, to: &Vector2<f64>) -> f64 {
    libm::atan2(to.y - from.y, to.x - from.x)
}

/// The place at a distance in metres and a direction in radians from another one.
fn away(from: &Vector2<f64>, distance: f64, direction: f64) -> Vector2<f64> {
    from + Vector2::new(libm::cos(direction), libm::sin(direction)) * distance
}

/// The direction from a place to the drone that is nearest to it, in radians.
fn nearest_direction(place: &Vector2<f64>, stations: &[Station]) -> f64 {
    let distance = |s: &Station| (s.pose.position.xy() - place).norm();
    let nearest = stations.iter().min_by(|a, b| distance(a).total_cmp(&distance(b)));
    nearest.map_or(0.0, |s| direction(place, &s.pose.position.xy()))
}

/// Returns true if drones at this mean distance to the estimate are on a circle about it, in
/// metres.
fn at_radius(mean_distance: f64, radius: f64) -> bool {
    mean_distance <= NEAR * radius
}

/// Returns the drones' mean distance from a place over ground, in metres.
fn mean_distance(place: &Vector2<f64>, stations: &[Station]) -> f64 {
    let sum: f64 = stations.iter().map(|s| (s.pose.position.xy() - place).norm()).sum();
    sum / number(stations.len().max(1))
}

/// A step around the estimate: finite and not 0, of either sense.
fn turning(name: &'static str, step_rad: f64) -> Result<f64, ParameterError> {
    require(step_rad.is_finite() && step_rad.abs() > 0.0, name, step_rad, "finite and not 0")
}

/// `count` places of equal weight that lie as a Gaussian has them, on a spiral whose turns are
/// golden angles (Vogel 1979); `factor` is the Cholesky factor of its covariance.
#[cfg(feature = "alloc")]
pub(super) fn spiral(
    mean: Vector2<f64>,
    factor: nalgebra::Matrix2<f64>,
    count: u32,
) -> impl Iterator<Item = Vector2<f64>> {
    let golden = core::f64::consts::PI * (3.0 - libm::sqrt(5.0));
    (0..count).map(move |index| {
        let share = (f64::from(index) + 0.5) / f64::from(count);
        let radius = libm::sqrt(-2.0 * libm::log1p(-share));
        let angle = golden * f64::from(index);
        mean + factor * Vector2::new(libm::cos(angle), libm::sin(angle)) * radius
    })
}

#[cfg(test)]
mod tests {
    use approx::{abs_diff_eq, assert_abs_diff_eq};
    use core::f64::consts::FRAC_PI_6;

    use super::*;

    #[test]
    fn the_elevation_stays_below_the_limit_inside_the_band() {
        let rule = AltitudeRule { elevation_limit: 0.5, least_m: 2.0, most_m: 20.0 };
        assert_eq!(rule.check(), Ok(()));
        for distance in [4.0, 10.0, 30.0] {
            let elevation = libm::atan2(rule.altitude(distance), distance);
            assert!(abs_diff_eq!(elevation, 0.5, epsilon = 1e-12), "{elevation} at {distance} m");
        }
        for (distance, altitude) in [(0.0, 2.0), (1.0, 2.0), (300.0, 20.0)] {
            assert_abs_diff_eq!(rule.altitude(distance), altitude, epsilon = 1e-12);
        }
    }

    #[test]
    fn what_cannot_be_kept_is_named() {
        let rule = AltitudeRule::default();
        assert_eq!(rule.check(), Ok(()));
        for (bad, field) in [
            (AltitudeRule { elevation_limit: FRAC_PI_2, ..rule }, "elevation_limit_rad"),
            (AltitudeRule { elevation_limit: 0.0, ..rule }, "elevation_limit_rad"),
            (AltitudeRule { least_m: f64::NAN, ..rule }, "least_m"),
            (AltitudeRule { most_m: 2.9, ..rule }, "most_m"),
        ] {
            assert_eq!(bad.check().map_err(|error| error.name), Err(field));
        }
    }

    fn at(east: f64, sigma: f64) -> Estimate<2> {
        Estimate::isotropic(Vector2::new(east, 0.0), sigma)
    }

    #[test]
    fn three_drones_pass_every_direction_in_four_steps() {
        let rule = SettlingRule::default();
        let mut settling = Settling::default();
        let mut take = |estimate, near| settling.take(&rule, estimate, FRAC_PI_6, 3, near);
        assert_eq!(take(at(0.0, 5.0), true), Decision::Listen(Stage::Searching));
        assert_eq!(take(at(0.1, 4.0), true), Decision::Listen(Stage::Searching));
        assert_eq!(take(at(0.2, 3.0), false), Decision::Listen(Stage::Searching));
        assert_eq!(take(at(2.0, 2.5), true), Decision::Listen(Stage::Searching));
        assert_eq!(take(at(2.1, 2.0), true), Decision::Listen(Stage::Finishing));
        for sigma in [1.9, 1.8, 1.7] {
            assert_eq!(take(at(2.1, sigma), true), Decision::Listen(Stage::Finishing));
        }
        assert_eq!(take(at(2.1, 1.6), true), Decision::Finish(Outcome::Converged));
    }

    #[test]
    fn a_round_is_done_near_the_estimate_only() {
        let rule = SettlingRule::default();
        let mut settling = Settling::default();
        let mut take = |sigma, near| settling.take(&rule, at(0.0, sigma), FRAC_PI_6, 6, near);
        take(5.0, true);
        take(4.0, true);
        assert_eq!(take(3.0, true), Decision::Listen(Stage::Finishing));
        for sigma in [2.9, 2.8, 2.7] {
            assert_eq!(take(sigma, false), Decision::Listen(Stage::Finishing));
        }
        assert_eq!(take(2.6, true), Decision::Listen(Stage::Finishing));
        assert_eq!(take(2.5, true), Decision::Finish(Outcome::Converged));
    }

    #[test]
    fn silence_is_no_success_and_has_an_end() {
        let rule = SettlingRule { most_positions: 9, ..SettlingRule::default() };
        let mut settling = Settling::default();
        let mut take = || settling.take(&rule, at(1.0, 2.0), FRAC_PI_6, 1, true);
        for _ in 1..9 {
            assert_eq!(take(), Decision::Listen(Stage::Searching));
        }
        assert_eq!(take(), Decision::Finish(Outcome::MoveLimit));
    }

    #[test]
    fn what_makes_no_rule_is_named() {
        let rule = SettlingRule::default();
        assert_eq!(rule.check(), Ok(()));
        let bad = SettlingRule { settled_m: 0.0, ..rule };
        assert_eq!(bad.check().map_err(|error| error.name), Err("settled_m"));
        let bad = SettlingRule { most_positions: 0, ..rule };
        assert_eq!(bad.check().map_err(|error| error.name), Err("most_positions"));
    }
}
