//! Filters of several transmitters: against sums by hand, against each other, and over draws from
//! their own prior.

mod existence;
mod flights;
mod model;
mod several;
