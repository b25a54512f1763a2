use std::{error::Error, f64::consts::TAU, fmt};

use foxhunt_core::{BeaconId, PatternSource, Sweep};
use foxhunt_sensors::{BodyConfig, OmnidirectionalConfig, StepperConfig};
use foxhunt_sim::{SimError, SimStepperConfig, World};
use serde::{Deserialize, Serialize};

/// What a drone listens with, chosen at run time.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
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
}

impl Default for SourceConfig {
    /// The reference's stepper.
    fn default() -> Self {
        Self::Stepper(StepperConfig::default())
    }
}

/// A pattern source that was chosen at run time.
pub type BoxedSource = Box<dyn PatternSource<Error = SourceError>>;

impl SourceConfig {
    /// Builds the source of a drone of a simulated world.
    ///
    /// # Errors
    ///
    /// [`SimError`] when there is no such drone, or a number is out of its range.
    pub fn build(&self, world: &World, drone: usize) -> Result<BoxedSource, SimError> {
        Ok(match *self {
            Self::Stepper(config) => boxed(world.late(drone, world.stepper(drone, config)?)?),
            Self::RotatingBody(config) => boxed(world.late(drone, world.body(drone, config)?)?),
            Self::Omnidirectional(config) => {
                boxed(world.late(drone, world.omnidirectional(drone, config)?)?)
            }
        })
    }
}

impl SourceConfig {
    /// About how long a turn takes in a simulated world that asks so many beacons, in seconds, where
    /// every question is answered.
    #[must_use]
    pub fn turn_s(&self, quickness: &SimStepperConfig, beacons: u16) -> f64 {
        let answer_s = quickness.radio_latency_s;
        let per_question = |spacing_s: f64| f64::from(beacons) * spacing_s.max(answer_s);
        match self {
            Self::Stepper(config) => {
                let questions =
                    f64::from(config.positions()) * f64::from(config.samples_per_position());
                questions * per_question(0.0) + TAU / quickness.rotator_speed_rad_s
            }
            Self::RotatingBody(config) => TAU / config.rate_rad_s.abs(),
            Self::Omnidirectional(config) => {
                f64::from(config.questions) * per_question(config.spacing_s)
            }
        }
    }
}

/// Any source as one of many kinds in a list.
pub fn boxed<S: PatternSource + 'static>(source: S) -> BoxedSource {
    Box::new(Erased(source))
}

/// What went wrong with a source of any kind.
#[derive(Debug)]
pub struct SourceError(Box<dyn Error>);

impl fmt::Display for SourceError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

impl Error for SourceError {
    fn source(&self) -> Option<&(dyn Error + 'static)> {
        self.0.source()
    }
}

/// A source that does not tell its kind.
#[derive(Debug)]
struct Erased<S>(S);

impl<S: PatternSource> PatternSource for Erased<S> {
    type Error = SourceError;

    fn begin(&mut self, beacons: &[BeaconId]) -> Result<(), SourceError> {
        self.0.begin(beacons).map_err(|error| SourceError(Box::new(error)))
    }

    fn poll(&mut self) -> Result<Option<Sweep<'_>>, SourceError> {
        self.0.poll().map_err(|error| SourceError(Box::new(error)))
    }
}
