//! Cursor on Target to TAK servers and teams (`--cot`).

use std::{net::IpAddr, path::PathBuf};

#[cfg(feature = "cot")]
use foxhunt::{
    export::{CotEvent, CotFeed, CotPlatform},
    hardware::cot::{CotAddress, CotConfig, CotError, CotMessage, CotSender},
};
#[cfg(feature = "hardware")]
use foxhunt::{hardware::link::MqttConfig, overview::Overview};

use super::mqtt::MqttArgs;
#[cfg(feature = "hardware")]
use super::mqtt::MqttOutlet;
use crate::error::CliError;
#[cfg(not(feature = "cot"))]
use crate::hints;
#[cfg(feature = "cot")]
use crate::output::warn;

/// Arguments of Cursor on Target.
#[derive(Debug, clap::Args)]
pub struct CotArgs {
    /// Send receivers, fixes, 95 % ellipses and bearings to a TAK server or team, as Cursor on
    /// Target: tcp://HOST:8087, tls://HOST:8089 or udp://239.2.3.1:6969; may be given several times
    #[arg(long, value_name = "ADDRESS")]
    cot: Vec<String>,
    /// For --cot tls://: the authorities that the server's certificate is checked by, PEM or
    /// PKCS#12, such as truststore-root.p12; FOXHUNT_COT_PASSWORD in the environment opens what is
    /// encrypted
    #[arg(long, value_name = "FILE", requires = "cot")]
    cot_ca: Option<PathBuf>,
    /// For --cot tls://: one's own certificate, PEM, or PKCS#12 with its key
    #[arg(long, value_name = "FILE", requires = "cot")]
    cot_cert: Option<PathBuf>,
    /// For --cot tls://: the key of --cot-cert, PEM
    #[arg(long, value_name = "FILE", requires = "cot_cert")]
    cot_key: Option<PathBuf>,
    /// For --cot tls://: the name in the server's certificate, if it is not the host of the address
    #[arg(long, value_name = "NAME", requires = "cot")]
    cot_server_name: Option<String>,
    /// For --cot udp://: the address of the network card that datagrams leave by
    #[arg(long, value_name = "IP", requires = "cot")]
    cot_from: Option<IpAddr>,
}

/// The environment variable of the password of certificates.
#[cfg(feature = "cot")]
const PASSWORD_VARIABLE: &str = "FOXHUNT_COT_PASSWORD";

impl CotArgs {
    /// Returns true if events are sent anywhere.
    pub fn is_given(&self) -> bool {
        !self.cot.is_empty()
    }

    /// Opens the addresses of the flags and the broker of `--mqtt` for an answer.
    pub fn teams(&self, mqtt: &MqttArgs) -> Result<Teams, CliError> {
        #[cfg(not(feature = "cot"))]
        self.check()?;
        #[cfg(not(feature = "hardware"))]
        mqtt.check()?;
        Ok(Teams {
            #[cfg(feature = "cot")]
            sender: self.open(None)?,
            #[cfg(feature = "hardware")]
            mqtt: mqtt.config()?,
        })
    }

    /// Refuses the flags in a build that sends no events.
    #[cfg(not(feature = "cot"))]
    pub fn check(&self) -> Result<(), CliError> {
        match self.is_given() {
            true => Err(not_built("--cot")),
            false => Ok(()),
        }
    }

    /// Opens the addresses of the flags, or else of a file.
    #[cfg(feature = "cot")]
    pub fn open(&self, of_file: Option<(&CotConfig, &str)>) -> Result<Option<CotSender>, CliError> {
        let (config, file) = match (self.config()?, of_file) {
            (Some(config), _) => (config, None),
            (None, Some((config, file))) => (config.clone(), Some(file)),
            (None, None) => return Ok(None),
        };
        let password = std::env::var(PASSWORD_VARIABLE).ok();
        let sender = CotSender::open(&config, password.as_deref()).map_err(|error| {
            match (&error, file) {
                (CotError::Setting { name, reason }, None) => {
                    CliError::input(format!("--cot-{}: {reason}", name.replace('_', "-")))
                }
                (CotError::Setting { .. }, Some(file)) => {
                    CliError::input(format!("{file}: cot.{error}"))
                }
                _ => CliError::input(error),
            }
        })?;
        for address in config.to.iter().filter(|address| address.is_open()) {
            warn(&format!(
                "{address}: nothing is encrypted; everybody on the way can read where the \
                 receivers and beacons are, and change it"
            ));
        }
        Ok(Some(sender))
    }

    #[cfg(feature = "cot")]
    fn config(&self) -> Result<Option<CotConfig>, CliError> {
        if !self.is_given() {
            return Ok(None);
        }
        let to = self.cot.iter().map(|text| text.parse::<CotAddress>()).collect::<Result<_, _>>();
        Ok(Some(CotConfig {
            to: to.map_err(|error| CliError::input(format!("--cot: {error}")))?,
            ca: self.cot_ca.clone(),
            cert: self.cot_cert.clone(),
            key: self.cot_key.clone(),
            server_name: self.cot_server_name.clone(),
            from: self.cot_from,
        }))
    }
}

/// TAK servers, teams and a broker that an answer is sent to.
pub struct Teams {
    #[cfg(feature = "cot")]
    sender: Option<CotSender>,
    #[cfg(feature = "hardware")]
    mqtt: Option<MqttConfig>,
}

/// Longest wait for servers to take an answer.
#[cfg(feature = "hardware")]
const PATIENCE: std::time::Duration = std::time::Duration::from_secs(10);

impl Teams {
    /// Returns true if the answer is sent anywhere.
    pub fn any(&self) -> bool {
        self.flag().is_some()
    }

    /// The first flag that sends the answer anywhere.
    fn flag(&self) -> Option<&'static str> {
        #[cfg(feature = "cot")]
        if self.sender.is_some() {
            return Some("--cot");
        }
        #[cfg(feature = "hardware")]
        return self.mqtt.is_some().then_some("--mqtt");
        #[cfg(not(feature = "hardware"))]
        None
    }

    /// Refuses places that are nowhere on Earth.
    pub fn check_known(&self, origin: bool) -> Result<(), CliError> {
        match self.flag().filter(|_| !origin) {
            Some(flag) => Err(CliError::input(format!(
                "{flag}: the places are in local metres; --origin LAT,LON places them on Earth"
            ))),
            None => Ok(()),
        }
    }

    /// Sends the places of recordings, and waits until they have arrived.
    #[cfg(feature = "hardware")]
    pub fn send(self, overview: &Overview) -> Result<(), CliError> {
        let title = &overview.title;
        let mqtt = self.mqtt.map(|config| MqttOutlet::of_recordings(&config, title)).transpose()?;
        #[cfg(feature = "cot")]
        if let Some(sender) = self.sender {
            let mut outlet = CotOutlet { sender, feed: CotFeed::of_recordings() };
            outlet.publish(overview, true);
            outlet.finish(PATIENCE).map_err(CliError::failure)?;
        }
        let Some(mut outlet) = mqtt else { return Ok(()) };
        outlet.publish(overview);
        outlet.finish(PATIENCE).map_err(CliError::failure)
    }

    #[cfg(not(feature = "hardware"))]
    pub fn send(self, _: &foxhunt::overview::Overview) -> Result<(), CliError> {
        Ok(())
    }
}

/// The error of a build that sends nothing.
#[cfg(not(feature = "cot"))]
pub fn not_built(what: &str) -> CliError {
    CliError::input(format!("{what} needs a build with the feature cot: {}", hints::build("cot")))
}

/// Events of a hunt on their way to TAK servers and teams.
#[cfg(feature = "cot")]
pub struct CotOutlet {
    sender: CotSender,
    feed: CotFeed,
}

#[cfg(feature = "cot")]
impl CotOutlet {
    pub fn new(sender: CotSender, platforms: Vec<CotPlatform>, is_simulated: bool) -> Self {
        Self { sender, feed: CotFeed::new(platforms, is_simulated) }
    }

    /// Takes the place of a receiver at a time of the hunt.
    pub fn place(&mut self, receiver: usize, time: f64, place: foxhunt::nalgebra::Vector3<f64>) {
        self.feed.place(receiver, time, place);
    }

    /// Sends what has changed, and reports the connections.
    pub fn publish(&mut self, overview: &Overview, is_over: bool) {
        match self.feed.events(overview, now_unix_s(), is_over) {
            Ok(events) => {
                let messages = events.into_iter().map(message);
                self.sender.put(&messages.collect::<Vec<_>>());
            }
            Err(error) => warn(&format!("--cot: {error}")),
        }
        self.sender.take_remarks().iter().for_each(|remark| warn(remark));
    }

    /// Waits until everything is sent, for a while at most.
    pub fn finish(self, within: std::time::Duration) -> Result<(), String> {
        let Self { sender, .. } = self;
        sender.finish(within).map_err(|failed| failed.join("\n"))
    }
}

#[cfg(feature = "cot")]
fn message(event: CotEvent) -> CotMessage {
    let CotEvent { uid, xml, stale_unix_s } = event;
    CotMessage { uid, xml, stale_unix_s }
}

#[cfg(feature = "cot")]
fn now_unix_s() -> f64 {
    let now = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH);
    now.unwrap_or_default().as_secs_f64()
}
