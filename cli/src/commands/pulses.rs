use std::path::{Path, PathBuf};

use foxhunt::signal::{
    Complex32, Pulse,
    detector::{
        Detection, Detector, DetectorConfig, DetectorError, FoldConfig, Train, TrainDetector,
    },
    samples::{OpenOptions, SampleFormat, SampleSource, open},
};
use serde::Serialize;

use crate::{
    error::{CliError, InFile},
    output::{Context, Output},
    table::{number, table},
};

/// Find the pulses in recorded samples
///
/// Searches complex samples for pulses of any frequency, and of widths between 2.5 and 40 ms unless
/// others are given, at the rate of false alarms that you allow. Reads raw samples (.cu8 of an
/// RTL-SDR, .cs8, .cs16, .cf32), SigMF and its archives, WAV with two channels (also RF64 and W64),
/// recordings of SDRangel and gqrx, and raw samples on standard input. Files may be longer than the
/// memory. With --fold it finds tags whose single pulses are too weak: it adds up the energies of
/// several at every start, interval, frequency and drift.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  \
                        foxhunt pulses tag.cu8 --rate-hz 250000 --center-hz 150.1e6\n  \
                        foxhunt pulses tag.sigmf-meta --width-ms 20 --csv > pulses.csv\n  \
                        foxhunt pulses tag.wav --band-hz 148.0e6,148.1e6 --center-hz 148.05e6\n  \
                        foxhunt pulses tag.wav --fold 10 --interval-s 1.27,1.33\n  \
                        rtl_sdr -f 150100000 -s 250000 - | foxhunt pulses - --format cu8 \
                        --rate-hz 250000 --csv")]
pub struct Args {
    /// Files of samples; - for standard input
    #[arg(required = true)]
    files: Vec<PathBuf>,
    /// Print each pulse as soon as it is found, as CSV
    #[arg(long, conflicts_with = "json")]
    csv: bool,
    #[command(flatten)]
    search: Search,
    /// Add up this many pulses before each decision, and find trains of pulses; usually 5 to 10
    #[arg(long, value_name = "PULSES")]
    fold: Option<usize>,
    /// The interval of the trains in seconds, or the shortest and the longest; run time grows with
    /// the range [default: 0.5,3]
    #[arg(long, value_name = "FROM[,TO]", value_parser = intervals, requires = "fold")]
    interval_s: Option<[f64; 2]>,
    /// The largest drift of a carrier, up or down, in hertz per second [default: 1]
    #[arg(long, value_name = "HZ", requires = "fold")]
    drift_hz_per_s: Option<f64>,
}

/// Settings of the search for pulses.
#[derive(Debug, clap::Args)]
pub struct Search {
    /// Samples per second of raw samples; files with a header have their own
    #[arg(long, value_name = "HZ")]
    pub rate_hz: Option<f64>,
    /// The centre frequency in hertz; without it frequencies are about the middle, unless the file
    /// has it
    #[arg(long, value_name = "HZ", allow_hyphen_values = true)]
    pub center_hz: Option<f64>,
    /// The format of raw samples, if the extension does not give it: cu8, cs8, cs16, cf32
    #[arg(long, value_parser = format)]
    pub format: Option<SampleFormat>,
    /// The lowest and the highest frequency to search, in hertz [default: the whole band]
    #[arg(long, value_name = "FROM,TO", value_parser = band, allow_hyphen_values = true)]
    band_hz: Option<[f64; 2]>,
    /// The widths of pulses in milliseconds, searched at once [default: 2.5,5,10,20,40, or 20 with
    /// --fold]
    #[arg(long, value_name = "MS", value_delimiter = ',')]
    width_ms: Option<Vec<f64>>,
    /// The number of pulses per hour that noise alone may give
    #[arg(long, value_name = "COUNT", default_value_t = 1.0)]
    pub false_alarms_per_hour: f64,
    /// The power of a full-scale tone in dBm; without it levels are in dB of full scale
    #[arg(long, value_name = "DBM", allow_hyphen_values = true)]
    pub full_scale_dbm: Option<f64>,
}

impl Search {
    /// Returns the options to open a file.
    pub fn options(&self) -> OpenOptions {
        let mut options = OpenOptions::default();
        (options.rate_hz, options.center_hz) = (self.rate_hz, self.center_hz);
        options.format = self.format;
        options
    }

    /// Returns the detector's settings for samples of a rate about a centre, whose rounding makes
    /// this power of noise.
    pub fn config(
        &self,
        rate_hz: f64,
        center_hz: Option<f64>,
        rounding_noise: f64,
    ) -> DetectorConfig {
        let mut config = DetectorConfig::new(rate_hz);
        self.apply_to(&mut config, center_hz, rounding_noise);
        config
    }

    fn apply_to(&self, config: &mut DetectorConfig, center_hz: Option<f64>, rounding_noise: f64) {
        config.center_hz = center_hz;
        config.least_noise = rounding_noise;
        config.false_alarms_per_hour = self.false_alarms_per_hour;
        config.full_scale_dbm = self.full_scale_dbm.unwrap_or(0.0);
        config.band_hz = self.band_hz;
        if let Some(widths) = &self.width_ms {
            config.widths_s = widths.iter().map(|ms| ms * 1e-3).collect();
        }
    }
}

/// Default range of intervals, in seconds: that of most tags.
const INTERVALS_S: [f64; 2] = [0.5, 3.0];

fn intervals(text: &str) -> Result<[f64; 2], String> {
    match text.trim().parse() {
        Ok(known) => Ok([known, known]),
        Err(_) => band(text).map_err(|_| "not one or two numbers with a comma between".to_owned()),
    }
}

fn format(name: &str) -> Result<SampleFormat, String> {
    SampleFormat::of_name(name).ok_or_else(|| "not one of cu8, cs8, cs16, cf32".to_owned())
}

fn band(text: &str) -> Result<[f64; 2], String> {
    let number = |text: &str| text.trim().parse::<f64>().ok();
    let two = text.split_once(',').and_then(|(low, high)| Some([number(low)?, number(high)?]));
    two.ok_or_else(|| "not two numbers with a comma between".to_owned())
}

/// The pulses of a file in JSON.
#[derive(Debug, Serialize)]
struct Report {
    file: String,
    rate_hz: f64,
    /// Centre frequency; without it frequencies are about the middle of the band.
    center_hz: Option<f64>,
    /// Searched time without gaps, in seconds.
    searched_s: f64,
    /// True if levels are in dBm, and not in dB of full scale.
    calibrated: bool,
    /// The energy over the noise's power density that a pulse must have, at the end.
    threshold_db: f64,
    /// Allowed rate of false alarms, per hour.
    false_alarms_per_hour: f64,
    /// Trains found with --fold; `train` of a pulse is an index here.
    #[serde(skip_serializing_if = "Option::is_none")]
    trains: Option<Vec<FoundTrain>>,
    /// Pulses in the order of time.
    pulses: Vec<Found>,
}

#[derive(Debug, Serialize)]
struct Found {
    #[serde(flatten)]
    pulse: Pulse,
    /// Rate at which noise alone gives a pulse as strong, or a train as strong as its, per hour.
    false_alarms_per_hour: f64,
    /// The probability that noise alone gives one as strong in all that was searched.
    p_value: f64,
    /// The place of its train, from 0.
    #[serde(skip_serializing_if = "Option::is_none")]
    train: Option<usize>,
}

/// A train without its pulses.
#[derive(Debug, Serialize)]
struct FoundTrain {
    interval_s: f64,
    first_s: f64,
    frequency_hz: f64,
    drift_hz_per_s: f64,
    width_s: f64,
    snr_db: f64,
    /// Number of pulses that stand out.
    pulses: usize,
    missed: usize,
    false_alarms_per_hour: f64,
    p_value: f64,
}

/// Detector of samples, with its findings so far.
#[derive(Debug)]
enum PulseSearch {
    Single(Detector, Vec<Detection>),
    Folded(TrainDetector, Vec<Train>),
}

impl PulseSearch {
    fn new(args: &Args, source: &SampleSource) -> Result<Self, DetectorError> {
        let center_hz = source.center_hz();
        let rounding_noise = source.rounding_noise();
        let Some(pulses) = args.fold else {
            let config = args.search.config(source.rate_hz(), center_hz, rounding_noise);
            return Ok(Self::Single(Detector::new(config)?, Vec::new()));
        };
        let intervals_s = args.interval_s.unwrap_or(INTERVALS_S);
        let mut config = FoldConfig::new(source.rate_hz(), pulses, intervals_s);
        args.search.apply_to(&mut config.detector, center_hz, rounding_noise);
        config.drift_hz_per_s = args.drift_hz_per_s.unwrap_or(config.drift_hz_per_s);
        Ok(Self::Folded(TrainDetector::new(config)?, Vec::new()))
    }

    fn push(&mut self, first: u64, samples: &[Complex32]) -> Result<(), DetectorError> {
        match self {
            Self::Single(detector, found) => detector.push(first, samples, found),
            Self::Folded(detector, found) => detector.push(first, samples, found),
        }
    }

    fn finish(&mut self) {
        match self {
            Self::Single(detector, found) => detector.finish(found),
            Self::Folded(detector, found) => detector.finish(found),
        }
    }

    fn searched_s(&self) -> f64 {
        match self {
            Self::Single(detector, _) => detector.searched_s(),
            Self::Folded(detector, _) => detector.searched_s(),
        }
    }

    fn threshold_db(&self) -> f64 {
        match self {
            Self::Single(detector, _) => detector.threshold_db(),
            Self::Folded(detector, _) => detector.threshold_db(),
        }
    }

    /// Takes the findings: pulses with the rate of false alarms and the index of their trains, of
    /// which `before` came before.
    fn take(&mut self, before: usize) -> Taken {
        match self {
            Self::Single(_, found) => {
                let pulse = |found: Detection| (found.pulse, found.false_alarms_per_hour, None);
                Taken { pulses: found.drain(..).map(pulse).collect(), trains: Vec::new() }
            }
            Self::Folded(_, found) => {
                let trains: Vec<Train> = std::mem::take(found);
                let pulses = trains.iter().enumerate().flat_map(|(place, train)| {
                    let rate = train.false_alarms_per_hour;
                    let pulses = train.pulses.iter();
                    pulses.map(move |pulse| (*pulse, rate, Some(before + place)))
                });
                Taken { pulses: pulses.collect(), trains }
            }
        }
    }
}

/// Findings since the last call.
#[derive(Debug, Default)]
struct Taken {
    /// Pulses with their false alarms per hour and the index of their train.
    pulses: Vec<(Pulse, f64, Option<usize>)>,
    trains: Vec<Train>,
}

pub fn run(args: &Args, context: Context<'_>) -> Result<(), CliError> {
    let output = context.output;
    if args.csv {
        let train = if args.fold.is_some() { ",train" } else { "" };
        output.note(&format!("{HEADER}{train}"))?;
    }
    let mut reports = Vec::new();
    for file in &args.files {
        let report = search(args, file, output)?;
        reports.push(report);
    }
    if args.csv { Ok(()) } else { output.result(&reports, |reports| pulses(reports)) }
}

fn search(args: &Args, file: &Path, output: Output) -> Result<Report, CliError> {
    let mut source = open(file, &args.search.options()).map_err(CliError::input)?;
    let in_file = |error: DetectorError| {
        CliError::input(InFile { file: file.display().to_string(), source: error.into() })
    };
    let mut search = PulseSearch::new(args, &source).map_err(in_file)?;
    let mut samples = Vec::new();
    let mut all = Taken::default();
    let mut count = 0;
    loop {
        let first = source.read(&mut samples).map_err(CliError::input)?;
        match first {
            Some(first) => search.push(first, &samples).map_err(in_file)?,
            None => search.finish(),
        }
        let taken = search.take(count);
        count += taken.trains.len();
        if args.csv {
            for (pulse, rate, train) in &taken.pulses {
                output.note(&line(pulse, *rate, source.file(), *train))?;
            }
        } else {
            all.pulses.extend(taken.pulses);
            all.trains.extend(taken.trains);
        }
        if first.is_none() {
            break;
        }
    }
    all.pulses.sort_by(|a, b| a.0.time_s.total_cmp(&b.0.time_s));
    let searched_s = search.searched_s();
    // The probability of at least one of events at that rate.
    let p_value = |rate: f64| -(-rate * searched_s / 3600.0).exp_m1();
    let found = |(pulse, rate, train): (Pulse, f64, Option<usize>)| Found {
        pulse,
        false_alarms_per_hour: rate,
        p_value: p_value(rate),
        train,
    };
    let found_train = |train: Train| FoundTrain {
        interval_s: train.interval_s,
        first_s: train.first_s,
        frequency_hz: train.frequency_hz,
        drift_hz_per_s: train.drift_hz_per_s,
        width_s: train.width_s,
        snr_db: train.snr_db,
        pulses: train.pulses.len(),
        missed: train.missed,
        false_alarms_per_hour: train.false_alarms_per_hour,
        p_value: p_value(train.false_alarms_per_hour),
    };
    Ok(Report {
        file: source.file().to_owned(),
        rate_hz: source.rate_hz(),
        center_hz: source.center_hz(),
        searched_s,
        calibrated: args.search.full_scale_dbm.is_some(),
        threshold_db: search.threshold_db(),
        false_alarms_per_hour: args.search.false_alarms_per_hour,
        trains: args.fold.map(|_| all.trains.into_iter().map(found_train).collect()),
        pulses: all.pulses.into_iter().map(found).collect(),
    })
}

/// The header of lists of pulses.
pub const HEADER: &str = "time_s,frequency_hz,width_s,power_dbm,snr_db,false_alarms_per_hour,file";

/// A pulse as a line of CSV, as `foxhunt tags` reads it, with its false alarms an hour.
pub fn line(pulse: &Pulse, rate: f64, file: &str, train: Option<usize>) -> String {
    let Pulse { time_s, frequency_hz, width_s, power_dbm, snr_db, .. } = pulse;
    let file = if file.contains(['"', ',', '\n']) {
        format!("\"{}\"", file.replace('"', "\"\""))
    } else {
        file.to_owned()
    };
    let train = train.map_or(String::new(), |train| format!(",{train}"));
    format!(
        "{time_s:.6},{frequency_hz:.2},{width_s:.5},{power_dbm:.2},{snr_db:.2},{rate:.2e},\
         {file}{train}"
    )
}

/// A probability or a rate, however small.
fn small(value: f64) -> String {
    if value < 1e-99 { "<1e-99".to_owned() } else { format!("{value:.0e}") }
}

fn trains(trains: &[FoundTrain], frequency: &str) -> String {
    let mut lines = table(&[
        "train",
        "interval s",
        "first s",
        frequency,
        "drift Hz/s",
        "E/N0 dB",
        "pulses",
        "missed",
        "false/h",
        "p",
    ]);
    for (place, train) in trains.iter().enumerate() {
        lines.add_row([
            place.to_string(),
            number(train.interval_s, 4),
            number(train.first_s, 4),
            number(train.frequency_hz, 1),
            number(train.drift_hz_per_s, 2),
            number(train.snr_db, 1),
            train.pulses.to_string(),
            train.missed.to_string(),
            small(train.false_alarms_per_hour),
            small(train.p_value),
        ]);
    }
    lines.to_string()
}

fn pulses(reports: &[Report]) -> String {
    let mut lines = Vec::new();
    for report in reports {
        let level = if report.calibrated { "power dBm" } else { "power dBFS" };
        let frequency = if report.center_hz.is_some() { "frequency Hz" } else { "offset Hz" };
        if reports.len() > 1 {
            lines.push(format!("{}:", report.file));
        }
        if report.pulses.is_empty() {
            lines.push("nothing detected".to_owned());
        } else if let Some(found) = &report.trains {
            lines.push(trains(found, frequency));
        } else {
            let mut pulses = table(&["time s", frequency, "width ms", level, "E/N0 dB", "p"]);
            for Found { pulse, p_value, .. } in &report.pulses {
                pulses.add_row([
                    number(pulse.time_s, 4),
                    number(pulse.frequency_hz, 1),
                    number(1e3 * pulse.width_s, 1),
                    number(pulse.power_dbm, 1),
                    number(pulse.snr_db, 1),
                    small(*p_value),
                ]);
            }
            lines.push(pulses.to_string());
        }
        let folded = report.trains.as_ref();
        let folded = folded.map_or(String::new(), |trains| format!("{} trains, ", trains.len()));
        lines.push(format!(
            "{folded}{} pulses in {:.1} s searched, {} kS/s; E/N0 above {:.1} dB for {} false \
             alarms an hour.",
            report.pulses.len(),
            report.searched_s,
            report.rate_hz / 1e3,
            report.threshold_db,
            report.false_alarms_per_hour
        ));
    }
    lines.join("\n")
}
