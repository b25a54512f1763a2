//! A drone of a mission: its devices, what is known of it, and the watch over its height.

use std::collections::VecDeque;

use foxhunt_core::{HeightAboveGround, PatternSource, Waypoint};
use foxhunt_hardware::{Aircraft, AircraftState, Hands, ReportedHeight};
use foxhunt_hunt::hunt::{Devices, Event};

use super::{Ending, eager::Ordered};

/// Modes of drones that come down.
const HOMEWARD: [&str; 3] = ["RTL", "RETURN", "LAND"];

/// A link that has brought nothing for longer does not carry an order that is given once, in
/// seconds.
const ALIVE_S: f64 = 1.0;

/// Time from an order to leave until its mode shows it, in seconds: the order waits for a
/// heartbeat, and is given five times a second apart.
const SHOWN_S: f64 = 8.0;

/// A drone with less than this share of its battery waits for nobody.
const LOW_BATTERY: f64 = 0.25;

/// Interval at which an order that was not followed is repeated, in seconds.
const ORDER_AGAIN_S: f64 = 2.0;

/// Silence of a link after which it counts as lost, in seconds.
const SILENT_S: f64 = 3.0;

/// A report that is older is of another place, in seconds: at 5 m/s of two metres away.
const FRESH_S: f64 = 0.4;

/// Duration of a difference until it is reported, in seconds: a tree or a roof is passed by then.
const LASTS_S: f64 = 3.0;

/// Heights agree again within this share of the tolerance.
const AGREEMENT: f64 = 0.5;

/// A drone of a [`Mission`](super::Mission): its devices, and what is known of it.
#[derive(Debug)]
pub struct FlownDrone<A, S> {
    /// Name of the drone.
    pub name: String,
    /// Aircraft of the drone.
    pub aircraft: A,
    /// Source with which it listens.
    pub source: S,
    /// Order of the hunt to a source that listens between the hunt's turns, too; absent for others.
    pub(crate) listens_between: Option<Ordered>,
    /// Present state of the drone; absent while its link fails.
    state: Option<AircraftState>,
    /// The state that was logged last.
    reported_state: Option<AircraftState>,
    /// The health that was logged last.
    reported_health: Option<Health>,
    /// True once it was ordered to take off, or taken over: before that it is not ours to bring
    /// down.
    engaged: bool,
    /// True if it may be taken over while it is in the air already.
    may_take_over: bool,
    /// Time of the last order to take off, to take our orders again or to come down, in seconds.
    last_order: f64,
    /// True if it has accepted the order to leave.
    leave_accepted: bool,
    /// Time of that order, in seconds.
    leave_accepted_at: f64,
    /// True if the hunt has landed it, and nobody else has had it since.
    landed_by_hunt: bool,
    /// Comparison of its own height above the ground with the elevation model's, if there is one.
    height_watch: Option<HeightWatch>,
}

/// Course of a drone while the flight is left.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Departure {
    /// It is on the ground, its motors at rest.
    Down,
    /// It is to be ordered down, and waited for.
    Ordered,
    /// It comes down by rules of its own, and is waited for.
    Awaited,
    /// Somebody has it, who keeps it: who that is.
    Left(String),
}

impl<A, S> FlownDrone<A, S> {
    /// A drone on the ground with its devices.
    pub fn new(name: impl Into<String>, aircraft: A, source: S) -> Self {
        Self {
            name: name.into(),
            aircraft,
            source,
            listens_between: None,
            state: None,
            reported_state: None,
            reported_health: None,
            engaged: false,
            may_take_over: false,
            last_order: f64::NEG_INFINITY,
            leave_accepted: false,
            leave_accepted_at: f64::NEG_INFINITY,
            landed_by_hunt: false,
            height_watch: None,
        }
    }

    /// Compares the height above the ground that it reports with that of its pose, in the air: what
    /// is more than `tolerance_m` metres apart is logged ([`Event::HeightDiffers`]).
    #[must_use]
    pub fn with_height_tolerance(mut self, tolerance_m: f64) -> Self {
        self.height_watch = Some(HeightWatch::new(tolerance_m));
        self
    }

    /// Returns true if it takes our orders.
    pub(crate) fn is_commanded(&self) -> bool {
        self.state.as_ref().is_some_and(|state| state.commanded)
    }

    /// Returns true if it never goes anywhere.
    pub(crate) fn is_rooted(&self) -> bool {
        self.state.as_ref().is_some_and(|state| state.rooted)
    }

    /// Returns true if it is known to be on the ground with its motors off.
    pub(crate) fn is_down(&self) -> bool {
        self.state
            .as_ref()
            .is_some_and(|state| !state.airborne && !state.armed && state.hands != Hands::Unheard)
    }

    /// Returns true if it is known to be in the air.
    pub(crate) fn is_airborne(&self) -> bool {
        self.state.as_ref().is_some_and(|state| state.airborne)
    }

    /// Allows that the drone is taken over if it is in the air already, in the mode that takes
    /// orders.
    pub(crate) fn allow_take_over(&mut self) {
        self.may_take_over = true;
    }

    /// Returns who flies it. A drone whose link fails counts as not heard.
    fn hands(&self) -> Hands {
        self.state.as_ref().map_or(Hands::Unheard, |state| match state.commanded {
            true => Hands::Ours,
            false => state.hands,
        })
    }

    /// Returns its course while the flight is left by a rule.
    pub(crate) fn departure(&self, ending: Ending) -> Departure {
        let hands = self.hands();
        let mode = self.state.as_ref().map_or("", |state| state.mode.as_str());
        let left = |who: &str| Departure::Left(format!("{} is left to {who}", self.name));
        match hands {
            Hands::Unheard if self.engaged => Departure::Ordered,
            // A take-off that has not left the ground is ended, too.
            _ if self.is_down() && (hands != Hands::Ours || self.leave_accepted) => Departure::Down,
            Hands::Ours => Departure::Ordered,
            Hands::GivenBack | Hands::Stopped if self.engaged && ending != Ending::Hold => {
                Departure::Ordered
            }
            Hands::Autopilot => Departure::Awaited,
            Hands::Station => left(&format!("another station, which flies it in {mode}")),
            Hands::Stopped => left(&format!("its autopilot, which holds it in {mode}")),
            Hands::Pilot => left(&format!("its pilot, who has it in {mode}; he keeps it")),
            _ => left(&format!("whoever flies it in {mode}")),
        }
    }

    /// Returns true if nothing may be expected of it any more: it is down, or nothing was received
    /// from it for more than `silent_s` seconds. A drone that the pilot flies may be given back.
    pub(crate) fn is_out(&self, silent_s: f64) -> bool {
        self.is_down() || self.state.as_ref().is_none_or(|state| state.silent_s > silent_s)
    }

    /// Takes note that the hunt has landed it.
    pub(crate) fn was_landed(&mut self) {
        self.landed_by_hunt = true;
    }

    /// Makes every order due at once, and the order to leave one that it has not accepted.
    pub(crate) fn reset_orders(&mut self) {
        self.last_order = f64::NEG_INFINITY;
        self.leave_accepted = false;
    }

    /// Returns true if it may hold its place while another drone comes home, or is coming home
    /// itself: it is in the air and in our hands, or on its way home by our order, which its mode
    /// may not show yet.
    pub(crate) fn can_wait(&self, time: f64) -> bool {
        self.state.as_ref().is_some_and(|state| {
            let charged = state.battery.is_none_or(|left| left > LOW_BATTERY);
            let ordered = state.hands == Hands::Ours && time - self.leave_accepted_at < SHOWN_S;
            let comes = ordered || HOMEWARD.contains(&state.mode.as_str());
            let ours = state.commanded || (self.leave_accepted && comes);
            state.airborne && ours && charged && state.silent_s <= SILENT_S
        })
    }

    /// Returns the reason why it is not up.
    pub(crate) fn hindrance(&self) -> &str {
        self.state.as_ref().map_or("its link has failed", |state| state.hindrance.as_str())
    }

    /// Returns true if an order is due; if so, it counts as given at `time`.
    fn takes_turn(&mut self, time: f64) -> bool {
        let due = time - self.last_order >= ORDER_AGAIN_S;
        if due {
            self.last_order = time;
        }
        due
    }
}

/// Returns true if `test` holds for all drones that go anywhere, or for all where none does: a
/// station, which is there for ever, keeps no flight alive.
pub(crate) fn all_that_move<A, S>(
    drones: &[FlownDrone<A, S>],
    test: impl Fn(&FlownDrone<A, S>) -> bool,
) -> bool {
    let some_move = drones.iter().any(|drone| !drone.is_rooted());
    drones.iter().filter(|drone| !(some_move && drone.is_rooted())).all(test)
}

impl<A: Aircraft, S> FlownDrone<A, S> {
    /// Describes how it is in the air before it was sent up, unless it may be taken over.
    pub(crate) fn flown_by_others(&self) -> Option<String> {
        let state = self.state.as_ref().filter(|state| state.airborne && state.armed)?;
        // One that takes orders without a take-over is flown by its pilot, as he is advised.
        if state.commanded {
            return None;
        }
        if state.offered && self.may_take_over {
            return None;
        }
        let how = match (state.offered, self.may_take_over) {
            (true, _) => "; allow a take-over only if nobody else flies it",
            (false, true) => "; a take-over needs GUIDED, or HOLD of PX4",
            (false, false) => "",
        };
        Some(format!("{} is in the air in {}, not by us{how}", self.name, state.mode))
    }

    /// Reads the aircraft's state, which serves its link. Adds an event for each change; `index` is
    /// the drone's number in the mission.
    pub(crate) fn read_state(
        &mut self,
        time: f64,
        index: usize,
        events: &mut VecDeque<Event>,
    ) -> Result<(), A::Error> {
        self.state = None;
        let state = self.aircraft.state()?;
        if !self.reported_state.as_ref().is_some_and(|reported| is_same(reported, &state)) {
            events.push_back(Event::Aircraft {
                time,
                drone: index,
                mode: state.mode.clone(),
                armed: state.armed,
                airborne: state.airborne,
                commanded: state.commanded,
                hindrance: state.hindrance.clone(),
            });
            self.reported_state = Some(state.clone());
        }
        let sigma = self.aircraft.position_sigma().map(|sigma| sigma.max());
        let health = Health::new(&state, sigma);
        if let Some(watch) = &mut self.height_watch
            && let Some(reported) = state.above_ground.filter(|_| state.airborne)
            && let Ok(pose) = self.aircraft.pose()
        {
            events.extend(watch.compare(time, index, reported, pose.position.z));
        }
        if self.reported_health.is_none_or(|reported| !reported.is_like(&health)) {
            let Health { battery, linked, position_sigma_m, above_ground } = health;
            events.push_back(Event::Health {
                time,
                drone: index,
                battery,
                linked,
                position_sigma_m,
                above_ground,
            });
            self.reported_health = Some(health);
        }
        if let Some(failure) = self.aircraft.device_failure() {
            let reason = failure.to_string();
            events.push_back(Event::DeviceFailed { time, drone: Some(index), reason });
        }
        self.landed_by_hunt &= matches!(state.hands, Hands::Ours | Hands::Unheard);
        self.state = Some(state);
        Ok(())
    }

    /// Returns the reason why it cannot take off yet, if there is one.
    pub(crate) fn not_ready(&mut self) -> Option<String> {
        match &self.state {
            None => Some("its link has failed".to_owned()),
            Some(state) if state.airborne || state.hindrance.is_empty() => {
                Some(self.aircraft.pose().err()?.to_string())
            }
            Some(state) => Some(state.hindrance.clone()),
        }
    }

    /// Has it take off, if that order is due. One that is up already, from a flight that was cut
    /// short, is taken as it is, where that is allowed.
    pub(crate) fn take_off(&mut self, time: f64, up_m: f64) -> Result<(), A::Error> {
        if !self.takes_turn(time) {
            return Ok(());
        }
        if !self.is_airborne() {
            if self.hands() == Hands::Grounded {
                return Ok(());
            }
            // It counts from the attempt on: an order may arrive though its link fails.
            self.engaged = true;
            return self.aircraft.take_off(up_m);
        }
        let offered = self.may_take_over && self.state.as_ref().is_some_and(|state| state.offered);
        if self.hands() == Hands::GivenBack || (offered && !self.engaged) {
            self.aircraft.take_over()?;
            self.engaged = true;
        }
        Ok(())
    }

    /// Has it take our orders again, if that is due, when its pilot has given it back, or its link
    /// is back and nobody has it. A mode that the pilot has chosen is never changed.
    pub(crate) fn take_over_again(&mut self, time: f64) {
        let back = self.is_airborne() && self.hands() == Hands::GivenBack;
        let lives = self.state.as_ref().is_some_and(|state| state.silent_s < ALIVE_S);
        if back && lives && self.takes_turn(time) {
            // What is in the way stands in its state, which is logged.
            let _ = self.aircraft.take_over();
        }
    }

    /// Passes on the pilot's word that it may take off again.
    pub(crate) fn clear_to_take_off(&mut self) {
        self.aircraft.clear_to_take_off();
    }

    /// Orders it to leave by a rule, if that order is due.
    pub(crate) fn order_to_leave(&mut self, time: f64, ending: Ending) -> Result<(), A::Error> {
        if !self.takes_turn(time) {
            return Ok(());
        }
        match ending {
            // Coming home would climb first, at its home and out of its touch-down.
            _ if self.landed_by_hunt => self.aircraft.land()?,
            Ending::Return => self.aircraft.return_to_launch()?,
            Ending::Land => self.aircraft.land()?,
            Ending::Hold if self.leave_accepted => {}
            Ending::Hold => {
                self.aircraft.spin(None)?;
                let position = self.aircraft.pose()?.position;
                self.aircraft.go_to(&Waypoint { position })?;
            }
        }
        if !std::mem::replace(&mut self.leave_accepted, true) {
            self.leave_accepted_at = time;
        }
        Ok(())
    }
}

impl<A: Aircraft, S: PatternSource> Devices for FlownDrone<A, S> {
    type Source = S;
    type Vehicle = A;

    fn devices(&mut self) -> (&mut S, &mut A) {
        (&mut self.source, &mut self.aircraft)
    }
}

/// State of an aircraft's battery, link, position and height above the ground.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Health {
    battery: Option<f64>,
    linked: bool,
    position_sigma_m: Option<f64>,
    above_ground: Option<HeightAboveGround>,
}

impl Health {
    fn new(state: &AircraftState, position_sigma_m: Option<f64>) -> Self {
        Self {
            battery: state.battery,
            linked: state.silent_s <= SILENT_S,
            position_sigma_m,
            above_ground: state.above_ground.map(|reported| reported.height),
        }
    }

    /// Returns true if the change is not noticeable: less than 5 % of the battery, half of σ, a
    /// metre and a fifth of the height.
    fn is_like(&self, other: &Self) -> bool {
        let source = |of: &Self| of.above_ground.map(|height| height.source);
        let metres = |of: &Self| of.above_ground.map(|height| height.metres);
        let near = |one: Option<f64>, other: Option<f64>, is_near: fn(f64, f64) -> bool| match (
            one, other,
        ) {
            (Some(one), Some(other)) => is_near(one, other),
            (one, other) => one.is_none() && other.is_none(),
        };
        self.linked == other.linked
            && source(self) == source(other)
            && near(metres(self), metres(other), |one, other| {
                (one - other).abs() < (0.2 * one.abs().max(other.abs())).max(1.0)
            })
            && near(self.battery, other.battery, |one, other| (one - other).abs() < 0.05)
            && near(self.position_sigma_m, other.position_sigma_m, |one, other| {
                (0.67..1.5).contains(&(one / other)) || one.max(other) < 0.5
            })
    }
}

/// Compares the height above the ground that a drone reports with that of an elevation model.
#[derive(Clone, Copy, Debug)]
struct HeightWatch {
    tolerance_m: f64,
    /// Time since when they have been too far apart, in seconds.
    since: Option<f64>,
    /// True if the difference was reported.
    reported: bool,
}

impl HeightWatch {
    fn new(tolerance_m: f64) -> Self {
        Self { tolerance_m, since: None, reported: false }
    }

    /// Compares what was reported with what is expected, in metres; returns what is to be logged of
    /// the drone with this number: once, until they agree again.
    fn compare(
        &mut self,
        time: f64,
        drone: usize,
        of: ReportedHeight,
        expected_m: f64,
    ) -> Option<Event> {
        if of.age_s > FRESH_S {
            return None;
        }
        let apart_m = (of.height.metres - expected_m).abs();
        if apart_m <= self.tolerance_m {
            self.since = None;
            self.reported &= apart_m > AGREEMENT * self.tolerance_m;
            return None;
        }
        let since = *self.since.get_or_insert(time);
        if self.reported || time - since < LASTS_S {
            return None;
        }
        self.reported = true;
        let reported = of.height;
        let tolerance_m = self.tolerance_m;
        Some(Event::HeightDiffers { time, drone, reported, expected_m, tolerance_m })
    }
}

/// Returns true if two states are one in the log, where batteries and ages make no difference.
fn is_same(one: &AircraftState, other: &AircraftState) -> bool {
    one.mode == other.mode
        && one.hindrance == other.hindrance
        && one.armed == other.armed
        && one.airborne == other.airborne
        && one.commanded == other.commanded
}

#[cfg(test)]
mod tests {
    use foxhunt_core::HeightSource;

    use super::*;

    #[test]
    fn small_changes_of_health_are_none() {
        let health = |battery, linked, position_sigma_m| Health {
            battery,
            linked,
            position_sigma_m,
            above_ground: None,
        };
        let known = health(Some(0.80), true, Some(1.0));
        assert!(known.is_like(&health(Some(0.76), true, Some(1.4))));
        assert!(!known.is_like(&health(Some(0.74), true, Some(1.0))));
        assert!(!known.is_like(&health(Some(0.80), false, Some(1.0))));
        assert!(!known.is_like(&health(Some(0.80), true, Some(1.6))));
        assert!(!known.is_like(&health(Some(0.80), true, None)));
        assert!(!known.is_like(&health(None, true, Some(1.0))));
        let sharp = health(None, true, Some(0.02));
        assert!(sharp.is_like(&health(None, true, Some(0.4))), "both are good enough");
        let high = |metres, source| Health {
            above_ground: Some(HeightAboveGround { metres, source }),
            ..known
        };
        let by = HeightSource::Rangefinder;
        assert!(high(4.0, by).is_like(&high(4.9, by)) && high(40.0, by).is_like(&high(46.0, by)));
        assert!(!high(4.0, by).is_like(&high(5.1, by)) && !high(40.0, by).is_like(&high(51.0, by)));
        assert!(!high(4.0, by).is_like(&high(4.0, HeightSource::Terrain)));
        assert!(!high(4.0, by).is_like(&known));
        let state = |silent_s| AircraftState { silent_s, ..AircraftState::default() };
        assert!(Health::new(&state(2.9), None).linked && !Health::new(&state(3.1), None).linked);
    }

    #[test]
    fn a_station_keeps_no_dead_flight_alive() {
        let drone = |rooted, airborne, silent_s| {
            let state = AircraftState {
                rooted,
                airborne,
                armed: airborne,
                silent_s,
                ..AircraftState::default()
            };
            FlownDrone { state: Some(state), ..FlownDrone::new("one", (), ()) }
        };
        let is_dead = |drones: &[FlownDrone<(), ()>]| {
            let down = all_that_move(drones, FlownDrone::is_down);
            [down, all_that_move(drones, |drone| drone.is_out(5.0))]
        };
        let station = || drone(true, true, 0.0);
        assert_eq!(is_dead(&[station(), drone(false, false, 0.0)]), [true, true]);
        assert_eq!(is_dead(&[station(), drone(false, true, 6.0)]), [false, true]);
        assert_eq!(is_dead(&[station(), drone(false, true, 0.0)]), [false, false]);
        assert_eq!(is_dead(&[station(), station()]), [false, false], "a hunt of stations alone");
        assert_eq!(is_dead(&[drone(true, false, 0.0)]), [true, true]);
    }

    /// The times at which a watch of 4 m reports, of heights that are so far apart each second.
    fn reports(apart: &[f64], age_s: f64) -> Vec<f64> {
        let mut watch = HeightWatch::new(4.0);
        let compared = apart.iter().zip(0_u32..).filter_map(|(apart, second)| {
            let height =
                HeightAboveGround { metres: 10.0 + apart, source: HeightSource::Rangefinder };
            let event = watch.compare(second.into(), 0, ReportedHeight { height, age_s }, 10.0)?;
            Some(event.time())
        });
        compared.collect()
    }

    #[test]
    fn a_difference_is_reported_once_while_it_lasts() {
        assert_eq!(reports(&[4.5; 20], 0.1), [3.0]);
        assert_eq!(reports(&[-4.5; 20], 0.1), [3.0]);
        assert_eq!(reports(&[3.9; 20], 0.1), [0.0; 0]);
        assert_eq!(reports(&[4.5; 20], 0.5), [0.0; 0], "an old report");
        let passed = [4.5, 4.5, 4.5, 0.0, 4.5, 4.5, 4.5, 0.0];
        assert_eq!(reports(&passed, 0.1), [0.0; 0], "a tree");
        // 3 m are no agreement again, 1 m are.
        let apart = [5.0, 5.0, 5.0, 5.0, 3.0, 5.0, 5.0, 5.0, 5.0, 1.0, 5.0, 5.0, 5.0, 5.0, 5.0];
        assert_eq!(reports(&apart, 0.1), [3.0, 13.0]);
    }
}
