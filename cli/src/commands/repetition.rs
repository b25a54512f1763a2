use std::{hint::black_box, thread::available_parallelism};

use clap::value_parser;
use foxhunt::campaign::Repetition;

use crate::{output::Output, progress::Progress};

/// Runs, their seeds and the jobs that they share.
#[derive(Debug, clap::Args)]
pub(super) struct Runs {
    /// The number of runs of each contender
    #[arg(long, value_name = "N", value_parser = value_parser!(u32).range(1..))]
    runs: u32,
    /// The number of runs at the same time [default: the number of processors]; the result does not
    /// depend on it
    #[arg(long, value_name = "J", value_parser = value_parser!(u16).range(1..=1024))]
    jobs: Option<u16>,
    /// The seed of the first run; run i has this plus i
    #[arg(long, default_value_t = 1, value_name = "N")]
    seed: u64,
    /// Print no progress on standard error
    #[arg(long)]
    quiet: bool,
}

impl Runs {
    /// Returns the number of runs of each contender.
    #[cfg(feature = "store")]
    pub(super) fn count(&self) -> u32 {
        self.runs
    }

    /// Calls `run` with a repetition that shows its progress, where each of `contenders` has all
    /// runs; `what` names the runs.
    pub(super) fn with_progress<R>(
        &self,
        output: Output<'_>,
        what: &'static str,
        contenders: usize,
        run: impl FnOnce(&Repetition<'_>) -> R,
    ) -> R {
        self.with_progress_of(output, what, contenders, self.runs, run)
    }

    /// Calls `run` as [`with_progress`](Self::with_progress) does, where each contender has only
    /// `part` of the runs.
    pub(super) fn with_progress_of<R>(
        &self,
        output: Output<'_>,
        what: &'static str,
        contenders: usize,
        part: u32,
        run: impl FnOnce(&Repetition<'_>) -> R,
    ) -> R {
        let jobs = match self.jobs {
            Some(jobs) => usize::from(jobs),
            None => available_parallelism().map_or(1, usize::from),
        };
        let contenders = u64::try_from(contenders).unwrap_or(u64::MAX);
        let total = u64::from(part).saturating_mul(contenders);
        keep_freed_memory();
        let progress = Progress::new(output, what, total, !self.quiet);
        let step = || progress.step();
        let repetition = Repetition { runs: self.runs, seed: self.seed, jobs, progress: &step };
        let result = run(&repetition);
        progress.finish();
        result
    }
}

/// Has the heap keep what runs free, a few megabytes, for the next runs.
///
/// glibc gives the top of its heap back to the system as soon as 128 KiB of it are free, and takes
/// it again page by page; once a larger block was freed, as soon as twice as much is (mallopt(3),
/// dynamic thresholds). The block is never written to, so it takes no memory. Other heaps are as
/// they were.
fn keep_freed_memory() {
    const BLOCK: usize = 16 << 20;
    drop(black_box(Vec::<u8>::with_capacity(BLOCK)));
}
