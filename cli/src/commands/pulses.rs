use std::path::{Path, PathBuf};

use foxhunt::signal::{
    Pulse,
    detector::{Detection, Detector, DetectorConfig},
    samples::{OpenOptions, SampleFormat, open},
};
use serde::Serialize;

use crate::{
    context::Context,
    error::{CliError, InFile},
    output::Output,
    table::{number, table},
};

/// Find the pulses in recorded samples
///
/// Searches complex samples for pulses of any frequency, and of widths between 2.5 and 40 ms unless
/// others are given, at the rate of false alarms that you allow. Reads raw samples (.cu8 of an
/// RTL-SDR, .cs8, .cs16, .cf32), SigMF, WAV with two channels, and raw samples on standard input.
/// Files may be longer than the memory.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  \
                        foxhunt pulses tag.cu8 --rate-hz 250000 --center-hz 150.1e6\n  \
                        foxhunt pulses tag.sigmf-meta --width-ms 20 --csv > pulses.csv\n  \
                        foxhunt pulses tag.wav --band-hz 148.0e6,148.1e6 --center-hz 148.05e6\n  \
                        rtl_sdr -f 150100000 -s 250000 - | foxhunt pulses - --format cu8 \
                        --rate-hz 250000 --csv")]
pub(crate) struct Args {
    /// Files of samples; - for standard input
    #[arg(required = true)]
    files: Vec<PathBuf>,
    /// Print each pulse as soon as it is found, as CSV
    #[arg(long, conflicts_with = "json")]
    csv: bool,
    #[command(flatten)]
    search: Search,
}

/// What is searched in samples.
#[derive(Debug, clap::Args)]
pub(super) struct Search {
    /// Samples per second; SigMF and WAV have their own
    #[arg(long, value_name = "HZ")]
    pub(super) rate_hz: Option<f64>,
    /// The frequency in the middle; without it frequencies are about the middle, unless SigMF has
    /// it
    #[arg(long, value_name = "HZ", allow_hyphen_values = true)]
    pub(super) center_hz: Option<f64>,
    /// The format of raw samples, where the extension does not give it: cu8, cs8, cs16, cf32
    #[arg(long, value_parser = format)]
    pub(super) format: Option<SampleFormat>,
    /// The lowest and the highest frequency to search [default: the whole band]
    #[arg(long, value_name = "FROM,TO", value_parser = band, allow_hyphen_values = true)]
    band_hz: Option<[f64; 2]>,
    /// How long pulses are; several widths are searched at once [default: 2.5,5,10,20,40]
    #[arg(long, value_name = "MS", value_delimiter = ',')]
    width_ms: Option<Vec<f64>>,
    /// How many times an hour noise may be taken for a pulse
    #[arg(long, value_name = "COUNT", default_value_t = 1.0)]
    pub(super) false_alarms_per_hour: f64,
    /// The power of a tone at full scale; without it levels are in dB of full scale
    #[arg(long, value_name = "DBM", allow_hyphen_values = true)]
    pub(super) full_scale_dbm: Option<f64>,
}

impl Search {
    /// How a file is read.
    pub(super) fn options(&self) -> OpenOptions {
        let mut options = OpenOptions::default();
        (options.rate_hz, options.center_hz) = (self.rate_hz, self.center_hz);
        options.format = self.format;
        options
    }

    /// How samples of a rate about a centre are searched, whose numbers have steps that make this
    /// power of noise.
    pub(super) fn config(
        &self,
        rate_hz: f64,
        center_hz: Option<f64>,
        rounding_noise: f64,
    ) -> DetectorConfig {
        let mut config = DetectorConfig::new(rate_hz);
        config.center_hz = center_hz;
        config.least_noise = rounding_noise;
        config.false_alarms_per_hour = self.false_alarms_per_hour;
        config.full_scale_dbm = self.full_scale_dbm.unwrap_or(0.0);
        config.band_hz = self.band_hz;
        if let Some(widths) = &self.width_ms {
            config.widths_s = widths.iter().map(|ms| ms * 1e-3).collect();
        }
        config
    }
}

fn format(name: &str) -> Result<SampleFormat, String> {
    SampleFormat::of_name(name).ok_or_else(|| "none of cu8, cs8, cs16, cf32".to_owned())
}

fn band(text: &str) -> Result<[f64; 2], String> {
    let number = |text: &str| text.trim().parse::<f64>().ok();
    let two = text.split_once(',').and_then(|(low, high)| Some([number(low)?, number(high)?]));
    two.ok_or_else(|| "not two numbers with a comma between".to_owned())
}

/// The pulses of a file, as JSON has them.
#[derive(Debug, Serialize)]
struct Report {
    file: String,
    rate_hz: f64,
    /// Without it frequencies are about the middle of the band.
    center_hz: Option<f64>,
    /// How long a stretch was searched, without gaps.
    searched_s: f64,
    /// Whether levels are in dBm, and not in dB of full scale.
    calibrated: bool,
    /// The energy over the noise's power density that a pulse must have, at the end.
    threshold_db: f64,
    /// What was allowed.
    false_alarms_per_hour: f64,
    pulses: Vec<Found>,
}

#[derive(Debug, Serialize)]
struct Found {
    #[serde(flatten)]
    detection: Detection,
    /// The probability that noise alone gives one as strong in all that was searched.
    p_value: f64,
}

pub(crate) fn run(args: &Args, context: Context<'_>) -> Result<(), CliError> {
    let output = context.output;
    if args.csv {
        output.note(HEADER)?;
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
    let in_file = |error: foxhunt::signal::detector::DetectorError| {
        CliError::input(InFile { file: file.display().to_string(), source: error.into() })
    };
    let config = args.search.config(source.rate_hz(), source.center_hz(), source.rounding_noise());
    let mut detector = Detector::new(config).map_err(in_file)?;
    let (mut samples, mut found, mut all) = (Vec::new(), Vec::new(), Vec::new());
    loop {
        let first = source.read(&mut samples).map_err(CliError::input)?;
        match first {
            Some(first) => detector.push(first, &samples, &mut found).map_err(in_file)?,
            None => detector.finish(&mut found),
        }
        if args.csv {
            for detection in found.drain(..) {
                output.note(&line(&detection, source.file()))?;
            }
        } else {
            all.append(&mut found);
        }
        if first.is_none() {
            break;
        }
    }
    let searched_s = detector.searched_s();
    let with_p = |detection: Detection| Found { p_value: detection.p_value(searched_s), detection };
    Ok(Report {
        file: source.file().to_owned(),
        rate_hz: source.rate_hz(),
        center_hz: source.center_hz(),
        searched_s,
        calibrated: args.search.full_scale_dbm.is_some(),
        threshold_db: detector.threshold_db(),
        false_alarms_per_hour: args.search.false_alarms_per_hour,
        pulses: all.into_iter().map(with_p).collect(),
    })
}

/// The header of lists of pulses.
pub(super) const HEADER: &str =
    "time_s,frequency_hz,width_s,power_dbm,snr_db,false_alarms_per_hour,file";

/// A pulse as a line of CSV, as `foxhunt tags` reads it.
pub(super) fn line(detection: &Detection, file: &str) -> String {
    let Pulse { time_s, frequency_hz, width_s, power_dbm, snr_db, .. } = detection.pulse;
    let file = if file.contains(['"', ',', '\n']) {
        format!("\"{}\"", file.replace('"', "\"\""))
    } else {
        file.to_owned()
    };
    format!(
        "{time_s:.6},{frequency_hz:.2},{width_s:.5},{power_dbm:.2},{snr_db:.2},{:.2e},{file}",
        detection.false_alarms_per_hour
    )
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
        } else {
            let mut pulses = table(&["time s", frequency, "width ms", level, "E/N0 dB", "p"]);
            for Found { detection, p_value } in &report.pulses {
                let pulse = detection.pulse;
                pulses.add_row([
                    number(pulse.time_s, 4),
                    number(pulse.frequency_hz, 1),
                    number(1e3 * pulse.width_s, 1),
                    number(pulse.power_dbm, 1),
                    number(pulse.snr_db, 1),
                    if *p_value < 1e-99 { "<1e-99".to_owned() } else { format!("{p_value:.0e}") },
                ]);
            }
            lines.push(pulses.to_string());
        }
        lines.push(format!(
            "{} pulses in {:.1} s searched, {} kS/s; E/N0 above {:.1} dB for {} false alarms an \
             hour.",
            report.pulses.len(),
            report.searched_s,
            report.rate_hz / 1e3,
            report.threshold_db,
            report.false_alarms_per_hour
        ));
    }
    lines.join("\n")
}
