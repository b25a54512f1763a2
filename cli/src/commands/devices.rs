use std::{path::PathBuf, thread, time::Duration};

use foxhunt::{
    fly::{FlightConfig, identify},
    hardware::{Finding, SystemClock},
    wire::{Endpoint, SerialStream},
};
use serde::Serialize;

use crate::{
    error::CliError,
    output::{Output, warn},
    table::list,
};

/// Check attached devices and say how to fix problems
///
/// With a flight's file, checks every device of every drone in turn; without one, every serial port
/// and the device behind it. Motors turn by a step, nothing takes off. The exit code is 1 if a
/// check fails.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  foxhunt devices\n  foxhunt devices meadow.toml\n  \
                        foxhunt devices --at serial:/dev/ttyUSB0:57600 --at udpin:127.0.0.1:14550")]
pub struct Args {
    /// The flight: a TOML file (docs/flying.md)
    config: Option<PathBuf>,
    /// Check this endpoint instead of the serial ports; may be repeated
    #[arg(long, value_name = "ENDPOINT", conflicts_with = "config")]
    at: Vec<Endpoint>,
}

/// Findings about a device.
#[derive(Serialize)]
struct Examined {
    /// Name of the drone; `None` without a file.
    #[serde(skip_serializing_if = "Option::is_none")]
    drone: Option<String>,
    device: String,
    findings: Vec<Finding>,
}

pub fn run(args: &Args, output: Output) -> Result<(), CliError> {
    let clock = SystemClock::start();
    let mut pause = || thread::sleep(Duration::from_millis(1));
    let mut examined = Vec::new();
    if let Some(path) = &args.config {
        let config = FlightConfig::read(path).map_err(CliError::input)?;
        for drone in &config.drones {
            let mut report = |device: &'static str, findings| {
                warn(&format!("{}: {device}", drone.name));
                let drone = Some(drone.name.clone());
                examined.push(Examined { drone, device: device.to_owned(), findings });
            };
            let origin = clock.started_unix_s();
            let site = &config.site;
            let beacons = &config.beacons;
            drone.examine(site, beacons, &clock, origin, &mut pause, &mut report);
        }
    } else {
        let endpoints = if args.at.is_empty() { serial_ports()? } else { args.at.clone() };
        for endpoint in endpoints {
            warn(&format!("examining {endpoint}"));
            let (device, findings) = identify(&endpoint, &clock, &mut pause);
            let device = format!("{device} at {endpoint}");
            examined.push(Examined { drone: None, device, findings });
        }
        #[cfg(feature = "soapy")]
        if args.at.is_empty() {
            examined.extend(soapy_receivers()?);
        }
    }
    output.result(&examined, |examined| describe(examined))?;
    let wrong = examined.iter().flat_map(|e| &e.findings).filter(|f| !f.is_good()).count();
    match wrong {
        0 => Ok(()),
        1 => Err(CliError::failure("1 check failed")),
        wrong => Err(CliError::failure(format!("{wrong} checks failed"))),
    }
}

fn serial_ports() -> Result<Vec<Endpoint>, CliError> {
    let ports = SerialStream::available().map_err(CliError::failure)?;
    // The rate is found out.
    Ok(ports.into_iter().map(|port| Endpoint::Serial { port, baud: 57_600 }).collect())
}

/// Returns the receivers that `SoapySDR` finds, each by the name that `listen` takes.
#[cfg(feature = "soapy")]
fn soapy_receivers() -> Result<Vec<Examined>, CliError> {
    let found = foxhunt::hardware::soapy_devices().map_err(CliError::failure)?;
    let receiver = |device: String| Examined {
        drone: None,
        findings: vec![Finding::good("SoapySDR", format_args!("foxhunt listen soapy:{device}"))],
        device: "receiver".to_owned(),
    };
    Ok(found.into_iter().map(receiver).collect())
}

fn describe(examined: &[Examined]) -> String {
    if examined.is_empty() {
        return "no serial port has a device; plug one in, or name an endpoint with --at".into();
    }
    let mut rows = list(&["device", "", "found", "what to do"]);
    for Examined { drone, device, findings } in examined {
        let device = drone.as_ref().map_or_else(|| device.clone(), |d| format!("{d}: {device}"));
        for (index, finding) in findings.iter().enumerate() {
            rows.add_row([
                if index == 0 { device.clone() } else { String::new() },
                finding.subject.clone(),
                finding.text.clone(),
                finding.remedy.clone().unwrap_or_default(),
            ]);
        }
    }
    rows.to_string()
}
