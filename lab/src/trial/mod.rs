//! Trials: bearings drawn from a stated density instead of flown turns. A scripted receiver, a
//! target whose course is known, a prior, and how well estimators follow it.

mod campaign;
mod draw;
mod prior;
mod run;

pub use campaign::trial_campaign;
pub use run::{TrialRun, run_trial};

use std::{fs, path::Path};

use foxhunt_core::{
    ConstantVelocity, EstimatorError,
    parameter::{ParameterError, finite, not_negative, positive, require},
};
use foxhunt_hunt::{document, registry::RegistryError};
use serde::{Deserialize, Serialize};

use crate::ThreadsError;

/// The built-in trials' texts, by name.
const TEXTS: [(&str, &str); 6] = [
    ("isaacs-static", include_str!("../../trials/isaacs-static.toml")),
    ("isaacs-line", include_str!("../../trials/isaacs-line.toml")),
    ("isaacs-circle", include_str!("../../trials/isaacs-circle.toml")),
    ("bot-m", include_str!("../../trials/bot-m.toml")),
    ("bot-h", include_str!("../../trials/bot-h.toml")),
    ("tdoa-two-drones", include_str!("../../trials/tdoa-two-drones.toml")),
];

/// A trial: what is true, the bearings, and what the estimators know.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Trial {
    /// Name of the trial.
    pub name: String,
    /// Description of the trial, in a line.
    pub description: String,
    /// The estimator that runs unless another one is given.
    pub estimator: String,
    /// The number of particles of a particle filter.
    pub particles: usize,
    /// The numbers of bearings after which the errors are reported besides after the last.
    #[serde(default)]
    pub checkpoints: Vec<u32>,
    /// The receiver's places.
    pub receiver: ReceiverConfig,
    /// Bearings of the trial; for differences, their number and times.
    pub bearings: BearingsConfig,
    /// Measurement instead of bearings; bearings if absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub differences: Option<DifferencesConfig>,
    /// The target's true course.
    pub target: TargetConfig,
    /// The motion of the target that the estimators assume.
    pub motion: TargetMotion,
    /// The prior of the estimators, before the first bearing.
    pub prior: PriorConfig,
}

/// The places of a receiver at its bearings.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
#[non_exhaustive]
pub enum ReceiverConfig {
    /// At each of these places for a number of bearings, over and over again.
    Stations {
        /// East and North of each, in metres.
        places_m: Vec<[f64; 2]>,
        /// The number of bearings that are taken before the next place.
        bearings_at_each: u32,
    },
    /// On straight legs from the origin; the last goes on for ever.
    Legs {
        /// The legs.
        legs: Vec<Leg>,
    },
}

/// A straight leg.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Leg {
    /// The speed in metres per second.
    pub speed_mps: f64,
    /// The course in degrees clockwise from North.
    pub course_deg_compass: f64,
    /// Duration of the leg, in seconds.
    pub duration_s: f64,
}

/// Bearings at even intervals; the first at the time 0.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BearingsConfig {
    /// The number of bearings.
    pub count: u32,
    /// Time from one to the next, in seconds.
    pub interval_s: f64,
    /// Standard deviation of the bearings, in radians; left out where differences are measured.
    #[serde(default)]
    pub sigma_rad: f64,
    /// Angle by which bearings lie counter-clockwise of the truth, in radians; 0 unless given.
    #[serde(default)]
    pub bias_rad: f64,
    /// Share of bearings that point anywhere; 0 unless given.
    #[serde(default)]
    pub outlier_share: f64,
}

/// Range differences to a second receiver, which stays where it is.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DifferencesConfig {
    /// East and North of the second receiver, in metres.
    pub reference_m: [f64; 2],
    /// Standard deviation of the differences, in metres.
    pub sigma_m: f64,
}

/// The true course of a target.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
#[non_exhaustive]
pub enum TargetConfig {
    /// On a straight line, or still; pushed off it by white acceleration.
    Line {
        /// East at the time 0, in metres.
        east_m: f64,
        /// North at the time 0, in metres.
        north_m: f64,
        /// The speed in metres per second; 0 unless given.
        #[serde(default)]
        speed_mps: f64,
        /// The course in degrees clockwise from North; 0 unless given.
        #[serde(default)]
        course_deg_compass: f64,
        /// q in m²/s³: the power spectral density of the acceleration on each axis; 0 by default.
        #[serde(default)]
        spectral_density: f64,
    },
    /// On a circle about the origin, counter-clockwise from the East.
    Circle {
        /// Radius of the circle in metres.
        radius_m: f64,
        /// The time of one round, in seconds.
        period_s: f64,
    },
    /// Drawn from the room of the prior, still or, with a speed, on a straight line.
    FromPrior,
}

/// The motion of a target that estimators assume.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
#[non_exhaustive]
pub enum TargetMotion {
    /// Not at all; the state is East and North.
    Still,
    /// At a nearly constant velocity; the state is East, North and their derivatives.
    ConstantVelocity {
        /// q in m²/s³: the power spectral density of the acceleration on each axis.
        spectral_density: f64,
    },
}

/// The prior of estimators, before the first bearing.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
#[non_exhaustive]
pub enum PriorConfig {
    /// Anywhere in a room, with the same probability.
    Room {
        /// West wall of the room, in metres East.
        west_m: f64,
        /// East wall of the room, in metres East.
        east_m: f64,
        /// South wall of the room, in metres North.
        south_m: f64,
        /// North wall of the room, in metres North.
        north_m: f64,
        /// σ of each component of the velocity, in metres per second; only for a target that
        /// moves.
        #[serde(default)]
        speed_sigma_mps: f64,
    },
    /// On the first bearing, which is used for nothing else, at a normal range, with a normal
    /// speed and a normal course about the way back along the bearing. The means of range and
    /// speed are drawn about the truth, again until they are above the least.
    Ranging {
        /// σ of the range, in metres.
        sigma_range_m: f64,
        /// σ of the speed, in metres per second.
        sigma_speed_mps: f64,
        /// σ of the course, in radians.
        sigma_course_rad: f64,
        /// The least mean of the range and the least range, in metres.
        least_range_m: f64,
        /// The least mean of the speed, in metres per second.
        least_speed_mps: f64,
    },
}

impl Trial {
    /// The trial of a built-in name, or else of a TOML file with a `receiver`, which a flown
    /// scenario does not have. `None` where there is neither.
    ///
    /// # Errors
    ///
    /// [`TrialError`] names the file, the line and the field.
    pub fn find(name_or_path: &str) -> Result<Option<Self>, TrialError> {
        if let Some((name, text)) = TEXTS.iter().find(|(known, _)| *known == name_or_path) {
            return Self::parse(text, name).map(Some);
        }
        if !Path::new(name_or_path).exists() {
            return Ok(None);
        }
        let file = name_or_path.to_owned();
        let text =
            fs::read_to_string(name_or_path).map_err(|source| TrialError::Read { file, source })?;
        let is_trial = text.parse::<toml::Table>().is_ok_and(|t| t.contains_key("receiver"));
        is_trial.then(|| Self::parse(&text, name_or_path)).transpose()
    }

    /// A trial from TOML; `file` is what errors call it.
    ///
    /// # Errors
    ///
    /// [`TrialError`] names the file, the line and the field.
    pub fn parse(text: &str, file: &str) -> Result<Self, TrialError> {
        let trial: Self = document::from_toml(text)
            .map_err(|source| TrialError::Parse { file: file.to_owned(), source })?;
        let wrong = |error| TrialError::Field { trial: file.to_owned(), error };
        trial.check().map_err(wrong)?;
        Ok(trial)
    }

    /// Refuses numbers that are out of their range.
    fn check(&self) -> Result<(), ParameterError> {
        let BearingsConfig { count, interval_s, sigma_rad, .. } = self.bearings;
        let counted = (1..=10_000).contains(&count);
        require(counted, "bearings.count", f64::from(count), "in 1 … 10 000")?;
        // A number from a file must not be able to take all memory there is.
        let particles = u32::try_from(self.particles).unwrap_or(u32::MAX);
        let cloud = (5..=10_000_000).contains(&particles);
        require(cloud, "particles", f64::from(particles), "in 5 … 10 000 000")?;
        positive("bearings.interval_s", interval_s)?;
        match self.differences {
            None => {
                positive("bearings.sigma_rad", sigma_rad)?;
            }
            Some(DifferencesConfig { reference_m, sigma_m }) => {
                let BearingsConfig { bias_rad, outlier_share, .. } = self.bearings;
                for (name, unused) in [
                    ("bearings.sigma_rad", sigma_rad),
                    ("bearings.bias_rad", bias_rad),
                    ("bearings.outlier_share", outlier_share),
                ] {
                    let absent = unused.abs() <= 0.0;
                    require(absent, name, unused, "left out where differences are measured")?;
                }
                for coordinate in reference_m {
                    finite("differences.reference_m", coordinate)?;
                }
                positive("differences.sigma_m", sigma_m)?;
                let room = matches!(self.prior, PriorConfig::Room { .. });
                require(room, "prior", 0.0, "a room where differences are measured")?;
            }
        }
        for &point in &self.checkpoints {
            let within = (1..=count).contains(&point);
            require(within, "checkpoints", f64::from(point), "in 1 … bearings.count")?;
        }
        match &self.receiver {
            ReceiverConfig::Stations { places_m, bearings_at_each } => {
                let some = !places_m.is_empty() && *bearings_at_each > 0;
                let each = f64::from(*bearings_at_each);
                require(some, "receiver.bearings_at_each", each, "positive, at some place")?;
                for coordinate in places_m.iter().flatten() {
                    finite("receiver.places_m", *coordinate)?;
                }
            }
            ReceiverConfig::Legs { legs } => {
                require(!legs.is_empty(), "receiver.legs", 0.0, "at least one")?;
                for leg in legs {
                    not_negative("receiver.legs.speed_mps", leg.speed_mps)?;
                    finite("receiver.legs.course_deg_compass", leg.course_deg_compass)?;
                    not_negative("receiver.legs.duration_s", leg.duration_s)?;
                }
            }
        }
        match self.target {
            TargetConfig::Line {
                east_m,
                north_m,
                speed_mps,
                course_deg_compass,
                spectral_density,
            } => {
                finite("target.east_m", east_m)?;
                finite("target.north_m", north_m)?;
                not_negative("target.speed_mps", speed_mps)?;
                finite("target.course_deg_compass", course_deg_compass)?;
                not_negative("target.spectral_density", spectral_density)?;
            }
            TargetConfig::Circle { radius_m, period_s } => {
                positive("target.radius_m", radius_m)?;
                positive("target.period_s", period_s)?;
            }
            TargetConfig::FromPrior => {
                let room = matches!(self.prior, PriorConfig::Room { .. });
                require(room, "target", 0.0, "drawn from a room only")?;
            }
        }
        let moving = match self.motion {
            TargetMotion::Still => false,
            TargetMotion::ConstantVelocity { spectral_density } => {
                not_negative("motion.spectral_density", spectral_density)?;
                true
            }
        };
        match self.prior {
            PriorConfig::Room { west_m, east_m, south_m, north_m, speed_sigma_mps } => {
                positive("prior.east_m - prior.west_m", east_m - west_m)?;
                positive("prior.north_m - prior.south_m", north_m - south_m)?;
                if moving {
                    positive("prior.speed_sigma_mps", speed_sigma_mps)?;
                }
            }
            PriorConfig::Ranging {
                sigma_range_m,
                sigma_speed_mps,
                sigma_course_rad,
                least_range_m,
                least_speed_mps,
            } => {
                let needed = "constant-velocity where the prior is one of ranging";
                require(moving, "motion", 0.0, needed)?;
                positive("prior.sigma_range_m", sigma_range_m)?;
                positive("prior.sigma_speed_mps", sigma_speed_mps)?;
                positive("prior.sigma_course_rad", sigma_course_rad)?;
                positive("prior.least_range_m", least_range_m)?;
                not_negative("prior.least_speed_mps", least_speed_mps)?;
            }
        }
        Ok(())
    }

    /// The motion of a target with velocity, if that is what the trial has.
    fn moving(&self) -> Option<ConstantVelocity> {
        match self.motion {
            TargetMotion::Still => None,
            TargetMotion::ConstantVelocity { spectral_density } => {
                Some(ConstantVelocity { spectral_density })
            }
        }
    }
}

/// The reason why there is no trial.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TrialError {
    /// There is no such file and no such trial.
    #[error("{file}: cannot be read")]
    Read {
        /// The file.
        file: String,
        /// The cause.
        source: std::io::Error,
    },
    /// The file is no trial; the source names line, field and value.
    #[error("{file}: not a trial")]
    Parse {
        /// The file.
        file: String,
        /// The cause.
        source: toml::de::Error,
    },
    /// A field is out of its range.
    #[error("{trial}: {error}")]
    Field {
        /// The trial.
        trial: String,
        /// The field, its value and what it must be.
        error: ParameterError,
    },
    /// The estimator does not run in this trial.
    #[error("{estimator} cannot run in {trial}: it needs {needs}")]
    Unsuited {
        /// Name of the estimator.
        estimator: String,
        /// The trial.
        trial: String,
        /// The requirement of the estimator.
        needs: &'static str,
    },
    /// The density of the bearings is out of range.
    #[error("the bearings of the trial: {0}")]
    Bearings(#[from] ParameterError),
    /// The estimator cannot be built.
    #[error("the estimator of the trial: {0}")]
    Estimator(#[from] EstimatorError),
    /// The estimator takes all receptions at once.
    #[error(transparent)]
    Name(#[from] RegistryError),
    /// The threads could not be started.
    #[error(transparent)]
    Threads(#[from] ThreadsError),
}

/// The trials that need no file.
#[must_use]
pub fn builtin_trials() -> Vec<Trial> {
    TEXTS
        .iter()
        .map(|(name, text)| Trial::parse(text, name).expect("a test parses each of them"))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_text_is_a_trial_of_its_name() {
        let registry = foxhunt_hunt::registry::Registry::builtin();
        for (name, text) in TEXTS {
            let trial = Trial::parse(text, name).expect("a built-in trial is in order");
            assert_eq!(trial.name, name);
            assert!(registry.estimator(&trial.estimator).is_ok());
        }
        assert_eq!(Trial::find("pritzl-6.1").expect("no file"), None);
    }

    #[test]
    fn the_root_of_an_intensity_is_refused_by_its_name() {
        // Until q took its place, `acceleration_density` was √q.
        let text = include_str!("../../trials/isaacs-circle.toml");
        let old = text.replace("spectral_density = 1e-4", "acceleration_density = 0.01");
        let error = Trial::parse(&old, "old.toml").expect_err("it is refused");
        let cause = std::error::Error::source(&error).expect("the parser's").to_string();
        assert!(error.to_string().starts_with("old.toml"), "{error}");
        assert!(cause.contains("acceleration_density"), "{cause}");
    }

    #[test]
    fn numbers_out_of_range_are_named() {
        let text = TEXTS[0].1;
        for (good, bad, field) in [
            ("count = 48", "count = 0", "bearings.count"),
            ("particles = 2000", "particles = 4", "particles"),
            ("sigma_rad = 0.2468", "sigma_rad = 0.0", "bearings.sigma_rad"),
            ("checkpoints = [12, 24]", "checkpoints = [49]", "checkpoints"),
            ("bearings_at_each = 3", "bearings_at_each = 0", "receiver.bearings_at_each"),
            ("west_m = -3.0", "west_m = 3.0", "prior.east_m - prior.west_m"),
            ("kind = \"still\"", "kind = \"constant-velocity\"\nspectral_density = nan", "motion"),
        ] {
            assert!(text.contains(good), "{good}");
            let error =
                Trial::parse(&text.replace(good, bad), "bad.toml").expect_err(bad).to_string();
            assert!(error.starts_with("bad.toml: ") && error.contains(field), "{error}");
        }
    }
}
