use std::sync::{Mutex, PoisonError, mpsc::sync_channel};

use rayon::{ThreadPool, ThreadPoolBuilder, prelude::*};

/// Something that is done many times, each time with another seed, to see how its results spread.
///
/// ```
/// use std::convert::Infallible;
///
/// use foxhunt_lab::{Experiment, Runner};
///
/// /// The last digit of the seed.
/// struct LastDigit;
///
/// impl Experiment for LastDigit {
///     type Run = u64;
///     type Error = Infallible;
///
///     fn run(&self, seed: u64) -> Result<u64, Infallible> {
///         Ok(seed % 10)
///     }
/// }
///
/// let runs = Runner::new(2)?.run(&LastDigit, 4, 18, &|| ())?;
/// assert_eq!(runs, [8, 9, 0, 1]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub trait Experiment: Sync {
    /// The result of one run.
    type Run: Send;
    /// The reason why the experiment cannot be run at all: no run could.
    type Error: Send;

    /// Runs it once. The same seed gives the same run.
    ///
    /// # Errors
    ///
    /// Ends the whole experiment; a run that goes wrong by chance is a result, not an error.
    fn run(&self, seed: u64) -> Result<Self::Run, Self::Error>;
}

/// The threads that experiments run on.
#[derive(Debug)]
pub struct Runner {
    pool: ThreadPool,
}

impl Runner {
    /// A runner of `jobs` threads.
    ///
    /// # Errors
    ///
    /// [`ThreadsError`] when they cannot be started.
    pub fn new(jobs: usize) -> Result<Self, ThreadsError> {
        let pool = ThreadPoolBuilder::new().num_threads(jobs).build();
        let pool = pool.map_err(|error| ThreadsError { jobs, reason: error.to_string() })?;
        Ok(Self { pool })
    }

    /// Runs an experiment `runs` times. Run i has the seed `first_seed` + i; the result, in the
    /// order of the seeds, does not depend on the number of threads. `progress` is called after
    /// each run, from any thread.
    ///
    /// # Errors
    ///
    /// Those of the experiment.
    pub fn run<E: Experiment>(
        &self,
        experiment: &E,
        runs: u32,
        first_seed: u64,
        progress: &(dyn Fn() + Sync),
    ) -> Result<Vec<E::Run>, E::Error> {
        let mut all = Vec::new();
        self.run_each(experiment, runs, first_seed, progress, |_, run| {
            all.push(run);
            Ok(())
        })?;
        Ok(all)
    }

    /// Runs an experiment as [`run`](Self::run) does and hands each run to `take` with its seed, in
    /// the order of the seeds, instead of keeping them: however many there are, no more than some
    /// hundreds for each thread are in memory at a time.
    ///
    /// # Errors
    ///
    /// Those of the experiment and of `take`, which ends it.
    pub fn run_each<E: Experiment>(
        &self,
        experiment: &E,
        runs: u32,
        first_seed: u64,
        progress: &(dyn Fn() + Sync),
        mut take: impl FnMut(u64, E::Run) -> Result<(), E::Error>,
    ) -> Result<(), E::Error> {
        let one = |run: u32| {
            let outcome = experiment.run(seed_of(first_seed, run));
            progress();
            outcome
        };
        let threads = u32::try_from(self.pool.current_num_threads()).unwrap_or(u32::MAX);
        let batch = RUNS_PER_THREAD.saturating_mul(threads);
        let mut begun = 0;
        while begun < runs {
            let end = begun.saturating_add(batch).min(runs);
            let done: Vec<E::Run> = self
                .pool
                .install(|| (begun..end).into_par_iter().map(one).collect::<Result<_, _>>())?;
            for (run, outcome) in (begun..end).zip(done) {
                take(seed_of(first_seed, run), outcome)?;
            }
            begun = end;
        }
        Ok(())
    }

    /// Runs an experiment for each of these seeds and hands the runs to `take`, some at a time, as
    /// they end: in no order, on the thread of the caller. No more than some for each thread are in
    /// memory at a time.
    ///
    /// # Errors
    ///
    /// Those of the experiment and of `take`; either ends it.
    pub fn run_seeds<E: Experiment, F: From<E::Error>>(
        &self,
        experiment: &E,
        seeds: impl Iterator<Item = u64> + Send,
        progress: &(dyn Fn() + Sync),
        mut take: impl FnMut(Vec<(u64, E::Run)>) -> Result<(), F>,
    ) -> Result<(), F> {
        let seeds = Mutex::new(seeds.fuse());
        let waiting = self.pool.current_num_threads().saturating_mul(WAITING_PER_THREAD);
        let (sender, receiver) = sync_channel(waiting);
        let pool = &self.pool;
        let seeds = &seeds;
        std::thread::scope(|scope| {
            // Dropped with an error, upon which nothing more can be sent.
            let receiver = receiver;
            scope.spawn(move || {
                pool.broadcast(|_| {
                    loop {
                        let next = seeds.lock().unwrap_or_else(PoisonError::into_inner).next();
                        let Some(seed) = next else { break };
                        let outcome = experiment.run(seed);
                        progress();
                        if sender.send((seed, outcome)).is_err() {
                            break;
                        }
                    }
                });
            });
            while let Ok(first) = receiver.recv() {
                let some = std::iter::once(first).chain(receiver.try_iter().take(waiting));
                take(some.map(|(seed, run)| Ok((seed, run?))).collect::<Result<_, E::Error>>()?)?;
            }
            Ok(())
        })
    }
}

/// The most runs of each thread that may wait to be taken.
const WAITING_PER_THREAD: usize = 64;

/// The number of runs of a thread before all wait for the last of them: enough for that to cost
/// nothing, and few enough to be kept.
const RUNS_PER_THREAD: u32 = 256;

/// The seed of a run.
pub(crate) fn seed_of(first_seed: u64, run: u32) -> u64 {
    first_seed.wrapping_add(u64::from(run))
}

/// The threads of an experiment could not be started.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{jobs} threads cannot be started: {reason}")]
pub struct ThreadsError {
    /// The number of threads.
    pub jobs: usize,
    /// The reason.
    pub reason: String,
}
