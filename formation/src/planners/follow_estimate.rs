use core::{f64::consts::PI, fmt};

use foxhunt_core::{
    Belief, Decision, FormationPlanner, Outcome, PlanError, Stage, Station, angle,
    parameter::{ParameterError, at_least_one, finite, positive},
};
use nalgebra::Vector2;

use super::{centroid, finite_place};
use crate::shape::{Polygon, Shape, arrange};

/// Configuration of [`FollowEstimate`]. Lengths are metres, angles radians.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct FollowConfig {
    /// From the centre of the formation to each drone, where it is a polygon.
    pub circumradius_m: f64,
    /// The direction of the first drone from the centre, at the very start.
    pub rotation_rad: f64,
    /// Altitude while searching.
    pub search_altitude_m: f64,
    /// Altitude while finishing.
    pub finish_altitude_m: f64,
    /// The estimate has settled when one formation position moves it by less than this …
    pub settled_m: f64,
    /// … and at least this many formation positions were measured.
    pub least_positions: u32,
    /// Number of further formation positions measured once it has settled.
    pub finishing_positions: u32,
    /// Angle that the formation turns by before each of these.
    pub finishing_turn_rad: f64,
    /// The search ends with [`Outcome::MoveLimit`] after this many formation positions.
    pub most_positions: u32,
}

impl FollowConfig {
    /// The reference system's (Pritzl 2018, §5.2): radius 6 m, rotation 0, 4 m up while
    /// searching and 3 m while finishing, settled below 1 m after 3 positions, then 4 more with
    /// π/6 between them. The document has no cap; it is 60 positions here.
    #[must_use]
    pub const fn pritzl2018() -> Self {
        Self {
            circumradius_m: 6.0,
            rotation_rad: 0.0,
            search_altitude_m: 4.0,
            finish_altitude_m: 3.0,
            settled_m: 1.0,
            least_positions: 3,
            finishing_positions: 4,
            finishing_turn_rad: PI / 6.0,
            most_positions: 60,
        }
    }
}

impl Default for FollowConfig {
    /// [`pritzl2018`](Self::pritzl2018).
    fn default() -> Self {
        Self::pritzl2018()
    }
}

/// The reference's formation control (Pritzl 2018, §5.2): a regular polygon, with three drones a
/// triangle, or any other shape, whose centre follows the estimate until it settles.
///
/// Each target starts around the drones' centroid, or around its estimate if there is one,
/// at the search altitude; the rotation is kept from one target to the next.
#[derive(Clone, Debug, PartialEq)]
pub struct FollowEstimate<S = Polygon> {
    config: FollowConfig,
    shape: S,
    centre: Vector2<f64>,
    rotation: f64,
    stage: Stage,
    measured: u32,
    finishing: u32,
    shift: f64,
}

impl FollowEstimate {
    /// A planner of polygons before its first target.
    ///
    /// # Errors
    ///
    /// [`ParameterError`] names the first field that is not finite, or not positive where it
    /// has to be.
    pub fn new(config: FollowConfig) -> Result<Self, ParameterError> {
        positive("circumradius_m", config.circumradius_m)?;
        for (field, value) in [
            ("rotation_rad", config.rotation_rad),
            ("search_altitude_m", config.search_altitude_m),
            ("finish_altitude_m", config.finish_altitude_m),
            ("finishing_turn_rad", config.finishing_turn_rad),
        ] {
            finite(field, value)?;
        }
        positive("settled_m", config.settled_m)?;
        at_least_one("most_positions", config.most_positions)?;
        Ok(Self {
            config,
            shape: Polygon { circumradius: config.circumradius_m },
            centre: Vector2::zeros(),
            rotation: config.rotation_rad,
            stage: Stage::Searching,
            measured: 0,
            finishing: 0,
            shift: 0.0,
        })
    }
}

impl<S: Shape> FollowEstimate<S> {
    /// Replaces the polygon by `shape`.
    #[must_use]
    pub fn with_shape<T: Shape>(self, shape: T) -> FollowEstimate<T> {
        let Self { config, centre, rotation, stage, measured, finishing, shift, .. } = self;
        FollowEstimate { config, shape, centre, rotation, stage, measured, finishing, shift }
    }

    /// The centre of the formation, East and North in metres.
    #[must_use]
    pub fn centre(&self) -> &Vector2<f64> {
        &self.centre
    }

    /// The direction of the first drone from the centre, in radians.
    #[must_use]
    pub fn rotation(&self) -> f64 {
        self.rotation
    }

    fn place(&self, stations: &mut [Station]) {
        let altitude = match self.stage {
            Stage::Searching => self.config.search_altitude_m,
            Stage::Finishing => self.config.finish_altitude_m,
        };
        arrange(&self.shape, &self.centre, self.rotation, altitude, stations);
    }

    fn begin_around(
        &mut self,
        centre: Vector2<f64>,
        stations: &mut [Station],
    ) -> Result<(), PlanError> {
        self.centre = finite_place(centre)?;
        self.stage = Stage::Searching;
        self.measured = 0;
        self.finishing = 0;
        self.shift = 0.0;
        self.place(stations);
        Ok(())
    }

    fn turn(&mut self) {
        self.rotation = angle::wrap(self.rotation + self.config.finishing_turn_rad);
    }

    /// The rule of Pritzl 2018, §5.2, after one more formation position was measured.
    fn decide(&mut self, shift: f64) -> Decision {
        self.measured = self.measured.saturating_add(1);
        self.shift = shift;
        match self.stage {
            Stage::Finishing => {
                self.finishing += 1;
                if self.finishing >= self.config.finishing_positions {
                    return Decision::Finish(Outcome::Converged);
                }
                self.turn();
            }
            Stage::Searching
                if shift < self.config.settled_m
                    && self.measured >= self.config.least_positions =>
            {
                if self.config.finishing_positions == 0 {
                    return Decision::Finish(Outcome::Converged);
                }
                self.stage = Stage::Finishing;
                self.turn();
            }
            Stage::Searching => {}
        }
        if self.measured >= self.config.most_positions {
            Decision::Finish(Outcome::MoveLimit)
        } else {
            Decision::Listen(self.stage)
        }
    }
}

impl<S: Shape> FormationPlanner for FollowEstimate<S> {
    fn begin(&mut self, stations: &mut [Station]) -> Result<(), PlanError> {
        let centre = centroid(stations)?;
        self.begin_around(centre, stations)
    }

    fn resume(&mut self, belief: &dyn Belief, stations: &mut [Station]) -> Result<(), PlanError> {
        self.begin_around(belief.position().mean, stations)
    }

    fn plan(
        &mut self,
        belief: &dyn Belief,
        stations: &mut [Station],
    ) -> Result<Decision, PlanError> {
        let estimate = finite_place(belief.position().mean)?;
        // The centre was moved to the estimate before, so this is how far the estimate moved.
        let decision = self.decide((estimate - self.centre).norm());
        self.centre = estimate;
        self.place(stations);
        Ok(decision)
    }

    fn explain(&self, to: &mut dyn fmt::Write) -> fmt::Result {
        let Self { config, shift, measured, finishing, .. } = self;
        write!(to, "the estimate moved {shift:.2} m, ")?;
        let all = config.finishing_positions;
        match self.stage {
            Stage::Finishing => write!(to, "settled: {finishing} of {all} last positions done"),
            Stage::Searching if *shift < config.settled_m => {
                write!(to, "but {measured} of {} positions are too few", config.least_positions)
            }
            Stage::Searching => write!(to, "settled is below {:.2} m", config.settled_m),
        }
    }
}

#[cfg(test)]
mod tests {
    use approx::assert_abs_diff_eq;
    use foxhunt_core::{Estimate, Pose, laws};
    use proptest::prelude::*;

    use super::*;
    use crate::shape::Line;

    fn planner() -> FollowEstimate {
        FollowEstimate::new(FollowConfig::pritzl2018()).expect("the preset is in range")
    }

    fn at(east: f64, north: f64) -> Estimate<2> {
        Estimate::isotropic(Vector2::new(east, north), 2.0)
    }

    fn stations() -> [Station; 3] {
        [(0.0, 0.0), (3.0, 0.0), (0.0, 3.0)]
            .map(|(e, n)| Station { pose: Pose::at(e, n, 2.0), ..Station::default() })
    }

    #[test]
    fn the_reference_script() {
        let mut planner = planner();
        let mut stations = stations();
        planner.begin(&mut stations).expect("three drones");
        assert!((planner.centre() - Vector2::new(1.0, 1.0)).norm() < 1e-12);
        assert_abs_diff_eq!(stations[0].goal.position.x, 7.0, epsilon = 1e-12);
        assert_abs_diff_eq!(stations[0].goal.position.z, 4.0, epsilon = 1e-12);

        // Settled at once, but fewer than three positions were measured.
        for _ in 0..2 {
            let decision = planner.plan(&at(1.5, 1.0), &mut stations);
            assert_eq!(decision, Ok(Decision::Listen(Stage::Searching)));
        }
        // Moved too far, then settled.
        let decision = planner.plan(&at(3.0, 1.0), &mut stations);
        assert_eq!(decision, Ok(Decision::Listen(Stage::Searching)));
        assert_abs_diff_eq!(planner.rotation(), 0.0, epsilon = 1e-12);
        for turned in 1..=4 {
            let decision = planner.plan(&at(3.1, 1.0), &mut stations);
            assert_eq!(decision, Ok(Decision::Listen(Stage::Finishing)));
            assert_abs_diff_eq!(planner.rotation(), f64::from(turned) * PI / 6.0, epsilon = 1e-12);
            assert_abs_diff_eq!(stations[1].goal.position.z, 3.0, epsilon = 1e-12);
            let direction =
                crate::planners::direction(planner.centre(), &stations[0].goal.position.xy());
            assert_abs_diff_eq!(direction, planner.rotation(), epsilon = 1e-9);
        }
        let decision = planner.plan(&at(3.2, 1.0), &mut stations);
        assert_eq!(decision, Ok(Decision::Finish(Outcome::Converged)));

        // The next target: back to the search altitude, the rotation kept.
        planner.begin(&mut stations).expect("three drones");
        assert_abs_diff_eq!(stations[0].goal.position.z, 4.0, epsilon = 1e-12);
        assert_abs_diff_eq!(planner.rotation(), 4.0 * PI / 6.0, epsilon = 1e-12);

        // One of which something is known: around where it is believed to be.
        planner.resume(&at(8.0, -3.0), &mut stations).expect("three drones");
        assert!((planner.centre() - Vector2::new(8.0, -3.0)).norm() < 1e-12);
        let error = planner.resume(&at(f64::NAN, 0.0), &mut stations);
        assert!(matches!(error, Err(PlanError::NotFinite { .. })));
        assert!((planner.centre() - Vector2::new(8.0, -3.0)).norm() < 1e-12);
    }

    #[test]
    fn an_estimate_that_never_settles_meets_the_cap() {
        let config = FollowConfig { most_positions: 5, ..FollowConfig::pritzl2018() };
        let mut planner = FollowEstimate::new(config).expect("in range");
        let mut stations = stations();
        planner.begin(&mut stations).expect("three drones");
        for place in 1..5 {
            let decision = planner.plan(&at(10.0 * f64::from(place), 0.0), &mut stations);
            assert_eq!(decision, Ok(Decision::Listen(Stage::Searching)));
        }
        let decision = planner.plan(&at(50.0, 0.0), &mut stations);
        assert_eq!(decision, Ok(Decision::Finish(Outcome::MoveLimit)));
    }

    #[test]
    fn bad_values_are_named_and_change_nothing() {
        let mut config = FollowConfig::pritzl2018();
        config.circumradius_m = -1.0;
        let error = FollowEstimate::new(config).expect_err("no radius is negative");
        assert_eq!((error.name, error.value), ("circumradius_m", -1.0));

        let mut planner = planner();
        let mut stations = stations();
        planner.begin(&mut stations).expect("three drones");
        let before = (planner.clone(), stations);
        let error = planner.plan(&at(f64::NAN, 0.0), &mut stations);
        assert!(matches!(error, Err(PlanError::NotFinite { .. })));
        assert_eq!((planner.clone(), stations), before);
        assert!(planner.begin(&mut []).is_err());
    }

    #[test]
    fn a_line_follows_as_well() {
        let line = Line::new(10.0).expect("a spacing");
        let mut planner = planner().with_shape(line);
        let mut stations = stations();
        planner.begin(&mut stations).expect("three drones");
        planner.plan(&at(20.0, 5.0), &mut stations).expect("a place");
        let goals = stations.map(|s| s.goal.position.xy());
        for (goal, east) in goals.into_iter().zip([30.0, 20.0, 10.0]) {
            assert!((goal - Vector2::new(east, 5.0)).norm() < 1e-12, "{goal}");
        }
    }

    proptest! {
        #[test]
        fn keeps_the_laws(e in -1e3..1e3, n in -1e3..1e3) {
            laws::formation_planner(planner, &at(e, n), &mut stations());
        }
    }
}
