//! The program with a user's own estimator: it is in `--help`, in `list estimators`, and flies
//! in `hunt`, `campaign`, `compare`, `replay` and `locate`.
//!
//! ```text
//! cargo run -p foxhunt-cli --example own_program -- \
//!     campaign --runs 10 --estimator bare-cubature --estimator ekf
//! ```

use std::process::ExitCode;

use foxhunt::{
    core::{EstimatorError, RandomWalk},
    filters::Ckf,
    hunt::{Track, TrackConfig},
    registry::{EstimatorEntry, Need, Needs, Registry, TrackRequest},
};

fn main() -> ExitCode {
    let needs = Needs {
        level: Need::Used,
        bearing: Need::Used,
        others: Vec::new(),
        moving: false,
        all_at_once: false,
    };
    let about = "a cubature filter without a gate";
    let own = EstimatorEntry::own("bare-cubature", about, "this example", needs, bare_cubature);
    foxhunt_cli::run(Registry::builtin().with_estimator(own))
}

/// The estimator of one beacon: the hunt's prior, its law of propagation, a walk of 2 cm per √s.
fn bare_cubature(request: &TrackRequest<'_>) -> Result<Track, EstimatorError> {
    let walk = RandomWalk::uniform(0.02);
    let filter = Ckf::new(walk, request.model.clone(), request.search.prior)?;
    Ok(Track::new::<2, 2>(filter, TrackConfig::default()))
}
