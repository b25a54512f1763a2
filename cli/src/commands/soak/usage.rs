use std::{
    fs,
    time::{SystemTime, UNIX_EPOCH},
};

/// Watches the memory that the program holds, where the system has it in a file.
#[derive(Debug, Default)]
pub struct Memory {
    looks: u64,
    /// Maximum while the first runs warmed up.
    warm_mib: f64,
    most_mib: f64,
    is_reported: bool,
}

/// Number of runs of each thread after which everything that is kept has been made once.
const WARM_RUNS: u64 = 200;

/// Allowed growth after that, in mebibytes: clouds and grids differ from run to run.
const ROOM_MIB: f64 = 192.0;

impl Memory {
    /// Checks the memory; returns the growth once, if it is too large.
    pub fn grown(&mut self, jobs: usize) -> Option<String> {
        let held = held_mib()?;
        self.looks += 1;
        self.most_mib = self.most_mib.max(held);
        if self.looks <= WARM_RUNS.saturating_mul(u64::try_from(jobs).unwrap_or(1)) {
            self.warm_mib = self.warm_mib.max(held);
        } else if held > self.warm_mib + ROOM_MIB && !self.is_reported {
            self.is_reported = true;
            return Some(format!("{held:.0} MiB, where it were {:.0} at first", self.warm_mib));
        }
        None
    }

    pub fn most_mib(&self) -> Option<f64> {
        Some(self.most_mib).filter(|most| *most > 0.0)
    }
}

/// Memory that the program holds now, by Linux's account of it.
pub fn held_mib() -> Option<f64> {
    let status = fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:"))?;
    let kib: f64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(kib / 1024.0)
}

/// Seconds that this thread has been on a processor, by Linux's account; of the clock on other
/// systems. Differences count alone.
pub fn spent_s() -> f64 {
    let account = fs::read_to_string("/proc/thread-self/schedstat").ok();
    let own = account.as_deref().and_then(|text| text.split(' ').next()?.parse::<f64>().ok());
    let clock = || SystemTime::now().duration_since(UNIX_EPOCH).map_or(0.0, |t| t.as_secs_f64());
    own.map_or_else(clock, |nanoseconds| 1e-9 * nanoseconds)
}
