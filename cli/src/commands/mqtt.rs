//! Places of a hunt to an MQTT broker, for Home Assistant and Node-RED (`--mqtt`), and the address
//! of a broker.

#[cfg(feature = "hardware")]
use std::time::Duration;

#[cfg(feature = "hardware")]
use foxhunt::{
    export::{CotPlatform, MqttFeed, availability_topic},
    hardware::{MqttSender, link::MqttConfig},
    nalgebra::Vector3,
    overview::Overview,
};

use crate::error::CliError;
#[cfg(not(feature = "hardware"))]
use crate::hints;
#[cfg(feature = "hardware")]
use crate::output::warn;

/// Arguments of the places for Home Assistant and Node-RED.
#[derive(Debug, clap::Args)]
pub struct MqttArgs {
    /// Send the place of every beacon and receiver to an MQTT broker, for Home Assistant and
    /// Node-RED; port 1883 if none is given
    #[arg(long, value_name = "HOST[:PORT]", value_parser = broker)]
    mqtt: Option<(String, u16)>,
    /// For --mqtt: the user name at the broker, if it needs one; the password is
    /// $FOXHUNT_MQTT_PASSWORD
    #[arg(long, value_name = "NAME", requires = "mqtt")]
    mqtt_user: Option<String>,
}

impl MqttArgs {
    /// Returns true if places are sent.
    pub fn is_given(&self) -> bool {
        self.mqtt.is_some()
    }

    /// Returns the broker, if one is given.
    #[cfg(feature = "hardware")]
    pub fn config(&self) -> Result<Option<MqttConfig>, CliError> {
        let Some((host, port)) = self.mqtt.clone() else { return Ok(None) };
        let login = login("--mqtt-user", self.mqtt_user.as_deref())?;
        let config = MqttConfig { host, port, login, ..MqttConfig::default() };
        if config.is_open() {
            let MqttConfig { host, port, .. } = &config;
            warn(&format!(
                "--mqtt {host}:{port}: nothing is encrypted; everybody on the way can read where \
                 the receivers and beacons are, and the password, and change it"
            ));
        }
        Ok(Some(config))
    }

    /// Refuses the flag in a build that sends nothing.
    #[cfg(not(feature = "hardware"))]
    pub fn check(&self) -> Result<(), CliError> {
        match self.is_given() {
            true => Err(CliError::input(format!(
                "--mqtt needs a build with the feature hardware: {}",
                hints::build("hardware")
            ))),
            false => Ok(()),
        }
    }
}

/// Parses the address of a broker: a host with or without a port.
pub fn broker(text: &str) -> Result<(String, u16), String> {
    let bare = text.strip_prefix("mqtt://").unwrap_or(text);
    if bare.contains("://") {
        return Err("an address is HOST, HOST:PORT or mqtt://HOST:PORT, without TLS".into());
    }
    let bare = bare.strip_suffix('/').unwrap_or(bare);
    let (host, port) = match bare.strip_prefix('[') {
        Some(rest) => rest.split_once(']').ok_or("] is missing")?,
        None if bare.matches(':').count() > 1 => {
            return Err("an IPv6 address stands in brackets".into());
        }
        None => bare.find(':').map_or((bare, ""), |colon| bare.split_at(colon)),
    };
    let port = match port.strip_prefix(':') {
        Some(port) => (port.parse().ok().filter(|port| *port > 0))
            .ok_or_else(|| format!("{port:?} is not a port from 1 to 65535"))?,
        None if port.is_empty() => 1883,
        None => return Err("a port follows a colon".into()),
    };
    let plain = |c: char| c.is_ascii_alphanumeric() || matches!(c, '.' | '-' | '_' | ':' | '%');
    match host {
        "" => Err("the host is missing".into()),
        host if host.chars().all(plain) => Ok((host.to_owned(), port)),
        _ => Err("the host is a name or a number".into()),
    }
}

/// Returns the name and the password at a broker; `flag` is the one with the name.
#[cfg(feature = "hardware")]
pub fn login(flag: &str, user: Option<&str>) -> Result<Option<(String, String)>, CliError> {
    let Some(user) = user else { return Ok(None) };
    let password = std::env::var("FOXHUNT_MQTT_PASSWORD").map_err(|_| {
        CliError::input(format!("{flag}: set its password in $FOXHUNT_MQTT_PASSWORD"))
    })?;
    Ok(Some((user.to_owned(), password)))
}

/// Places of a hunt on their way to a broker.
#[cfg(feature = "hardware")]
pub struct MqttOutlet {
    sender: MqttSender,
    feed: MqttFeed,
}

#[cfg(feature = "hardware")]
impl MqttOutlet {
    /// Begins for a hunt of this name.
    pub fn new(
        config: &MqttConfig,
        hunt: &str,
        platforms: Vec<CotPlatform>,
        is_simulated: bool,
    ) -> Result<Self, CliError> {
        Self::with(config, hunt, MqttFeed::new(platforms, is_simulated))
    }

    /// Begins for recordings of this name.
    pub fn of_recordings(config: &MqttConfig, title: &str) -> Result<Self, CliError> {
        Self::with(config, title, MqttFeed::of_recordings())
    }

    fn with(config: &MqttConfig, hunt: &str, feed: MqttFeed) -> Result<Self, CliError> {
        let sender = MqttSender::open(config, &availability_topic(hunt));
        let sender = sender.map_err(|error| CliError::input(format!("--mqtt: {error}")))?;
        Ok(Self { sender, feed })
    }

    /// Takes the place of a receiver at a time of the hunt.
    pub fn place(&mut self, receiver: usize, time: f64, place: Vector3<f64>) {
        self.feed.place(receiver, time, place);
    }

    /// Sends what has changed, and reports the connection.
    pub fn publish(&mut self, overview: &Overview) {
        match self.feed.messages(overview) {
            Ok(messages) => self
                .sender
                .put(messages.iter().map(|message| (message.topic.as_str(), &*message.payload))),
            Err(error) => warn(&format!("--mqtt: {error}")),
        }
        self.report();
    }

    fn report(&self) {
        self.sender.take_remarks().iter().for_each(|remark| warn(remark));
    }

    /// Waits until everything has arrived, for a while at most.
    pub fn finish(self, within: Duration) -> Result<(), String> {
        let finished = self.sender.finish(within);
        self.report();
        finished
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn brokers_are_read() {
        for (text, host, port) in [
            ("localhost", "localhost", 1883),
            ("127.0.0.1:1884", "127.0.0.1", 1884),
            ("mqtt://homeassistant.local:1883/", "homeassistant.local", 1883),
            ("[::1]:1885", "::1", 1885),
            ("[::1]", "::1", 1883),
        ] {
            assert_eq!(broker(text), Ok((host.to_owned(), port)), "{text}");
        }
        for (text, why) in [
            ("", "host is missing"),
            (":1883", "host is missing"),
            ("host:", "port"),
            ("host:0", "65535"),
            ("host:70000", "65535"),
            ("host:mqtt", "65535"),
            ("::1", "in brackets"),
            ("[::1", "]"),
            ("[::1]1883", "colon"),
            ("a b", "name or a number"),
            ("mqtts://host:8883", "without TLS"),
            ("http://host", "without TLS"),
        ] {
            let error = broker(text).expect_err(text);
            assert!(error.contains(why), "{text}: {error}");
        }
    }
}
