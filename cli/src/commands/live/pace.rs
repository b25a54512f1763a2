use std::{
    thread,
    time::{Duration, Instant},
};

/// Pace of simulated time in the live view.
#[derive(Debug, clap::Args)]
pub(in crate::commands) struct PaceArgs {
    /// With --live, --cot or --mqtt: the simulated seconds that pass in one second [default: 20]
    #[arg(long, value_name = "FACTOR", value_parser = factor)]
    pace: Option<f64>,
}

/// Default pace of simulated time.
const FACTOR: f64 = 20.0;

impl PaceArgs {
    /// Returns true if the pace was given.
    pub(in crate::commands) fn is_given(&self) -> bool {
        self.pace.is_some()
    }

    /// Simulated time that begins at 0 now.
    pub(in crate::commands) fn start(&self) -> Pace {
        Pace { begun: Instant::now(), factor: self.pace.unwrap_or(FACTOR) }
    }
}

/// Simulated time by the clock of this computer.
pub(in crate::commands) struct Pace {
    begun: Instant,
    factor: f64,
}

impl Pace {
    /// Waits until this simulated time, in seconds; not at all if it is over.
    pub(in crate::commands) fn wait_until(&self, time: f64) {
        let due = Duration::try_from_secs_f64(time / self.factor).unwrap_or_default();
        thread::sleep(due.saturating_sub(self.begun.elapsed()));
    }
}

/// Parses a positive factor.
fn factor(text: &str) -> Result<f64, &'static str> {
    let factor = text.parse::<f64>().ok().filter(|factor| factor.is_finite() && *factor > 0.0);
    factor.ok_or("it must be a number above 0")
}
