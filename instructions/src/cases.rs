//! Cases to be counted: each is made ready first, and only its work is counted.

use std::{convert::Infallible, error::Error};

#[cfg(feature = "dual")]
use foxhunt::core::{Differentiated, DualMeasurement, Number};
use foxhunt::{
    config::BoxedEstimator,
    filters::Resampling,
    formation::{Information, InformationConfig},
    prelude::*,
    registry::RECOMMENDED_EXTRACTOR,
};
use nalgebra::Vector2;

#[path = "../../benches/beacon/mod.rs"]
mod beacon;
#[path = "../../benches/bearings/mod.rs"]
mod bearings;
#[path = "../../benches/problems/belief.rs"]
mod belief;
#[path = "../../benches/problems/reception.rs"]
mod reception;
#[path = "../../benches/problems/turn.rs"]
mod turn;

/// Work to be counted; its result is what it found, so that nothing of it is left out.
pub(crate) type Work = Box<dyn FnOnce() -> f64>;

/// A case by name.
pub(crate) type Case = (&'static str, fn() -> Result<Work, Box<dyn Error>>);

/// The case that takes the feature `dual`, with which most of foxhunt is built again.
pub(crate) const WITH_DUAL_NUMBERS: &str = "ekf with dual numbers, 48 steps";

/// Every case.
pub(crate) const CASES: &[Case] = &[
    ("ukf, 48 steps", || Ok(steps(beacon::ukf()))),
    ("ukf by hand, 48 steps", || Ok(steps_by_hand(beacon::hand_ukf))),
    ("ekf, 48 steps", || Ok(steps(beacon::ekf()))),
    ("ekf by hand, 48 steps", || Ok(steps_by_hand(beacon::hand_ekf))),
    #[cfg(feature = "dual")]
    (WITH_DUAL_NUMBERS, || Ok(steps(beacon::ekf_of(Differentiated(Once))))),
    ("ekf with central differences, 48 steps", || Ok(steps(beacon::ekf_of(Differences)))),
    ("cloud of 10000, multinomial, 10 steps", || Ok(cloud(Resampling::Multinomial))),
    ("cloud of 10000, systematic, 10 steps", || Ok(cloud(Resampling::Systematic))),
    ("grid, 4 receptions", || receptions("grid", 4)),
    ("default, 4 receptions", || receptions("default", 4)),
    ("batch, 1000 observations", || receptions("batch", 1000)),
    ("extractor of the reference, a turn", || extraction("pritzl2018")),
    ("recommended extractor, a turn", || extraction(RECOMMENDED_EXTRACTOR)),
    ("information planner, a decision", || decision(&[[20.0, 30.0]], 15.0)),
    ("information planner, two modes", || decision(&[[-40.0, 30.0], [60.0, 10.0]], 8.0)),
    ("hunt pritzl-6.1 with ukf-pritzl2018", || hunt("ukf-pritzl2018")),
    ("hunt pritzl-6.1 with ekf", || hunt("ekf")),
];

/// The model of [`beacon`], written once over any number.
#[cfg(feature = "dual")]
struct Once;

#[cfg(feature = "dual")]
impl DualMeasurement<2, 2> for Once {
    fn quantities(&self) -> [Quantity; 2] {
        [Quantity::RSS, Quantity::BEARING]
    }

    fn expected<T: Number>(&self, [east, north]: [T; 2], receiver: &Pose) -> [T; 2] {
        let east = east - receiver.position.x;
        let north = north - receiver.position.y;
        let square = east * east + north * north + receiver.position.z.powi(2);
        [square.log10() * (-5.0 * beacon::EXPONENT) + beacon::REFERENCE_DBM, north.atan2(east)]
    }
}

/// The model without a Jacobian of its own.
struct Differences;

impl MeasurementModel<2, 2> for Differences {
    fn quantities(&self) -> [Quantity; 2] {
        [Quantity::RSS, Quantity::BEARING]
    }

    fn expected(&self, state: &State<2>, receiver: &Pose) -> Vector2<f64> {
        let way = state - receiver.position.xy();
        let square = way.norm_squared() + receiver.position.z.powi(2);
        let level = -5.0 * beacon::EXPONENT * square.log10() + beacon::REFERENCE_DBM;
        Vector2::new(level, way.y.atan2(way.x))
    }
}

fn steps(mut filter: impl Estimator<2, 2> + 'static) -> Work {
    let sweep = beacon::sweep();
    Box::new(move || {
        for observation in &sweep {
            filter.predict(1.0).expect("a proper step");
            let _ = filter.update(observation).expect("possible");
        }
        filter.estimate().mean.x
    })
}

fn steps_by_hand(step: fn(&Estimate<2>, &Observation<2>) -> Option<Estimate<2>>) -> Work {
    let mut belief = beacon::prior();
    let sweep = beacon::sweep();
    Box::new(move || {
        for observation in &sweep {
            belief = step(&belief, observation).expect("positive definite");
        }
        belief.mean.x
    })
}

fn cloud(scheme: Resampling) -> Work {
    let mut step = bearings::of("columns", scheme, 10_000, 1);
    let observations = bearings::observations();
    Box::new(move || observations[..10].iter().map(|o| step(o).mean.x).sum())
}

fn receptions(name: &str, count: u32) -> Result<Work, Box<dyn Error>> {
    let registry = Registry::builtin();
    let estimator = reception::in_the_middle(registry.estimator(name)?);
    let mut estimator: BoxedEstimator<2, 2> = estimator.ok_or("it has no settings")?;
    let observations: Vec<_> = (12..12 + count).map(reception::observation).collect();
    Ok(Box::new(move || {
        for observation in &observations {
            reception::receive(&mut estimator, observation);
        }
        estimator.estimate().mean.x
    }))
}

fn extraction(name: &str) -> Result<Work, Box<dyn Error>> {
    let registry = Registry::builtin();
    let extractor = registry.build_extractor(&registry.extractor(name)?.config())?;
    let samples = turn::turn(0.5);
    Ok(Box::new(move || {
        let sweep = Sweep { positions: 128, samples: &samples, ..Sweep::default() };
        extractor.extract(&sweep).expect("a turn of a beacon in range").rss_dbm
    }))
}

fn decision(modes: &[[f64; 2]], sigma: f64) -> Result<Work, Box<dyn Error>> {
    let mut planner = Information::new(InformationConfig::default())?;
    let belief = belief::Cloud::about(modes, sigma);
    let mut drones = belief::drones();
    Ok(Box::new(move || {
        let _ = planner.plan(&belief, &mut drones).expect("a belief that can be planned from");
        drones[0].goal.position.x
    }))
}

fn hunt(estimator: &'static str) -> Result<Work, Box<dyn Error>> {
    let registry = Registry::builtin();
    let scenario = Scenario::find("pritzl-6.1")?;
    let _ = registry.estimator(estimator)?;
    Ok(Box::new(move || {
        let estimator = registry.estimator(estimator).expect("it was there before");
        let setup = Setup { scenario: &scenario, estimator, registry: &registry };
        let hunt = setup.simulate(1, |_| Ok::<_, Infallible>(())).expect("a hunt that ends");
        hunt.found.iter().map(|found| found.error_m()).sum()
    }))
}
