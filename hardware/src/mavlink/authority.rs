use foxhunt_wire::mavlink::{
    Autopilot, FlightMode,
    dialect::{MavCmd, MavMessage},
};

use crate::Hands;

/// Holder of the vehicle, as far as its heartbeats tell, and hence what may be sent to it.
///
/// It does no I/O and reads no clock: heartbeats, silences and orders are told to it, and every
/// message asks it on its way out.
#[derive(Debug)]
pub(super) struct Authority {
    hands: Hands,
    /// Mode of the last heartbeat.
    mode: Option<FlightMode>,
    /// Modes that were ordered and not seen yet, the oldest first.
    pending: Vec<FlightMode>,
    /// True if it was ordered to take off, or taken over.
    engaged: bool,
    /// True if its motors ran, or may have run, since it was ours.
    ran: bool,
    /// True if it is to come down, which a silence does not end.
    leaves: bool,
    /// Height at the last heartbeat, in metres.
    up_m: f64,
    /// Number of heartbeats in a row at which it has held its height instead of climbing.
    held: u32,
    /// Time of the last heartbeat that was read, in seconds.
    read_at: f64,
    /// Time of its last change of mode, in seconds.
    changed_at: f64,
    /// Reason why it is not in our hands.
    why: String,
}

/// A heartbeat, with what else is known of the vehicle when it is read.
#[derive(Clone, Copy, Debug)]
pub(super) struct Seen<'a> {
    pub mode: FlightMode,
    pub armed: bool,
    pub airborne: bool,
    /// True if its state is MAV_STATE_CRITICAL: a failsafe acts.
    pub failsafe: bool,
    /// True if the order to climb was accepted, and it is not up yet.
    pub climbs: bool,
    /// Height of the vehicle above its launch place, in metres.
    pub up_m: f64,
    /// True if it is as high as its take-off was to bring it.
    pub climbed: bool,
    /// True if its motors were ordered to run.
    pub started: bool,
    /// True if it was ordered to come down, or its motors to stop.
    pub ended: bool,
    /// The autopilot's last complaint, and when it came, in seconds.
    pub complaint: Option<(f64, &'a str)>,
}

/// The age in seconds up to which a heartbeat shows whose the vehicle is: orders that change its
/// mode or its motors follow a heartbeat this closely, so that none of them meets a choice of the
/// pilot that could have been read.
const FRESH_S: f64 = 0.5;

/// Heartbeats come at least this often on a link that works, in seconds.
const HEARD_S: f64 = 1.5;

/// Number of heartbeats beyond which a vehicle that was ordered to climb, has accepted that and
/// holds without rising is held by its pilot.
const HELD: u32 = 2;

/// It rises by more than this from one heartbeat to the next, in metres.
const RISES_M: f64 = 0.2;

/// A complaint explains a change of mode that follows it this closely, in seconds.
const EXPLAINS_S: f64 = 5.0;

impl Default for Authority {
    fn default() -> Self {
        Self {
            hands: Hands::Nobody,
            mode: None,
            pending: Vec::new(),
            engaged: false,
            ran: false,
            leaves: false,
            up_m: 0.0,
            held: 0,
            read_at: f64::NEG_INFINITY,
            changed_at: f64::NEG_INFINITY,
            why: String::new(),
        }
    }
}

impl Authority {
    pub(super) fn hands(&self) -> Hands {
        self.hands
    }

    /// Returns why it is not in our hands; empty while it is.
    pub(super) fn why(&self) -> &str {
        &self.why
    }

    pub(super) fn is_ours(&self) -> bool {
        self.hands == Hands::Ours
    }

    /// Returns the time of the last heartbeat that was read, in seconds.
    pub(super) fn read_at(&self) -> f64 {
        self.read_at
    }

    /// Returns true if our own heartbeats may go out after `silent_s` seconds without one of the
    /// vehicle: until the link counts as lost, so that its failsafe for a lost station acts then.
    pub(super) fn beats(silent_s: f64, limit_s: f64) -> bool {
        silent_s <= limit_s || silent_s.is_infinite()
    }

    /// Returns true if a message may be sent, where the link counts as `heard` or as lost:
    /// questions always; orders to what is ours and is heard; orders of mode or motors only right
    /// after a heartbeat.
    pub(super) fn permits(&self, message: &MavMessage, now: f64, heard: bool) -> bool {
        match message {
            MavMessage::COMMAND_LONG(command) => match command.command {
                MavCmd::MAV_CMD_SET_MESSAGE_INTERVAL | MavCmd::MAV_CMD_REQUEST_MESSAGE => true,
                MavCmd::MAV_CMD_CONDITION_YAW
                | MavCmd::MAV_CMD_DO_CHANGE_SPEED
                | MavCmd::MAV_CMD_IMAGE_START_CAPTURE
                | MavCmd::MAV_CMD_DO_DIGICAM_CONTROL => self.is_ours() && heard,
                _ => self.may_order(now),
            },
            MavMessage::SET_POSITION_TARGET_GLOBAL_INT(_)
            | MavMessage::SET_POSITION_TARGET_LOCAL_NED(_) => self.is_ours() && heard,
            _ => true,
        }
    }

    /// Returns true if its mode or its motors may be ordered.
    pub(super) fn may_order(&self, now: f64) -> bool {
        self.is_ours() && now - self.read_at <= FRESH_S
    }

    /// A take-off begins, or it is taken over: it is ours.
    pub(super) fn take(&mut self) {
        (self.hands, self.engaged) = (Hands::Ours, true);
        (self.ran, self.leaves) = (false, false);
        self.pending.clear();
        self.why.clear();
    }

    /// It is to take off in this flight: from now on motors that run without our order are somebody
    /// else's.
    pub(super) fn engage(&mut self) {
        self.engaged = true;
    }

    /// It is to come down. What is not heard is ordered to when its heartbeat shows that nobody
    /// else has it.
    pub(super) fn bring_down(&mut self, now: f64) {
        self.leaves = true;
        // In a silence its pilot may have it: the next heartbeat tells.
        let stopped = self.hands == Hands::Stopped && now - self.read_at <= HEARD_S;
        if stopped || self.hands == Hands::GivenBack {
            self.hands = Hands::Ours;
            self.pending.clear();
            self.why.clear();
        }
    }

    /// A mode was ordered, or will follow from what was ordered.
    pub(super) fn ordered(&mut self, mode: FlightMode) {
        self.pending.retain(|pending| *pending != mode);
        self.pending.push(mode);
    }

    /// Notes the pilot's consent to another take-off.
    pub(super) fn clear_to_take_off(&mut self) {
        if self.hands == Hands::Grounded {
            self.rest();
        }
    }

    /// Another station flies it in the mode of our orders.
    pub(super) fn yield_to_station(&mut self, why: String) {
        (self.hands, self.why) = (Hands::Station, why);
    }

    /// Gives it to its pilot: an order was given up in the air, and he has to see to it.
    pub(super) fn release(&mut self, why: String) {
        (self.hands, self.why) = (Hands::Pilot, why);
    }

    /// Nothing has been heard of it for longer than the limit. Returns true if it was ours until
    /// then.
    pub(super) fn falls_silent(&mut self) -> bool {
        let was_ours = matches!(self.hands, Hands::Ours | Hands::GivenBack);
        if was_ours {
            (self.hands, self.why) = (Hands::Unheard, "the link was lost".into());
        }
        was_ours
    }

    /// It stands on the ground, and may take off.
    pub(super) fn rest(&mut self) {
        (self.hands, self.ran, self.leaves) = (Hands::Nobody, false, false);
        self.pending.clear();
        self.why.clear();
    }

    /// Takes a heartbeat.
    pub(super) fn hear(&mut self, now: f64, seen: &Seen<'_>) {
        let before = self.mode.replace(seen.mode);
        let changed = before.is_some_and(|before| before != seen.mode);
        let rests = !seen.armed && !seen.airborne;
        self.ran |= self.engaged && !rests;
        let read_before = std::mem::replace(&mut self.read_at, now);
        let explained = seen.complaint.filter(|(at, _)| {
            // A complaint about an earlier change says nothing of this one.
            *at >= now - EXPLAINS_S - (now - read_before).clamp(0.0, 60.0) && *at > self.changed_at
        });
        if changed {
            self.changed_at = now;
        }
        let explained = explained.map(|(_, text)| text);
        match self.hands {
            Hands::Nobody if self.engaged && !rests => self.lose_motors(seen),
            Hands::Nobody => {}
            Hands::Ours => self.hear_ours(before, seen, explained),
            Hands::Unheard if rests && (self.ran || seen.started) => {
                self.ground("it came down while nothing was heard of it");
            }
            Hands::Unheard if rests => self.rest(),
            // A climb that ended in a silence has ended as it would have without.
            Hands::Unheard
                if (!changed && !self.may_be_held(seen.mode))
                    || self.is_pending(seen.mode)
                    || self.has_climbed(before, seen) =>
            {
                self.follow(seen.mode);
                let hands = if self.leaves { Hands::Ours } else { Hands::GivenBack };
                self.hands = hands;
                if self.leaves {
                    self.why.clear();
                }
            }
            Hands::Grounded if !rests => self.lose_motors(seen),
            Hands::Grounded if changed && is_word(before, seen.mode) => self.rest(),
            Hands::Grounded => {}
            _ if rests => {
                let why = self.why.clone();
                self.ground(&why);
            }
            // It was somewhere else in between, and nobody has chosen that but its pilot.
            Hands::Pilot | Hands::Autopilot | Hands::Stopped | Hands::Station
                if changed && seen.mode == seen.mode.autopilot.commanded() =>
            {
                (self.hands, self.why) = (Hands::GivenBack, "it was given back".into());
            }
            Hands::Unheard => self.lose(seen, explained),
            _ if changed => self.lose(seen, explained),
            // The failsafe acts no more, and its pilot has chosen to stay in this mode.
            Hands::Stopped if !seen.failsafe => self.lose(seen, None),
            _ => {}
        }
    }

    fn hear_ours(&mut self, before: Option<FlightMode>, seen: &Seen<'_>, why: Option<&str>) {
        let mode = seen.mode;
        let autopilot = seen.mode.autopilot;
        let rests = !seen.armed && !seen.airborne;
        if !rests && !seen.started && !seen.ended && before.is_some() {
            return self.lose_motors(seen);
        }
        let land = autopilot.land();
        let home = autopilot.return_to_launch();
        let follows = match before {
            _ if self.is_pending(mode) => true,
            // What runs at its first heartbeat was started by somebody else.
            None => rests,
            Some(before) if before == mode => true,
            // PX4 holds when it has landed, too.
            _ if self.has_climbed(before, seen) => true,
            Some(before) if autopilot == Autopilot::Px4 && mode == autopilot.hold() => {
                [land, home].contains(&before) && !seen.airborne
            }
            Some(before) => before == home && mode == land,
        };
        // A pilot who holds it before a heartbeat has shown that it climbs.
        let rises = seen.up_m - std::mem::replace(&mut self.up_m, seen.up_m) > RISES_M;
        let holds = autopilot == Autopilot::Px4 && mode == autopilot.hold();
        let held = holds && seen.climbs && !seen.climbed && !rises;
        self.held = if held { self.held + 1 } else { 0 };
        if !follows || self.held > HELD {
            self.lose(seen, why);
            if rests {
                let why = self.why.clone();
                self.ground(&why);
            }
            return;
        }
        self.follow(mode);
        if rests && self.ran {
            match seen.ended {
                true => self.rest(),
                false => self.ground("its motors were stopped, which we did not order"),
            }
        }
    }

    /// Returns true if PX4's pilot may have held it in a silence, with another mode on its way.
    fn may_be_held(&self, mode: FlightMode) -> bool {
        let px4 = mode.autopilot == Autopilot::Px4;
        px4 && mode == mode.autopilot.hold() && !self.pending.is_empty()
    }

    /// Returns true if its mode is the one in which PX4 ends a climb, at the height of that.
    fn has_climbed(&self, before: Option<FlightMode>, seen: &Seen<'_>) -> bool {
        let mode = seen.mode;
        let climb = seen.mode.autopilot.take_off();
        let climbed = before == Some(climb) || self.is_pending(climb);
        mode.autopilot == Autopilot::Px4 && mode == mode.autopilot.hold() && climbed && seen.climbed
    }

    fn is_pending(&self, mode: FlightMode) -> bool {
        self.pending.contains(&mode)
    }

    /// A mode is there: what was ordered before it does not come any more.
    fn follow(&mut self, mode: FlightMode) {
        if let Some(index) = self.pending.iter().position(|pending| *pending == mode) {
            self.pending.drain(..=index);
        }
    }

    fn lose_motors(&mut self, seen: &Seen<'_>) {
        self.lose(seen, None);
        self.why = "its motors run, which we did not order".into();
    }

    /// A mode that was not ordered: its pilot's, or its own.
    fn lose(&mut self, seen: &Seen<'_>, text: Option<&str>) {
        let mode = seen.mode;
        let autopilot = seen.mode.autopilot;
        // PX4 alone says that a failsafe and not its pilot has chosen the mode: ArduCopter's state
        // is critical while its pilot flies on, too.
        // What was somebody else's before that is so still.
        let holds = seen.failsafe
            && matches!(self.hands, Hands::Ours | Hands::GivenBack | Hands::Unheard)
            && autopilot == Autopilot::Px4
            && mode == autopilot.hold();
        self.hands = if [autopilot.land(), autopilot.return_to_launch()].contains(&mode) {
            Hands::Autopilot
        } else if holds {
            Hands::Stopped
        } else {
            Hands::Pilot
        };
        self.pending.clear();
        self.why = format!("its mode became {mode}, which we did not order");
        if let Some(text) = text {
            self.why = format!("{} ({text})", self.why);
        }
    }

    /// It stays on the ground until its pilot says otherwise.
    fn ground(&mut self, why: &str) {
        self.pending.clear();
        let mode = self.mode.map(|mode| mode.autopilot.before_take_off().to_string());
        let mode = mode.unwrap_or_default();
        self.why = format!(
            "{why}; it stays down until its pilot clears it to take off, or sets {mode} there"
        );
        self.hands = Hands::Grounded;
    }
}

/// Returns true if a change of mode on the ground is the pilot's word that it may take off again.
/// PX4 goes from a landing to HOLD by itself.
fn is_word(before: Option<FlightMode>, mode: FlightMode) -> bool {
    let autopilot = mode.autopilot;
    let landing = [autopilot.land(), autopilot.return_to_launch(), autopilot.take_off()];
    let by_itself =
        autopilot == Autopilot::Px4 && before.is_none_or(|before| landing.contains(&before));
    mode == autopilot.before_take_off() && !by_itself
}

#[cfg(test)]
mod tests {
    use foxhunt_wire::mavlink::dialect::{COMMAND_LONG_DATA, SET_POSITION_TARGET_GLOBAL_INT_DATA};
    use proptest::prelude::*;

    use super::*;

    fn seen(mode: FlightMode, armed: bool) -> Seen<'static> {
        Seen {
            mode,
            armed,
            airborne: armed,
            failsafe: false,
            climbs: false,
            up_m: 0.0,
            climbed: false,
            started: true,
            ended: false,
            complaint: None,
        }
    }

    fn orders() -> [MavMessage; 2] {
        let command = MavCmd::MAV_CMD_DO_SET_MODE;
        let order = COMMAND_LONG_DATA { command, ..COMMAND_LONG_DATA::default() };
        let goal = SET_POSITION_TARGET_GLOBAL_INT_DATA::default();
        [MavMessage::COMMAND_LONG(order), MavMessage::SET_POSITION_TARGET_GLOBAL_INT(goal)]
    }

    proptest! {
        /// Whatever heartbeats, silences and orders come: orders go out only to what is ours,
        /// orders of its mode only after a heartbeat that has just been read, and it becomes ours
        /// by nothing but a take-off, a take-over, or an order down that the pilot's hands permit.
        #[test]
        fn no_order_passes_it(
            px4 in any::<bool>(),
            steps in prop::collection::vec(
                (0_u8..8, 0_usize..5, any::<bool>(), 0.0_f64..9.0),
                1..60,
            ),
        ) {
            let autopilot = if px4 { Autopilot::Px4 } else { Autopilot::ArduPilot };
            let modes = [
                autopilot.commanded(),
                autopilot.by_hand(),
                autopilot.hold(),
                autopilot.land(),
                autopilot.return_to_launch(),
            ];
            let mut authority = Authority::default();
            let mut now = 0.0;
            let mut read_at = f64::NEG_INFINITY;
            let mut told = Vec::new();
            for (what, mode, armed, passes_s) in steps {
                now += passes_s;
                let before = authority.hands();
                match what {
                    0..4 => {
                        authority.hear(now, &seen(modes[mode], armed));
                        read_at = now;
                        let others =
                            [Hands::Pilot, Hands::Station, Hands::Autopilot, Hands::Grounded];
                        if others.contains(&before) {
                            prop_assert_ne!(authority.hands(), Hands::Ours);
                        }
                        if before == Hands::Ours && armed && modes[mode] == autopilot.by_hand() {
                            let last = told.last() == Some(&modes[mode]);
                            prop_assert!(last || authority.hands() != Hands::Ours);
                        }
                        told.push(modes[mode]);
                    }
                    4 => { authority.falls_silent(); }
                    5 => authority.clear_to_take_off(),
                    6 => {
                        authority.bring_down(now);
                        if matches!(before, Hands::Pilot | Hands::Autopilot | Hands::Station) {
                            prop_assert_eq!(authority.hands(), before);
                        }
                    }
                    _ if matches!(before, Hands::Nobody | Hands::GivenBack) => authority.take(),
                    _ => {}
                }
                let [mode, goal] = orders();
                let ours = authority.hands() == Hands::Ours;
                let fresh = now - read_at <= FRESH_S;
                prop_assert!(!authority.permits(&mode, now, true) || ours && fresh);
                prop_assert!(!authority.permits(&goal, now, true) || ours);
                prop_assert!(!authority.permits(&goal, now, false));
            }
        }
    }
}
