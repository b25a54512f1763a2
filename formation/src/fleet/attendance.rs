use core::fmt;

use nalgebra::Vector3;

/// Limits beyond which a drone counts as one that takes part no more.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct AttendanceConfig {
    /// Number of turns in a row without a delivery after which it is silent.
    pub misses: u32,
    /// It is lost after its place was not known for this many seconds.
    pub lost_after_s: f64,
    /// It stands still after it was under way for this many seconds …
    pub still_after_s: f64,
    /// … and came no farther than this, in metres.
    pub still_m: f64,
    /// Seconds after which it gets another chance to move; twice as many the next time, and so on.
    pub tried_again_after_s: f64,
}

impl Default for AttendanceConfig {
    /// 2 turns, 5 s without a place, 15 s for half a metre, another chance after a minute.
    fn default() -> Self {
        Self {
            misses: 2,
            lost_after_s: 5.0,
            still_after_s: 15.0,
            still_m: 0.5,
            tried_again_after_s: 60.0,
        }
    }
}

/// A drone's part in the formation.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "snake_case"))]
pub enum Duty {
    /// It takes its place and listens.
    #[default]
    Formation,
    /// It does not move where it is sent; it listens where it is.
    Still,
    /// It delivers nothing; its turns are still requested, and not waited for.
    Silent,
    /// The place of the drone is not known.
    Lost,
    /// It takes no orders: its pilot has it, it flies by its own rules, or it is on the ground.
    Away,
    /// It is on its way home.
    Returning,
    /// It has landed, or was ordered to.
    Landed,
}

impl fmt::Display for Duty {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Formation => "in the formation",
            Self::Still => "stands still",
            Self::Silent => "silent",
            Self::Lost => "lost",
            Self::Away => "takes no orders",
            Self::Returning => "returning",
            Self::Landed => "landed",
        })
    }
}

/// Follows what one drone does, and decides whether the formation can count on it. One that drops
/// out is left out of the formation; one that comes back is taken in again.
///
/// A pure state machine: what happened goes in, a [`Duty`] comes out.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Attendance {
    config: AttendanceConfig,
    misses: u32,
    /// Time when its place was known last.
    located: f64,
    lost: bool,
    away: bool,
    /// Place and time since when it has not moved on.
    mark: (Vector3<f64>, f64),
    still: bool,
    /// True if it never goes anywhere.
    rooted: bool,
    /// Time to wait for another chance.
    patience_s: f64,
    /// Duty that it was ordered to do instead of hunting.
    dismissed: Option<Duty>,
}

impl Attendance {
    /// A drone that takes part, at `position` at a time in seconds.
    #[must_use]
    pub fn new(config: AttendanceConfig, time: f64, position: Vector3<f64>) -> Self {
        Self {
            config,
            misses: 0,
            located: time,
            lost: false,
            away: false,
            mark: (position, time),
            still: false,
            rooted: false,
            patience_s: config.tried_again_after_s,
            dismissed: None,
        }
    }

    /// Returns the present duty.
    #[must_use]
    pub fn duty(&self) -> Duty {
        match self.dismissed {
            Some(duty) => duty,
            None if self.away => Duty::Away,
            None if self.lost => Duty::Lost,
            None if self.misses >= self.config.misses => Duty::Silent,
            None if self.still || self.rooted => Duty::Still,
            None => Duty::Formation,
        }
    }

    /// Returns true if it cannot be counted on to fly where it is sent.
    #[must_use]
    pub fn is_astray(&self) -> bool {
        self.lost || self.still || self.rooted || self.away
    }

    /// Returns true if it takes no orders, so that nothing may be expected of it.
    #[must_use]
    pub fn is_away(&self) -> bool {
        self.away
    }

    /// Sets whether it takes orders; at first it does.
    pub fn set_away(&mut self, away: bool) {
        self.away = away;
    }

    /// Sets whether it never goes anywhere; at first it does. It listens where it is, and no
    /// formation counts on it.
    pub fn set_rooted(&mut self, rooted: bool) {
        self.rooted = rooted;
    }

    /// Returns true if it never goes anywhere.
    #[must_use]
    pub fn is_rooted(&self) -> bool {
        self.rooted
    }

    /// For how many seconds its place has not been known.
    #[must_use]
    pub fn unlocated_s(&self, time: f64) -> f64 {
        time - self.located
    }

    /// Takes note of the drone's place. `under_way` is true if the drone was sent somewhere else
    /// and has not come there.
    pub fn located(&mut self, time: f64, position: Vector3<f64>, under_way: bool) {
        self.located = time;
        self.lost = false;
        let moved = (position - self.mark.0).norm() > self.config.still_m;
        if moved {
            self.mark = (position, time);
            self.still = false;
            self.patience_s = self.config.tried_again_after_s;
        } else if !(under_way || self.still) {
            self.mark.1 = time;
        } else if under_way && time - self.mark.1 >= self.config.still_after_s {
            self.still = true;
        }
    }

    /// The next time at which its duty may change while it is located all the time, and `under_way`
    /// or not, in seconds; `None` for one that stood still and may move on at any time.
    #[must_use]
    pub fn next_event(&self, under_way: bool) -> Option<f64> {
        match (self.still, under_way) {
            (true, true) => None,
            (false, true) => Some(self.mark.1 + self.config.still_after_s),
            (_, false) => Some(f64::INFINITY),
        }
    }

    /// If it has stood still for long enough, it may take a place in the formation again, and has
    /// to move then.
    pub fn give_another_chance(&mut self, time: f64) {
        if self.still && time - self.mark.1 >= self.config.still_after_s + self.patience_s {
            self.still = false;
            self.mark.1 = time;
            self.patience_s *= 2.0;
        }
    }

    /// Time has passed, and its place may not be known.
    pub fn pass(&mut self, time: f64) {
        self.lost |= time - self.located >= self.config.lost_after_s;
    }

    /// It delivered a turn.
    pub fn delivered(&mut self) {
        self.misses = 0;
    }

    /// It was waited for, and delivered nothing.
    pub fn missed(&mut self) {
        self.misses = self.misses.saturating_add(1);
    }

    /// It was sent home.
    pub fn sent_home(&mut self) {
        self.dismissed = Some(Duty::Returning);
    }

    /// It was ordered to land.
    pub fn landed(&mut self) {
        self.dismissed = Some(Duty::Landed);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(east: f64) -> Vector3<f64> {
        Vector3::new(east, 0.0, 4.0)
    }

    fn drone() -> Attendance {
        Attendance::new(AttendanceConfig::default(), 0.0, at(0.0))
    }

    #[test]
    fn one_that_delivers_nothing_is_silent_until_it_delivers() {
        let mut drone = drone();
        drone.missed();
        assert_eq!(drone.duty(), Duty::Formation);
        drone.missed();
        assert_eq!(drone.duty(), Duty::Silent);
        drone.delivered();
        assert_eq!(drone.duty(), Duty::Formation);
    }

    #[test]
    fn one_that_is_not_located_is_lost_until_it_is_located() {
        let mut drone = drone();
        drone.pass(4.9);
        assert_eq!(drone.duty(), Duty::Formation);
        drone.pass(5.1);
        assert_eq!(drone.duty(), Duty::Lost);
        assert!(drone.is_astray());
        drone.located(6.0, at(0.0), false);
        assert_eq!(drone.duty(), Duty::Formation);
    }

    #[test]
    fn one_that_is_sent_and_does_not_go_stands_still_until_it_goes() {
        let mut drone = drone();
        drone.located(100.0, at(0.0), false);
        for tenth in 0..200 {
            drone.located(100.0 + 0.1 * f64::from(tenth), at(0.1), true);
        }
        assert_eq!(drone.duty(), Duty::Still);
        // Nobody sends it any more, and it is still where it was.
        drone.located(130.0, at(0.1), false);
        assert_eq!(drone.duty(), Duty::Still);
        drone.located(131.0, at(1.0), true);
        assert_eq!(drone.duty(), Duty::Formation);
        // Slow, but it goes.
        for second in 0..60 {
            drone.located(131.0 + f64::from(second), at(1.0 + 0.1 * f64::from(second)), true);
            assert_eq!(drone.duty(), Duty::Formation);
        }
    }

    #[test]
    fn one_that_stands_still_gets_another_chance_later_and_later() {
        let mut drone = drone();
        let mut sent = 0.0;
        for patience in [60.0, 120.0, 240.0] {
            drone.located(sent + 15.0, at(0.0), true);
            assert_eq!(drone.duty(), Duty::Still);
            drone.give_another_chance(sent + 14.0 + patience);
            assert_eq!(drone.duty(), Duty::Still);
            sent += 15.0 + patience;
            drone.give_another_chance(sent);
            assert_eq!(drone.duty(), Duty::Formation);
        }
        drone.located(sent + 1.0, at(1.0), true);
        drone.located(sent + 17.0, at(1.0), true);
        drone.give_another_chance(sent + 80.0);
        assert_eq!(drone.duty(), Duty::Formation, "it had moved");
    }

    #[test]
    fn one_that_takes_no_orders_is_away_until_it_takes_them() {
        let mut drone = drone();
        drone.set_away(true);
        drone.located(1.0, at(9.0), false);
        drone.delivered();
        assert!(drone.duty() == Duty::Away && drone.is_astray());
        drone.set_away(false);
        assert_eq!(drone.duty(), Duty::Formation);
    }

    #[test]
    fn one_that_is_rooted_stands_still_whatever_it_does() {
        let mut station = drone();
        station.set_rooted(true);
        assert!(station.duty() == Duty::Still && station.is_astray());
        station.located(1.0, at(9.0), true);
        station.give_another_chance(1000.0);
        assert_eq!(station.duty(), Duty::Still);
        station.sent_home();
        assert_eq!(station.duty(), Duty::Returning);
    }

    #[test]
    fn one_that_was_sent_home_is_counted_on_no_more() {
        let mut drone = drone();
        drone.sent_home();
        drone.missed();
        drone.missed();
        assert_eq!(drone.duty(), Duty::Returning);
        drone.landed();
        assert_eq!(drone.duty(), Duty::Landed);
    }
}
