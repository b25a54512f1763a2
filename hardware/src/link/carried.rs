//! Links over a [`Carrier`]: messages as JSON in signed envelopes.

use foxhunt_core::Waypoint;
use serde::Serialize;

use super::{
    BeaconView, Carrier, DroneLink, FusionLink, Health, LinkError, Order, Report, TeamKey, View,
    envelope::Envelope,
};

/// Name of the link in errors.
const OVER: &str = "messages";

/// Most messages that are looked at in one call, so that a flood of strangers does not hold up a
/// node.
const MOST_LOOKED_AT: usize = 1000;

/// The channel of a drone's reports, and that of its orders.
fn channels(drone: usize) -> (String, String) {
    (format!("drone_{drone}/report"), format!("drone_{drone}/order"))
}

fn unreadable(channel: &str, error: &serde_json::Error) -> LinkError {
    LinkError::Message { over: OVER, what: channel.to_owned(), reason: error.to_string() }
}

/// A drone's end of a link over a carrier, whose messages are signed with the key of the team.
#[derive(Debug)]
pub struct CarriedDrone<C> {
    carrier: C,
    drone: usize,
    envelope: Envelope,
}

impl<C: Carrier> CarriedDrone<C> {
    /// The end of a drone, counted from 0. Without a key nothing is signed, and what is signed is
    /// refused.
    ///
    /// # Errors
    ///
    /// [`LinkError::Open`] when the operating system has no randomness.
    pub fn new(carrier: C, drone: usize, key: Option<TeamKey>) -> Result<Self, LinkError> {
        Ok(Self { carrier, drone, envelope: Envelope::new(key)? })
    }
}

impl<C: Carrier> DroneLink for CarriedDrone<C> {
    fn send(&mut self, report: &Report) -> Result<(), LinkError> {
        let (out, _) = channels(self.drone);
        let body = serde_json::to_vec(report).map_err(|error| unreadable(&out, &error))?;
        let payload = self.envelope.seal(&out, &body);
        self.carrier.send(self.drone, payload)
    }

    fn receive(&mut self) -> Result<Option<Order>, LinkError> {
        let (out, into) = channels(self.drone);
        for _ in 0..MOST_LOOKED_AT {
            let Some((drone, payload)) = self.carrier.receive()? else { break };
            if drone != self.drone {
                continue;
            }
            match self.envelope.open(&into, &payload) {
                Ok(None) => {}
                Ok(Some(body)) => {
                    let order = serde_json::from_slice(body);
                    return order.map(Some).map_err(|error| unreadable(&into, &error));
                }
                Err(why) => {
                    if let Some(error) = self.envelope.refuse(why, &into) {
                        return Err(error);
                    }
                }
            }
        }
        for answer in self.envelope.answers(&out) {
            self.carrier.send(self.drone, answer)?;
        }
        Ok(None)
    }
}

/// The fusing end of a link over a carrier, whose messages are signed with the key of the team.
#[derive(Debug)]
pub struct CarriedFusion<C> {
    carrier: C,
    envelopes: Vec<Envelope>,
}

impl<C: Carrier> CarriedFusion<C> {
    /// The end of the one that fuses, for a number of drones. Without a key nothing is signed, and
    /// what is signed is refused.
    ///
    /// # Errors
    ///
    /// [`LinkError::Open`] when the operating system has no randomness.
    pub fn new(carrier: C, drones: usize, key: Option<TeamKey>) -> Result<Self, LinkError> {
        let envelope = |_| Envelope::new(key.clone());
        let envelopes = (0..drones).map(envelope).collect::<Result<_, LinkError>>()?;
        Ok(Self { carrier, envelopes })
    }
}

/// A beacon as it is shown.
#[derive(Serialize)]
struct ShownBeacon<'a> {
    unix_s: f64,
    name: &'a str,
    east_m: f64,
    north_m: f64,
    /// Rows of East and North, in square metres.
    covariance_m2: [[f64; 2]; 2],
}

/// A drone's goal as it is shown: East, North and Up in metres.
#[derive(Serialize)]
struct ShownGoal {
    unix_s: f64,
    goal_m: [f64; 3],
}

/// Health of the drones and of the hunt, as it is shown.
#[derive(Serialize)]
struct ShownHealth<'a> {
    unix_s: f64,
    health: &'a [Health],
}

impl<C: Carrier> CarriedFusion<C> {
    fn show_as(&mut self, topic: &str, shown: &impl Serialize) -> Result<(), LinkError> {
        let text = serde_json::to_string(shown).map_err(|error| unreadable(topic, &error))?;
        self.carrier.show(topic, text)
    }
}

impl<C: Carrier> FusionLink for CarriedFusion<C> {
    fn send(&mut self, drone: usize, order: &Order) -> Result<(), LinkError> {
        let drones = self.envelopes.len();
        let envelope = self.envelopes.get_mut(drone).ok_or(LinkError::Drone { drone, drones })?;
        let (_, out) = channels(drone);
        let body = serde_json::to_vec(order).map_err(|error| unreadable(&out, &error))?;
        let payload = envelope.seal(&out, &body);
        self.carrier.send(drone, payload)
    }

    fn receive(&mut self) -> Result<Option<(usize, Report)>, LinkError> {
        for _ in 0..MOST_LOOKED_AT {
            let Some((drone, payload)) = self.carrier.receive()? else { break };
            let Some(envelope) = self.envelopes.get_mut(drone) else { continue };
            let (into, _) = channels(drone);
            match envelope.open(&into, &payload) {
                Ok(None) => {}
                Ok(Some(body)) => {
                    let report = serde_json::from_slice(body);
                    let report = report.map_err(|error| unreadable(&into, &error))?;
                    return Ok(Some((drone, report)));
                }
                Err(why) => {
                    if let Some(error) = envelope.refuse(why, &into) {
                        return Err(error);
                    }
                }
            }
        }
        for (drone, envelope) in self.envelopes.iter_mut().enumerate() {
            let (_, out) = channels(drone);
            for answer in envelope.answers(&out) {
                self.carrier.send(drone, answer)?;
            }
        }
        Ok(None)
    }

    fn show(&mut self, view: &View) -> Result<(), LinkError> {
        let unix_s = view.at.since(super::UnixTime::default());
        for BeaconView { number, name, estimate } in &view.beacons {
            let mean = estimate.mean;
            let covariance = estimate.covariance;
            let shown = ShownBeacon {
                unix_s,
                name,
                east_m: mean.x,
                north_m: mean.y,
                covariance_m2: [
                    [covariance[(0, 0)], covariance[(0, 1)]],
                    [covariance[(1, 0)], covariance[(1, 1)]],
                ],
            };
            self.show_as(&format!("beacon_{number}/estimate"), &shown)?;
        }
        for (drone, shown) in view.drones.iter().enumerate() {
            if let Some(Waypoint { position }) = shown.goal {
                let goal = ShownGoal { unix_s, goal_m: position.into() };
                self.show_as(&format!("drone_{drone}/goal"), &goal)?;
            }
        }
        self.show_as("health", &ShownHealth { unix_s, health: &view.health })
    }
}
