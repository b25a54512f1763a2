//! Innovations watched: whiteness and the watchdog on filters that are right, wrong and lost.

use approx::assert_abs_diff_eq;
use foxhunt_core::{
    Correction, Estimate, Estimator, MeasurementModel, Observation, Pose, Quantity, RandomWalk,
    State,
    nalgebra::{Matrix1, Vector1, Vector2},
};
use foxhunt_filters::{
    Ekf, Gate, Innovation, ParticleFilter, Ukf,
    consistency::{ChiSquaredAverage, Monitored, NisHealth, NisWatchdog, Verdict, Whiteness},
};
use rand::RngExt;
use rand_distr::StandardNormal;

use super::{
    edges::rng,
    model::{FIELD, observed},
};

/// z = x.
#[derive(Clone, Copy)]
struct Itself;

impl MeasurementModel<1, 1> for Itself {
    fn quantities(&self) -> [Quantity; 1] {
        [Quantity::linear("x_m")]
    }
    fn expected(&self, state: &State<1>, _receiver: &Pose) -> Vector1<f64> {
        *state
    }
}

/// 2000 steps of a walk of 1 m a step observed with σ = 2 m, by a filter that thinks of another
/// walk and another σ; from seed 4.
fn walked(drift: f64, sigma: f64) -> (Verdict, f64) {
    let mut rng = rng(4);
    let mut white = || -> f64 { rng.sample(StandardNormal) };
    let prior = Estimate::isotropic(Vector1::zeros(), 1.0);
    let filter = Ekf::new(RandomWalk::uniform(drift), Itself, prior).expect("a proper prior");
    let mut watched = Monitored::new(filter, Itself);
    let mut truth = white();
    for _ in 0..2000 {
        truth += white();
        let z = Vector1::new(truth + 2.0 * white());
        let noise = Matrix1::new(sigma * sigma);
        watched.predict(1.0).expect("a proper step");
        let reported = Observation::new(0.0, Pose::default(), z, noise).expect("proper");
        let _ = watched.update(&reported).expect("proper");
    }
    let mut whiteness = Whiteness::new(10);
    whiteness.add_run(watched.innovations());
    (watched.nis().verdict(), whiteness.ljung_box().expect("2000 of them").p_value)
}

#[test]
fn a_filter_with_the_right_noise_is_consistent_and_white() {
    // One run: a false alarm in 20 of either, but not of this seed.
    let (verdict, p_value) = walked(1.0, 2.0);
    assert_eq!(verdict, Verdict::Consistent);
    assert!(p_value > 0.05, "{p_value}");
    // Too slow a walk: innovations too large, and each like the one before.
    let (verdict, p_value) = walked(0.3, 2.0);
    assert_eq!(verdict, Verdict::OverConfident);
    assert!(p_value < 1e-6, "{p_value}");
    // Both noises twice too large: of the right shape, hence white, and a quarter of the NIS.
    let (verdict, p_value) = walked(2.0, 4.0);
    assert_eq!(verdict, Verdict::UnderConfident);
    assert!(p_value > 0.01, "{p_value}");
}

#[test]
fn the_innovation_of_any_belief_is_the_filter_s_own() {
    let prior = Estimate::isotropic(Vector2::new(30.0, -8.0), 4.0);
    let ukf = Ukf::new(RandomWalk::uniform(0.1), FIELD, prior).expect("a proper prior");
    let whole = observed(Pose::at(2.0, 2.0, 4.0), Vector2::new(-70.0, 0.3), 4.0, 0.2);
    for observation in [whole, whole.without(0), whole.without(1)] {
        let own = ukf.innovation(&observation).expect("finite");
        // Of the Ukf's points the central one has no weight here: the same moments as cubature
        // points, to the fourth order.
        let reported = Innovation::of_belief(&ukf, &FIELD, &observation).expect("finite");
        assert!((own.residual - reported.residual).norm() < 0.05 * (1.0 + own.residual.norm()));
        assert!((own.covariance - reported.covariance).norm() < 0.02 * own.covariance.norm());
        let white = reported.normalised_present(&observation).expect("definite");
        let square: f64 = white.iter().flatten().map(|v| v * v).sum();
        assert_abs_diff_eq!(square, reported.nis, epsilon = 1e-12 * (1.0 + square));
        assert_eq!(white.iter().flatten().count(), observation.len());
    }
}

#[test]
fn monitoring_changes_nothing() {
    let prior = Estimate::isotropic(Vector2::new(30.0, -8.0), 4.0);
    let make = || {
        ParticleFilter::new(RandomWalk::uniform(0.1), FIELD, prior, 300, rng(3)).expect("proper")
    };
    let mut bare = make();
    let mut watched = Monitored::new(make(), FIELD);
    for step in 0..8_u8 {
        let whole =
            observed(Pose::at(f64::from(step), 2.0, 4.0), Vector2::new(-70.0, 0.3), 4.0, 0.2);
        let observation = if step == 3 { whole.without(0).without(1) } else { whole };
        assert_eq!(bare.predict(1.0), watched.predict(1.0));
        assert_eq!(bare.update(&observation), watched.update(&observation));
        assert_eq!(bare.estimate(), watched.estimate());
    }
    assert_eq!((watched.nis().count(), watched.innovations().len()), (7, 7), "one was empty");
    // The NIS of a cloud is that of its innovation.
    let sum: f64 = watched.innovations().iter().flatten().flatten().map(|v| v * v).sum();
    assert_abs_diff_eq!(sum / 7.0, watched.nis().average().expect("some"), epsilon = 1e-9);
}

#[test]
fn the_watchdog_barks_at_a_lost_target_and_seldom_else() {
    // 1000 sequences of 1000 consistent NIS of two degrees of freedom, seed 8: 6 of 100 have an
    // alarm, by the doc, to 3.3 standard errors.
    let mut rng = rng(8);
    let alarmed = (0..1000).filter(|_| {
        let mut watchdog = NisWatchdog::new(10, 1e-4).expect("in range");
        (0..1000).fold(false, |alarm, _| {
            // χ²₂ is exponential with the mean 2.
            let nis = -2.0 * libm::log(1.0 - rng.random::<f64>());
            alarm | watchdog.add(nis, 2).is_alarm()
        })
    });
    let share = f64::from(u32::try_from(alarmed.count()).expect("few")) / 1000.0;
    assert!((0.035..0.085).contains(&share), "{share}");

    // A still target that jumps 30 m aside: found within the window, gate or not.
    let prior = Estimate::isotropic(Vector2::new(40.0, 0.0), 3.0);
    for gate in [Gate::open(), Gate::probability(0.99).expect("in range")] {
        let mut filter =
            Ekf::new(RandomWalk::uniform(0.01), FIELD, prior).expect("proper").with_gate(gate);
        let mut watchdog = NisWatchdog::new(10, 1e-4).expect("in range");
        let mut lost = None;
        for step in 0..60_u32 {
            let truth = Vector2::new(40.0, if step < 30 { 0.0 } else { 30.0 });
            let receiver = Pose::at(f64::from(step % 7), 0.0, 4.0);
            let noise =
                Vector2::new(4.0, 0.1).map(|s| -> f64 { s * rng.sample::<f64, _>(StandardNormal) });
            let z = FIELD.expected(&truth, &receiver) + noise;
            let observation = observed(receiver, z, 4.0, 0.1);
            filter.predict(1.0).expect("a proper step");
            let reported = filter.update(&observation).expect("proper");
            if let NisHealth::Diverged { average, interval } = watchdog.observe(&reported, 2) {
                assert!(average > interval[1]);
                lost = lost.or(Some(step));
            }
        }
        assert!(lost.is_some_and(|step| (30..40).contains(&step)), "{lost:?}");
    }
}

#[test]
fn the_watchdog_counts_components_and_fills_first() {
    let mut watchdog = NisWatchdog::new(2, 0.05).expect("in range");
    assert_eq!(watchdog.add(1.0, 2), NisHealth::Filling);
    assert_eq!(watchdog.add(1e9, 0), NisHealth::Filling);
    assert_eq!(watchdog.observe(&Correction::Empty, 0), NisHealth::Filling);
    // χ²₃ at 2.5 and 97.5 %: 0.2158 and 9.3484.
    let NisHealth::Sound { average, interval } = watchdog.add(3.0, 1) else { panic!("not sound") };
    assert_abs_diff_eq!(average, 2.0, epsilon = 1e-15);
    assert_abs_diff_eq!(2.0 * interval[0], 0.2158, epsilon = 1e-4);
    assert_abs_diff_eq!(2.0 * interval[1], 9.3484, epsilon = 1e-4);
    let rejected = Correction::Rejected { nis: 30.0, limit: 10.0 };
    assert!(matches!(watchdog.observe(&rejected, 2), NisHealth::Diverged { .. }));
    let _ = watchdog.add(0.01, 2);
    assert!(matches!(watchdog.add(0.01, 2), NisHealth::Overcautious { .. }));
    assert!(matches!(watchdog.add(f64::NAN, 2), NisHealth::Diverged { .. }));
    watchdog.reset();
    assert_eq!(watchdog.health(), NisHealth::Filling);
    assert!(NisWatchdog::new(0, 0.05).is_err() && NisWatchdog::new(3, 0.0).is_err());
    assert!(ChiSquaredAverage::default().average().is_none());
}
