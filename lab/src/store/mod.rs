//! Campaigns in a file: every run of every contender is kept in SQLite as it ends, so that a
//! campaign that was killed goes on, and parts of one that ran elsewhere are put together.
//!
//! A [`Store`] holds campaigns (a scenario as it is flown, a planner, a version of the program),
//! their contenders (an estimator with its settings) and for each of these the runs by seed, one
//! row for each beacon. Campaigns and contenders are known again by the SHA-256 of the text that
//! defines them, which is kept beside it.
//!
//! Summaries go over the rows in the order of the seeds through the same running figures as
//! [`campaign`](crate::campaign::campaign)'s, so that both agree to the last digit, however often
//! a campaign was broken off and on however many computers it ran.

mod compare;
mod contender;
mod error;
mod export;
mod file;
mod fly;
mod merge;
mod read;
mod shard;

pub use compare::{SeedBySeed, compare};
pub use contender::{Contender, StoredCampaign};
pub use error::StoreError;
pub use export::write_csv;
#[cfg(feature = "parquet")]
pub use export::write_parquet;
pub use file::Store;
pub use fly::CampaignToStore;
pub use merge::merge;
pub use read::{Filter, Held, Row, Summary};
pub use shard::{Shard, ShardError};
