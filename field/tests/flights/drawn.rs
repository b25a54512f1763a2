use foxhunt_sim::{AutopilotFaults, FailsafeOrder, Interval, PilotOrder};
use foxhunt_wire::mavlink::Autopilot;
use proptest::prelude::*;

/// A flight that is drawn: who flies, and everything that happens.
#[derive(Clone, Debug)]
pub(super) struct Drawn {
    pub(super) autopilot: Autopilot,
    pub(super) drones: usize,
    /// True if the drones land where they are when it is over; otherwise they return.
    pub(super) lands: bool,
    /// True if the hunt itself brings them home and lands them when it is over.
    pub(super) flies_home: bool,
    pub(super) happenings: Vec<Happening>,
}

/// Event that happens to a drone, with its time in tenths of seconds.
#[derive(Clone, Copy, Debug)]
pub(super) struct Happening {
    pub(super) at: u32,
    pub(super) drone: usize,
    pub(super) what: What,
}

/// One thing that happens; durations in tenths of seconds.
#[derive(Clone, Copy, Debug)]
pub(super) enum What {
    /// The pilot chooses a mode of a list.
    Takes(usize),
    /// The pilot gives it back.
    GivesBack,
    /// Nothing gets through.
    Silent(u32),
    /// Its messages are lost.
    Unheard(u32),
    /// Messages to it are lost.
    Deaf(u32),
    /// Its messages come late, out of order and twice.
    Late(u32),
    /// A failsafe returns it, lands it, or holds it in place.
    Failsafe(usize),
    /// Another station sends it northwards.
    Velocities(u32),
    /// Another station runs its motors.
    Motors(u32),
    /// Its autopilot starts again, on the ground.
    Restarts,
    /// Its radio fails.
    Deafened(u32),
    /// The pilot clears all to take off again.
    Word,
    /// The pilot breaks off.
    BreaksOff,
    /// foxhunt is killed, and started again after a while.
    Killed(u32),
}

/// Time at which the pilot breaks off at last, in seconds.
pub(super) const BREAKS_OFF_S: f64 = 90.0;

impl Drawn {
    /// The flight of a firmware with what happens to its first drone: seconds, and what.
    pub(super) fn of(autopilot: Autopilot, drones: usize, happenings: &[(f64, What)]) -> Self {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "seconds")]
        let happening =
            |&(at, what): &(f64, What)| Happening { at: (at * 10.0) as u32, drone: 0, what };
        let happenings = happenings.iter().map(happening).collect();
        Self { autopilot, drones, lands: false, flies_home: false, happenings }
    }

    /// Flights of both firmwares, of one to five drones.
    pub(super) fn strategy() -> impl Strategy<Value = Self> {
        let autopilot = prop_oneof![Just(Autopilot::ArduPilot), Just(Autopilot::Px4)];
        // One and three drones are flown most.
        let drones = prop_oneof![3 => Just(1_usize), 2 => Just(2), 3 => Just(3), 1 => Just(5)];
        let happenings = prop::collection::vec(Happening::strategy(), 0..7);
        (autopilot, drones, any::<bool>(), happenings).prop_map(
            |(autopilot, drones, lands, happenings)| Self {
                autopilot,
                drones,
                lands,
                flies_home: false,
                happenings,
            },
        )
    }

    /// Events of a drone, as its emulated autopilot takes them.
    pub(super) fn faults(&self, drone: usize) -> AutopilotFaults {
        let mut faults = AutopilotFaults::default();
        let px4 = self.autopilot == Autopilot::Px4;
        let mut happenings: Vec<_> =
            self.happenings.iter().filter(|of| of.is_of(self, drone)).collect();
        happenings.sort_by_key(|happening| happening.at);
        for happening in happenings {
            let at_s = f64::from(happening.at) * 0.1;
            let during =
                |tenths: u32| Interval { from_s: at_s, to_s: Some(at_s + f64::from(tenths) * 0.1) };
            match happening.what {
                What::Takes(mode) => {
                    let modes = modes(self.autopilot);
                    let mode = modes[mode % modes.len()].to_owned();
                    faults.pilot.push(PilotOrder { at_s, mode });
                }
                What::GivesBack => {
                    let mode = if px4 { "HOLD" } else { "GUIDED" }.to_owned();
                    faults.pilot.push(PilotOrder { at_s, mode });
                }
                What::Failsafe(kind) => {
                    let modes = match px4 {
                        true => ["RETURN", "LAND", "HOLD"],
                        false => ["RTL", "LAND", "BRAKE"],
                    };
                    let mode = modes[kind % modes.len()].to_owned();
                    let text = "Battery Failsafe".to_owned();
                    faults.failsafes.push(FailsafeOrder { at_s, text, mode });
                }
                What::Silent(tenths) => faults.silent.push(during(tenths)),
                What::Unheard(tenths) => faults.unheard.push(during(tenths)),
                What::Deaf(tenths) => faults.deaf.push(during(tenths)),
                What::Late(tenths) => faults.late.push(during(tenths)),
                What::Velocities(tenths) => faults.velocities.push(during(tenths)),
                What::Motors(tenths) => faults.motors.push(during(tenths)),
                What::Restarts => faults.restarts_s.push(at_s),
                What::Deafened(_) | What::Word | What::BreaksOff | What::Killed(_) => {}
            }
        }
        faults
    }
}

/// Modes that the pilot takes it in.
fn modes(autopilot: Autopilot) -> &'static [&'static str] {
    match autopilot {
        Autopilot::ArduPilot => &["LOITER", "STABILIZE", "ALT_HOLD", "BRAKE", "RTL", "LAND"],
        Autopilot::Px4 => &["POSITION", "HOLD", "ALTITUDE", "MISSION", "RETURN", "LAND"],
    }
}

impl Happening {
    fn strategy() -> impl Strategy<Value = Self> {
        (0_u32..1100, 0_usize..5, What::strategy()).prop_map(|(at, drone, what)| Self {
            at,
            drone,
            what,
        })
    }

    pub(super) fn is_of(&self, drawn: &Drawn, drone: usize) -> bool {
        self.drone % drawn.drones == drone
    }
}

impl What {
    fn strategy() -> impl Strategy<Value = Self> {
        let short = || 5_u32..120;
        let long = || 20_u32..400;
        prop_oneof![
            4 => (0_usize..6).prop_map(Self::Takes),
            3 => Just(Self::GivesBack),
            2 => long().prop_map(Self::Silent),
            2 => long().prop_map(Self::Unheard),
            1 => long().prop_map(Self::Deaf),
            1 => long().prop_map(Self::Late),
            2 => (0_usize..3).prop_map(Self::Failsafe),
            1 => short().prop_map(Self::Velocities),
            1 => short().prop_map(Self::Motors),
            1 => Just(Self::Restarts),
            1 => long().prop_map(Self::Deafened),
            1 => Just(Self::Word),
            1 => Just(Self::BreaksOff),
            1 => short().prop_map(Self::Killed),
        ]
    }
}
