use std::f64::consts::TAU;

use foxhunt_filters::Loss;

use super::{EstimatorConfig, FilterConfig, GateConfig, MovingConfig, OutlierConfig};
use crate::hunt::{Components, TimeStep, TrackConfig, WithoutBearing};

/// An estimator that the program knows by name.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NamedEstimator {
    /// Its name, as `--estimator` takes it.
    pub name: &'static str,
    /// What it is, in a line.
    pub about: &'static str,
    /// Where it comes from.
    pub source: &'static str,
    /// What it is made of.
    pub config: EstimatorConfig,
}

/// The random walk of a still beacon, m/√s: a few decimetres over a hunt, so that nothing
/// freezes.
const STILL: f64 = 0.02;

/// The reference's random walk in metres per step: q² is 0.1957², its exponent lost in print
/// (Pritzl 2018, §4.4).
const PRITZL_DRIFT: f64 = 0.1957;

/// √70 m, the root of the reference's prior variance (Pritzl 2018, §4.4).
const PRITZL_PRIOR_SIGMA_M: f64 = 8.366_600_265_340_756;

/// Enough for what follows to change an iterated update by less than the filter's own tolerance;
/// most end after 3 to 6.
const ITERATIONS: u32 = 10;

/// The root of 0.19572 m², the other reading of what is printed there.
const PRITZL_VARIANCE_DRIFT: f64 = 0.442_402_531_638_326;

/// The estimator that is asked for as such: it knows what a user knows, which is neither the
/// transmitter's power nor the level's σ to better than some dB.
pub const DEFAULT_ESTIMATOR: &str = "default";

/// A Kalman filter starts from what a grid makes of so many receptions: two formation positions
/// of three drones.
const START_ON_GRID: u32 = 6;

/// Bearings alone; a turn without one is of no use.
const BEARING_ONLY: TrackConfig = TrackConfig {
    time_step: TimeStep::Elapsed,
    first_position_rss_sigma_db: None,
    rss_sigma_db: None,
    without_bearing: WithoutBearing::Discard,
    components: Components::BearingOnly,
};

/// Every estimator that has a name.
#[must_use]
pub fn estimators() -> Vec<NamedEstimator> {
    let gate = GateConfig::Probability(0.999);
    let as_read = |filter| EstimatorConfig {
        filter,
        drift: STILL,
        prior_sigma_m: None,
        power_sigma_db: None,
        moving: None,
        lag_s: None,
        start_on_grid: None,
        track: TrackConfig::default(),
    };
    let started =
        |filter| EstimatorConfig { start_on_grid: Some(START_ON_GRID), ..as_read(filter) };
    let pritzl = |drift, filter| EstimatorConfig {
        filter,
        drift,
        prior_sigma_m: Some(PRITZL_PRIOR_SIGMA_M),
        power_sigma_db: None,
        moving: None,
        lag_s: None,
        start_on_grid: None,
        track: TrackConfig::pritzl2018(),
    };
    let pritzl_ukf = FilterConfig::Ukf {
        gate: GateConfig::Pritzl2018,
        alpha: 0.001,
        beta: 2.0,
        kappa: 1.0,
        iterations: 1,
    };
    let bearing_cloud = FilterConfig::Particle { count: 2000, adaptive_bin: None };
    vec![
        NamedEstimator {
            name: DEFAULT_ESTIMATOR,
            about: "grid with the reference power and σ of the level in doubt: found along with the place",
            source: "Bucy & Senne 1971; Doucet et al. 2000 (Rao-Blackwell)",
            config: EstimatorConfig {
                power_sigma_db: Some(5.0),
                ..as_read(FilterConfig::Grid { side: 64, level_noise_spread: Some(0.5) })
            },
        },
        NamedEstimator {
            name: "grid",
            about: "recursive Bayes over cells that follow the belief",
            source: "Bucy & Senne 1971",
            config: as_read(FilterConfig::Grid { side: 64, level_noise_spread: None }),
        },
        NamedEstimator {
            name: "ukf-pritzl2018",
            about: "the reference system's unscented Kalman filter with its gate and its σ of the level",
            source: "Pritzl 2018, §4.4",
            config: pritzl(PRITZL_DRIFT, pritzl_ukf),
        },
        NamedEstimator {
            name: "ekf-pritzl2018",
            about: "the extended Kalman filter that the reference system was compared with",
            source: "Pritzl 2018, §4.4 and §6",
            config: pritzl(
                PRITZL_DRIFT,
                FilterConfig::Ekf { gate: GateConfig::Pritzl2018, iterations: 1 },
            ),
        },
        NamedEstimator {
            name: "ukf-pritzl2018-variance",
            about: "the same as ukf-pritzl2018 with the printed 0.19572 m² read as the variance",
            source: "Pritzl 2018, §4.4",
            config: pritzl(PRITZL_VARIANCE_DRIFT, pritzl_ukf),
        },
        NamedEstimator {
            name: "ukf",
            about: "unscented Kalman filter, sigma points at √2 standard deviations, χ² gate",
            source: "Julier & Uhlmann 2004; Wan & van der Merwe 2000",
            config: started(FilterConfig::Ukf {
                gate,
                alpha: 1.0,
                beta: 2.0,
                kappa: 0.0,
                iterations: 1,
            }),
        },
        NamedEstimator {
            name: "ekf",
            about: "extended Kalman filter, χ² gate",
            source: "Bar-Shalom, Li & Kirubarajan 2001, §10.3",
            config: started(FilterConfig::Ekf { gate, iterations: 1 }),
        },
        NamedEstimator {
            name: "ekf-iterated",
            about: "extended Kalman filter linearised up to 10 times about its posterior, χ² gate",
            source: "Bell & Cathey 1993",
            config: started(FilterConfig::Ekf { gate, iterations: ITERATIONS }),
        },
        NamedEstimator {
            name: "cubature",
            about: "cubature Kalman filter, χ² gate",
            source: "Arasaratnam & Haykin 2009",
            config: started(FilterConfig::Cubature { gate, outliers: None, iterations: 1 }),
        },
        NamedEstimator {
            name: "iterated-posterior-linearisation",
            about: "cubature points redrawn up to 10 times from the posterior, damped, χ² gate",
            source: "García-Fernández, Svensson, Morelande & Särkkä 2015; Raitoharju et al. 2018",
            config: started(FilterConfig::Cubature {
                gate,
                outliers: None,
                iterations: ITERATIONS,
            }),
        },
        NamedEstimator {
            name: "iterated-posterior-linearisation-robust",
            about: "the same without a gate: one reception in twenty is taken to say nothing",
            source: "the above; Bar-Shalom & Tse 1975",
            config: started(FilterConfig::Cubature {
                gate: GateConfig::Open,
                outliers: Some(OutlierConfig { share: 0.05, support: 100.0 * TAU }),
                iterations: ITERATIONS,
            }),
        },
        NamedEstimator {
            name: "gaussian-sum",
            about: "the prior as 49 Gaussians, each run by iterated posterior linearisation, merged as they agree",
            source: "Alspach & Sorenson 1972; Runnalls 2007",
            config: as_read(FilterConfig::GaussianSum { parts: 7, iterations: ITERATIONS }),
        },
        NamedEstimator {
            name: "range-parameterised",
            about: "a row of 12 Gaussians along the first bearing, ranges in geometric progression",
            source: "Peach 1995; Arulampalam & Ristic 2000",
            config: as_read(FilterConfig::RangeParameterised { parts: 12, iterations: ITERATIONS }),
        },
        NamedEstimator {
            name: "imm",
            about: "interacting multiple models, still and moving, each linearised up to 10 times about its posterior",
            source: "Blom & Bar-Shalom 1988",
            config: EstimatorConfig {
                moving: Some(MovingConfig { acceleration_density: 0.05, speed_sigma: 0.3 }),
                ..started(FilterConfig::Imm {
                    sojourn_s: [600.0, 60.0],
                    still_drift: STILL,
                    iterations: ITERATIONS,
                })
            },
        },
        NamedEstimator {
            name: "batch",
            about: "the most probable place, solved anew over all receptions after each",
            source: "Levenberg 1944; Marquardt 1963; Bar-Shalom, Li & Kirubarajan 2001, §3.4",
            config: as_read(FilterConfig::Batch { loss: Loss::Gaussian }),
        },
        NamedEstimator {
            name: "batch-robust",
            about: "the same with residuals as Student's t with 4 degrees of freedom has them",
            source: "Lange, Little & Taylor 1989",
            config: as_read(FilterConfig::Batch { loss: Loss::StudentT { degrees: 4.0 } }),
        },
        NamedEstimator {
            name: "particle",
            about: "particle filter, 5000 particles, regularised systematic resampling",
            source: "Gordon, Salmond & Smith 1993; Liu & West 2001",
            config: as_read(FilterConfig::Particle { count: 5000, adaptive_bin: None }),
        },
        NamedEstimator {
            name: "particle-adaptive",
            about: "the same with 500 to 20 000 particles, as many as the belief is wide",
            source: "Fox 2003",
            config: as_read(FilterConfig::Particle { count: 20_000, adaptive_bin: Some(0.5) }),
        },
        NamedEstimator {
            name: "particle-rao-blackwellised",
            about: "2000 particles, each with a Gaussian of the reference power, which is in doubt by 5 dB",
            source: "Doucet et al. 2000; Schön, Gustafsson & Nordlund 2005",
            config: EstimatorConfig {
                power_sigma_db: Some(5.0),
                ..as_read(FilterConfig::RaoBlackwellised { count: 2000 })
            },
        },
        NamedEstimator {
            name: "particle-bearing",
            about: "particle filter on bearings alone, 2000 particles",
            source: "Isaacs et al. 2014, §IV",
            config: EstimatorConfig { track: BEARING_ONLY, ..as_read(bearing_cloud) },
        },
        NamedEstimator {
            name: "particle-bearing-moving",
            about: "the same, 5000 particles, for a target that moves at some centimetres per second",
            source: "Isaacs et al. 2014, §IV",
            config: EstimatorConfig {
                moving: Some(MovingConfig { acceleration_density: 0.005, speed_sigma: 0.05 }),
                track: BEARING_ONLY,
                ..as_read(FilterConfig::Particle { count: 5000, adaptive_bin: None })
            },
        },
    ]
}

/// The estimator of a name.
#[must_use]
pub fn estimator_named(name: &str) -> Option<NamedEstimator> {
    estimators().into_iter().find(|known| known.name == name)
}
