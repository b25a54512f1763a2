/// The keying of a beacon: 16 bits of a millisecond each, first to last, then silence.
pub(super) const KEY: u16 = 0b1011_0010_1110_1001;
const BIT_S: f64 = 0.001;
const PERIOD_S: f64 = 0.05;

/// Returns true if the beacon sends at a time.
pub(super) fn sends(time: f64) -> bool {
    let bit = ((time / PERIOD_S).fract() * PERIOD_S / BIT_S).floor();
    if !(0.0..16.0).contains(&bit) {
        return false;
    }
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "from 0 to 15")]
    let bit = bit as u32;
    KEY << bit & 0x8000 != 0
}
