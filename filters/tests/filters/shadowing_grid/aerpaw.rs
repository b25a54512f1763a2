//! Six recorded flights: an unknown transmitter power, real fading, real antennas.

use foxhunt_filters::{ShadowingFix, ShadowingGrid, ShadowingGridConfig};

use super::world::level;
use crate::recorded_flights::{Flight, flights};

fn locate(flight: &Flight, config: ShadowingGridConfig) -> (f64, f64, ShadowingFix) {
    let estimator = ShadowingGrid::new(config).expect("in range");
    let fix = estimator.locate(&flight.readings, level).expect("a posterior");
    let error_m = (fix.position.mean - flight.truth).norm();
    (error_m, fix.position.nees(&flight.truth).expect("positive definite"), fix)
}

#[test]
fn recorded_flights_are_located_and_their_ellipses_hold() {
    let flights = match flights() {
        Ok(flights) => flights,
        Err(path) => return println!("skipped: no vectors at {}", path.display()),
    };
    let mut errors_m = Vec::new();
    for flight in &flights {
        let (error_m, nees, fix) = locate(flight, ShadowingGridConfig::default());
        let major_m = fix.position.ellipse(0.95).expect("positive definite").semi_major;
        println!(
            "{error_m:.1} m, NEES {nees:.2}, 95 % ellipse {major_m:.0} m, exponent {:.2}, \
             sigma {:.1} dB, border {:.3}, {} segments, lengths {:.2?}",
            fix.slope.mean,
            fix.sigma.mean,
            fix.border_mass,
            fix.segments,
            fix.correlation_lengths_m,
        );
        errors_m.push(error_m);
        assert!(nees < 5.991, "the 95 % ellipse misses the truth: {nees}");
    }
    errors_m.sort_by(f64::total_cmp);
    let median_m = 0.5 * (errors_m[2] + errors_m[3]);
    println!("median {median_m:.1} m");
    assert!(median_m < 40.0, "{errors_m:?}");
}
