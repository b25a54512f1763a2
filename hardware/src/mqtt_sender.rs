//! Places of a hunt to an MQTT broker, which keeps the last of each for those who join late.

use std::{
    fmt,
    sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError},
    thread,
    time::{Duration, Instant},
};

use rumqttc::{Client, Connection, Event, LastWill, MqttOptions, Outgoing, Packet, QoS};

use crate::{
    link::{LinkError, MqttConfig, client, options},
    outbox::{Outbox, Parcel},
};

/// Name of the client in its identifier and in errors.
const NAME: &str = "hunt";

/// State of a hunt that sends.
const ONLINE: &[u8] = b"online";

/// State of a hunt that is over, or that the broker has lost.
const OFFLINE: &[u8] = b"offline";

/// Shortest pause before a lost broker is tried again; each further one is twice as long.
const FIRST_PAUSE: Duration = Duration::from_secs(1);

/// Longest pause before a lost broker is tried again.
const LONGEST_PAUSE: Duration = Duration::from_secs(30);

/// Longest time between two looks at the connection, and the shortest between two sends.
const TURN: Duration = Duration::from_millis(200);

/// Sends retained messages to an MQTT broker, and connects again whenever it is lost.
///
/// A thread does the work, so that no broker holds up the hunt. Only the last message of each topic
/// is kept: memory and traffic are bounded, and a broker that comes back gets the present state.
pub struct MqttSender {
    broker: String,
    /// Topic that says whether the hunt sends.
    availability: String,
    outbox: Arc<Outbox>,
}

impl fmt::Debug for MqttSender {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("MqttSender").field("broker", &self.broker).finish_non_exhaustive()
    }
}

impl MqttSender {
    /// Connects in the background. The topic `availability` says `online` until
    /// [`finish`](Self::finish); the broker says `offline` on it if the program is lost.
    ///
    /// # Errors
    ///
    /// [`LinkError::Open`] if a setting is invalid. A broker that is not there is no error.
    pub fn open(config: &MqttConfig, availability: &str) -> Result<Self, LinkError> {
        let mut options = options(config, NAME)?;
        let will = LastWill::new(availability, OFFLINE, QoS::AtLeastOnce, true);
        let _ = options.set_last_will(will);
        let outbox = Arc::new(Outbox::default());
        let serving = Serving { options, outbox: Arc::clone(&outbox) };
        let spawned = thread::Builder::new().name("mqtt".to_owned()).spawn(|| serving.serve());
        let _ = spawned.map_err(|error| LinkError::Open {
            over: "MQTT",
            what: NAME.to_owned(),
            reason: format!("its thread: {error}"),
        })?;
        let broker = format!("the broker {}:{}", config.host, config.port);
        let sender = Self { broker, availability: availability.to_owned(), outbox };
        sender.put([(availability, ONLINE)]);
        Ok(sender)
    }

    /// Puts messages, each with its topic, to be sent. It never waits for a network.
    pub fn put<'a>(&self, messages: impl IntoIterator<Item = (&'a str, &'a [u8])>) {
        let parcel = |(name, bytes)| Parcel { name, bytes, stale_unix_s: f64::INFINITY };
        self.outbox.put(messages.into_iter().map(parcel), 0.0);
    }

    /// Returns remarks about the connection since the last call.
    #[must_use]
    pub fn take_remarks(&self) -> Vec<String> {
        let remarks = self.outbox.take_remarks().into_iter();
        remarks.map(|remark| format!("{}: {remark}", self.broker)).collect()
    }

    /// Says `offline`, and waits until every message has arrived, for a while at most.
    ///
    /// # Errors
    ///
    /// The broker, with the number of messages that it has not got and the reason.
    pub fn finish(&self, within: Duration) -> Result<(), String> {
        self.close();
        match self.outbox.ended(within) {
            Some(failure) => Err(format!("{}: {failure}", self.broker)),
            None => Ok(()),
        }
    }

    fn close(&self) {
        self.put([(self.availability.as_str(), OFFLINE)]);
        self.outbox.close();
    }
}

impl Drop for MqttSender {
    fn drop(&mut self) {
        self.close();
    }
}

/// Data of the sender's thread.
struct Serving {
    options: MqttOptions,
    outbox: Arc<Outbox>,
}

impl Serving {
    fn serve(self) {
        let mut pause = FIRST_PAUSE;
        loop {
            let mut since = None;
            let Err(failure) = self.connection(&mut since) else { break };
            // A broker that takes a message and hangs up is not tried each second.
            if since.is_some_and(|since: Instant| since.elapsed() >= LONGEST_PAUSE) {
                pause = FIRST_PAUSE;
            }
            self.outbox.lost(failure);
            if self.outbox.is_closed() {
                break;
            }
            self.outbox.pause(pause);
            pause = (pause * 2).min(LONGEST_PAUSE);
        }
        self.outbox.end();
    }

    /// Sends over one connection until nothing more will come; an error if the broker is lost.
    /// `since` becomes the time at which the connection was there.
    ///
    /// A new client for each connection has nothing of the last one in flight, so that the number
    /// of confirmations tells what has arrived.
    fn connection(&self, since: &mut Option<Instant>) -> Result<(), String> {
        let (client, connection) = client(self.options.clone());
        let session = Arc::new(Session::default());
        let followed = Arc::clone(&session);
        let spawned = thread::Builder::new()
            .name("mqtt-connection".to_owned())
            .spawn(move || followed.follow(connection));
        let following = spawned.map_err(|error| format!("its thread: {error}"))?;
        let served = self.send(&client, &session, since);
        // The broker takes a client that ends without a farewell for lost.
        let is_leaving = client.try_disconnect().is_ok() && served.is_ok();
        if is_leaving {
            let _ = following.join();
        }
        served
    }

    fn send(
        &self,
        client: &Client,
        session: &Session,
        since: &mut Option<Instant>,
    ) -> Result<(), String> {
        session.wait(|state| state.is_connected)?;
        self.outbox.connected("connected".to_owned());
        *since = Some(Instant::now());
        let mut put = 0;
        loop {
            let messages = self.outbox.take(TURN, 0.0);
            session.check()?;
            if messages.is_empty() && self.outbox.is_closed() {
                return Ok(());
            }
            for (topic, payload) in &messages {
                let published = client.publish(topic, QoS::AtLeastOnce, true, &**payload);
                published.map_err(|error| session.failure(&error.to_string()))?;
                put += 1;
            }
            session.wait(|state| state.confirmed >= put)?;
            messages.iter().for_each(|(topic, payload)| self.outbox.sent(topic, payload));
            // Limits how often a thing that changes all the time is sent.
            if !messages.is_empty() && !self.outbox.is_closed() {
                self.outbox.pause(TURN);
            }
        }
    }
}

/// State of one connection, for the two threads that share it.
#[derive(Default)]
struct Session {
    state: Mutex<SessionState>,
    changed: Condvar,
}

#[derive(Default)]
struct SessionState {
    is_connected: bool,
    /// Number of messages that the broker has confirmed.
    confirmed: usize,
    /// Reason why the connection has ended.
    failure: Option<String>,
}

impl Session {
    fn state(&self) -> MutexGuard<'_, SessionState> {
        // A thread that panicked has left a whole state behind.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Does the work of a connection until it is lost or closed.
    fn follow(&self, mut connection: Connection) {
        for event in connection.iter() {
            let mut state = self.state();
            match event {
                Ok(Event::Incoming(Packet::ConnAck(_))) => state.is_connected = true,
                Ok(Event::Incoming(Packet::PubAck(_))) => state.confirmed += 1,
                Ok(Event::Outgoing(Outgoing::Disconnect)) => return,
                Ok(_) => continue,
                Err(error) => {
                    state.failure = Some(error.to_string());
                    self.changed.notify_all();
                    return;
                }
            }
            self.changed.notify_all();
        }
    }

    /// Waits until something is so; an error if the connection is lost first.
    fn wait(&self, is_so: impl Fn(&SessionState) -> bool) -> Result<(), String> {
        let waits = |state: &mut SessionState| state.failure.is_none() && !is_so(state);
        let waited = self.changed.wait_while(self.state(), waits);
        let state = waited.unwrap_or_else(PoisonError::into_inner);
        if is_so(&state) { Ok(()) } else { Err(state.failure.clone().unwrap_or_default()) }
    }

    /// Returns the reason why the connection has ended, if it has.
    fn check(&self) -> Result<(), String> {
        self.state().failure.clone().map_or(Ok(()), Err)
    }

    /// Returns the reason why the connection has ended, or else another one.
    fn failure(&self, other: &str) -> String {
        self.state().failure.clone().unwrap_or_else(|| other.to_owned())
    }
}
