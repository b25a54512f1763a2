//! Runs one filter for the given number of steps, so that what one step costs can be counted:
//!
//! ```sh
//! cargo build --release -p foxhunt-instructions --bin steps
//! valgrind --tool=callgrind target/release/steps ukf 48000
//! ```
//!
//! The difference of two counts is what the steps between them cost.

use std::{error::Error, hint::black_box};

use foxhunt_core::{Estimate, Estimator, Observation};

#[path = "../../../benches/beacon/mod.rs"]
mod beacon;

fn run<E: Estimator<2, 2> + ?Sized>(filter: &mut E, steps: usize) -> Result<(), Box<dyn Error>> {
    for observation in beacon::sweep().iter().cycle().take(steps) {
        filter.predict(1.0)?;
        let _ = black_box(filter.update(observation)?);
    }
    black_box(filter.estimate());
    Ok(())
}

fn by_hand(
    step: impl Fn(&Estimate<2>, &Observation<2>) -> Option<Estimate<2>>,
    steps: usize,
) -> Result<(), Box<dyn Error>> {
    let mut belief = beacon::prior();
    for observation in beacon::sweep().iter().cycle().take(steps) {
        belief = black_box(step(&belief, observation).ok_or("not positive definite")?);
    }
    Ok(())
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [filter, steps] = arguments.as_slice() else {
        return Err("two arguments: [boxed-|hand-]ukf|ekf, and how many steps".into());
    };
    let steps = steps.parse()?;
    match filter.as_str() {
        "ukf" => run(&mut beacon::ukf(), steps),
        "ekf" => run(&mut beacon::ekf(), steps),
        "boxed-ukf" => run(&mut *boxed(beacon::ukf()), steps),
        "boxed-ekf" => run(&mut *boxed(beacon::ekf()), steps),
        "hand-ukf" => by_hand(beacon::hand_ukf, steps),
        "hand-ekf" => by_hand(beacon::hand_ekf, steps),
        other => Err(format!("there is no filter {other}").into()),
    }
}

/// A filter of which the compiler knows no more than its trait.
fn boxed(filter: impl Estimator<2, 2> + 'static) -> Box<dyn Estimator<2, 2>> {
    black_box(Box::new(filter))
}
