use clap::ValueEnum;
use foxhunt::{
    config::{ExtractorConfig, NamedEstimator},
    hunt::Components,
    scenario::Scenario,
};

use crate::output::warn;

/// What of an estimator is set otherwise than its name says.
#[derive(Debug, clap::Args)]
#[command(next_help_heading = "The estimator")]
pub(super) struct Overrides {
    /// Which of level and bearing it is told
    #[arg(long, value_name = "WHICH")]
    components: Option<Told>,
    /// How far from the formation's start a beacon is looked for: σ of each coordinate, in metres
    #[arg(long, value_name = "M")]
    prior_sigma_m: Option<f64>,
    /// σ in dB of the reference power, which is then found along with the place; 0 where it is
    /// known
    #[arg(long, value_name = "DB")]
    power_sigma_db: Option<f64>,
    /// Add so much to the σ of each bearing, in squares: errors that no turn shows of itself, as where
    /// whole patterns are turned
    #[arg(long, value_name = "DEG")]
    bearing_sigma_deg: Option<f64>,
    /// Use receptions that come at most so many seconds late at their own time
    #[arg(long, value_name = "S")]
    lag_s: Option<f64>,
}

/// Which components of a reception are used, as the command line has it.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum Told {
    /// Level and bearing.
    Both,
    /// The level alone.
    Rss,
    /// The bearing alone.
    Bearing,
}

impl Overrides {
    /// Whether anything was.
    pub(super) fn any(&self) -> bool {
        let Self { components, prior_sigma_m, power_sigma_db, bearing_sigma_deg, lag_s } = self;
        let numbers = [prior_sigma_m, power_sigma_db, bearing_sigma_deg, lag_s];
        components.is_some() || numbers.iter().any(|v| v.is_some())
    }

    /// Tells a scenario's hunt what was asked for of its bearings.
    pub(super) fn tell(&self, scenario: &mut Scenario) {
        if let Some(sigma) = self.bearing_sigma_deg {
            scenario.bearings.get_or_insert_default().sigma_floor_deg = sigma;
        }
    }

    /// Warns of an extractor whose σ is that of the turn alone, in a world that turns patterns as a
    /// whole.
    pub(super) fn warn_of(&self, scenario: &Scenario) {
        let turned = scenario.world.channel.bearing_sigma_deg;
        let told = scenario.bearings.is_some_and(|bearings| bearings.sigma_floor_deg > 0.0);
        let reference = matches!(scenario.extractor, ExtractorConfig::Pritzl2018(_));
        if turned > 0.0 && !told && !reference {
            warn(&format!(
                "  {} turns whole patterns by {turned}°, which no turn shows: its bearings are less \
                 certain than this extractor says; tell it with --bearing-sigma-deg {turned}",
                scenario.name
            ));
        }
    }

    /// The estimator with what was asked for set otherwise.
    pub(super) fn apply(&self, mut estimator: NamedEstimator) -> NamedEstimator {
        let config = &mut estimator.config;
        if let Some(told) = self.components {
            config.track.components = match told {
                Told::Both => Components::Both,
                Told::Rss => Components::RssOnly,
                Told::Bearing => Components::BearingOnly,
            };
        }
        config.prior_sigma_m = self.prior_sigma_m.or(config.prior_sigma_m);
        config.lag_s = self.lag_s.or(config.lag_s);
        if let Some(sigma) = self.power_sigma_db {
            config.power_sigma_db = Some(sigma).filter(|sigma| sigma.total_cmp(&0.0).is_ne());
        }
        estimator
    }
}
