//! What a receiver at a known pose measures of a target in a given state.

mod bearing_mixture;
mod bearing_only;
mod free_path_loss;
mod free_power;
mod kernel;
mod rss;
mod rss_bearing;
mod sight;

pub use bearing_mixture::BearingMixture;
pub use bearing_only::BearingOnly;
pub use free_path_loss::FreePathLossRssBearing;
pub use free_power::FreePowerRssBearing;
pub use rss::Rss;
pub use rss_bearing::RssBearing;

use kernel::rss_bearing_log_likelihoods;
use sight::Sight;
