use std::{
    ffi::OsStr,
    fs::{self, File},
    io::{BufWriter, Write},
    path::{Path, PathBuf},
};

use foxhunt::{
    core::BeaconId,
    sim::{EmulatedDongle, World},
};
use serde::Serialize;

use super::rtl_tcp::{Args, PulseList};
use crate::{error::CliError, output::Output};

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
pub(super) fn write(
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
