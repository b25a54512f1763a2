use std::path::PathBuf;

use foxhunt::signal::{
    Pulse,
    tags::{Association, AssociationConfig, Tag, TagTable, associate, read_pulses},
};
use serde::Serialize;

use crate::{
    error::CliError,
    output::Context,
    table::{number, table},
};

/// Assign recorded pulses to tags
///
/// Finds the trains of pulses in a list that a detector wrote: known tags of a table by the gaps of
/// their bursts or by frequency, width and interval, and unknown ones by the interval they show.
/// Reads the lists of `foxhunt pulses --csv`, SensorGnome and pyradiotracking.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  foxhunt tags pulses.csv\n  \
                        foxhunt tags pulses.csv --tags tags.csv\n  \
                        foxhunt tags pulses.csv --intervals-s 0.5,2 --frequency-sigma-hz 15\n  \
                        foxhunt tags pulses.csv --csv > given.csv")]
pub struct Args {
    /// A list of pulses: CSV with named columns
    pulses: PathBuf,
    /// A table of known tags: CSV with the columns name, interval_s and optionally frequency_hz,
    /// width_s, gaps_ms, other_interval_s; or one of SensorGnome
    #[arg(long, value_name = "FILE")]
    tags: Option<PathBuf>,
    /// Print each pulse with the names of its tags, as CSV
    #[arg(long)]
    csv: bool,
    /// The shortest and the longest interval of unknown tags, in seconds [default: 0.2,5]
    #[arg(long, value_name = "FROM,TO", value_parser = from_to)]
    intervals_s: Option<[f64; 2]>,
    /// The tolerance of intervals, as a share of the table's [default: 0.01]
    #[arg(long, value_name = "SHARE")]
    interval_tolerance: Option<f64>,
    /// The standard deviation of a pulse's measured frequency, in hertz [default: 30]
    #[arg(long, value_name = "HZ")]
    frequency_sigma_hz: Option<f64>,
    /// The standard deviation of carriers about the table's frequencies, in hertz [default: 100]
    #[arg(long, value_name = "HZ")]
    frequency_tolerance_hz: Option<f64>,
}

/// Output of `--json`.
#[derive(Debug, Serialize)]
struct Report {
    file: String,
    format: &'static str,
    pulses: usize,
    #[serde(flatten)]
    given: Association,
}

impl Args {
    fn config(&self) -> AssociationConfig {
        let mut config = AssociationConfig::default();
        config.intervals_s = self.intervals_s.unwrap_or(config.intervals_s);
        let set = |value: Option<f64>, field: &mut f64| *field = value.unwrap_or(*field);
        set(self.interval_tolerance, &mut config.interval_tolerance);
        set(self.frequency_sigma_hz, &mut config.frequency_sigma_hz);
        set(self.frequency_tolerance_hz, &mut config.frequency_tolerance_hz);
        config
    }
}

/// Two numbers with a comma between them.
pub fn from_to(text: &str) -> Result<[f64; 2], String> {
    let numbers: Vec<f64> = text.split(',').filter_map(|n| n.trim().parse().ok()).collect();
    match (numbers.as_slice(), text.matches(',').count()) {
        ([from, to], 1) => Ok([*from, *to]),
        _ => Err("it must be two numbers with a comma between them".to_owned()),
    }
}

pub fn run(args: &Args, context: Context<'_>) -> Result<(), CliError> {
    let known = match &args.tags {
        Some(file) => TagTable::read(file).map_err(CliError::input)?,
        None => TagTable::default(),
    };
    let list = read_pulses(&args.pulses).map_err(CliError::input)?;
    let given = associate(&list.pulses, &known, &args.config()).map_err(CliError::input)?;
    let report = Report {
        file: args.pulses.display().to_string(),
        format: list.format,
        pulses: list.pulses.len(),
        given,
    };
    let text = |report: &Report| {
        if args.csv { lines(&list.pulses, &report.given) } else { tags(report) }
    };
    context.output.result(&report, text)
}

/// Name of a tag: its names, or its number among the tags.
pub fn name(tag: &Tag, place: usize) -> String {
    if tag.names.is_empty() { format!("unknown {}", place + 1) } else { tag.names.join(" or ") }
}

fn tags(report: &Report) -> String {
    let mut tags = table(&[
        "tag",
        "frequency Hz",
        "interval s",
        "± ms",
        "width ms",
        "pulses",
        "bursts",
        "missed",
        "collided",
        "slips",
        "changes",
    ]);
    for (place, tag) in report.given.tags.iter().enumerate() {
        tags.add_row([
            name(tag, place),
            number(tag.frequency_hz, 0),
            number(tag.interval_s, 4),
            number(1e3 * tag.jitter_s, 2),
            number(1e3 * tag.width_s, 1),
            tag.pulses.len().to_string(),
            tag.bursts.to_string(),
            tag.missed.to_string(),
            tag.collided.to_string(),
            tag.slips.to_string(),
            tag.changes.to_string(),
        ]);
    }
    let others = report.given.others.len();
    format!("{tags}\n{} pulses, {others} of them of no tag.", report.pulses)
}

/// Each pulse with its tags.
fn lines(pulses: &[Pulse], given: &Association) -> String {
    let mut names: Vec<Vec<String>> = vec![Vec::new(); pulses.len()];
    for (place, tag) in given.tags.iter().enumerate() {
        for index in &tag.pulses {
            names[*index].push(name(tag, place));
        }
    }
    let mut text = "time_s,frequency_hz,width_s,power_dbm,snr_db,tags\n".to_owned();
    for (pulse, names) in pulses.iter().zip(names) {
        let Pulse { time_s, frequency_hz, width_s, power_dbm, snr_db, .. } = pulse;
        // A name may hold what separates fields.
        let names = names.join("; ").replace('"', "\"\"");
        text += &format!("{time_s},{frequency_hz},{width_s},{power_dbm},{snr_db},\"{names}\"\n");
    }
    text
}
