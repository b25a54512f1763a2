//! Consistency of an estimator: its errors and innovations against the covariances that it
//! reports (Bar-Shalom, Li & Kirubarajan 2001, §5.4).

mod monitoring;
mod verdict;
mod whiteness;

pub use monitoring::{Monitored, NisHealth, NisWatchdog};
pub use verdict::{ChiSquaredAverage, ChiSquaredSums, Coverage, Verdict};
pub use whiteness::{Autocorrelation, LjungBox, Whiteness};
