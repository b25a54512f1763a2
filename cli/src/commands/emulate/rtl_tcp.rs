//! An emulated RTL-SDR: a server of its samples, and files of them.

use std::{
    ffi::OsStr,
    fs::{self, File},
    io::{self, BufWriter, Write},
    path::{Path, PathBuf},
};

use foxhunt::{
    core::BeaconId,
    document,
    sim::{EmulatedDongle, EmulatedRtlTcp, EmulatedRtlTcpConfig, Emulator, PlayedPulse, World},
    wire::TcpServerStream,
};
use serde::Serialize;

use super::device::{Field, Placed, Pose};
use crate::{
    error::{CliError, InFile},
    output::Output,
};

/// An RTL-SDR behind `rtl_tcp`, with everything that is on air
///
/// Serves samples at a TCP port as `rtl_tcp` does: the pulses of the scenario's tags with the power
/// that the drone's antenna receives, noise, and interferers. With --to it writes them to a file
/// instead, faster than real time.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  foxhunt emulate rtl-tcp --scenario vhf-tag\n  \
                        foxhunt emulate rtl-tcp --scenario vhf-tag --to tag.cu8 --for 30\n  \
                        foxhunt emulate rtl-tcp --scenario vhf-tag --to tag.sigmf-meta --for 30 \
                        --pulses tag.csv")]
pub struct Args {
    #[command(flatten)]
    pub field: Field,
    #[command(flatten)]
    pub pose: Pose,
    /// The address at which it listens
    #[arg(long, value_name = "ADDRESS:PORT", default_value = "127.0.0.1:1234")]
    listen: String,
    /// A TOML file with the receiver's noise and oscillator, drift, interferers
    /// (docs/devices/receivers.md)
    #[arg(long, value_name = "FILE")]
    receiver: Option<PathBuf>,
    /// Write the pulses of each tag to this file as CSV: the truth for a detector
    #[arg(long, value_name = "FILE")]
    pulses: Option<PathBuf>,
    /// Write samples to this file instead of serving clients: .cu8, or .sigmf-meta with .sigmf-data
    /// beside it
    #[arg(long, value_name = "FILE", requires = "duration_s",
        conflicts_with_all = ["listen", "from"])]
    to: Option<PathBuf>,
    /// Samples per second of the file
    #[arg(long, value_name = "HZ", default_value_t = 250_000, requires = "to",
        value_parser = clap::value_parser!(u32).range(1..=4_000_000))]
    rate_hz: u32,
    /// The centre frequency of the file, in hertz [default: 20 kHz below the first beacon]
    #[arg(long, value_name = "HZ", requires = "to", value_parser = hertz)]
    center_hz: Option<u32>,
    /// The gain of the file's samples, in dB
    #[arg(
        long,
        value_name = "DB",
        default_value_t = 28.0,
        requires = "to",
        allow_negative_numbers = true
    )]
    pub gain_db: f64,
}

/// A frequency in whole Hz, such as 150.1e6.
fn hertz(text: &str) -> Result<u32, String> {
    let hz = text.parse::<f64>().ok().filter(|hz| (1.0..4.2e9).contains(hz));
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "in range")]
    hz.map(|hz| hz.round() as u32).ok_or_else(|| "not a frequency from 1 to 4.2e9 Hz".to_owned())
}

impl Args {
    pub fn to(&self) -> Option<&Path> {
        self.to.as_deref()
    }

    /// Returns the settings of the receiver, from the file if one is given.
    fn config(&self) -> Result<EmulatedRtlTcpConfig, CliError> {
        let seeded = EmulatedRtlTcpConfig { seed: self.field.seed, ..Default::default() };
        let Some(path) = &self.receiver else { return Ok(seeded) };
        let wrong = |source: Box<dyn std::error::Error>| {
            CliError::input(InFile { file: path.display().to_string(), source })
        };
        let text = fs::read_to_string(path).map_err(|error| wrong(error.into()))?;
        document::from_toml(&text).map_err(|error| wrong(error.into()))
    }
}

/// List of the sent pulses.
#[derive(Debug)]
struct PulseList {
    path: PathBuf,
    writer: BufWriter<File>,
}

impl PulseList {
    fn create(path: &Path) -> Result<Self, CliError> {
        let create = || {
            let mut writer = BufWriter::new(File::create(path)?);
            writeln!(writer, "time_s,frequency_hz,width_s,power_dbm,snr_db,tag")?;
            Ok(writer)
        };
        let writer = create().map_err(|error| CliError::writing(path, error))?;
        Ok(Self { path: path.to_owned(), writer })
    }

    /// Writes pulses, with times from that of the first sample on.
    fn write(
        &mut self,
        world: &World,
        pulses: &[PlayedPulse],
        first_s: f64,
    ) -> Result<(), CliError> {
        self.rows(world, pulses, first_s).map_err(|error| CliError::writing(&self.path, error))
    }

    fn rows(&mut self, world: &World, pulses: &[PlayedPulse], first_s: f64) -> io::Result<()> {
        for pulse in pulses {
            let PlayedPulse { beacon, frequency_hz, width_s, power_dbm, snr_db, .. } = pulse;
            let time_s = pulse.time_s - first_s;
            let tag = world.beacon_name(*beacon).unwrap_or_default().replace('"', "\"\"");
            writeln!(
                self.writer,
                "{time_s:.6},{frequency_hz:.2},{width_s:.5},{power_dbm:.2},{snr_db:.2},\"{tag}\""
            )?;
        }
        self.writer.flush()
    }
}

/// Server that writes the list of the sent pulses.
struct Listed {
    server: EmulatedRtlTcp<TcpServerStream>,
    list: Option<PulseList>,
    world: World,
}

impl Emulator for Listed {
    fn serve(&mut self) -> io::Result<()> {
        self.server.serve()?;
        let played = self.server.played();
        match &mut self.list {
            Some(list) => list.rows(&self.world, &played, 0.0),
            None => Ok(()),
        }
    }
}

pub fn place(args: &Args, world: &World) -> Result<Placed, CliError> {
    if args.field.speed.to_bits() != 1.0_f64.to_bits() {
        return Err(CliError::input(
            "--speed: clients of rtl_tcp keep the time of the wall; --to writes samples quicker",
        ));
    }
    if args.field.link.is_some() {
        return Err(CliError::input("--link: it is reached at a TCP port, not at a serial one"));
    }
    let server = TcpServerStream::listen(&args.listen).map_err(CliError::failure)?;
    let address = server.local_address().map_err(CliError::failure)?;
    let server = EmulatedRtlTcp::new(world, args.field.drone, args.config()?, server);
    let list = args.pulses.as_deref().map(PulseList::create).transpose()?;
    let world = world.clone();
    let emulator = Listed { server: server.map_err(CliError::input)?, list, world };
    Ok(Placed {
        device: "rtl-tcp",
        endpoint: format!("tcp:{address}"),
        emulator: Box::new(emulator),
    })
}

/// Time that is sampled at once, in seconds: antennas and drones stand still meanwhile.
const STEP_S: f64 = 0.01;

/// Distance of the middle below the first beacon, in Hz: away from the receiver's own line.
const BESIDE_HZ: f64 = 20_000.0;

/// Description of the written samples.
#[derive(Debug, Serialize)]
struct Written {
    file: String,
    rate_hz: u32,
    center_hz: u32,
    gain_db: f64,
    /// The power of a tone at full scale.
    full_scale_dbm: f64,
    seconds: f64,
    samples: u64,
    pulses: usize,
}

/// Writes the samples of a receiver under a drone's antenna to a file.
pub fn write_samples(
    args: &Args,
    to: &Path,
    world: &World,
    output: Output<'_>,
) -> Result<(), CliError> {
    let config = args.config()?;
    let full_scale_dbm = config.full_scale_dbm - args.gain_db;
    let mut dongle =
        EmulatedDongle::new(world, args.field.drone, config).map_err(CliError::input)?;
    let first = world.frequency_mhz(BeaconId(0)).map_or(BESIDE_HZ, |mhz| mhz * 1e6);
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "it saturates")]
    let center_hz = args.center_hz.unwrap_or((first - BESIDE_HZ) as u32);
    dongle.tune(center_hz);
    dongle.set_rate(args.rate_hz);
    dongle.set_gain(args.gain_db);
    let data = data_file(to)?;
    let create = |path: &Path| {
        File::create(path).map(BufWriter::new).map_err(|error| CliError::writing(path, error))
    };
    let mut file = create(&data)?;
    let mut list = args.pulses.as_deref().map(PulseList::create).transpose()?;
    let begun = world.time();
    let seconds = args.field.duration_s.unwrap_or(0.0);
    let mut samples = 0;
    let mut pulses = 0;
    while world.time() < begun + seconds - 1e-9 {
        world.advance(STEP_S.min(begun + seconds - world.time())).map_err(CliError::failure)?;
        let bytes = dongle.take();
        file.write_all(&bytes).map_err(|error| CliError::writing(&data, error))?;
        samples += bytes.len() as u64 / 2;
        let played = dongle.played();
        pulses += played.len();
        if let Some(list) = &mut list {
            list.write(world, &played, begun)?;
        }
    }
    file.flush().map_err(|error| CliError::writing(&data, error))?;
    if data != to {
        let text = metadata(args.rate_hz, center_hz)?;
        fs::write(to, text).map_err(|error| CliError::writing(to, error))?;
    }
    let written = Written {
        file: to.display().to_string(),
        rate_hz: args.rate_hz,
        center_hz,
        gain_db: args.gain_db,
        full_scale_dbm,
        seconds,
        samples,
        pulses,
    };
    output.result(&written, |written| {
        format!(
            "{}: {} samples of {} kS/s about {} MHz, {} pulses of tags\nread it with foxhunt \
             pulses {}{} --full-scale-dbm {}",
            written.file,
            written.samples,
            f64::from(written.rate_hz) / 1e3,
            f64::from(written.center_hz) / 1e6,
            written.pulses,
            written.file,
            if data == to {
                format!(" --rate-hz {} --center-hz {}", written.rate_hz, written.center_hz)
            } else {
                String::new()
            },
            written.full_scale_dbm
        )
    })
}

/// Path of the file with the samples themselves.
fn data_file(to: &Path) -> Result<PathBuf, CliError> {
    match to.extension().and_then(OsStr::to_str) {
        Some("cu8" | "bin") => Ok(to.to_owned()),
        Some("sigmf-meta") => Ok(to.with_extension("sigmf-data")),
        _ => {
            let text = format!("--to {}: its extension must be cu8 or sigmf-meta", to.display());
            Err(CliError::input(text))
        }
    }
}

/// SigMF's metadata of bytes.
fn metadata(rate_hz: u32, center_hz: u32) -> Result<String, CliError> {
    let text = serde_json::to_string_pretty(&serde_json::json!({
        "global": {
            "core:datatype": "cu8",
            "core:sample_rate": rate_hz,
            "core:version": "1.2.0",
            "core:recorder": "foxhunt emulate rtl-tcp",
        },
        "captures": [{ "core:sample_start": 0, "core:frequency": center_hz }],
        "annotations": [],
    }));
    text.map_err(CliError::failure)
}
