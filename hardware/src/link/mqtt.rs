//! The link over MQTT 3.1.1: for computers without ROS.

use std::{
    collections::VecDeque,
    fmt,
    sync::{
        Arc, Mutex, MutexGuard, PoisonError,
        atomic::{AtomicBool, Ordering},
    },
    thread,
    time::Duration,
};

use rumqttc::{Client, Connection, Event, MqttOptions, Packet, Publish, QoS};
use serde::{Deserialize, Serialize};

use super::{Carrier, LinkError};
use crate::host::is_this_computer;

/// Name of the link in errors.
const OVER: &str = "MQTT";

/// Pause before a lost broker is tried again, in seconds.
const AGAIN_S: u64 = 1;

/// Seconds without a packet after which the broker is taken for lost.
const KEEP_ALIVE_S: u64 = 5;

/// Most messages that wait for the broker; what has no room is repeated.
const MOST_WAITING: usize = 100;

/// Most messages of each drone that wait to be taken; the oldest are lost.
const MOST_KEPT: usize = 1000;

/// Most bytes of a message that are kept.
const MOST_BYTES: usize = 70_000;

/// A larger packet ends the connection, in bytes: the broker should let none through.
const MOST_PACKET_BYTES: usize = 16 << 20;

/// Settings of a node at an MQTT broker.
#[derive(Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct MqttConfig {
    /// Name or address of the broker.
    pub host: String,
    /// TCP port of the broker.
    pub port: u16,
    /// Beginning of all topics: teams that share a broker have different ones.
    pub prefix: String,
    /// Name and password at the broker; `None` if it wants neither.
    pub login: Option<(String, String)>,
}

impl Default for MqttConfig {
    /// A broker on this machine at port 1883 without a password; topics below `foxhunt`.
    fn default() -> Self {
        let host = "localhost".to_owned();
        let prefix = "foxhunt".to_owned();
        Self { host, port: 1883, prefix, login: None }
    }
}

impl MqttConfig {
    /// Returns true if others on the way can read and change what is sent.
    #[must_use]
    pub fn is_open(&self) -> bool {
        !is_this_computer(&self.host)
    }
}

/// Returns the options of a client, under a name that no other client has.
pub(crate) fn options(config: &MqttConfig, name: &str) -> Result<MqttOptions, LinkError> {
    let open = |reason: String| LinkError::Open { over: OVER, what: name.to_owned(), reason };
    let MqttConfig { host, port, prefix, login } = config;
    if prefix.is_empty() || prefix.contains(['+', '#', '\0']) || prefix.starts_with('$') {
        return Err(open(format!("prefix is {prefix:?}, which no topic can begin with")));
    }
    // A broker throws out the first of two clients with one name.
    let run = getrandom::u32().map_err(|error| open(error.to_string()))?;
    let mut options = MqttOptions::new(format!("{prefix}-{name}-{run:08x}"), host, *port);
    options
        .set_keep_alive(Duration::from_secs(KEEP_ALIVE_S))
        .set_max_packet_size(MOST_PACKET_BYTES, MOST_PACKET_BYTES);
    if let Some((user, password)) = login {
        options.set_credentials(user, password);
    }
    Ok(options)
}

/// Returns a client, and the connection that does its work.
pub(crate) fn client(options: MqttOptions) -> (Client, Connection) {
    let (client, mut connection) = Client::new(options, MOST_WAITING);
    let mut network = connection.eventloop.network_options();
    network.set_tcp_nodelay(true);
    network.set_connection_timeout(KEEP_ALIVE_S);
    connection.eventloop.set_network_options(network);
    (client, connection)
}

/// The password stays out of it.
impl fmt::Debug for MqttConfig {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("MqttConfig")
            .field("host", &self.host)
            .field("port", &self.port)
            .field("prefix", &self.prefix)
            .field("user", &self.login.as_ref().map(|(user, _)| user))
            .finish()
    }
}

/// One end of the traffic over an MQTT broker. It connects again whenever the broker is lost; what
/// is sent meanwhile is lost.
///
/// A drone sends on `PREFIX/drone_N/report` and receives on `PREFIX/drone_N/order`, the fusing node
/// the other way round, with quality of service 0.
pub struct MqttCarrier {
    client: Client,
    prefix: String,
    /// The last word of the topics that it sends on.
    out: &'static str,
    inbox: Arc<Inbox>,
    /// Index of the drone whose turn was last.
    turn: usize,
}

/// Messages that have come, for the thread that takes them.
struct Inbox {
    /// The first of the drones whose messages come, counted from 0.
    first: usize,
    kept: Mutex<Kept>,
    stop: AtomicBool,
}

#[derive(Default)]
struct Kept {
    /// The messages of each drone, the oldest first.
    queues: Vec<VecDeque<Vec<u8>>>,
    /// Trouble of the connection since the last call.
    trouble: Option<String>,
}

impl Inbox {
    fn kept(&self) -> MutexGuard<'_, Kept> {
        // Whoever panicked has left whole messages behind.
        self.kept.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl fmt::Debug for MqttCarrier {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("MqttCarrier")
            .field("prefix", &self.prefix)
            .field("out", &self.out)
            .finish_non_exhaustive()
    }
}

impl MqttCarrier {
    /// Joins as a drone, counted from 0. A broker that is not there is waited for.
    ///
    /// # Errors
    ///
    /// [`LinkError::Open`] when a setting cannot be.
    pub fn drone(config: &MqttConfig, drone: usize) -> Result<Self, LinkError> {
        Self::join(config, &format!("drone_{drone}"), ("report", "order"), drone, 1)
    }

    /// Joins as the fusing node, for a number of drones. A broker that is not there is waited for.
    ///
    /// # Errors
    ///
    /// [`LinkError::Open`] when a setting cannot be.
    pub fn fusion(config: &MqttConfig, drones: usize) -> Result<Self, LinkError> {
        Self::join(config, "fusion", ("order", "report"), 0, drones)
    }

    fn join(
        config: &MqttConfig,
        name: &str,
        (out, into): (&'static str, &'static str),
        first: usize,
        drones: usize,
    ) -> Result<Self, LinkError> {
        let open = |reason| LinkError::Open { over: OVER, what: name.to_owned(), reason };
        let (client, connection) = client(options(config, name)?);
        let MqttConfig { host, port, prefix, .. } = config;
        let kept = Kept { queues: vec![VecDeque::new(); drones], trouble: None };
        let inbox = Inbox { first, kept: Mutex::new(kept), stop: AtomicBool::new(false) };
        let inbox = Arc::new(inbox);
        let topics = (first..first + drones)
            .map(|drone| format!("{prefix}/drone_{drone}/{into}"))
            .collect::<Vec<_>>();
        let serving = Serving {
            client: client.clone(),
            broker: format!("the broker {host}:{port}"),
            topics,
            inbox: Arc::clone(&inbox),
        };
        let named = thread::Builder::new().name("mqtt".to_owned());
        named
            .spawn(move || serving.serve(connection))
            .map_err(|error| open(format!("its thread: {error}")))?;
        Ok(Self { client, prefix: prefix.clone(), out, inbox, turn: 0 })
    }

    fn publish(&self, topic: &str, retain: bool, payload: Vec<u8>) {
        // What has no room, or nobody to take it, is repeated.
        let _ = self.client.try_publish(topic, QoS::AtMostOnce, retain, payload);
    }
}

impl Drop for MqttCarrier {
    fn drop(&mut self) {
        self.inbox.stop.store(true, Ordering::Relaxed);
        let _ = self.client.try_disconnect();
    }
}

impl Carrier for MqttCarrier {
    fn send(&mut self, drone: usize, payload: Vec<u8>) -> Result<(), LinkError> {
        let topic = format!("{}/drone_{drone}/{}", self.prefix, self.out);
        self.publish(&topic, false, payload);
        Ok(())
    }

    fn receive(&mut self) -> Result<Option<(usize, Vec<u8>)>, LinkError> {
        let mut kept = self.inbox.kept();
        if let Some(reason) = kept.trouble.take() {
            let what = "the connection".to_owned();
            return Err(LinkError::Message { over: OVER, what, reason });
        }
        let drones = kept.queues.len();
        for _ in 0..drones {
            // Each has its turn, so that a flood on one channel holds up no other.
            self.turn = (self.turn + 1) % drones;
            if let Some(payload) = kept.queues[self.turn].pop_front() {
                return Ok(Some((self.inbox.first + self.turn, payload)));
            }
        }
        Ok(None)
    }

    fn show(&mut self, topic: &str, text: String) -> Result<(), LinkError> {
        self.publish(&format!("{}/{topic}", self.prefix), true, text.into_bytes());
        Ok(())
    }
}

/// Data of a connection's thread.
struct Serving {
    client: Client,
    broker: String,
    topics: Vec<String>,
    inbox: Arc<Inbox>,
}

impl Serving {
    fn serve(self, mut connection: Connection) {
        // The topics that are to be subscribed to: a broker that was restarted has forgotten them.
        let mut missing: &[String] = &[];
        for event in connection.iter() {
            if self.inbox.stop.load(Ordering::Relaxed) {
                return;
            }
            match event {
                Ok(Event::Incoming(Packet::ConnAck(_))) => missing = &self.topics,
                Ok(Event::Incoming(Packet::Publish(message))) => self.keep(&message),
                Ok(_) => {}
                Err(error) => {
                    let reason = format!("{}: {error}; it is tried again", self.broker);
                    self.inbox.kept().trouble = Some(reason);
                    thread::sleep(Duration::from_secs(AGAIN_S));
                }
            }
            // There may be no room for a request behind those that waited for the broker.
            while let [topic, others @ ..] = missing
                && self.client.try_subscribe(topic, QoS::AtMostOnce).is_ok()
            {
                missing = others;
            }
        }
    }

    fn keep(&self, message: &Publish) {
        let Some(index) = self.topics.iter().position(|topic| *topic == message.topic) else {
            return;
        };
        // Of a message that is too long, enough is kept to see that it is.
        let payload = &message.payload[..message.payload.len().min(MOST_BYTES)];
        let mut kept = self.inbox.kept();
        if let Some(queue) = kept.queues.get_mut(index) {
            if queue.len() == MOST_KEPT {
                queue.pop_front();
            }
            queue.push_back(payload.to_vec());
        }
    }
}
