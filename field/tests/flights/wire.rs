//! The link between foxhunt and an autopilot, and what is heard on it.

use std::{cell::RefCell, io, rc::Rc};

use foxhunt_core::Clock;
use foxhunt_sim::SimClock;
use foxhunt_wire::{
    ByteStream, MemoryStream,
    mavlink::{
        Autopilot, Codec, FlightMode,
        dialect::{MavCmd, MavMessage, MavType},
    },
};

/// Message that foxhunt sent.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Sent {
    Beat,
    Mode(FlightMode),
    Arm,
    Disarm,
    TakeOff,
    Goal,
}

/// Messages on a link since the last look at it.
#[derive(Debug, Default)]
pub(super) struct Heard {
    pub(super) sent: Vec<Sent>,
    /// Time of the autopilot's last heartbeat, in seconds.
    pub(super) beat_at: Option<f64>,
    /// Time of the last message received of it, in seconds.
    pub(super) any_at: Option<f64>,
}

/// foxhunt's end of a link.
pub(super) struct Tapped {
    pub(super) stream: MemoryStream,
    pub(super) autopilot: Autopilot,
    pub(super) heard: Rc<RefCell<Heard>>,
    pub(super) clock: SimClock,
    pub(super) codecs: [Codec; 2],
}

impl ByteStream for Tapped {
    fn receive(&mut self, into: &mut [u8]) -> io::Result<usize> {
        let count = self.stream.receive(into)?;
        self.codecs[0].push(into.get(..count).unwrap_or_default());
        while let Some(frame) = self.codecs[0].next_frame(0.0) {
            self.heard.borrow_mut().any_at = Some(self.clock.now());
            if let MavMessage::HEARTBEAT(beat) = &frame.message
                && beat.mavtype != MavType::MAV_TYPE_GCS
            {
                self.heard.borrow_mut().beat_at = Some(self.clock.now());
            }
        }
        Ok(count)
    }

    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.codecs[1].push(bytes);
        while let Some(frame) = self.codecs[1].next_frame(0.0) {
            let sent = self.sent(&frame.message);
            self.heard.borrow_mut().sent.extend(sent);
        }
        self.stream.send(bytes)
    }
}

impl Tapped {
    fn sent(&self, message: &MavMessage) -> Option<Sent> {
        let command = match message {
            MavMessage::HEARTBEAT(_) => return Some(Sent::Beat),
            MavMessage::SET_POSITION_TARGET_GLOBAL_INT(_) => return Some(Sent::Goal),
            MavMessage::COMMAND_LONG(command) => command,
            _ => return None,
        };
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "small numbers"
        )]
        let [first, second, third] =
            [command.param1 as u8, command.param2 as u8, command.param3 as u8];
        match command.command {
            MavCmd::MAV_CMD_DO_SET_MODE => Some(Sent::Mode(match self.autopilot {
                Autopilot::ArduPilot => {
                    FlightMode { autopilot: self.autopilot, custom: u32::from(second) }
                }
                Autopilot::Px4 => FlightMode::px4(second, third),
            })),
            MavCmd::MAV_CMD_COMPONENT_ARM_DISARM if first == 1 => Some(Sent::Arm),
            MavCmd::MAV_CMD_COMPONENT_ARM_DISARM => Some(Sent::Disarm),
            MavCmd::MAV_CMD_NAV_TAKEOFF => Some(Sent::TakeOff),
            _ => None,
        }
    }
}

/// The autopilot's end of a link, which goes on when foxhunt is started again.
#[derive(Clone)]
pub(super) struct Far(pub(super) Rc<RefCell<MemoryStream>>);

impl ByteStream for Far {
    fn receive(&mut self, into: &mut [u8]) -> io::Result<usize> {
        self.0.borrow_mut().receive(into)
    }

    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.0.borrow_mut().send(bytes)
    }
}
