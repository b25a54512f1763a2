/// Pins of a stepper as AccelStepper energises them.
#[derive(Clone, Copy, Debug)]
pub(super) struct Wires {
    pub(super) pins: [u8; 4],
    pub(super) count: usize,
    /// Bit by bit, from the first pin on.
    pub(super) inverted: u8,
    pub(super) enable_pin: Option<u8>,
    patterns: &'static [u8],
}

/// Outputs for each step; bit 0 is the first pin.
const HALF_4: [u8; 8] = [0b0001, 0b0101, 0b0100, 0b0110, 0b0010, 0b1010, 0b1000, 0b1001];
const WHOLE_4: [u8; 4] = [0b0101, 0b0110, 0b1010, 0b1001];
const HALF_3: [u8; 6] = [0b100, 0b101, 0b001, 0b011, 0b010, 0b110];
const WHOLE_3: [u8; 3] = [0b100, 0b001, 0b010];
const WHOLE_2: [u8; 4] = [0b10, 0b11, 0b01, 0b00];
/// A driver's step pin is high for a microsecond; its direction is all that stays.
const DRIVER: [u8; 1] = [0b10];

impl Wires {
    /// Wires of an interface byte; `None` where the library has no such stepper.
    pub(super) fn new(interface: u8, pins: [u8; 4]) -> Option<Self> {
        let (count, patterns): (_, &[u8]) = match (interface >> 4 & 7, interface >> 1 & 7) {
            (1, _) => (2, &DRIVER),
            (2, _) => (2, &WHOLE_2),
            (3, 0) => (3, &WHOLE_3),
            (3, 1) => (3, &HALF_3),
            (4, 0) => (4, &WHOLE_4),
            (4, 1) => (4, &HALF_4),
            _ => return None,
        };
        Some(Self { pins, count, inverted: 0, enable_pin: None, patterns })
    }

    /// Each pin and its level at a position.
    pub(super) fn at(&self, position: i64) -> impl Iterator<Item = (u8, bool)> + use<> {
        let cycle = i64::try_from(self.patterns.len()).unwrap_or(1);
        let at = usize::try_from(position.rem_euclid(cycle)).unwrap_or(0);
        self.levels(self.patterns[at])
    }

    /// Each pin and its level without current.
    pub(super) fn off(&self) -> impl Iterator<Item = (u8, bool)> + use<> {
        self.levels(0)
    }

    fn levels(&self, outputs: u8) -> impl Iterator<Item = (u8, bool)> + use<> {
        let outputs = outputs ^ self.inverted;
        self.pins
            .into_iter()
            .take(self.count)
            .enumerate()
            .map(move |(i, pin)| (pin, outputs >> i & 1 == 1))
    }

    /// Half steps that a rotor makes at each step, its coils being at `wired`; `None` where it does
    /// not just follow.
    pub(super) fn gain(&self, wired: [u8; 4]) -> Option<i64> {
        if self.patterns != HALF_4 || self.inverted & 0x0F != 0 {
            return None;
        }
        let coil = |pin: u8| wired.iter().position(|at| *at == pin);
        let [a, c, b, d] = self.pins;
        let order = [coil(a)?, coil(b)?, coil(c)?, coil(d)?];
        let follows = |by: usize| (0..4).all(|i| (order[i] + by) % 4 == order[(i + 1) % 4]);
        if follows(1) { Some(1) } else { follows(3).then_some(-1) }
    }
}

/// Half step of a rotor, from 0 to 7, that current through coils IN1 to IN4 pulls it to; `None`
/// where they pull it nowhere.
pub(super) fn half_step(coils: [bool; 4]) -> Option<i64> {
    match coils {
        [true, false, false, false] => Some(0),
        [true, true, false, false] => Some(1),
        [false, true, false, false] => Some(2),
        [false, true, true, false] => Some(3),
        [false, false, true, false] => Some(4),
        [false, false, true, true] => Some(5),
        [false, false, false, true] => Some(6),
        [true, false, false, true] => Some(7),
        _ => None,
    }
}
