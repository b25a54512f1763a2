use serde::{Deserialize, Serialize};

use super::{FilterConfig, GateConfig};
use crate::hunt::TrackConfig;

/// An estimator: a filter, and how receptions are put to it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EstimatorConfig {
    /// The filter.
    pub filter: FilterConfig,
    /// How receptions are put to it; everything as it was read unless given.
    #[serde(default)]
    pub track: TrackConfig,
}

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

/// Enough for what follows to change an iterated update by less than the filter's own tolerance;
/// most end after 3 to 6.
const ITERATIONS: u32 = 10;

/// The root of 0.19572 m², the other reading of what is printed there.
const PRITZL_VARIANCE_DRIFT: f64 = 0.442_402_531_638_326;

/// Every estimator that has a name.
#[must_use]
pub fn estimators() -> [NamedEstimator; 9] {
    let gate = GateConfig::Probability(0.999);
    let as_read = |filter| EstimatorConfig { filter, track: TrackConfig::default() };
    let pritzl = |filter| EstimatorConfig { filter, track: TrackConfig::pritzl2018() };
    let pritzl_ukf = |drift| {
        pritzl(FilterConfig::Ukf {
            drift,
            gate: GateConfig::Pritzl2018,
            alpha: 0.001,
            beta: 2.0,
            kappa: 1.0,
            iterations: 1,
        })
    };
    [
        NamedEstimator {
            name: "ukf-pritzl2018",
            about: "the reference system's unscented Kalman filter with its gate and its σ of the level",
            source: "Pritzl 2018, §4.4",
            config: pritzl_ukf(PRITZL_DRIFT),
        },
        NamedEstimator {
            name: "ekf-pritzl2018",
            about: "the extended Kalman filter that the reference system was compared with",
            source: "Pritzl 2018, §4.4 and §6",
            config: pritzl(FilterConfig::Ekf {
                drift: PRITZL_DRIFT,
                gate: GateConfig::Pritzl2018,
                iterations: 1,
            }),
        },
        NamedEstimator {
            name: "ukf-pritzl2018-variance",
            about: "the same as ukf-pritzl2018 with the printed 0.19572 m² read as the variance",
            source: "Pritzl 2018, §4.4",
            config: pritzl_ukf(PRITZL_VARIANCE_DRIFT),
        },
        NamedEstimator {
            name: "ukf",
            about: "unscented Kalman filter, sigma points at √2 standard deviations, χ² gate",
            source: "Julier & Uhlmann 2004; Wan & van der Merwe 2000",
            config: as_read(FilterConfig::Ukf {
                drift: STILL,
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
            config: as_read(FilterConfig::Ekf { drift: STILL, gate, iterations: 1 }),
        },
        NamedEstimator {
            name: "ekf-iterated",
            about: "extended Kalman filter linearised up to 10 times about its posterior, χ² gate",
            source: "Bell & Cathey 1993",
            config: as_read(FilterConfig::Ekf { drift: STILL, gate, iterations: ITERATIONS }),
        },
        NamedEstimator {
            name: "cubature",
            about: "cubature Kalman filter, χ² gate",
            source: "Arasaratnam & Haykin 2009",
            config: as_read(FilterConfig::Cubature { drift: STILL, gate, iterations: 1 }),
        },
        NamedEstimator {
            name: "iterated-posterior-linearisation",
            about: "cubature points redrawn up to 10 times from the posterior, damped, χ² gate",
            source: "García-Fernández, Svensson, Morelande & Särkkä 2015; Raitoharju et al. 2018",
            config: as_read(FilterConfig::Cubature { drift: STILL, gate, iterations: ITERATIONS }),
        },
        NamedEstimator {
            name: "particle",
            about: "particle filter, 5000 particles, regularised systematic resampling",
            source: "Gordon, Salmond & Smith 1993; Liu & West 2001",
            config: as_read(FilterConfig::Particle { drift: STILL, count: 5000 }),
        },
    ]
}

/// The estimator of a name.
#[must_use]
pub fn estimator_named(name: &str) -> Option<NamedEstimator> {
    estimators().into_iter().find(|known| known.name == name)
}
