//! What a receiver at a known pose measures of a target in a given state.

mod bearing_mixture;
mod bearing_only;
mod censored;
mod differential_rss;
#[cfg(feature = "alloc")]
mod elevation;
mod free_path_loss;
mod free_power;
mod kernel;
mod range_difference;
mod rss;
mod rss_bearing;
mod sight;
mod stacked;

pub use bearing_mixture::BearingMixture;
pub use bearing_only::BearingOnly;
pub use censored::Censored;
pub use differential_rss::DifferentialRss;
#[cfg(feature = "alloc")]
pub use elevation::WithElevationPattern;
pub use free_path_loss::FreePathLossRssBearing;
pub use free_power::FreePowerRssBearing;
pub use range_difference::RangeDifference;
pub use rss::Rss;
pub use rss_bearing::RssBearing;
pub use stacked::Stacked;

use kernel::rss_bearing_log_likelihoods;
use sight::Sight;
