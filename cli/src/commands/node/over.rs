use std::{
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
    thread,
    time::Duration,
};

use foxhunt::{
    core::Clock,
    hardware::{
        SystemClock,
        link::{DroneLink, FusionLink, UnixTime},
    },
    network::NetworkError,
};

use crate::{error::CliError, output::warn};

/// The arguments of both kinds of nodes.
#[derive(Debug, clap::Args)]
pub(super) struct Shared {
    /// The middleware between the computers; one that is missing here needs a build with
    /// `--features ros1,ros2`
    #[arg(long, value_enum)]
    over: Over,
    #[cfg(feature = "ros2")]
    /// The DDS domain of ROS 2; $ROS_DOMAIN_ID, or else 0, unless given
    #[arg(long, value_name = "N")]
    domain_id: Option<u16>,
    #[cfg(feature = "ros1")]
    /// The master of ROS 1; $ROS_MASTER_URI, or else http://localhost:11311, unless given
    #[arg(long, value_name = "URI")]
    master: Option<String>,
    /// How much faster than the clock on the wall the time of a simulated hunt runs; the same for
    /// all nodes
    #[arg(long, value_name = "FACTOR", default_value_t = 1.0, value_parser = speed)]
    speed: f64,
}

/// A middleware.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum Over {
    #[cfg(feature = "ros1")]
    Ros1,
    #[cfg(feature = "ros2")]
    Ros2,
}

impl Shared {
    /// Joins as a drone.
    pub(super) fn drone(&self, drone: usize) -> Result<Box<dyn DroneLink>, CliError> {
        match self.over {
            #[cfg(feature = "ros1")]
            Over::Ros1 => {
                let link = foxhunt::hardware::link::Ros1Drone::join(&self.ros1(), drone);
                Ok(Box::new(link.map_err(CliError::failure)?))
            }
            #[cfg(feature = "ros2")]
            Over::Ros2 => {
                let link = foxhunt::hardware::link::Ros2Drone::join(self.ros2()?, drone);
                Ok(Box::new(link.map_err(CliError::failure)?))
            }
        }
    }

    /// Joins as the one that fuses.
    pub(super) fn fusion(&self, drones: usize) -> Result<Box<dyn FusionLink>, CliError> {
        match self.over {
            #[cfg(feature = "ros1")]
            Over::Ros1 => {
                let link = foxhunt::hardware::link::Ros1Fusion::join(&self.ros1(), drones);
                Ok(Box::new(link.map_err(CliError::failure)?))
            }
            #[cfg(feature = "ros2")]
            Over::Ros2 => {
                let link = foxhunt::hardware::link::Ros2Fusion::join(self.ros2()?, drones);
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

    /// The clock of all nodes: UNIX time, or a faster one that those of the same speed agree on.
    pub(super) fn clock(&self) -> NodeClock {
        let clock = SystemClock::start();
        let unix_s = clock.started_unix_s();
        let base_s = (unix_s / PERIOD_S).floor() * PERIOD_S;
        NodeClock { clock, base_s, since_s: unix_s - base_s, speed: self.speed }
    }
}

/// Faster clocks begin anew every twelve days, so that they stay near to the one on the wall.
const PERIOD_S: f64 = 1_048_576.0;

/// UNIX time, which may run faster from a moment on that all nodes know.
#[derive(Clone, Copy, Debug)]
pub(super) struct NodeClock {
    clock: SystemClock,
    base_s: f64,
    since_s: f64,
    speed: f64,
}

impl NodeClock {
    pub(super) fn unix(&self) -> Result<UnixTime, CliError> {
        let since_s = (self.since_s + self.clock.now()) * self.speed;
        let at = UnixTime::default().after(self.base_s).and_then(|base| base.after(since_s));
        at.ok_or_else(|| CliError::failure("the system's clock has no UNIX time"))
    }
}

/// Whether the user wants the program to end.
pub(super) struct Stop(Arc<AtomicBool>);

impl Stop {
    /// Listens for Ctrl-C and termination.
    pub(super) fn listen() -> Result<Self, CliError> {
        let stop = Arc::new(AtomicBool::new(false));
        let stopped = Arc::clone(&stop);
        ctrlc::set_handler(move || stopped.store(true, Ordering::Relaxed))
            .map_err(CliError::failure)?;
        Ok(Self(stop))
    }

    /// Waits for a moment; whether to go on.
    pub(super) fn goes_on(&self) -> bool {
        thread::sleep(Duration::from_millis(2));
        !self.0.load(Ordering::Relaxed)
    }
}

/// Prints a link's failure once, however often it fails.
#[derive(Default)]
pub(super) struct Failures(String);

impl Failures {
    /// Prints it and goes on, unless the hunt cannot.
    pub(super) fn report(&mut self, result: Result<(), NetworkError>) -> Result<(), CliError> {
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
