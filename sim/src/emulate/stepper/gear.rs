use std::f64::consts::TAU;

use super::EmulatedStepperConfig;

/// What is between the motor and the antenna.
#[derive(Clone, Copy, Debug)]
pub(super) struct Gear {
    /// Half steps that the rotor has really made.
    rotor: i64,
    /// Where the antenna is, in half steps.
    antenna: f64,
    /// In half steps.
    play: f64,
    /// In radians.
    half_step: f64,
    start: f64,
}

impl Gear {
    pub(super) fn new(config: &EmulatedStepperConfig) -> Self {
        let [numerator, denominator] = config.half_steps_per_turn.map(f64::from);
        let half_step = TAU * denominator / numerator;
        let play = config.backlash_deg.to_radians() / half_step;
        Self { rotor: 0, antenna: 0.0, play, half_step, start: config.start_deg.to_radians() }
    }

    /// Turns the rotor. It pushes the antenna forwards, and pulls it backwards after the play.
    #[expect(clippy::cast_precision_loss, reason = "2⁵³ half steps are not made")]
    pub(super) fn turn(&mut self, half_steps: i64) {
        self.rotor += half_steps;
        let rotor = self.rotor as f64;
        self.antenna = self.antenna.clamp(rotor, rotor + self.play);
    }

    /// Where the antenna looks, in radians from the nose.
    pub(super) fn angle(&self) -> f64 {
        self.start + self.antenna * self.half_step
    }
}
