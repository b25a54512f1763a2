use std::f64::consts::TAU;

use foxhunt_sensors::{BodyConfig, OmnidirectionalConfig, StepperConfig, TurnGoal};
use foxhunt_sim::{RangeDifferenceConfig, SimError, SimStepperConfig, ThreeAxisConfig, World};
use serde::{Deserialize, Serialize};

use crate::hunt::{BoxedSource, boxed_source};

/// Source with which a drone listens, chosen at run time.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case")]
#[non_exhaustive]
pub enum SourceConfig {
    /// An antenna on a stepper motor (Pritzl 2018, §4.1).
    Stepper(StepperConfig),
    /// An antenna that is fixed to the drone, which turns as a whole (Pritzl 2018, §5.1; Isaacs et
    /// al. 2014, §III).
    RotatingBody(BodyConfig),
    /// An antenna without a direction: levels alone.
    Omnidirectional(OmnidirectionalConfig),
    /// A receiver of three coils: the magnetic field near a beacon (EN 300 718-1), in simulated
    /// worlds.
    ThreeAxis(ThreeAxisConfig),
    /// Receiver that measures range differences to a reference receiver, in simulated worlds.
    RangeDifference(RangeDifferenceConfig),
    /// One that a [`Registry`](crate::registry::Registry) knows by a name.
    Registered {
        /// The name.
        name: String,
    },
}

/// σ of a range difference in metres unless given: 10 ns of the arrivals' times.
const DIFFERENCE_SIGMA_M: f64 = 3.0;

impl Default for SourceConfig {
    /// The reference's stepper.
    fn default() -> Self {
        Self::Stepper(StepperConfig::default())
    }
}

impl SourceConfig {
    /// Names of the kinds besides registered ones, each with what it is.
    pub const KINDS: [(&'static str, &'static str); 5] = [
        ("stepper", "a directional antenna on a stepper motor"),
        (
            "rotating-body",
            "a directional antenna that is fixed to the drone, which turns as a whole",
        ),
        ("omnidirectional", "an antenna without a direction: levels alone"),
        ("three-axis", "three coils across each other: the magnetic field near a beacon"),
        (
            "range-difference",
            "a receiver that shares its clock with a reference receiver: range differences",
        ),
    ];

    /// Source of a kind with its defaults; `None` for a name that is no kind, and for a range
    /// difference without the reference receiver's place, East, North and Up in metres.
    #[must_use]
    pub fn of_kind(kind: &str, reference_m: Option<[f64; 3]>) -> Option<Self> {
        Some(match kind {
            "stepper" => Self::Stepper(StepperConfig::default()),
            "rotating-body" => Self::RotatingBody(BodyConfig::default()),
            "omnidirectional" => Self::Omnidirectional(OmnidirectionalConfig::default()),
            "three-axis" => Self::ThreeAxis(ThreeAxisConfig::default()),
            "range-difference" => {
                let sigma_m = DIFFERENCE_SIGMA_M;
                let reference_m = reference_m?;
                Self::RangeDifference(RangeDifferenceConfig { reference_m, sigma_m })
            }
            _ => return None,
        })
    }

    /// Name of its kind, as files have it.
    #[must_use]
    pub fn kind(&self) -> &'static str {
        match self {
            Self::Stepper(_) => "stepper",
            Self::RotatingBody(_) => "rotating-body",
            Self::Omnidirectional(_) => "omnidirectional",
            Self::ThreeAxis(_) => "three-axis",
            Self::RangeDifference(_) => "range-difference",
            Self::Registered { .. } => "registered",
        }
    }

    /// Returns true if it looks along one direction after the other, in turns that may go on.
    #[must_use]
    pub fn turns(&self) -> bool {
        matches!(self, Self::Stepper(_) | Self::RotatingBody(_))
    }

    /// The receiver's weakest reading in dBm, where it is given.
    #[must_use]
    pub fn floor_dbm(&self) -> Option<f64> {
        match self {
            Self::Stepper(config) => config.floor_dbm(),
            Self::RotatingBody(config) => config.floor_dbm,
            Self::Omnidirectional(config) => config.floor_dbm,
            Self::ThreeAxis(_) | Self::RangeDifference(_) | Self::Registered { .. } => None,
        }
    }

    /// Builds the source of a drone of a simulated world, whose turns go on for `goal` where there
    /// is one; `None` for one that is known by name alone.
    ///
    /// # Errors
    ///
    /// [`SimError`] when there is no such drone, or a number is out of its range.
    pub fn build(
        &self,
        world: &World,
        drone: usize,
        goal: Option<&TurnGoal>,
    ) -> Result<Option<BoxedSource>, SimError> {
        Ok(Some(match self {
            Self::Stepper(config) => {
                let source = world.stepper(drone, *config)?;
                let source = match goal {
                    Some(goal) => source.with_goal(goal.clone()),
                    None => source,
                };
                boxed_source(world.late(drone, source)?)
            }
            Self::RotatingBody(config) => {
                let source = world.body(drone, *config)?;
                let source = match goal {
                    Some(goal) => source.with_goal(goal.clone()),
                    None => source,
                };
                boxed_source(world.late(drone, source)?)
            }
            Self::Omnidirectional(config) => {
                boxed_source(world.late(drone, world.omnidirectional(drone, *config)?)?)
            }
            Self::ThreeAxis(config) => {
                boxed_source(world.late(drone, world.three_axis(drone, *config)?)?)
            }
            Self::RangeDifference(config) => {
                boxed_source(world.late(drone, world.range_difference(drone, *config)?)?)
            }
            Self::Registered { .. } => return Ok(None),
        }))
    }

    /// Returns the approximate duration of a turn in a simulated world, in seconds, where every
    /// question is answered; `None` for a source that is known by name alone. `of_goal` gives the
    /// expected number of questions of a turn with a goal, given their least number.
    #[must_use]
    pub fn turn_s(
        &self,
        questions: &Questions,
        of_goal: impl Fn(u16) -> Option<u16>,
    ) -> Option<f64> {
        let Questions { quickness, beacons, interval_s } = *questions;
        let answer_s = quickness.radio_latency_s.max(interval_s.unwrap_or(0.0));
        let per_question = |spacing_s: f64| f64::from(beacons) * spacing_s.max(answer_s);
        Some(match self {
            Self::Stepper(config) => {
                let positions = config.positions();
                let samples = config.samples_per_position();
                // A fit is by boresights.
                let positions = of_goal(positions).unwrap_or(positions);
                f64::from(positions) * f64::from(samples) * per_question(0.0)
                    + TAU / quickness.rotator_speed_rad_s
            }
            Self::RotatingBody(config) => match interval_s.and_then(|_| of_goal(FEWEST_PULSES)) {
                Some(pulses) => f64::from(pulses) * per_question(config.spacing_s),
                None => TAU / config.rate_rad_s.abs(),
            },
            Self::Omnidirectional(config) => {
                f64::from(config.questions) * per_question(config.spacing_s)
            }
            Self::ThreeAxis(_) | Self::RangeDifference(_) => per_question(0.0),
            Self::Registered { .. } => return None,
        })
    }
}

/// Conditions that set the duration of questions.
#[derive(Clone, Copy, Debug)]
pub struct Questions {
    /// Quickness of the simulation's devices.
    pub quickness: SimStepperConfig,
    /// Number of beacons of a turn.
    pub beacons: u16,
    /// From pulse to pulse of the slowest beacon that sends by itself, in seconds.
    pub interval_s: Option<f64>,
}

/// Least number of pulses in a turn of a body that waits for pulses, which turns slowly enough.
const FEWEST_PULSES: u16 = 9;
