use clap::ValueEnum;
use foxhunt::{config::NamedEstimator, hunt::Components};

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
        let Self { components, prior_sigma_m, power_sigma_db, lag_s } = self;
        components.is_some() || [prior_sigma_m, power_sigma_db, lag_s].iter().any(|v| v.is_some())
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
