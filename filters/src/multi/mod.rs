//! Several transmitters, one that may be absent, and an unknown number of them.
//!
//! A scan is a list of observations, each of which is made by one transmitter or is clutter; it is
//! not known which. A transmitter makes at most one observation of a scan ([`Detection`]).
//!
//! | filter | transmitters | source |
//! |-|-|-|
//! | [`BernoulliFilter`] | one or none | Ristic, Vo, Vo & Farina 2013 |
//! | [`Jpda`] | a known number | Fortmann, Bar-Shalom & Scheffe 1983 |
//! | [`LabelledMultiBernoulli`] | an unknown number, labelled | Reuter, Vo, Vo & Dietmayer 2014 |
//!
//! Each runs over any [`Estimator`](foxhunt_core::Estimator): Kalman filters, clouds, cells. The
//! density of a track is a weighted sum of them, one for each association history ([`Reduction`]).
//! The probabilities of all joint associations are in [`Associations`].
//!
//! From rows of still transmitters, all at once, [`Sorting`] finds how many transmitters made them,
//! and which made which.
//!
//! [`gospa`] and [`ospa`] are distances between the found transmitters and the true ones.

mod assignment;
mod association;
mod bernoulli;
mod density;
mod jpda;
mod labelled;
mod metric;
mod partition;
mod scan;

pub use assignment::{Assignment, assign};
pub use association::Associations;
pub use bernoulli::{BernoulliFilter, Lifetime};
pub use density::{Reduction, ReplaceBelief};
pub use jpda::Jpda;
pub use labelled::{Label, LabelledMultiBernoulli, Track};
pub use metric::{Gospa, Ospa, gospa, ospa};
pub use partition::{Group, Sorted, Sorting};
pub use scan::Detection;
