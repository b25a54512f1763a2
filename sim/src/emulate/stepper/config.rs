use foxhunt_core::parameter::{FieldError, finite, in_range, require};
use serde::{Deserialize, Serialize};

/// The stepper and the switch of an emulated Arduino.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct EmulatedStepperConfig {
    /// The pins that lead to IN1, IN2, IN3 and IN4 of the motor's driver.
    pub pins: [u8; 4],
    /// Half steps of the motor in a turn of the antenna, as numerator and denominator.
    pub half_steps_per_turn: [u32; 2],
    /// The play of the gear in degrees.
    pub backlash_deg: f64,
    /// Direction of the antenna at the beginning, in degrees counter-clockwise from the nose; the
    /// gear is then pushed forwards.
    pub start_deg: f64,
    /// A switch that the antenna closes.
    pub switch: Option<EmulatedSwitch>,
    /// Half step of the coils, from 0 to 7, that the rotor stands at in the beginning. A motor that
    /// is switched on at another one jumps by up to four half steps.
    pub phase: u8,
    /// Half steps per second above which the rotor stands still while its coils go on; absent, it
    /// follows at any speed. A 28BYJ-48 follows some 1000.
    pub fastest_half_steps_per_s: Option<f64>,
    /// True if AccelStepper is in the sketch. It is commented out in the one that comes with
    /// ConfigurableFirmata.
    pub accel_stepper: bool,
    /// Number of steppers that the memory holds. Each Configure without a system reset before it
    /// leaks one, and the one that finds no room hangs the firmware.
    pub steppers_in_memory: u32,
}

/// A switch to ground that the antenna closes between two angles.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EmulatedSwitch {
    /// The pin that it connects to ground.
    pub pin: u8,
    /// The angle from which on, counter-clockwise, it is open again, in degrees from the nose.
    pub opens_at_deg: f64,
    /// Width of the closed part before that, in degrees.
    pub width_deg: f64,
}

impl Default for EmulatedStepperConfig {
    /// A 28BYJ-48 at pins 8 to 11, 64 · (31·32·26·22)/(9·11·10·9) half steps a turn, 3° of
    /// play; an antenna along the nose, without a switch; a rotor at half step 0 that follows at
    /// any speed; a sketch with AccelStepper, and memory for 12.
    fn default() -> Self {
        Self {
            pins: [8, 9, 10, 11],
            half_steps_per_turn: [64 * 31 * 32 * 26 * 22, 9 * 11 * 10 * 9],
            backlash_deg: 3.0,
            start_deg: 0.0,
            switch: None,
            phase: 0,
            fastest_half_steps_per_s: None,
            accel_stepper: true,
            steppers_in_memory: 12,
        }
    }
}

impl EmulatedStepperConfig {
    pub(super) fn check(&self) -> Result<(), FieldError> {
        let [numerator, denominator] = self.half_steps_per_turn.map(f64::from);
        let holds = numerator > 0.0 && denominator > 0.0;
        require(holds, "half_steps_per_turn", numerator, "a positive fraction")?;
        in_range("backlash_deg", self.backlash_deg, 0.0..=90.0, "between 0 and 90")?;
        finite("start_deg", self.start_deg)?;
        in_range("phase", f64::from(self.phase), 0.0..=7.0, "at most 7")?;
        if let Some(fastest) = self.fastest_half_steps_per_s {
            require(fastest > 0.0, "fastest_half_steps_per_s", fastest, "positive")?;
        }
        if let Some(EmulatedSwitch { opens_at_deg, width_deg, .. }) = self.switch {
            finite("switch.opens_at_deg", opens_at_deg)?;
            let narrow = (0.0..360.0).contains(&width_deg);
            require(narrow, "switch.width_deg", width_deg, "between 0 and 360")?;
        }
        Ok(())
    }
}
