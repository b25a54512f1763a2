use std::fmt;

use serde::{Deserialize, Serialize};

/// An autopilot's firmware.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Autopilot {
    /// ArduCopter.
    #[default]
    ArduPilot,
    /// PX4.
    Px4,
}

impl Autopilot {
    /// The mode that takes goals from a companion computer: GUIDED, or OFFBOARD.
    #[must_use]
    pub fn commanded(self) -> FlightMode {
        self.mode(4, px4(6, 0))
    }

    /// The mode in which it is armed and ordered to take off.
    #[must_use]
    pub fn before_take_off(self) -> FlightMode {
        self.mode(4, px4(4, 3))
    }

    /// The mode that climbs after the order to take off.
    #[must_use]
    pub fn take_off(self) -> FlightMode {
        self.mode(4, px4(4, 2))
    }

    /// The mode that stays in place: LOITER, or HOLD.
    #[must_use]
    pub fn hold(self) -> FlightMode {
        self.mode(5, px4(4, 3))
    }

    /// The mode that lands in place.
    #[must_use]
    pub fn land(self) -> FlightMode {
        self.mode(9, px4(4, 6))
    }

    /// The mode that comes back and lands.
    #[must_use]
    pub fn return_to_launch(self) -> FlightMode {
        self.mode(6, px4(4, 5))
    }

    /// The mode that a pilot flies by hand with a held place: POSHOLD, or POSITION.
    #[must_use]
    pub fn by_hand(self) -> FlightMode {
        self.mode(16, px4(3, 0))
    }

    /// The mode after power-up: STABILIZE, or MANUAL.
    #[must_use]
    pub fn at_boot(self) -> FlightMode {
        self.mode(0, px4(1, 0))
    }

    fn mode(self, ardupilot: u32, px4: u32) -> FlightMode {
        let custom = if self == Self::ArduPilot { ardupilot } else { px4 };
        FlightMode { autopilot: self, custom }
    }
}

impl fmt::Display for Autopilot {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(if *self == Self::ArduPilot { "ArduPilot" } else { "PX4" })
    }
}

/// A mode of PX4: main and sub mode in the upper half of the custom mode.
const fn px4(main: u32, sub: u32) -> u32 {
    main << 16 | sub << 24
}

/// An autopilot's flight mode: the custom mode of its heartbeats.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FlightMode {
    /// The autopilot that the mode belongs to.
    pub autopilot: Autopilot,
    /// Number of the mode.
    pub custom: u32,
}

/// ArduCopter's modes (`ardupilot/ArduCopter/mode.h`).
const ARDUCOPTER: [(u32, &str); 26] = [
    (0, "STABILIZE"),
    (1, "ACRO"),
    (2, "ALT_HOLD"),
    (3, "AUTO"),
    (4, "GUIDED"),
    (5, "LOITER"),
    (6, "RTL"),
    (7, "CIRCLE"),
    (9, "LAND"),
    (11, "DRIFT"),
    (13, "SPORT"),
    (14, "FLIP"),
    (15, "AUTOTUNE"),
    (16, "POSHOLD"),
    (17, "BRAKE"),
    (18, "THROW"),
    (19, "AVOID_ADSB"),
    (20, "GUIDED_NOGPS"),
    (21, "SMART_RTL"),
    (22, "FLOWHOLD"),
    (23, "FOLLOW"),
    (24, "ZIGZAG"),
    (25, "SYSTEMID"),
    (26, "AUTOROTATE"),
    (27, "AUTO_RTL"),
    (28, "TURTLE"),
];

/// PX4's (`px4_custom_mode.h`).
const PX4: [(u32, &str); 15] = [
    (px4(1, 0), "MANUAL"),
    (px4(2, 0), "ALTITUDE"),
    (px4(3, 0), "POSITION"),
    (px4(4, 1), "READY"),
    (px4(4, 2), "TAKEOFF"),
    (px4(4, 3), "HOLD"),
    (px4(4, 4), "MISSION"),
    (px4(4, 5), "RETURN"),
    (px4(4, 6), "LAND"),
    (px4(4, 8), "FOLLOW"),
    (px4(4, 9), "PRECISION_LAND"),
    (px4(5, 0), "ACRO"),
    (px4(6, 0), "OFFBOARD"),
    (px4(7, 0), "STABILIZED"),
    (px4(10, 0), "TERMINATION"),
];

impl FlightMode {
    /// The mode of a name, such as `GUIDED`, whatever its case.
    #[must_use]
    pub fn named(autopilot: Autopilot, name: &str) -> Option<Self> {
        let (custom, _) =
            names(autopilot).iter().find(|(_, known)| known.eq_ignore_ascii_case(name))?;
        Some(Self { autopilot, custom: *custom })
    }

    /// PX4's main mode and sub mode, as orders for a mode carry them.
    #[must_use]
    pub fn main_and_sub(self) -> (u8, u8) {
        let [_, _, main, sub] = self.custom.to_le_bytes();
        (main, sub)
    }

    /// PX4's mode of a main mode and a sub mode.
    #[must_use]
    pub fn px4(main: u8, sub: u8) -> Self {
        Self { autopilot: Autopilot::Px4, custom: px4(u32::from(main), u32::from(sub)) }
    }
}

fn names(autopilot: Autopilot) -> &'static [(u32, &'static str)] {
    match autopilot {
        Autopilot::ArduPilot => &ARDUCOPTER,
        Autopilot::Px4 => &PX4,
    }
}

impl fmt::Display for FlightMode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match names(self.autopilot).iter().find(|(custom, _)| *custom == self.custom) {
            Some((_, name)) => f.write_str(name),
            None => write!(f, "mode {}", self.custom),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn modes_have_their_names_and_numbers() {
        let named = |autopilot, name| FlightMode::named(autopilot, name).expect("a known name");
        assert_eq!(Autopilot::ArduPilot.commanded(), named(Autopilot::ArduPilot, "guided"));
        assert_eq!(Autopilot::Px4.commanded().custom, 0x6_0000);
        assert_eq!(Autopilot::Px4.return_to_launch().custom, 0x504_0000);
        assert_eq!(Autopilot::Px4.land().main_and_sub(), (4, 6));
        assert_eq!(FlightMode::px4(4, 3), named(Autopilot::Px4, "HOLD"));
        for autopilot in [Autopilot::ArduPilot, Autopilot::Px4] {
            for (custom, name) in names(autopilot) {
                assert_eq!(named(autopilot, name), FlightMode { autopilot, custom: *custom });
                assert_eq!(FlightMode { autopilot, custom: *custom }.to_string(), *name);
            }
        }
        let unknown = FlightMode { autopilot: Autopilot::ArduPilot, custom: 99 };
        assert_eq!(unknown.to_string(), "mode 99");
    }
}
