//! Hunts against the output of the program before version 0.2. The numbers of the particle filter
//! are from its present stream of random numbers.

use std::convert::Infallible;

use foxhunt::{core::Outcome, prelude::*};
use nalgebra::{Matrix2, Vector2};

use crate::support::entry;

/// A fix: estimator, mean, covariance (East, East with North, North), steps.
type Golden = (&'static str, [([f64; 2], [f64; 3], u32); 2]);

/// `foxhunt hunt pritzl-6.1 --seed 3`, with each estimator.
const GOLDEN: [Golden; 4] = [
    (
        "ekf",
        [
            (
                [-9.52637607364001, -10.308657821890673],
                [0.8850979342912821, 0.03270926370671986, 0.8461612104648752],
                21,
            ),
            (
                [4.656488345029614, 14.0220264672315],
                [0.7497020978326436, 0.03149515668326441, 0.8716945798744559],
                27,
            ),
        ],
    ),
    (
        "grid",
        [
            (
                [-9.529737593521377, -10.102916927419534],
                [0.9556003560978604, 0.08059376644361735, 0.8060445644016849],
                21,
            ),
            (
                [4.712827300384142, 14.726050909456715],
                [0.3095289504920997, -0.02939400962896793, 0.4217448878284761],
                27,
            ),
        ],
    ),
    (
        "particle",
        [
            (
                [-9.499388178689463, -10.051436698055463],
                [0.927274629827349, 0.06772407095169265, 0.799986521661756],
                21,
            ),
            (
                [4.22106387409318, 14.680512098010448],
                [0.4236652870103723, 0.0006433302631951337, 0.6073924621423785],
                27,
            ),
        ],
    ),
    (
        "default",
        [
            (
                [-9.801952799244916, -10.599913425033158],
                [0.626797243044344, -0.015570224487891955, 0.4208092934533515],
                24,
            ),
            (
                [4.8422159471977, 14.774782205709547],
                [0.4124510519427219, 0.044169912559423735, 0.4628418440439209],
                33,
            ),
        ],
    ),
];

/// To 1e-5 m and m²: sums over cells and roots were rounded otherwise then, and so does another
/// compiler.
#[test]
fn hunts_find_what_they_found_before() {
    let scenario = Scenario::find("pritzl-6.1").expect("it is built in");
    let registry = Registry::builtin();
    let close = |found: f64, before: f64| (found - before).abs() <= 1e-5;
    for (name, fixes) in GOLDEN {
        let setup = Setup { scenario: &scenario, estimator: &entry(name), registry: &registry };
        let flown = setup.simulate(3, |_| Ok::<_, Infallible>(())).expect("it comes to an end");
        assert_eq!(flown.found.len(), fixes.len());
        for (found, (mean, [east, both, north], steps)) in flown.found.iter().zip(fixes) {
            let fix = &found.fix;
            assert_eq!((fix.outcome, fix.steps), (Outcome::Converged, steps), "{name}");
            let mean = Vector2::from(mean);
            let covariance = Matrix2::new(east, both, both, north);
            assert!(fix.estimate.mean.zip_map(&mean, close).iter().all(|&c| c), "{name}: {fix:?}");
            let same = fix.estimate.covariance.zip_map(&covariance, close);
            assert!(same.iter().all(|&c| c), "{name}: {fix:?}");
        }
    }
}
