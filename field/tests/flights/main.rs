//! Flights in which anything may happen at any time: nothing is ordered of what somebody else has,
//! nobody takes off that was not sent up by the pilot's word, and each ends with every drone down
//! or in the hands of somebody who is named.

mod drawn;
mod flight;
mod judge;
mod scenarios;
mod wire;

use drawn::Drawn;
use flight::fly;
use proptest::test_runner::{Config, RngAlgorithm, TestRng, TestRunner};

/// Flies so many drawn flights of a seed; a failing one is shrunk to the happenings that matter.
fn play(flights: u32, seed: u8) {
    let config = Config { cases: flights, failure_persistence: None, ..Config::default() };
    let random = TestRng::from_seed(RngAlgorithm::ChaCha, &[seed; 32]);
    let mut runner = TestRunner::new_with_rng(config, random);
    let result = runner.run(&Drawn::strategy(), |drawn| {
        let flown = fly(&drawn);
        proptest::prop_assert!(flown.wrong.is_empty(), "{flown:#?}");
        Ok(())
    });
    if let Err(error) = result {
        panic!("{error}");
    }
}

#[test]
fn a_hundred_drawn_flights() {
    play(100, 1);
}

#[test]
#[ignore = "a thousand flights take minutes"]
fn a_thousand_drawn_flights() {
    play(1000, 2);
}
