//! An XBee as a radio: one question at a time, until it is answered or given up.

use foxhunt_core::{BeaconId, Clock, Radio, parameter::FieldError};
use foxhunt_wire::{
    ByteStream,
    xbee::{Address, Address16, Address64, AtCommand, AtStatus, Frame, Protocol},
};

use super::{Link, XbeeConfig, XbeeError, XbeeIdentity, XbeeQuestion, setup::Setup};

/// Counts of questions by their outcome.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct XbeeCounts {
    /// Questions that went out.
    pub queries: u64,
    /// Questions whose answer's power was reported.
    pub answered: u64,
    /// Questions whose time passed.
    pub silent: u64,
    /// Questions that the beacon's radio did not acknowledge.
    pub undelivered: u64,
    /// Powers that were dropped because another packet had come in between.
    pub crossed: u64,
    /// Packets from others, or to older questions.
    pub foreign: u64,
}

impl<S: ByteStream, C: Clock> XbeeRadio<S, C> {
    /// A radio on a stream.
    ///
    /// # Errors
    ///
    /// [`FieldError`] names what is wrong in `config`.
    pub fn new(config: XbeeConfig, stream: S, clock: C) -> Result<Self, FieldError> {
        config.check()?;
        Ok(Self {
            late_until: vec![f64::NEG_INFINITY; config.beacons.len()],
            state: State::SettingUp(Setup::new(config.setup_timeout_s)),
            config,
            link: Link::new(stream),
            clock,
            question: None,
            number: 0,
            level_dbm: None,
            counts: XbeeCounts::default(),
        })
    }

    /// Returns the identity of the radio; `None` while it is not set up.
    #[must_use]
    pub fn identity(&self) -> Option<XbeeIdentity> {
        match self.state {
            State::Ready(identity, _) => Some(identity),
            State::SettingUp(_) => None,
        }
    }

    /// Returns the counts of the questions by their outcome since the beginning.
    #[must_use]
    pub fn counts(&self) -> XbeeCounts {
        self.counts
    }

    /// The port.
    pub fn stream_mut(&mut self) -> &mut S {
        &mut self.link.stream
    }

    /// The power that waits to be taken.
    pub(super) fn level_dbm_taken(&mut self) -> Option<f64> {
        self.level_dbm.take()
    }

    /// Takes what has come and does what is to be done now.
    pub(super) fn serve(&mut self) -> Result<(), XbeeError> {
        let now = self.clock.now();
        let bytes = self.link.read();
        if self.link.reopened() {
            self.set_up_again();
        }
        let bytes = bytes?;
        if let State::SettingUp(setup) = &mut self.state {
            setup.take_bytes(&bytes);
        }
        let mut outcome = Ok(());
        for frame in self.link.frames(&bytes, now) {
            outcome = outcome.and(self.take_frame(&frame, now));
        }
        outcome.and(self.advance(now))
    }

    fn set_up_again(&mut self) {
        self.state = State::SettingUp(Setup::new(self.config.setup_timeout_s));
        if let Some(question) = &mut self.question {
            question.stage = Stage::Queued { from: f64::NEG_INFINITY };
        }
    }

    fn advance(&mut self, now: f64) -> Result<(), XbeeError> {
        if let State::SettingUp(setup) = &mut self.state {
            let Some(identity) = setup.advance(&mut self.link, now)? else { return Ok(()) };
            let manner = manner(&self.config, identity.protocol)?;
            self.state = State::Ready(identity, manner);
        }
        let State::Ready(identity, manner) = self.state else { return Ok(()) };
        let Some(question) = &mut self.question else { return Ok(()) };
        match question.stage {
            Stage::Queued { from } if now >= from => {
                let id = self.link.id();
                self.number = self.number.wrapping_add(1);
                let protocol = identity.protocol;
                let (frame, token) =
                    query(&self.config, protocol, manner, question.address, id, self.number);
                self.link.send(&frame)?;
                self.counts.queries += 1;
                let until = now + self.config.answer_timeout_s;
                question.stage = Stage::Sent { id, token, until };
            }
            Stage::Sent { until, .. } | Stage::Answered { until, .. } if now >= until => {
                self.counts.silent += 1;
                self.give_up(now);
            }
            _ => {}
        }
        Ok(())
    }

    /// Forgets the question. Its answer may come yet, and would look like that to the next.
    fn give_up(&mut self, now: f64) {
        let Some(Outstanding { beacon, stage, .. }) = self.question.take() else { return };
        let packets =
            matches!(self.state, State::Ready(_, manner) if manner != XbeeQuestion::RemoteDb);
        if packets
            && !self.config.echoed
            && matches!(stage, Stage::Sent { .. })
            && let Some(late) = self.late_until.get_mut(usize::from(beacon.0))
        {
            *late = now + self.config.answer_timeout_s;
        }
    }

    fn take_frame(&mut self, frame: &Frame, now: f64) -> Result<(), XbeeError> {
        if matches!(frame, Frame::ModemStatus { status } if status.is_reset()) {
            self.set_up_again();
            return Ok(());
        }
        let manner = match &mut self.state {
            State::SettingUp(setup) => {
                setup.answered(frame, now);
                return Ok(());
            }
            State::Ready(_, manner) => *manner,
        };
        match frame {
            Frame::AtResponse { id, command, status, value } => {
                self.take_answer(*id, *command, *status, value, now)
            }
            Frame::RemoteAtResponse { id, command, status, value, .. } if self.is_sent(*id) => {
                self.take_remote_answer(frame, *command, *status, value)
            }
            Frame::DeliveryStatus { id, delivery, .. } if self.is_sent(*id) => {
                self.sent(delivery.0 == 0, delivery.is_silence(), delivery)
            }
            Frame::TransmitStatus { id, status } if self.is_sent(*id) => {
                self.sent(status.0 == 0, status.is_silence(), status)
            }
            frame => match Packet::of(frame) {
                Some(packet) => self.received(&packet, manner, now),
                None => Ok(()),
            },
        }
    }

    /// Returns true if this is the number of the question that waits for an answer.
    fn is_sent(&self, number: u8) -> bool {
        matches!(&self.question, Some(Outstanding { stage: Stage::Sent { id, .. }, .. }) if *id == number)
    }

    /// Takes the delivery status of the packet that held the question.
    fn sent(
        &mut self,
        delivered: bool,
        silence: bool,
        status: impl std::fmt::Display,
    ) -> Result<(), XbeeError> {
        if delivered {
            return Ok(());
        }
        // Silence is not a failure, and an acknowledgement can be lost where the answer is not.
        if silence {
            self.counts.undelivered += 1;
            return Ok(());
        }
        let Some(question) = self.question.take() else { return Ok(()) };
        Err(XbeeError::NotSent { address: question.address, reason: status.to_string() })
    }

    /// A packet came over the air.
    fn received(
        &mut self,
        packet: &Packet<'_>,
        manner: XbeeQuestion,
        now: f64,
    ) -> Result<(), XbeeError> {
        let Some(question) = &mut self.question else {
            self.counts.foreign += 1;
            return Ok(());
        };
        match &question.stage {
            Stage::Answered { .. } => {
                // The requested power may be this packet's.
                self.counts.crossed += 1;
                question.stage = Stage::Queued { from: now };
            }
            Stage::Sent { token, until, .. }
                if manner != XbeeQuestion::RemoteDb
                    && packet.is_from(question.address)
                    && packet.data.starts_with(token) =>
            {
                if let (XbeeQuestion::ReceivedRssi, Some(level)) = (manner, packet.rssi_neg_dbm) {
                    self.take_level(level);
                } else {
                    let id = self.link.id();
                    let until = *until;
                    question.stage = Stage::Answered { id, until };
                    return self.link.send(&Frame::at(id, AtCommand::DB));
                }
            }
            _ => self.counts.foreign += 1,
        }
        Ok(())
    }

    /// The radio answers, which concerns the question only if it is the requested power.
    fn take_answer(
        &mut self,
        number: u8,
        command: AtCommand,
        status: AtStatus,
        value: &[u8],
        now: f64,
    ) -> Result<(), XbeeError> {
        let Some(question) = &mut self.question else { return Ok(()) };
        if !matches!(question.stage, Stage::Answered { id, .. } if id == number)
            || command != AtCommand::DB
        {
            return Ok(());
        }
        match (status, value) {
            (AtStatus::OK, [.., level]) if *level > 0 => self.take_level(*level),
            // It reports that nothing was received.
            (AtStatus::OK, _) => question.stage = Stage::Queued { from: now },
            _ => {
                self.question = None;
                return Err(XbeeError::Refused { command, status });
            }
        }
        Ok(())
    }

    /// A beacon's radio answers the question.
    fn take_remote_answer(
        &mut self,
        frame: &Frame,
        command: AtCommand,
        status: AtStatus,
        value: &[u8],
    ) -> Result<(), XbeeError> {
        let Some(question) = &self.question else { return Ok(()) };
        let address = question.address;
        let is_theirs = Packet::of(frame).is_some_and(|packet| packet.is_from(address));
        match (status, value) {
            // Nobody answered, so the radio itself reports that, and not always in whose name.
            (AtStatus::NO_ANSWER, _) => self.counts.undelivered += 1,
            _ if !is_theirs || command != AtCommand::DB => self.counts.foreign += 1,
            (AtStatus::OK, [.., level]) if *level > 0 => self.take_level(*level),
            (AtStatus::OK, _) => {}
            _ => {
                self.question = None;
                return Err(XbeeError::RemoteRefused { address, status });
            }
        }
        Ok(())
    }

    fn take_level(&mut self, neg_dbm: u8) {
        self.question = None;
        self.counts.answered += 1;
        self.level_dbm = Some(-f64::from(neg_dbm));
    }
}

impl<S: ByteStream, C: Clock> Radio for XbeeRadio<S, C> {
    type Error = XbeeError;

    /// # Errors
    ///
    /// [`XbeeError::Beacon`] if there is no address of it; an older question stays then. Whatever
    /// keeps the radio from being set up, or from sending.
    fn request(&mut self, beacon: BeaconId) -> Result<(), XbeeError> {
        let index = usize::from(beacon.0);
        let beacons = self.config.beacons.len();
        let address = *self
            .config
            .beacons
            .get(index)
            .ok_or(XbeeError::Beacon { beacon: beacon.0, beacons })?;
        let now = self.clock.now();
        // What has come until now belongs to older questions.
        let before = self.serve();
        self.give_up(now);
        self.level_dbm = None;
        before?;
        let from = self.late_until.get(index).copied().unwrap_or(f64::NEG_INFINITY);
        self.question = Some(Outstanding { beacon, address, stage: Stage::Queued { from } });
        let sent = self.advance(now);
        if sent.is_err() {
            self.question = None;
        }
        sent
    }

    fn poll(&mut self) -> Result<Option<f64>, XbeeError> {
        let served = self.serve();
        match self.level_dbm.take() {
            Some(level) => Ok(Some(level)),
            None => served.map(|()| None),
        }
    }
}

/// A packet that came over the air: its sender, its data, and its power in −dBm if the frame
/// reports that.
struct Packet<'a> {
    from64: Option<Address64>,
    from16: Option<Address16>,
    data: &'a [u8],
    rssi_neg_dbm: Option<u8>,
}

impl<'a> Packet<'a> {
    /// `None` for what the radio reports of itself.
    fn of(frame: &'a Frame) -> Option<Self> {
        let (from64, from16, data, rssi_neg_dbm) = match frame {
            Frame::Receive64 { from, rssi_neg_dbm, data, .. } => {
                (Some(*from), None, data.as_slice(), Some(*rssi_neg_dbm))
            }
            Frame::Receive16 { from, rssi_neg_dbm, data, .. } => {
                (None, Some(*from), data.as_slice(), Some(*rssi_neg_dbm))
            }
            Frame::Receive { from64, from16, data, .. }
            | Frame::ExplicitReceive { from64, from16, data, .. } => {
                (Some(*from64), Some(*from16), data.as_slice(), None)
            }
            Frame::RemoteAtResponse { from64, from16, .. } => {
                (Some(*from64), Some(*from16), &[][..], None)
            }
            // Samples of inputs, node identifications, and what else is received.
            Frame::Unknown { frame_type: 0x82..=0x87 | 0x8E | 0x92..=0xAF, data } => {
                (None, None, data.as_slice(), None)
            }
            _ => return None,
        };
        Some(Self { from64, from16, data, rssi_neg_dbm })
    }

    fn is_from(&self, address: Address) -> bool {
        match address {
            Address::Long(address) => self.from64 == Some(address),
            Address::Short(address) => self.from16 == Some(address),
        }
    }
}

/// The query that a radio with this firmware sends.
fn manner(config: &XbeeConfig, protocol: Protocol) -> Result<XbeeQuestion, XbeeError> {
    let frames_have_rssi = protocol == Protocol::Ieee802154;
    if protocol == Protocol::DigiMesh {
        let short = config.beacons.iter().find(|address| matches!(address, Address::Short(_)));
        if let Some(address) = short {
            return Err(XbeeError::Address { address: *address });
        }
    }
    match config.question {
        XbeeQuestion::Auto if frames_have_rssi => Ok(XbeeQuestion::ReceivedRssi),
        XbeeQuestion::Auto => Ok(XbeeQuestion::TransmitDb),
        question @ XbeeQuestion::ReceivedRssi if !frames_have_rssi => {
            Err(XbeeError::Question { protocol, question })
        }
        question => Ok(question),
    }
}

/// The frame of a query, and what its answer begins with.
fn query(
    config: &XbeeConfig,
    protocol: Protocol,
    manner: XbeeQuestion,
    address: Address,
    id: u8,
    number: u16,
) -> (Frame, Vec<u8>) {
    let (to64, to16) = match address {
        Address::Long(to) => (to, Address16::UNKNOWN),
        Address::Short(to) => (Address64::UNKNOWN, to),
    };
    if manner == XbeeQuestion::RemoteDb {
        let command = AtCommand::DB;
        let parameter = Vec::new();
        let frame = Frame::RemoteAtCommand { id, to64, to16, options: 0, command, parameter };
        return (frame, Vec::new());
    }
    let mut data = config.payload.clone().into_bytes();
    let mut token = Vec::new();
    if config.echoed {
        data.extend(number.to_be_bytes());
        token.clone_from(&data);
    }
    let frame = match (protocol, address) {
        (Protocol::Ieee802154, Address::Long(to)) => Frame::Transmit64 { id, to, options: 0, data },
        (Protocol::Ieee802154, Address::Short(to)) => {
            Frame::Transmit16 { id, to, options: 0, data }
        }
        _ => Frame::Transmit { id, to64, to16, broadcast_radius: 0, options: 0, data },
    };
    (frame, token)
}

#[derive(Debug)]
enum State {
    SettingUp(Setup),
    Ready(XbeeIdentity, XbeeQuestion),
}

/// The one question that is outstanding.
#[derive(Clone, Debug)]
struct Outstanding {
    beacon: BeaconId,
    address: Address,
    stage: Stage,
}

/// Stage of the question.
#[derive(Clone, Debug, PartialEq)]
enum Stage {
    /// To be sent, not before then.
    Queued { from: f64 },
    /// Sent with this number; its answer begins with `token`, and is waited for until then.
    Sent { id: u8, token: Vec<u8>, until: f64 },
    /// Answered; the radio was queried for the power with this number.
    Answered { id: u8, until: f64 },
}

/// A drone's XBee, which queries beacons and measures the power of their answers.
///
/// It queries the radio's mode and firmware when it is used first, after a reset, and after its
/// port was opened again; a question that comes meanwhile goes out when that is known. It sets
/// nothing in the radio. One question is outstanding: the answer's sender is checked, an answer to
/// an older question is not reported, and a power that may be another packet's is dropped and
/// queried again. A beacon that does not answer is no failure: it is not reported.
#[derive(Debug)]
pub struct XbeeRadio<S, C> {
    pub(super) config: XbeeConfig,
    pub(super) link: Link<S>,
    pub(super) clock: C,
    state: State,
    question: Option<Outstanding>,
    /// For each beacon: an answer that comes before then may be to an older question.
    late_until: Vec<f64>,
    /// Number of the last question.
    number: u16,
    level_dbm: Option<f64>,
    counts: XbeeCounts,
}
