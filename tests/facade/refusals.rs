//! Refusals of requests that cannot be honoured, and the names in the error.

use std::{convert::Infallible, error::Error};

use foxhunt::{
    campaign::{CampaignError, campaign},
    filters::Ekf,
    formation::Hold,
    hunt::HuntError,
    prelude::*,
    registry::RegistryError,
    sensors::Pritzl2018,
    simulation::SimulationError,
    trial::{Trial, TrialError, trial_campaign},
};
use nalgebra::Vector2;

use crate::support::{entries, entry, repetition};

/// Range in metres and Doppler shift in hertz.
#[derive(Clone, Copy, Debug)]
struct Radar;

const DOPPLER: Quantity = Quantity::linear("doppler_hz");

impl MeasurementModel<2, 2> for Radar {
    fn quantities(&self) -> [Quantity; 2] {
        [Quantity::RANGE, DOPPLER]
    }

    fn expected(&self, state: &State<2>, receiver: &Pose) -> Vector2<f64> {
        let sight = state.push(0.0) - receiver.position;
        let approach = receiver.velocity.unwrap_or_default().dot(&sight) / sight.norm();
        Vector2::new(sight.norm(), 1.447 * approach)
    }
}

fn radar_parts() -> Parts {
    Parts::new(Pritzl2018::default(), Hold::new(1), |search: &Search<'_>| {
        let filter = Ekf::new(RandomWalk::uniform(0.02), Radar, search.prior)?;
        Ok(Track::new(filter, TrackConfig::default()))
    })
}

#[test]
fn metres_and_hertz_are_no_level_and_no_bearing() {
    let hunt = |parts| Hunt::new(parts, vec!["beacon".to_owned()], HuntConfig::default());
    let [level, bearing] = [Quantity::RSS, Quantity::BEARING];
    // The first quantity that is missing is named, and all that there are.
    for (parts, missing, measured) in [
        (radar_parts(), Quantity::RANGE, vec![level, bearing]),
        (
            radar_parts().with_quantities(&[Quantity::RANGE]),
            DOPPLER,
            vec![level, bearing, Quantity::RANGE],
        ),
    ] {
        let error = hunt(parts).expect_err("it is not measured");
        assert_eq!(error, HuntError::NotMeasured { quantity: missing, measured: measured.clone() });
        let text = error.to_string();
        for quantity in measured.iter().chain([&missing]) {
            assert!(text.contains(quantity.name()), "{text}");
        }
    }
    let all = radar_parts().with_quantities(&[Quantity::RANGE, DOPPLER]);
    assert!(hunt(all).is_ok());
}

#[test]
fn a_trial_refuses_settings_it_cannot_honour() {
    let trial = Trial::find("isaacs-static").expect("in order").expect("it is built in");
    let refused = |name| {
        let error = trial_campaign(&trial, &entries(&[name]), &repetition(1, 1));
        error.expect_err("it cannot be honoured")
    };
    let error = refused("default");
    assert!(matches!(error, TrialError::Unsuited { .. }), "{error}");
    let text = error.to_string();
    for part in ["default", "isaacs-static", "power_sigma_db"] {
        assert!(text.contains(part), "{text}");
    }
    let text = refused("ukf-pritzl2018").to_string();
    assert!(text.contains("track.time_step"), "{text}");
    // One that takes all receptions at once.
    let error = refused("shadowing-grid");
    assert!(error.to_string().contains("shadowing-grid"), "{error}");
}

#[test]
fn campaigns_refuse_estimators_that_take_all_receptions_at_once() {
    let registry = Registry::builtin();
    let scenario = Scenario::find("pritzl-6.1").expect("it is built in");
    let all_at_once = |entry: &&EstimatorEntry| entry.needs().all_at_once;
    assert!(registry.estimators().iter().filter(all_at_once).count() > 3);
    for estimator in registry.estimators().iter().filter(all_at_once) {
        let alone = std::slice::from_ref(estimator);
        let error = campaign(&registry, &scenario, alone, &repetition(1, 1));
        let error = error.expect_err("there is no stream");
        assert!(matches!(error, CampaignError::Simulation(SimulationError::Parts(_))), "{error}");
        assert!(error.to_string().contains(&*estimator.name), "{error}");
        let error = estimator.require_stream().expect_err("there is none");
        assert!(matches!(error, RegistryError::NeedsAllAtOnce { .. }), "{error}");
    }
    // Differences need a reference receiver, of which this scenario knows nothing.
    let setup = Setup {
        scenario: &scenario,
        estimator: &entry("range-difference-bearing"),
        registry: &registry,
    };
    let error = setup.simulate(1, |_| Ok::<_, Infallible>(())).expect_err("no reference");
    let text = chain(&error);
    assert!(text.contains("reference_m"), "{text}");
}

/// The messages of an error and all that caused it.
fn chain(error: &dyn Error) -> String {
    let causes = error.source().map(chain).unwrap_or_default();
    format!("{error}: {causes}")
}
