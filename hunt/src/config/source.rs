use std::f64::consts::TAU;

use foxhunt_sensors::{BodyConfig, OmnidirectionalConfig, StepperConfig};
use foxhunt_sim::{SimError, SimStepperConfig, ThreeAxisConfig, World};
use serde::{Deserialize, Serialize};

use crate::hunt::{BoxedSource, boxed_source};

/// What a drone listens with, chosen at run time.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case")]
#[non_exhaustive]
pub enum SourceConfig {
    /// An antenna on a stepper motor (Pritzl 2018, §5.1).
    Stepper(StepperConfig),
    /// An antenna that is fixed to the drone, which turns as a whole (Pritzl 2018, §5.1; Isaacs et
    /// al. 2014, §III).
    RotatingBody(BodyConfig),
    /// An antenna without a direction: levels alone.
    Omnidirectional(OmnidirectionalConfig),
    /// A receiver of three coils: the magnetic field near a beacon (EN 300 718-1), in simulated
    /// worlds.
    ThreeAxis(ThreeAxisConfig),
    /// One that a [`Registry`](crate::registry::Registry) knows by a name.
    Registered {
        /// The name.
        name: String,
    },
}

impl Default for SourceConfig {
    /// The reference's stepper.
    fn default() -> Self {
        Self::Stepper(StepperConfig::default())
    }
}

impl SourceConfig {
    /// Builds the source of a drone of a simulated world; `None` for one that is known by name
    /// alone.
    ///
    /// # Errors
    ///
    /// [`SimError`] when there is no such drone, or a number is out of its range.
    pub fn build(&self, world: &World, drone: usize) -> Result<Option<BoxedSource>, SimError> {
        Ok(Some(match self {
            Self::Stepper(config) => {
                boxed_source(world.late(drone, world.stepper(drone, *config)?)?)
            }
            Self::RotatingBody(config) => {
                boxed_source(world.late(drone, world.body(drone, *config)?)?)
            }
            Self::Omnidirectional(config) => {
                boxed_source(world.late(drone, world.omnidirectional(drone, *config)?)?)
            }
            Self::ThreeAxis(config) => {
                boxed_source(world.late(drone, world.three_axis(drone, *config)?)?)
            }
            Self::Registered { .. } => return Ok(None),
        }))
    }

    /// About how long a turn for so many beacons takes in a simulated world, in seconds,
    /// where every question is answered; `None` for a source that is known by name alone.
    #[must_use]
    pub fn turn_s(&self, quickness: &SimStepperConfig, beacons: u16) -> Option<f64> {
        let answer_s = quickness.radio_latency_s;
        let per_question = |spacing_s: f64| f64::from(beacons) * spacing_s.max(answer_s);
        Some(match self {
            Self::Stepper(config) => {
                let questions =
                    f64::from(config.positions()) * f64::from(config.samples_per_position());
                questions * per_question(0.0) + TAU / quickness.rotator_speed_rad_s
            }
            Self::RotatingBody(config) => TAU / config.rate_rad_s.abs(),
            Self::Omnidirectional(config) => {
                f64::from(config.questions) * per_question(config.spacing_s)
            }
            Self::ThreeAxis(_) => per_question(0.0),
            Self::Registered { .. } => return None,
        })
    }
}
