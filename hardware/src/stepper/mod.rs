//! The antenna's stepper behind Firmata: its state, which the modules read and drive.

mod coils;
mod config;
mod driver;
mod error;
mod homing;
mod moving;
mod setup;
#[cfg(test)]
mod tests;

pub use config::{Approach, BeyondCable, FirmataConfig, Homing};
pub use error::{CoilFailure, FirmataStepperError, LostPosition, MissingStepper};

use std::io;

use foxhunt_wire::{
    ByteStream,
    firmata::{Decoder, Message, Reply, Request, StepperRequest},
};

use config::Gearing;
use error::HomeFailure;

/// Interval of queries in seconds.
const QUERY_S: f64 = 0.5;

/// More than this is not taken in at once, so that a stream that never ends does not hold up
/// anyone.
const MOST_READS: usize = 64;

/// Number of times that the last stop is sent, as no answer is awaited.
const LAST_STOPS: u32 = 3;

/// Interval of queries while it turns, in seconds: 60 half steps at the default speed.
const MONITOR_S: f64 = 0.1;

/// An antenna on a stepper motor behind Firmata: ConfigurableFirmata's AccelStepper, or the
/// firmware in `hardware/firmware`.
///
/// It sets its Arduino up by itself, again whenever that was reset or plugged in, and then goes to
/// its last ordered direction. Targets are exact fractions of a turn, rounded once, so that turns
/// do not add up to a drift. Messages that were lost on the way are made good by queries.
///
/// Firmata has no checksum. A position is believed if it is one that the order and the motor's
/// speed allow, and once the levels of the coils' pins are those of it; otherwise the motor is
/// stopped and the position is lost. A motor that turns is stopped when this is dropped.
#[derive(Debug)]
pub struct FirmataStepper<S: ByteStream, C> {
    config: FirmataConfig,
    gearing: Gearing,
    link: Link<S>,
    clock: C,
    phase: Phase,
    /// Place of the Arduino's own 0, in steps from the antenna's 0.
    base: i64,
    /// Place at which the motor last stood, in steps.
    motor: i64,
    side: Side,
    /// Reason why the antenna's direction is unknown, if it is.
    lost: Option<LostPosition>,
    home_failure: Option<HomeFailure>,
    /// Last ordered place of the antenna, in steps, until it is there.
    wanted: Option<i64>,
    /// The firmware's own name and version.
    firmware: Option<String>,
    switch_closed: Option<bool>,
    /// Levels of ports since they were last requested.
    levels: Levels,
    /// True if the motor has made a step since it was configured, and the coils followed.
    aligned: bool,
    /// True if the coils stood at `motor` when the motor was last aligned.
    is_held: bool,
    /// True if the first step goes forwards.
    forwards: bool,
    /// Number of first steps that did not show in the coils.
    misaligned: u8,
    coil_failure: Option<CoilFailure>,
    /// Number of repetitions of the present order.
    tries: u8,
    /// Time since which the motor is being set up.
    arranging_since: Option<f64>,
    /// True if the firmware lists pins for steppers.
    has_steppers: Option<bool>,
    /// True if the version came without a request, and nothing since.
    booting: bool,
    /// True if the link failed since its last reply.
    broken: bool,
}

/// Present activity of the stepper.
#[derive(Clone, Copy, Debug)]
enum Phase {
    /// Waiting for the report which firmware there is.
    Greeting(Wait),
    /// Set up; waiting for the report that it stands at its own 0.
    Arranging(Wait),
    /// Waiting for the report of the position, after the link was broken.
    Checking(Wait),
    /// Making its first step, which shows that its coils follow.
    Aligning(Leg),
    /// Waiting for reports that confirm the position.
    Confirming(Confirming),
    Homing(Stage),
    Moving {
        leg: Leg,
        /// Next place, in steps.
        then: Option<i64>,
        /// Side of the gear's play at the end.
        side: Side,
    },
    Standing {
        /// From when on the antenna does not swing.
        settled: f64,
        /// Time at which its position is queried next.
        watch_at: f64,
    },
}

/// Since when something is waited for, which is when it was first queried, and when it was last
/// queried.
#[derive(Clone, Copy, Debug)]
struct Wait {
    since: f64,
    queried_at: Option<f64>,
    every_s: f64,
    /// Number of queries.
    count: u32,
    /// Number of unexpected answers.
    doubts: u32,
}

impl Wait {
    fn new(now: f64) -> Self {
        Self { since: now, queried_at: None, every_s: QUERY_S, count: 0, doubts: 0 }
    }

    /// One that queries at other intervals, in seconds.
    fn every(self, every_s: f64) -> Self {
        Self { every_s, ..self }
    }

    /// Returns true if a query is due, and counts it as sent.
    fn is_due(&mut self, now: f64) -> bool {
        let due = self.queried_at.is_none_or(|queried_at| now >= queried_at + self.every_s - 1e-9);
        if due {
            if self.queried_at.is_none() {
                self.since = now;
            }
            self.queried_at = Some(now);
            self.count += 1;
        }
        due
    }
}

/// Reports that are to confirm where the motor stands.
#[derive(Clone, Copy, Debug)]
struct Confirming {
    /// Place to confirm, in steps.
    at: i64,
    next: Next,
    since: f64,
    /// Time of the last request.
    asked_at: f64,
    /// True if the levels of the coils are still to come.
    reads: bool,
    /// True if the position is still to come.
    asks: bool,
    /// Reports that contradicted.
    strikes: u8,
}

/// Step that follows on a confirmed place.
#[derive(Clone, Copy, Debug)]
enum Next {
    /// The first step.
    Align,
    /// A place to stand at, and where the play of the gear is.
    Stand(Side),
}

/// Side on which the play of the gear is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Side {
    Unknown,
    /// The antenna was pushed forwards: it is where the motor is.
    Below,
    /// The antenna was pulled backwards: it is ahead of the motor by the play.
    Above,
}

/// Stage of the search for the home switch.
#[derive(Clone, Copy, Debug)]
enum Stage {
    /// Waiting for two reports whether the switch is closed.
    Level {
        wait: Wait,
        seen: Option<bool>,
        /// Remaining distance of the search, in steps.
        left: i64,
    },
    /// Turning backwards until it closes.
    Seeking(Leg),
    /// Stopping at the closed switch; the position at which the search would have been given up.
    Stopping(Leg, i64),
    /// Going forwards by a step; how many there were.
    Leaving(Leg, u64),
    /// Waiting for the switch, until then; how many steps there were.
    Looking { until: f64, steps: u64, wait: Wait, opened: bool },
}

/// Messages to and from the Arduino. A motor that turns is stopped when it is dropped.
#[derive(Debug)]
struct Link<S: ByteStream> {
    stream: S,
    device: u8,
    decoder: Decoder<Reply>,
    connections: u32,
    bytes: u64,
    /// Queries of the position whose answers have not come.
    unanswered: u32,
    /// Queries since the last answer.
    silent: u32,
    /// True if the motor was sent somewhere, and is not known to stand.
    may_turn: bool,
}

impl<S: ByteStream> Link<S> {
    fn new(stream: S, device: u8) -> Self {
        let connections = stream.connections();
        let decoder = Decoder::default();
        Self {
            stream,
            device,
            decoder,
            connections,
            bytes: 0,
            unanswered: 0,
            silent: 0,
            may_turn: false,
        }
    }

    /// Returns the replies that have come.
    fn receive(&mut self) -> io::Result<Vec<Reply>> {
        let mut replies = Vec::new();
        let mut into = [0; 256];
        for _ in 0..MOST_READS {
            let count = self.stream.receive(&mut into)?;
            if count == 0 {
                break;
            }
            self.bytes = self.bytes.saturating_add(u64::try_from(count).unwrap_or(u64::MAX));
            let bytes = into.iter().take(count);
            replies.extend(bytes.filter_map(|byte| self.decoder.push(*byte)));
        }
        Ok(replies)
    }

    /// Returns true if the stream was opened again since the last call.
    fn was_reopened(&mut self) -> bool {
        let before = std::mem::replace(&mut self.connections, self.stream.connections());
        before != self.connections
    }

    fn send(&mut self, request: Request) -> io::Result<()> {
        let mut bytes = Vec::new();
        let invalid = |error| io::Error::new(io::ErrorKind::InvalidInput, error);
        request.encode(&mut bytes).map_err(invalid)?;
        self.stream.send(&bytes)
    }

    fn order(&mut self, request: StepperRequest) -> io::Result<()> {
        match request {
            StepperRequest::Report => {
                self.unanswered = self.unanswered.saturating_add(1);
                self.silent = self.silent.saturating_add(1);
            }
            StepperRequest::To(_) => self.may_turn = true,
            _ => {}
        }
        self.send(Request::Stepper { device: self.device, request })
    }

    /// Counts an answer to a query of the position.
    fn was_answered(&mut self) {
        self.unanswered = self.unanswered.saturating_sub(1);
        self.silent = 0;
    }

    /// Returns the number of queries of the position since the last one that was answered.
    fn silent(&self) -> u32 {
        self.silent
    }

    /// Returns the number of open queries of the position: one may have been garbled into an order.
    fn unanswered(&self) -> u32 {
        self.unanswered
    }

    /// Waits for no answer to older queries any more.
    fn forget_queries(&mut self) {
        self.unanswered = 0;
    }

    fn may_turn(&self) -> bool {
        self.may_turn
    }

    /// The motor is known to stand.
    fn has_stopped(&mut self) {
        self.may_turn = false;
    }

    /// Returns the number of bytes that have come.
    fn bytes(&self) -> u64 {
        self.bytes
    }

    /// Returns the number of unreadable messages.
    fn rejected(&self) -> u64 {
        self.decoder.rejected()
    }
}

impl<S: ByteStream> Drop for Link<S> {
    fn drop(&mut self) {
        if self.may_turn {
            for _ in 0..LAST_STOPS {
                // Nobody is left to whom a failure could be returned.
                let _ = self.order(StepperRequest::Stop);
            }
        }
    }
}

/// A move of the motor in one direction, or its stop, until it is known to have ended.
///
/// The link has no checksum, so that a report is believed within what the order and the motor's
/// speed allow. The message that a move is complete may be lost, and so may the order: the position
/// is queried while the motor turns, and once the move should have ended.
#[derive(Clone, Copy, Debug)]
struct Leg {
    /// Place of its end, in steps; `None` if it ends wherever the motor stops.
    to: Option<i64>,
    /// Greatest length, in steps.
    steps: u64,
    /// Beginning; `None` if the motor turned already.
    from: Option<i64>,
    /// Range in which the motor may be.
    lowest: i64,
    highest: i64,
    /// Place of the Arduino's own 0.
    zero: i64,
    began: f64,
    /// Seconds below which it cannot have ended.
    least_s: f64,
    ends_at: f64,
    query_at: f64,
    deadline: f64,
    /// Last reported position of the motor.
    last: Option<i64>,
    /// True if a report was elsewhere than at the Arduino's 0.
    stirred: bool,
    /// End of the move before it, whose message may still come.
    overtaken: Option<i64>,
    /// True if it was reported that it does not end.
    is_given_up: bool,
}

/// Action that is due about a move.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Due {
    Nothing,
    /// Query its position.
    RequestPosition,
    /// Query its position, and send its speed again: it should have ended.
    Urge,
    /// It has lasted for too long: this number of seconds.
    TimedOut(f64),
}

/// A reported position in the light of its move.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Seen {
    /// It is on its way.
    Going,
    /// The motor is at its target, or stands after a stop.
    Complete,
    /// It stands elsewhere on its way.
    Short,
    /// It is where this move does not lead, or sooner than it can be.
    Astray,
    /// The device's count was set to 0, which nobody ordered.
    Zeroed,
    /// The move has ended sooner than the motor turns.
    TooFast,
}

/// Levels of the Arduino's ports of eight pins, as far as they were reported since they were
/// requested.
type Levels = [Option<u8>; 16];
