//! Flags that hunts and campaigns share: settings of the parts, the planner, the runs.

use std::{hint::black_box, thread::available_parallelism};

use clap::{ValueEnum, value_parser};
use foxhunt::{
    campaign::{OWN, Repetition},
    config::{EstimatorConfig, ExtractorConfig},
    hunt::Components,
    registry::{EstimatorEntry, PlannerEntry, Registry, RegistryError},
    scenario::Scenario,
    sim::{Dynamics, VehicleConfig},
};

use super::{calibration::Calibration, choice::Extraction};
use crate::{
    error::CliError,
    output::{Output, warn},
    progress::Progress,
};

/// Settings that replace a scenario's own, besides the planner.
#[derive(Debug, clap::Args)]
pub struct Settings {
    /// The source that all drones listen with (`foxhunt list sources`) [default: the scenario's
    /// own]
    #[arg(long, value_name = "NAME")]
    source: Option<String>,
    /// The equations of motion of a scenario's quadrotors [default: the scenario's own]
    #[arg(long, value_name = "NAME")]
    dynamics: Option<QuadrotorDynamics>,
    #[command(flatten)]
    extraction: Extraction,
    #[command(flatten)]
    overrides: Overrides,
    #[command(flatten)]
    calibration: Calibration,
}

/// The dynamics of quadrotors on the command line.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum QuadrotorDynamics {
    /// The simplified body of Isaacs et al. 2014, eq. 3 to 8
    Isaacs2014,
    /// The full rigid body of eq. 1 and 2
    RigidBody,
}

impl Settings {
    /// Sets source, dynamics, calibration, bearings and extractor of a scenario.
    pub fn apply_to(&self, scenario: &mut Scenario, registry: &Registry) -> Result<(), CliError> {
        self.apply_source_to(scenario, registry)?;
        self.apply_dynamics_to(scenario)?;
        self.calibration.read()?.apply_to(scenario);
        self.overrides.apply_to(scenario);
        scenario.extractor = self.extraction.config(registry, &scenario.extractor)?;
        self.overrides.warn_of_turned_patterns(scenario);
        Ok(())
    }

    /// Sets the source of all drones of a scenario.
    fn apply_source_to(
        &self,
        scenario: &mut Scenario,
        registry: &Registry,
    ) -> Result<(), CliError> {
        let Some(name) = &self.source else { return Ok(()) };
        let refused = |why: RegistryError| CliError::input(format!("--source: {why}"));
        let source = registry.source_config(name, &scenario.source, &scenario.model);
        let source = source.map_err(refused)?;
        if scenario.turns.is_some() && !source.turns() {
            return Err(CliError::input(format!(
                "--source {name}: [turns] of {} has a goal for turns, and this source does not \
                 turn",
                scenario.name
            )));
        }
        scenario.source = source;
        scenario.sources.clear();
        Ok(())
    }

    /// Sets the dynamics of a scenario's quadrotors.
    fn apply_dynamics_to(&self, scenario: &mut Scenario) -> Result<(), CliError> {
        let Some(dynamics) = self.dynamics else { return Ok(()) };
        let VehicleConfig::Quadrotor(vehicle) = &mut scenario.world.vehicle else {
            return Err(CliError::input(format!(
                "--dynamics: the drones of {} are no quadrotors; [world.vehicle] needs kind = \
                 \"quadrotor\"",
                scenario.name
            )));
        };
        match dynamics {
            QuadrotorDynamics::Isaacs2014 => {
                vehicle.dynamics = Dynamics::Isaacs2014;
                vehicle.inertia_kg_m2 = None;
            }
            QuadrotorDynamics::RigidBody => vehicle.dynamics = Dynamics::RigidBody,
        }
        Ok(())
    }

    /// The estimator with the settings of the command line.
    pub fn estimator(&self, entry: &EstimatorEntry) -> Result<EstimatorEntry, CliError> {
        self.overrides.estimator(entry)
    }
}

/// Settings that replace an estimator's own.
#[derive(Debug, clap::Args)]
#[command(next_help_heading = "The estimator")]
struct Overrides {
    /// The components of a reception that it uses
    #[arg(long, value_name = "WHICH")]
    components: Option<UsedComponents>,
    /// The prior σ of each coordinate of a beacon about the formation's start, in metres
    #[arg(long, value_name = "M")]
    prior_sigma_m: Option<f64>,
    /// The prior σ of the reference power in dB, which is then estimated along with the place; 0 if
    /// it is known
    #[arg(long, value_name = "DB")]
    power_sigma_db: Option<f64>,
    /// A σ in degrees added in squares to that of each bearing, for errors that no turn shows, such
    /// as turned patterns
    #[arg(long, value_name = "DEG")]
    bearing_sigma_deg: Option<f64>,
    /// Fuse receptions at their own time if they come at most this many seconds late
    #[arg(long, value_name = "S")]
    lag_s: Option<f64>,
}

/// The used components of a reception on the command line.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum UsedComponents {
    /// Level and bearing.
    Both,
    /// The level alone.
    Rss,
    /// The bearing alone.
    Bearing,
}

impl From<UsedComponents> for Components {
    fn from(used: UsedComponents) -> Self {
        match used {
            UsedComponents::Both => Self::Both,
            UsedComponents::Rss => Self::RssOnly,
            UsedComponents::Bearing => Self::BearingOnly,
        }
    }
}

impl Overrides {
    /// Sets σ of a scenario's bearings.
    fn apply_to(&self, scenario: &mut Scenario) {
        if let Some(sigma) = self.bearing_sigma_deg {
            scenario.bearings.get_or_insert_default().sigma_floor_deg = sigma;
        }
    }

    /// Warns of an extractor whose σ is that of the turn alone, in a world that turns patterns as a
    /// whole.
    fn warn_of_turned_patterns(&self, scenario: &Scenario) {
        let turned = scenario.world.channel.bearing_sigma_deg;
        let allowed_for = scenario.bearings.is_some_and(|bearings| bearings.sigma_floor_deg > 0.0);
        let reference = matches!(scenario.extractor, ExtractorConfig::Pritzl2018(_));
        if turned > 0.0 && !allowed_for && !reference {
            warn(&format!(
                "  {} turns whole patterns by {turned}°, which no turn shows: the σ of this \
                 extractor's bearings is too small; add --bearing-sigma-deg {turned}",
                scenario.name
            ));
        }
    }

    /// The estimator with the settings of the command line. One without settings is refused with
    /// the name of the flag.
    fn estimator(&self, entry: &EstimatorEntry) -> Result<EstimatorEntry, CliError> {
        let mut changed = entry.clone();
        let mut set = |flag, change: &dyn Fn(&mut EstimatorConfig)| {
            changed = changed.with_settings(flag, change).map_err(CliError::input)?;
            Ok::<_, CliError>(())
        };
        if let Some(used) = self.components {
            set("--components", &|settings| settings.track.components = used.into())?;
        }
        if let Some(sigma) = self.prior_sigma_m {
            set("--prior-sigma-m", &|settings| settings.prior_sigma_m = Some(sigma))?;
        }
        if let Some(lag_s) = self.lag_s {
            set("--lag-s", &|settings| settings.lag_s = Some(lag_s))?;
        }
        if let Some(sigma) = self.power_sigma_db {
            let sigma = Some(sigma).filter(|sigma| sigma.total_cmp(&0.0).is_ne());
            set("--power-sigma-db", &|settings| settings.power_sigma_db = sigma)?;
        }
        Ok(changed)
    }
}

/// Planner that replaces the scenario's own.
#[derive(Debug, clap::Args)]
pub struct Planning {
    /// The planner (`foxhunt list planners` describes them) [default: the scenario's own]
    #[arg(long, value_name = "NAME")]
    planner: Option<String>,
}

impl Planning {
    /// The planner of the command line.
    pub fn entry<'a>(&self, registry: &'a Registry) -> Result<Option<&'a PlannerEntry>, CliError> {
        let entry = self.planner.as_deref().map(|name| registry.planner(name));
        entry.transpose().map_err(CliError::input)
    }

    /// Returns its name, or a note that it is the scenario's own.
    pub fn name(&self) -> &str {
        self.planner.as_deref().unwrap_or(OWN)
    }

    /// Sets the planner of a scenario.
    pub fn apply_to(&self, scenario: &mut Scenario, registry: &Registry) -> Result<(), CliError> {
        if let Some(planner) = self.entry(registry)? {
            scenario.planner = planner.config(&scenario.field());
        }
        Ok(())
    }
}

/// Runs, their seeds and the jobs that they share.
#[derive(Debug, clap::Args)]
pub struct Runs {
    /// The number of runs of each contender
    #[arg(long, value_name = "N", value_parser = value_parser!(u32).range(1..))]
    runs: u32,
    /// The number of runs at the same time [default: the number of processors]; the result does not
    /// depend on it
    #[arg(long, value_name = "J", value_parser = value_parser!(u16).range(1..=1024))]
    jobs: Option<u16>,
    /// The seed of the first run; run i has this plus i
    #[arg(long, default_value_t = 1, value_name = "N")]
    seed: u64,
    /// Print no progress on standard error
    #[arg(long)]
    quiet: bool,
}

impl Runs {
    /// Returns the number of runs of each contender.
    #[cfg(feature = "store")]
    pub fn count(&self) -> u32 {
        self.runs
    }

    /// Calls `run` with a repetition that shows its progress, where each of `contenders` has all
    /// runs; `what` names the runs.
    pub fn with_progress<R>(
        &self,
        output: Output<'_>,
        what: &'static str,
        contenders: usize,
        run: impl FnOnce(&Repetition<'_>) -> R,
    ) -> R {
        self.with_progress_of(output, what, contenders, self.runs, run)
    }

    /// Calls `run` as [`with_progress`](Self::with_progress) does, where each contender has only
    /// `part` of the runs.
    pub fn with_progress_of<R>(
        &self,
        output: Output<'_>,
        what: &'static str,
        contenders: usize,
        part: u32,
        run: impl FnOnce(&Repetition<'_>) -> R,
    ) -> R {
        let jobs = match self.jobs {
            Some(jobs) => usize::from(jobs),
            None => available_parallelism().map_or(1, usize::from),
        };
        let contenders = u64::try_from(contenders).unwrap_or(u64::MAX);
        let total = u64::from(part).saturating_mul(contenders);
        keep_freed_memory();
        let progress = Progress::new(output, what, total, !self.quiet);
        let step = || progress.step();
        let repetition = Repetition { runs: self.runs, seed: self.seed, jobs, progress: &step };
        let result = run(&repetition);
        progress.finish();
        result
    }
}

/// Has the heap keep what runs free, a few megabytes, for the next runs.
///
/// glibc gives the top of its heap back to the system as soon as 128 KiB of it are free, and takes
/// it again page by page; once a larger block was freed, as soon as twice as much is (mallopt(3),
/// dynamic thresholds). The block is never written to, so it takes no memory. Other heaps are as
/// they were.
fn keep_freed_memory() {
    const BLOCK: usize = 16 << 20;
    drop(black_box(Vec::<u8>::with_capacity(BLOCK)));
}
