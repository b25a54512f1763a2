//! Setup of an XBee: its mode, its identity and its protocol.

use foxhunt_wire::{
    ByteStream,
    xbee::{Address64, ApiMode, AtCommand, AtStatus, Frame, Protocol},
};

use super::{Link, XbeeError, XbeeIdentity};

/// Number of times that a query of the radio is sent.
const ATTEMPTS: u8 = 3;

/// Pause after a failure before it is begun again, in seconds.
const RETRY_S: f64 = 1.0;

/// Silence that the line needs before and after `+++`, in seconds (Digi: 1 s, `GT`).
const GUARD_S: f64 = 1.1;

/// The queries of the radio, in this order.
const QUESTIONS: [AtCommand; 5] =
    [AtCommand::AP, AtCommand::VR, AtCommand::HV, AtCommand::SH, AtCommand::SL];

/// The number of the first question: neither it nor its answer has a byte that is escaped, so that
/// it is understood in either mode.
const FIRST_ID: u8 = 1;

/// Reads a radio's identity and protocol. It sets nothing.
#[derive(Debug)]
pub(super) struct Setup {
    step: Step,
    mode: ApiMode,
    /// The answers until now, after the first.
    values: [u32; 4],
    timeout: f64,
}

#[derive(Clone, Debug, PartialEq)]
enum Step {
    /// The question of this number is next.
    Query { question: usize, attempts: u8 },
    /// The answer to a question is waited for until then.
    Listen { question: usize, attempts: u8, id: u8, until: f64 },
    /// It sends nothing: the line is left quiet until then, so that it takes `+++` for a command.
    Quiet { until: f64 },
    /// `+++` was sent; what came since.
    Command { until: f64, received: Vec<u8>, queried: bool },
    /// It failed, and is begun again then.
    Failed { failure: Failure, until: f64 },
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Failure {
    NotAnswering,
    Mode(u8),
    Refused(AtCommand, AtStatus),
}

impl From<Failure> for XbeeError {
    fn from(failure: Failure) -> Self {
        match failure {
            Failure::NotAnswering => Self::NotAnswering,
            Failure::Mode(ap) => Self::Mode { ap },
            Failure::Refused(command, status) => Self::Refused { command, status },
        }
    }
}

impl Setup {
    pub(super) fn new(timeout: f64) -> Self {
        let step = Step::Query { question: 0, attempts: 0 };
        Self { step, mode: ApiMode::Plain, values: [0; 4], timeout }
    }

    /// Returns the longest time until it has failed, in seconds.
    pub(super) fn longest(timeout: f64) -> f64 {
        f64::from(ATTEMPTS) * timeout * 5.0 + 3.0 * GUARD_S + timeout
    }

    /// Bytes as they came, which are no frames while the radio is in command mode.
    pub(super) fn take_bytes(&mut self, bytes: &[u8]) {
        if let Step::Command { received, .. } = &mut self.step {
            received.extend(bytes.iter().take(32_usize.saturating_sub(received.len())));
        }
    }

    /// Takes an answer; any other frame is left alone.
    pub(super) fn answered(&mut self, frame: &Frame, now: f64) {
        let Step::Listen { question, id, .. } = self.step else { return };
        let Frame::AtResponse { id: answered, command, status, value } = frame else { return };
        if *answered != id || QUESTIONS.get(question) != Some(command) {
            return;
        }
        let failed = |failure| Step::Failed { failure, until: now + RETRY_S };
        self.step = if *status != AtStatus::OK {
            failed(Failure::Refused(*command, *status))
        } else if let Some(slot) = question.checked_sub(1) {
            if let Some(slot) = self.values.get_mut(slot) {
                *slot = value.iter().fold(0, |all, byte| all << 8 | u32::from(*byte));
            }
            Step::Query { question: question + 1, attempts: 0 }
        } else {
            match value.last() {
                Some(1) => self.mode = ApiMode::Plain,
                Some(2) => self.mode = ApiMode::Escaped,
                _ => {}
            }
            match value.last() {
                Some(1 | 2) => Step::Query { question: 1, attempts: 0 },
                ap => failed(Failure::Mode(ap.copied().unwrap_or(0))),
            }
        };
    }

    /// Does what is to be done now; who the radio is once that is known.
    ///
    /// # Errors
    ///
    /// Why it is not, as long as it is not tried again.
    pub(super) fn advance<S: ByteStream>(
        &mut self,
        link: &mut Link<S>,
        now: f64,
    ) -> Result<Option<XbeeIdentity>, XbeeError> {
        match &mut self.step {
            Step::Query { question, attempts } => {
                let question = *question;
                let attempts = *attempts + 1;
                let Some(command) = QUESTIONS.get(question) else {
                    return Ok(Some(self.identity()));
                };
                // Until the mode is known, a delimiter begins a frame wherever it stands.
                link_mode(link, if question == 0 { ApiMode::Escaped } else { self.mode });
                let id = if question == 0 { FIRST_ID } else { link.id() };
                link.send(&Frame::at(id, *command))?;
                let until = now + self.timeout;
                self.step = Step::Listen { question, attempts, id, until };
            }
            Step::Listen { question, attempts, until, .. } if now >= *until => {
                self.step = match (*question, *attempts) {
                    (question, attempts) if attempts < ATTEMPTS => {
                        Step::Query { question, attempts }
                    }
                    (0, _) => Step::Quiet { until: now + GUARD_S },
                    _ => failed(Failure::NotAnswering, now),
                };
            }
            Step::Quiet { until } if now >= *until => {
                link.stream.send(b"+++").map_err(XbeeError::Stream)?;
                let until = now + 2.0 * GUARD_S;
                self.step = Step::Command { until, received: Vec::new(), queried: false };
            }
            Step::Command { until, received, queried } => {
                if !*queried && received.ends_with(b"OK\r") {
                    link.stream.send(b"ATAP\r").map_err(XbeeError::Stream)?;
                    received.clear();
                    (*queried, *until) = (true, now + GUARD_S);
                } else if let [b'0'..=b'9', b'\r'] = received[..]
                    && *queried
                {
                    let ap = received[0] - b'0';
                    link.stream.send(b"ATCN\r").map_err(XbeeError::Stream)?;
                    self.step = failed(Failure::Mode(ap), now);
                } else if now >= *until {
                    self.step = failed(Failure::NotAnswering, now);
                }
            }
            Step::Failed { until, .. } if now >= *until => {
                self.step = Step::Query { question: 0, attempts: 0 };
            }
            Step::Listen { .. } | Step::Quiet { .. } | Step::Failed { .. } => {}
        }
        match self.step {
            Step::Failed { failure, .. } => Err(failure.into()),
            _ => Ok(None),
        }
    }

    fn identity(&self) -> XbeeIdentity {
        let [firmware, hardware, high, low] = self.values;
        let short = |value: u32| u16::try_from(value & 0xFFFF).unwrap_or(u16::MAX);
        let [.., kind, _] = hardware.to_be_bytes();
        XbeeIdentity {
            mode: self.mode,
            firmware: short(firmware),
            hardware: short(hardware),
            protocol: Protocol::of(kind, short(firmware)),
            address: Address64(u64::from(high) << 32 | u64::from(low)),
        }
    }
}

fn failed(failure: Failure, now: f64) -> Step {
    Step::Failed { failure, until: now + RETRY_S }
}

fn link_mode<S: ByteStream>(link: &mut Link<S>, mode: ApiMode) {
    if link.mode() != mode {
        link.set_mode(mode);
    }
}
