use std::f64::consts::TAU;

use super::EmulatedStepperConfig;

/// The motor's rotor, which its coils pull, and the gear between it and the antenna.
#[derive(Clone, Copy, Debug)]
pub(super) struct Gear {
    /// Half steps that the rotor has really made.
    rotor: i64,
    /// Half step of the coils where `rotor` is 0.
    phase: i64,
    /// The antenna's place, in half steps.
    antenna: f64,
    /// The play of the gear, in half steps.
    play: f64,
    /// A half step in radians.
    half_step: f64,
    start: f64,
}

impl Gear {
    pub(super) fn new(config: &EmulatedStepperConfig) -> Self {
        let [numerator, denominator] = config.half_steps_per_turn.map(f64::from);
        let half_step = TAU * denominator / numerator;
        let play = config.backlash_deg.to_radians() / half_step;
        let phase = config.phase.into();
        let start = config.start_deg.to_radians();
        Self { rotor: 0, phase, antenna: 0.0, play, half_step, start }
    }

    /// Half steps that the rotor has really made, forwards less backwards.
    pub(super) fn rotor(&self) -> i64 {
        self.rotor
    }

    /// Half step of the coils that the rotor stands at.
    pub(super) fn phase(&self) -> i64 {
        (self.rotor + self.phase).rem_euclid(8)
    }

    /// Pulls the rotor to the next place that belongs to a half step of the coils. Coils that are
    /// opposite to it, four half steps away, pull to neither side.
    pub(super) fn follow(&mut self, phase: i64) {
        match (phase - self.phase()).rem_euclid(8) {
            0 | 4 => {}
            ahead @ 1..4 => self.turn(ahead),
            ahead => self.turn(ahead - 8),
        }
    }

    /// Turns the rotor. It pushes the antenna forwards, and pulls it backwards after the play.
    #[expect(clippy::cast_precision_loss, reason = "2⁵³ half steps are not made")]
    pub(super) fn turn(&mut self, half_steps: i64) {
        self.rotor += half_steps;
        let rotor = self.rotor as f64;
        self.antenna = self.antenna.clamp(rotor, rotor + self.play);
    }

    /// The antenna's direction, in radians from the nose.
    pub(super) fn angle(&self) -> f64 {
        self.start + self.antenna * self.half_step
    }
}
