//! The rules that every flight keeps, judged by the truth of its autopilots and what was sent.

use std::cell::RefCell;

use foxhunt_sim::EmulatedAutopilot;
use foxhunt_wire::mavlink::{Autopilot, FlightMode};

use super::{
    drawn::{Drawn, What},
    wire::{Far, Heard, Sent},
};

/// The judge of one drone.
#[derive(Debug)]
pub(super) struct Judge {
    autopilot: Autopilot,
    mode: FlightMode,
    armed: bool,
    /// True if this flight has ordered anything of it.
    pub(super) engaged: bool,
    /// Time since which somebody else has it, in seconds.
    taken: Option<f64>,
    /// True if its autopilot has begun the mode that somebody else chose.
    by_itself: bool,
    /// True if somebody else chose a mode, false if he ran its motors.
    mode_taken: bool,
    /// Last time at which another station sent it velocities in the mode of our orders, in seconds.
    pub(super) by_station: bool,
    /// True if a failsafe holds it in place, so that it may be brought home.
    pub(super) stopped: bool,
    /// Time since which it is down without an order, in seconds, if nobody has cleared it.
    grounded: Option<f64>,
    /// True if an order has brought it down, or stopped its motors, since they were started.
    ended: bool,
    /// The modes that were ordered and not seen, with when.
    ordered: Vec<(f64, FlightMode)>,
    /// Last time at which its motors were ordered to run, in seconds.
    started_at: f64,
    /// Last time at which its messages were late, in seconds.
    late_at: f64,
}

/// A heartbeat shows whose it is for so long, in seconds.
const FRESH_S: f64 = 0.5;

/// An order takes effect within this, in seconds.
const EFFECT_S: f64 = 6.0;

/// The driver's limit without any message, and a tick more, in seconds.
const SILENT_S: f64 = 3.5 + 0.3;

impl Judge {
    pub(super) fn new(autopilot: Autopilot, emulated: &EmulatedAutopilot<Far>) -> Self {
        Self {
            autopilot,
            mode: emulated.mode(),
            armed: false,
            engaged: false,
            taken: None,
            by_itself: false,
            mode_taken: false,
            by_station: false,
            stopped: false,
            grounded: None,
            ended: false,
            ordered: Vec::new(),
            started_at: f64::NEG_INFINITY,
            late_at: f64::NEG_INFINITY,
        }
    }

    /// Returns true if somebody else has it.
    pub(super) fn is_taken(&self) -> bool {
        self.taken.is_some()
    }

    /// Returns true if somebody else has had it for so long that foxhunt knows: by then nothing
    /// that it receives counts. While nothing is heard of it foxhunt cannot know.
    pub(super) fn has_been_taken(&self, now: f64) -> bool {
        self.mode_taken && self.taken.is_some_and(|since| now - since > SILENT_S + 2.5)
    }

    /// foxhunt was started again, by its pilot.
    pub(super) fn begin_again(&mut self) {
        (self.engaged, self.grounded, self.taken) = (false, None, None);
        (self.by_station, self.stopped) = (false, false);
        self.ordered.clear();
    }

    /// The pilot has cleared it to take off.
    pub(super) fn clear(&mut self) {
        self.grounded = None;
        if !self.armed {
            self.taken = None;
        }
    }

    /// Looks at the truth of now: who has changed its mode, and whether its motors run.
    pub(super) fn watch(
        &mut self,
        now: f64,
        drawn: &Drawn,
        drone: usize,
        emulated: &EmulatedAutopilot<Far>,
        up_m: f64,
    ) {
        let is = |what: fn(&What) -> Option<u32>| {
            drawn.happenings.iter().filter(|happening| happening.is_of(drawn, drone)).any(|of| {
                let from_s = f64::from(of.at) * 0.1 - 0.05;
                what(&of.what).is_some_and(|tenths| {
                    (from_s..from_s + f64::from(tenths) * 0.1 + 1.0).contains(&now)
                })
            })
        };
        if is(|what| if let What::Late(tenths) = what { Some(*tenths) } else { None }) {
            self.late_at = now;
        }
        let mode = emulated.mode();
        let autopilot = self.autopilot;
        let flies = emulated.is_airborne() && mode == autopilot.commanded();
        self.by_station |= flies
            && is(|what| if let What::Velocities(tenths) = what { Some(*tenths) } else { None });
        let armed = emulated.is_armed();
        let before = std::mem::replace(&mut self.mode, mode);
        let rests = !armed && !emulated.is_airborne();
        if before != mode {
            (self.by_station, self.stopped) = (false, false);
            let ordered =
                self.ordered.iter().any(|(at, wanted)| *wanted == mode && now - at < EFFECT_S);
            self.ordered.retain(|(_, wanted)| *wanted != mode);
            let held = autopilot == Autopilot::Px4
                && mode == autopilot.hold()
                && is(|what| matches!(what, What::Failsafe(2)).then_some(0));
            // PX4 holds when it has climbed.
            let climbed = before == autopilot.take_off() && mode == autopilot.hold() && up_m > 2.8;
            let word = mode == autopilot.before_take_off()
                && (autopilot == Autopilot::ArduPilot
                    || ![autopilot.land(), autopilot.return_to_launch(), autopilot.take_off()]
                        .contains(&before));
            let restarted = rests && mode == autopilot.at_boot();
            let chosen = is(|what| matches!(what, What::Takes(_) | What::GivesBack).then_some(0));
            // Between two heartbeats it may have been seen or not.
            if held && (self.by_itself || self.taken.is_none_or(|since| now - since < 2.2)) {
                (self.taken, self.stopped) = (None, true);
            } else if ordered || restarted || (autopilot == Autopilot::Px4 && climbed) {
                // By our order, or by nobody. One that met a choice of the same moment stands.
                let met = self.taken.is_some_and(|since| now - since < FRESH_S + 0.35);
                if ordered && met {
                    self.taken = None;
                }
            } else if rests && word {
                (self.taken, self.grounded) = (None, None);
            } else if self.taken.is_some() && mode == autopilot.commanded() {
                self.taken = None;
            } else if self.engaged && self.taken.is_none() {
                // PX4 goes to POSITION when set-points stop: its pilot has it there.
                (self.taken, self.by_itself) = (Some(now), !chosen);
                self.mode_taken = true;
            } else if chosen {
                self.by_itself = false;
            }
        }
        match (std::mem::replace(&mut self.armed, armed), armed) {
            (false, true) => {
                self.ended = false;
                if self.engaged && now - self.started_at > EFFECT_S && self.taken.is_none() {
                    (self.taken, self.mode_taken) = (Some(now), false);
                }
            }
            (true, false) if self.engaged && (!self.ended || self.taken.is_some()) => {
                self.grounded = Some(now);
            }
            _ => {}
        }
    }

    /// Judges what was sent since the last time.
    pub(super) fn judge(&mut self, now: f64, heard: &RefCell<Heard>) -> Vec<String> {
        let mut wrong = Vec::new();
        let heard = &mut *heard.borrow_mut();
        let late_s = if now - self.late_at < 3.0 { 1.2 } else { 0.0 };
        let silent_s = heard.beat_at.map_or(0.0, |at| now - at);
        for sent in heard.sent.drain(..) {
            let taken_s = self.taken.map(|since| now - since);
            let seen = taken_s.is_some_and(|taken_s| taken_s > FRESH_S + 0.25 + late_s);
            let orders = !matches!(sent, Sent::Beat | Sent::Goal);
            if orders && seen {
                wrong.push(format!("{now:.1} s: {sent:?} sent, {taken_s:?} s after it was taken"));
            }
            let beats = taken_s.is_some_and(|taken_s| {
                // Set-points do nothing in another mode; two heartbeats may be needed.
                taken_s > 3.4 + late_s && silent_s < taken_s - 2.2 - late_s
            });
            if sent == Sent::Goal && beats {
                wrong.push(format!("{now:.1} s: a goal sent, {taken_s:?} s after it was taken"));
            }
            let nothing_s = heard.any_at.map_or(0.0, |at| now - at);
            if nothing_s > SILENT_S && !self.by_station {
                wrong
                    .push(format!("{now:.1} s: {sent:?} sent, nothing heard for {nothing_s:.1} s"));
            }
            let down = self.grounded.is_some_and(|since| now - since > FRESH_S + 0.25 + late_s);
            if matches!(sent, Sent::Arm | Sent::TakeOff) && down {
                wrong.push(format!("{now:.1} s: {sent:?} sent, and nobody has cleared it"));
            }
            let land = self.autopilot.land();
            let home = self.autopilot.return_to_launch();
            match sent {
                Sent::Mode(mode) => {
                    self.ended |= [land, home].contains(&mode);
                    self.ordered.push((now, mode));
                }
                Sent::TakeOff => self.ordered.push((now, self.autopilot.take_off())),
                Sent::Arm => {
                    self.started_at = now;
                    // Another station started them in the same second: nothing tells whose they
                    // are.
                    if self.armed && !seen && !self.mode_taken {
                        self.taken = None;
                    }
                }
                Sent::Disarm => self.ended = true,
                Sent::Beat | Sent::Goal => {}
            }
            self.engaged |= orders;
        }
        wrong
    }
}
