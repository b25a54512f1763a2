//! Consistency of an estimator: its errors and innovations against the covariances that it
//! reports (Bar-Shalom, Li & Kirubarajan 2001, §5.4).

mod average;
mod coverage;
mod monitored;
mod verdict;
mod watchdog;
mod whiteness;

pub use average::{ChiSquaredAverage, ChiSquaredSums};
pub use coverage::Coverage;
pub use monitored::Monitored;
pub use verdict::Verdict;
pub use watchdog::{NisHealth, NisWatchdog};
pub use whiteness::{Autocorrelation, LjungBox, Whiteness};
