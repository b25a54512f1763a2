//! Bags of ROS 2: poses and levels out of MCAP (feature `mcap`) and SQLite (feature `sqlite`), as a
//! recording in our own format.

#![cfg_attr(
    not(any(feature = "mcap", feature = "sqlite")),
    expect(dead_code, reason = "what messages hold is of use to the formats of bags alone")
)]

mod cdr;
mod contents;
mod error;
mod join;
#[cfg(feature = "mcap")]
mod mcap;
mod message;
mod open;
#[cfg(feature = "sqlite")]
mod sqlite;

pub use error::BagError;
pub use join::{Converted, Topics, convert};
pub use open::is_bag;
