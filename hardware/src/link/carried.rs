//! Links over a [`Carrier`]: messages as JSON in signed envelopes.

use std::collections::BTreeMap;

use foxhunt_core::Waypoint;
use serde::Serialize;

use super::{
    BeaconView, Carrier, DroneLink, FusionLink, Health, LinkError, Order, Refusal, Report, TeamKey,
    View,
};

/// Name of the link in errors.
const OVER: &str = "messages";

/// Most messages that are looked at in one call, so that a flood of strangers does not hold up a
/// node.
const MOST_LOOKED_AT: usize = 1000;

/// No message is longer, in bytes.
const MOST_BYTES: usize = 65_536;

/// No head of a message is longer, in bytes.
const MOST_HEAD: usize = 256;

/// Most earlier runs of the other end that are known.
const MOST_RETIRED: usize = 10_000;

/// First word of a message.
const HEAD: &str = "foxhunt1";

/// Word in place of the signature of a message that has none.
const UNSIGNED: &str = "unsigned";

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
    /// Returns the fusing end, for a number of drones. Without a key nothing is signed, and signed
    /// messages are refused.
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

/// One node's end of the traffic with another one: signs what goes out, and takes of what comes in
/// what the other one has signed, each message once, and none that was recorded before.
///
/// A message is a line of text, then its body:
///
/// ```text
/// foxhunt1 SESSION ECHO COUNT SIGNATURE
/// ```
///
/// The session is a random number of the run of its sender, in 16 hexadecimal digits; the echo is
/// the session of the run that it is meant for, 0 while that is not known. Only who has received
/// something of this run can name it, so that what was recorded before it began is refused. The
/// count grows by one with every message of a session; each count is accepted once, in any order
/// within the last 64 (RFC 4303, section 3.4.3). The signature is the HMAC-SHA-256 of channel, head
/// and body with the key of the team, so that no message counts on another channel.
///
/// A message with another echo is answered by one without a body that names this session: so two
/// ends find each other again after either was restarted.
#[derive(Debug)]
struct Envelope {
    key: Option<TeamKey>,
    session: u64,
    count: u64,
    /// The run of the other end, once it has named ours.
    peer: Option<u64>,
    /// Earlier runs of the other end.
    retired: Vec<u64>,
    window: Window,
    /// The sessions of those who do not know ours.
    unanswered: Vec<u64>,
    refused: BTreeMap<Refusal, u64>,
}

/// Record of which of the last 64 counts came.
#[derive(Clone, Copy, Debug, Default)]
struct Window {
    /// The largest.
    last: u64,
    /// Bit n stands for the one n before it.
    came: u64,
}

impl Window {
    /// Takes note of a count; `false` if it came before, or is too old to know.
    fn take(&mut self, count: u64) -> bool {
        if count > self.last {
            let ahead = u32::try_from(count - self.last).unwrap_or(u32::MAX);
            self.came = self.came.checked_shl(ahead).unwrap_or(0) | 1;
            self.last = count;
            return true;
        }
        let behind = u32::try_from(self.last - count).unwrap_or(u32::MAX);
        let Some(bit) = 1_u64.checked_shl(behind) else { return false };
        let is_new = self.came & bit == 0;
        self.came |= bit;
        is_new
    }
}

/// The head of a message.
struct Head<'a> {
    session: u64,
    echo: u64,
    count: u64,
    signature: &'a str,
}

impl<'a> Head<'a> {
    /// The head of a payload, and its body.
    fn parse(payload: &'a [u8]) -> Option<(Self, &'a [u8])> {
        let end = payload.iter().take(MOST_HEAD).position(|byte| *byte == b'\n')?;
        let text = std::str::from_utf8(&payload[..end]).ok()?;
        let mut words = text.split(' ');
        let mut word = || words.next();
        if word()? != HEAD {
            return None;
        }
        let session =
            |word: &str| (word.len() == 16).then(|| u64::from_str_radix(word, 16).ok()).flatten();
        let head = Self {
            session: session(word()?)?,
            echo: session(word()?)?,
            count: word()?.parse().ok()?,
            signature: word()?,
        };
        words.next().is_none().then_some((head, &payload[end + 1..]))
    }
}

impl Envelope {
    /// A new run with the key of the team; without one nothing is signed, and nothing verified.
    fn new(key: Option<TeamKey>) -> Result<Self, LinkError> {
        let session = getrandom::u64().map_err(|error| LinkError::Open {
            over: "signing",
            what: "a session".to_owned(),
            reason: error.to_string(),
        })?;
        Ok(Self::with_session(key, session))
    }

    fn with_session(key: Option<TeamKey>, session: u64) -> Self {
        Self {
            key,
            // 0 stands for none.
            session: session.max(1),
            count: 0,
            peer: None,
            retired: Vec::new(),
            window: Window::default(),
            unanswered: Vec::new(),
            refused: BTreeMap::new(),
        }
    }

    /// The message of a body that goes out on a channel.
    fn seal(&mut self, channel: &str, body: &[u8]) -> Vec<u8> {
        self.seal_for(self.peer.unwrap_or(0), channel, body)
    }

    fn seal_for(&mut self, echo: u64, channel: &str, body: &[u8]) -> Vec<u8> {
        self.count += 1;
        let session = self.session;
        let count = self.count;
        let signature = self.key.as_ref().map_or_else(
            || UNSIGNED.to_owned(),
            |key| key.sign(&[signed_head(channel, session, echo, count).as_bytes(), body]),
        );
        let head = format!("{HEAD} {session:016x} {echo:016x} {count} {signature}\n");
        [head.as_bytes(), body].concat()
    }

    /// The body of a message that came on a channel; `None` for one without, that only names a
    /// session.
    fn open<'a>(&mut self, channel: &str, payload: &'a [u8]) -> Result<Option<&'a [u8]>, Refusal> {
        if payload.len() > MOST_BYTES {
            return Err(Refusal::Oversize);
        }
        let (head, body) = Head::parse(payload).ok_or(Refusal::Garbage)?;
        let Head { session, echo, count, signature } = head;
        match &self.key {
            None if signature == UNSIGNED => {}
            None => return Err(Refusal::Signed),
            Some(_) if signature == UNSIGNED => return Err(Refusal::Unsigned),
            Some(key) => {
                let head = signed_head(channel, session, echo, count);
                if !key.verifies(&[head.as_bytes(), body], signature) {
                    return Err(Refusal::WrongKey);
                }
            }
        }
        if echo != self.session {
            // The present run of the other end knows ours, and its earlier ones are over.
            let is_known = self.peer == Some(session) || self.retired.contains(&session);
            if !is_known && !self.unanswered.contains(&session) {
                self.unanswered.push(session);
            }
            // One that has just begun knows no session.
            return if echo == 0 { Ok(None) } else { Err(Refusal::Stale) };
        }
        if self.peer != Some(session) {
            if self.retired.contains(&session) {
                return Err(Refusal::Stale);
            }
            self.begin(session);
        }
        if !self.window.take(count) {
            return Err(Refusal::Replayed);
        }
        Ok((!body.is_empty()).then_some(body))
    }

    /// Takes a new run of the other end for the present one.
    fn begin(&mut self, session: u64) {
        if let Some(before) = self.peer.replace(session) {
            if self.retired.len() == MOST_RETIRED {
                self.retired.remove(0);
            }
            self.retired.push(before);
        }
        self.window = Window::default();
    }

    /// The messages that name this session to those who have sent something and do not know it; to
    /// a few, whoever they are.
    fn answers(&mut self, channel: &str) -> Vec<Vec<u8>> {
        const MOST_ANSWERS: usize = 64;
        let mut unanswered = std::mem::take(&mut self.unanswered);
        unanswered.truncate(MOST_ANSWERS);
        unanswered.into_iter().map(|session| self.seal_for(session, channel, &[])).collect()
    }

    /// Counts a refusal; its error when it is the first of its kind, the tenth, the hundredth and
    /// so on. Of an earlier run some are under way whenever an end was restarted.
    fn refuse(&mut self, why: Refusal, from: &str) -> Option<LinkError> {
        let count = self.refused.entry(why).or_default();
        *count += 1;
        let count = *count;
        let harmless = matches!(why, Refusal::Stale | Refusal::Replayed) && count < 100;
        let is_power_of_ten = 10_u64.pow(count.ilog10()) == count;
        (is_power_of_ten && !harmless).then(|| LinkError::Refused {
            from: from.to_owned(),
            why,
            count,
        })
    }
}

/// The channel of a drone's reports, and that of its orders.
fn channels(drone: usize) -> (String, String) {
    (format!("drone_{drone}/report"), format!("drone_{drone}/order"))
}

fn unreadable(channel: &str, error: &serde_json::Error) -> LinkError {
    LinkError::Message { over: OVER, what: channel.to_owned(), reason: error.to_string() }
}

/// Returns the head that is signed with the body.
fn signed_head(channel: &str, session: u64, echo: u64, count: u64) -> String {
    format!("{HEAD} {channel} {session:016x} {echo:016x} {count}\n")
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const UP: &str = "drone_0/report";
    const DOWN: &str = "drone_0/order";

    fn key() -> Option<TeamKey> {
        Some(TeamKey::generate().expect("randomness"))
    }

    /// Lets both ends find each other: a message of each, and the answers.
    fn meet(drone: &mut Envelope, fusion: &mut Envelope) {
        let hello = drone.seal(UP, b"hello");
        assert_eq!(fusion.open(UP, &hello), Ok(None), "it names no session");
        for answer in fusion.answers(DOWN) {
            assert_eq!(drone.open(DOWN, &answer), Ok(None));
        }
        let report = drone.seal(UP, b"report");
        assert_eq!(fusion.open(UP, &report), Ok(Some(&b"report"[..])));
        let order = fusion.seal(DOWN, b"order");
        assert_eq!(drone.open(DOWN, &order), Ok(Some(&b"order"[..])));
    }

    #[test]
    fn nothing_counts_twice_or_from_before() {
        let key = key();
        let new = || Envelope::new(key.clone()).expect("randomness");
        let mut drone = new();
        let mut fusion = new();
        meet(&mut drone, &mut fusion);
        let recorded = drone.seal(UP, b"old");
        assert_eq!(fusion.open(UP, &recorded), Ok(Some(&b"old"[..])));
        assert_eq!(fusion.open(UP, &recorded), Err(Refusal::Replayed));
        // A message counts on its own channel alone, and as it was.
        let order = fusion.seal(DOWN, b"order");
        assert_eq!(drone.open("drone_1/order", &order), Err(Refusal::WrongKey));
        let mut changed = order.clone();
        *changed.last_mut().expect("a body") ^= 1;
        assert_eq!(drone.open(DOWN, &changed), Err(Refusal::WrongKey));
        assert_eq!(drone.open(DOWN, &order), Ok(Some(&b"order"[..])));
        // After a restart of the fusing end what was recorded is refused, and both meet again.
        let mut restarted = new();
        assert_eq!(restarted.open(UP, &recorded), Err(Refusal::Stale));
        let answers = restarted.answers(DOWN);
        assert_eq!(answers.len(), 1);
        assert_eq!(drone.open(DOWN, &answers[0]), Ok(None));
        let report = drone.seal(UP, b"new");
        assert_eq!(restarted.open(UP, &report), Ok(Some(&b"new"[..])));
        assert_eq!(restarted.open(UP, &recorded), Err(Refusal::Stale));
        assert_eq!(drone.open(DOWN, &order), Err(Refusal::Stale), "an order of the run before");
        // After one of the drone, too; its earlier run does not come back.
        let mut second = new();
        let before = drone.seal(UP, b"before");
        meet(&mut second, &mut restarted);
        assert_eq!(restarted.open(UP, &before), Err(Refusal::Stale));
        assert_eq!(restarted.open(UP, &report), Err(Refusal::Stale));
        let report = second.seal(UP, b"after");
        assert_eq!(restarted.open(UP, &report), Ok(Some(&b"after"[..])));
    }

    #[test]
    fn who_lacks_the_key_is_refused() {
        let mut fusion = Envelope::new(key()).expect("randomness");
        let mut other = Envelope::new(key()).expect("randomness");
        let mut none = Envelope::new(None).expect("randomness");
        assert_eq!(fusion.open(UP, &other.seal(UP, b"x")), Err(Refusal::WrongKey));
        assert_eq!(fusion.open(UP, &none.seal(UP, b"x")), Err(Refusal::Unsigned));
        assert_eq!(none.open(DOWN, &fusion.seal(DOWN, b"x")), Err(Refusal::Signed));
        assert!(fusion.answers(DOWN).is_empty() && none.answers(UP).is_empty());
        assert_eq!(fusion.open(UP, &vec![b'x'; MOST_BYTES + 1]), Err(Refusal::Oversize));
        let reports: Vec<u64> = (0..1000)
            .filter_map(|_| match fusion.refuse(Refusal::Garbage, "drone 0")? {
                LinkError::Refused { count, .. } => Some(count),
                _ => None,
            })
            .collect();
        assert_eq!(reports, [1, 10, 100, 1000]);
        assert_eq!(fusion.refuse(Refusal::Stale, "drone 0"), None);
    }

    #[test]
    fn without_keys_two_ends_meet_when_both_have_none() {
        let new = || Envelope::new(None).expect("randomness");
        let mut drone = new();
        let mut fusion = new();
        meet(&mut drone, &mut fusion);
    }

    proptest! {
        #[test]
        fn garbage_is_refused(bytes in proptest::collection::vec(any::<u8>(), 0..300)) {
            let mut fusion = Envelope::with_session(None, 7);
            prop_assert!(fusion.open(UP, &bytes).is_err());
            let mut headed = b"foxhunt1 ".to_vec();
            headed.extend(bytes);
            prop_assert!(fusion.open(UP, &headed).is_err());
        }

        /// Each count is taken once, if it is among the last 64.
        #[test]
        fn a_window_takes_each_once(counts in proptest::collection::vec(1_u64..300, 1..400)) {
            let mut window = Window::default();
            let mut taken = std::collections::BTreeSet::new();
            let mut last = 0_u64;
            for count in counts {
                let expected = count + 64 > last && !taken.contains(&count);
                prop_assert_eq!(window.take(count), expected, "{}", count);
                if expected {
                    taken.insert(count);
                }
                last = last.max(count);
            }
        }
    }
}
