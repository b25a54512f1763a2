//! Links between the nodes, and the key that signs their messages.

use std::{
    path::PathBuf,
    sync::{
        Arc,
        atomic::{AtomicU8, Ordering},
    },
    thread,
    time::Duration,
};

use foxhunt::{
    core::Clock,
    hardware::{
        SystemClock,
        link::{
            CarriedDrone, CarriedFusion, DroneLink, FusionLink, KeyError, MqttCarrier, MqttConfig,
            TeamKey, UnixTime,
        },
    },
    network::NetworkError,
};
use serde::Serialize;

use crate::{
    commands::mqtt::{broker, login},
    error::CliError,
    output::{Output, warn},
};

/// The arguments of both kinds of nodes.
#[derive(Debug, clap::Args)]
pub struct Shared {
    /// The middleware between the computers; ROS needs a build with `--features ros1,ros2`
    #[arg(long, value_enum)]
    over: Over,
    /// The key of the team (foxhunt node key), with which messages are signed
    #[arg(long, value_name = "FILE", required_unless_present = "unsigned")]
    key: Option<PathBuf>,
    /// Sign nothing, and trust every sender: only in a network that nobody else can reach
    #[arg(long, conflicts_with = "key")]
    unsigned: bool,
    /// The MQTT broker; port 1883 if none is given
    #[arg(long, value_name = "HOST[:PORT]", default_value = "localhost", value_parser = broker)]
    broker: (String, u16),
    /// The user name at the MQTT broker, if it needs one; the password is $FOXHUNT_MQTT_PASSWORD
    #[arg(long, value_name = "NAME")]
    broker_user: Option<String>,
    /// The prefix of MQTT topics; teams that share a broker need different ones
    #[arg(long, value_name = "PREFIX", default_value = "foxhunt")]
    topics: String,
    #[cfg(feature = "ros2")]
    /// The DDS domain of ROS 2 [default: $ROS_DOMAIN_ID, or else 0]
    #[arg(long, value_name = "N")]
    domain_id: Option<u16>,
    #[cfg(feature = "ros1")]
    /// The master of ROS 1 [default: $ROS_MASTER_URI, or else http://localhost:11311]
    #[arg(long, value_name = "URI")]
    master: Option<String>,
    /// The speed of a simulated hunt relative to the wall clock; the same for all nodes
    #[arg(long, value_name = "FACTOR", default_value_t = 1.0, value_parser = speed)]
    speed: f64,
}

/// A middleware.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum Over {
    Mqtt,
    #[cfg(feature = "ros1")]
    Ros1,
    #[cfg(feature = "ros2")]
    Ros2,
}

impl Shared {
    /// The key of the team, if messages are signed.
    fn key(&self) -> Result<Option<TeamKey>, CliError> {
        if self.unsigned {
            warn("messages are not signed: anyone in the network can fly the drones");
        }
        self.key.as_deref().map(TeamKey::read).transpose().map_err(key_error)
    }

    fn mqtt(&self) -> Result<MqttConfig, CliError> {
        let login = login("--broker-user", self.broker_user.as_deref())?;
        let (host, port) = self.broker.clone();
        Ok(MqttConfig { host, port, prefix: self.topics.clone(), login })
    }

    /// Joins as a drone.
    pub fn drone(&self, drone: usize) -> Result<Box<dyn DroneLink>, CliError> {
        let key = self.key()?;
        match self.over {
            Over::Mqtt => {
                let carrier = MqttCarrier::drone(&self.mqtt()?, drone).map_err(CliError::input)?;
                let link = CarriedDrone::new(carrier, drone, key);
                Ok(Box::new(link.map_err(CliError::failure)?))
            }
            #[cfg(feature = "ros1")]
            Over::Ros1 => {
                let link = foxhunt::hardware::link::Ros1Drone::join(&self.ros1(), drone, key);
                Ok(Box::new(link.map_err(CliError::failure)?))
            }
            #[cfg(feature = "ros2")]
            Over::Ros2 => {
                let link = foxhunt::hardware::link::Ros2Drone::join(self.ros2()?, drone, key);
                Ok(Box::new(link.map_err(CliError::failure)?))
            }
        }
    }

    /// Joins as the fusion node.
    pub fn fusion(&self, drones: usize) -> Result<Box<dyn FusionLink>, CliError> {
        let key = self.key()?;
        match self.over {
            Over::Mqtt => {
                let carrier = MqttCarrier::fusion(&self.mqtt()?, drones);
                let link = CarriedFusion::new(carrier.map_err(CliError::input)?, drones, key);
                Ok(Box::new(link.map_err(CliError::failure)?))
            }
            #[cfg(feature = "ros1")]
            Over::Ros1 => {
                let link = foxhunt::hardware::link::Ros1Fusion::join(&self.ros1(), drones, key);
                Ok(Box::new(link.map_err(CliError::failure)?))
            }
            #[cfg(feature = "ros2")]
            Over::Ros2 => {
                let link = foxhunt::hardware::link::Ros2Fusion::join(self.ros2()?, drones, key);
                Ok(Box::new(link.map_err(CliError::failure)?))
            }
        }
    }

    #[cfg(feature = "ros1")]
    fn ros1(&self) -> foxhunt::hardware::link::Ros1Config {
        let master = self.master.clone().or_else(|| std::env::var("ROS_MASTER_URI").ok());
        let default = foxhunt::hardware::link::Ros1Config::default();
        master.map_or(default, |master_uri| foxhunt::hardware::link::Ros1Config { master_uri })
    }

    #[cfg(feature = "ros2")]
    fn ros2(&self) -> Result<foxhunt::hardware::link::Ros2Config, CliError> {
        let domain = match (self.domain_id, std::env::var("ROS_DOMAIN_ID")) {
            (Some(domain), _) => Ok(domain),
            (None, Ok(text)) => text.parse().map_err(|_| text),
            (None, Err(_)) => Ok(0),
        };
        let domain_id = domain.map_err(|text| {
            CliError::input(format!("ROS_DOMAIN_ID is {text:?}, not a number from 0 to 65535"))
        })?;
        Ok(foxhunt::hardware::link::Ros2Config { domain_id })
    }

    /// The clock of all nodes: UNIX time, or a faster one that all nodes of the same speed agree
    /// on.
    pub fn clock(&self) -> NodeClock {
        let clock = SystemClock::start();
        let unix_s = clock.started_unix_s();
        let base_s = (unix_s / PERIOD_S).floor() * PERIOD_S;
        NodeClock { clock, base_s, since_s: unix_s - base_s, speed: self.speed }
    }
}

/// Period after which faster clocks begin again, in seconds (twelve days), so that they stay near
/// the wall clock.
const PERIOD_S: f64 = 1_048_576.0;

/// UNIX time, which may run faster from a moment on that all nodes know.
#[derive(Clone, Copy, Debug)]
pub struct NodeClock {
    clock: SystemClock,
    base_s: f64,
    since_s: f64,
    speed: f64,
}

impl NodeClock {
    /// Seconds since it began.
    pub fn seconds(&self) -> f64 {
        self.clock.now() * self.speed
    }

    /// UNIX time as all nodes of this speed have it.
    pub fn unix(&self) -> Result<UnixTime, CliError> {
        self.unix_after(self.clock.now())
    }

    /// UNIX time of its beginning, as all nodes of this speed have it.
    pub fn started(&self) -> Result<UnixTime, CliError> {
        self.unix_after(0.0)
    }

    fn unix_after(&self, elapsed_s: f64) -> Result<UnixTime, CliError> {
        let since_s = (self.since_s + elapsed_s) * self.speed;
        let at = UnixTime::default().after(self.base_s).and_then(|base| base.after(since_s));
        at.ok_or_else(|| CliError::failure("the system's clock has no UNIX time"))
    }
}

/// Counter of the user's requests to end the program.
pub struct Stop(Arc<AtomicU8>);

impl Stop {
    /// Listens for Ctrl-C and termination.
    pub fn listen() -> Result<Self, CliError> {
        let count = Arc::new(AtomicU8::new(0));
        let counted = Arc::clone(&count);
        ctrlc::set_handler(move || {
            let _ = counted.fetch_add(1, Ordering::Relaxed);
        })
        .map_err(CliError::failure)?;
        Ok(Self(count))
    }

    /// Returns the number of requests.
    pub fn count(&self) -> u8 {
        self.0.load(Ordering::Relaxed)
    }

    /// Waits for a moment; returns true if the node goes on.
    pub fn goes_on(&self) -> bool {
        rest();
        self.count() == 0
    }
}

/// Waits until the next step of a node.
pub fn rest() {
    thread::sleep(Duration::from_millis(2));
}

/// Prints a link's failure once, however often it fails.
#[derive(Default)]
pub struct Failures(String);

impl Failures {
    /// Prints a failure of the link and goes on; returns any other error.
    pub fn report(&mut self, result: Result<(), NetworkError>) -> Result<(), CliError> {
        match result {
            Ok(()) => Ok(()),
            Err(NetworkError::Link(error)) => {
                let text = error.to_string();
                if text != self.0 {
                    warn(&text);
                    self.0 = text;
                }
                Ok(())
            }
            Err(error) => Err(CliError::failure(error)),
        }
    }
}

fn speed(text: &str) -> Result<f64, String> {
    match text.parse() {
        // Its seconds have to fit into a message.
        Ok(value) if (0.01..=100.0).contains(&value) => Ok(value),
        _ => Err("not a number from 0.01 to 100".into()),
    }
}

/// Make the key that all nodes of a team share
///
/// Copy the file to every computer over a channel that you trust, such as scp. Anyone who has it
/// can fly the drones. Only its owner may read it.
#[derive(Debug, clap::Args)]
pub struct KeyArgs {
    /// The file to write; an existing one is refused
    file: PathBuf,
}

/// The file that was written.
#[derive(Serialize)]
struct Made<'a> {
    key: &'a str,
}

pub fn make_key(args: &KeyArgs, output: Output) -> Result<(), CliError> {
    let key = TeamKey::generate().map_err(CliError::failure)?;
    key.write(&args.file).map_err(key_error)?;
    let made = args.file.display().to_string();
    output.result(&Made { key: &made }, |made| format!("key: {}", made.key))
}

/// Returns the error of a key that cannot be made or read.
fn key_error(error: KeyError) -> CliError {
    match error {
        KeyError::Random(_) => CliError::failure(error),
        _ => CliError::input(error),
    }
}
