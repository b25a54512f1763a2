use super::{Kept, Publisher, Subscriber, Text, Topics, drone_topic};
use crate::link::{Carrier, LinkError};

/// Number of messages that wait for a slow end.
const DEPTH: usize = 100;

/// Signed messages as text, on two topics of each drone: `signed_report` and `signed_order`.
pub(in crate::link) struct RosCarrier {
    channels: Vec<Channel>,
    /// Index of the channel whose turn was last.
    turn: usize,
}

/// The two topics of a drone, counted from 0.
struct Channel {
    drone: usize,
    out: Publisher<Text>,
    into: Subscriber<Text>,
}

impl RosCarrier {
    /// The end of a drone.
    pub(super) fn drone(node: &mut impl Topics<Text>, drone: usize) -> Result<Self, LinkError> {
        Self::new(node, std::iter::once(drone), "signed_report", "signed_order")
    }

    /// The end of the one that fuses, for a number of drones.
    pub(super) fn fusion(node: &mut impl Topics<Text>, drones: usize) -> Result<Self, LinkError> {
        Self::new(node, 0..drones, "signed_order", "signed_report")
    }

    fn new(
        node: &mut impl Topics<Text>,
        drones: impl Iterator<Item = usize>,
        out: &str,
        into: &str,
    ) -> Result<Self, LinkError> {
        let channel = |drone| {
            let out = node.publisher(&drone_topic(drone, out), Kept::Queue(DEPTH))?;
            let into = node.subscriber(&drone_topic(drone, into), DEPTH)?;
            Ok(Channel { drone, out, into })
        };
        Ok(Self { channels: drones.map(channel).collect::<Result<_, LinkError>>()?, turn: 0 })
    }
}

impl Carrier for RosCarrier {
    fn send(&mut self, drone: usize, payload: Vec<u8>) -> Result<(), LinkError> {
        let drones = self.channels.len();
        let to = self.channels.iter_mut().find(|channel| channel.drone == drone);
        let to = to.ok_or(LinkError::Drone { drone, drones })?;
        let data = String::from_utf8(payload)
            .map_err(|error| LinkError::Value { field: "a message", value: error.to_string() })?;
        to.out.publish(Text { data })
    }

    fn receive(&mut self) -> Result<Option<(usize, Vec<u8>)>, LinkError> {
        let count = self.channels.len();
        for _ in 0..count {
            // Each has its turn, so that a flood on one channel holds up no other.
            self.turn = (self.turn + 1) % count;
            let channel = &mut self.channels[self.turn];
            if let Some(Text { data }) = channel.into.take()? {
                return Ok(Some((channel.drone, data.into_bytes())));
            }
        }
        Ok(None)
    }
}
