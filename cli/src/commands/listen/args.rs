use std::path::PathBuf;

use crate::commands::{pulses::Search, tags::from_to};

/// Show tags as they pulse: from a receiver, a file or a pipe
///
/// Searches samples as they come for pulses, and gives the pulses to tags. On a terminal there are
/// a waterfall and a table of tags; elsewhere a line for each pulse, and the table at the end.
/// Reads `rtl_tcp` (tcp:HOST:PORT) and receivers of `SoapySDR` (soapy:driver=...), which it sets,
/// files of samples, and raw samples on standard input. Ends with Ctrl-C.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  \
                        foxhunt listen tcp:127.0.0.1:1234 --center-hz 150.08e6 --rate-hz 250000\n  \
                        foxhunt listen tcp:127.0.0.1:1234 --center-hz 150.08e6 --rate-hz 250000 \
                        --tags tags.csv --csv > pulses.csv\n  \
                        foxhunt listen soapy:driver=airspy --center-hz 150.08e6 --rate-hz 2.5e6\n  \
                        foxhunt listen tag.sigmf-meta\n  \
                        rtl_sdr -f 150080000 -s 250000 - | foxhunt listen - --format cu8 \
                        --rate-hz 250000 --center-hz 150.08e6")]
pub struct Args {
    /// The source of samples: tcp:HOST:PORT of rtl_tcp, soapy:ARGUMENTS of `SoapySDR`, a file, or -
    /// for standard input
    pub source: String,
    /// Print each pulse as soon as it is found, as CSV
    #[arg(long, conflicts_with = "json")]
    pub csv: bool,
    #[command(flatten)]
    pub search: Search,
    /// The receiver's gain, in dB; only for tcp: and soapy:
    #[arg(long, value_name = "DB", allow_negative_numbers = true)]
    pub gain_db: Option<f64>,
    /// The receiver's frequency error in parts per million [default: 0]; only for tcp: and soapy:
    #[arg(long, value_name = "PPM", allow_negative_numbers = true)]
    pub ppm: Option<i32>,
    /// A table of known tags, as `foxhunt tags` reads it
    #[arg(long, value_name = "FILE")]
    pub tags: Option<PathBuf>,
    /// The shortest and the longest interval of unknown tags, in seconds [default: 0.2,5]
    #[arg(long, value_name = "FROM,TO", value_parser = from_to)]
    pub intervals_s: Option<[f64; 2]>,
    /// End after this time, in seconds
    #[arg(long, value_name = "S", value_parser = positive)]
    pub for_s: Option<f64>,
}

fn positive(text: &str) -> Result<f64, String> {
    let value = text.parse().ok().filter(|value: &f64| *value > 0.0 && value.is_finite());
    value.ok_or_else(|| "not a positive number".to_owned())
}
