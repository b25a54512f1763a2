use foxhunt_core::FormationPlanner;
use foxhunt_formation::{FollowConfig, FollowConfigError, FollowEstimate, Hold};
use serde::{Deserialize, Serialize};

/// A planner chosen at run time.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
#[non_exhaustive]
pub enum PlannerConfig {
    /// A polygon that follows the estimate (Pritzl 2018, §5.2).
    FollowEstimate {
        /// Its parameters; the reference's unless given.
        #[serde(default)]
        follow: FollowConfig,
    },
    /// Everyone stays and listens.
    Hold {
        /// For this many turns.
        turns: u32,
    },
}

impl PlannerConfig {
    /// Builds the planner.
    ///
    /// # Errors
    ///
    /// [`FollowConfigError`] names the field that is out of its range.
    pub fn build(&self) -> Result<Box<dyn FormationPlanner>, FollowConfigError> {
        Ok(match *self {
            Self::FollowEstimate { follow } => Box::new(FollowEstimate::new(follow)?),
            Self::Hold { turns } => Box::new(Hold::new(turns)),
        })
    }
}
