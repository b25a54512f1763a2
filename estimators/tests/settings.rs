//! Settings of filters as they stand in files.

use std::sync::Arc;

use foxhunt_core::{Estimate, EstimatorError, RandomWalk, State};
use foxhunt_estimators::{FilterConfig, FilterOf};
use foxhunt_sensors::{LogDistance, RssBearing};

#[test]
fn an_update_is_linearised_once_by_default() {
    let read = |kind: &str, rest: &str| {
        let text = format!(r#"{{"kind": "{kind}", "gate": "open"{rest}}}"#);
        serde_json::from_str::<FilterConfig>(&text)
    };
    for (kind, rest) in
        [("ekf", ""), ("cubature", ""), ("ukf", r#", "alpha": 1, "beta": 2, "kappa": 0"#)]
    {
        let bare = read(kind, rest).expect("as it was before there were iterations");
        for (iterations, same) in [(1, true), (2, false)] {
            let given = read(kind, &format!(r#"{rest}, "iterations": {iterations}"#));
            assert_eq!(given.expect("in order") == bare, same, "{kind}, {iterations}");
        }
        let never = read(kind, &format!(r#"{rest}, "iterations": 0"#)).expect("a number");
        let model = RssBearing::new(LogDistance::new(-29.06, 2.765).expect("in range"));
        let walk = Arc::new(RandomWalk::uniform(0.1));
        let prior = Estimate::isotropic(State::<2>::zeros(), 1.0);
        let refused = FilterOf::<2, 2>::build(&never, walk, Arc::new(model), &prior, 0).err();
        let Some(EstimatorError::Parameter(error)) = refused else {
            panic!("{kind}: {refused:?}");
        };
        assert_eq!(error.name, "iterations", "{kind}");
    }
}
