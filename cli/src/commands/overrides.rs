use clap::ValueEnum;
use foxhunt::{
    config::{EstimatorConfig, ExtractorConfig},
    hunt::Components,
    registry::EstimatorEntry,
    scenario::Scenario,
};

use crate::{error::CliError, output::warn};

/// Settings that replace an estimator's own.
#[derive(Debug, clap::Args)]
#[command(next_help_heading = "The estimator")]
pub(super) struct Overrides {
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
    pub(super) fn apply_to(&self, scenario: &mut Scenario) {
        if let Some(sigma) = self.bearing_sigma_deg {
            scenario.bearings.get_or_insert_default().sigma_floor_deg = sigma;
        }
    }

    /// Warns of an extractor whose σ is that of the turn alone, in a world that turns patterns as a
    /// whole.
    pub(super) fn warn_of_turned_patterns(&self, scenario: &Scenario) {
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
    pub(super) fn estimator(&self, entry: &EstimatorEntry) -> Result<EstimatorEntry, CliError> {
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
