use std::f64::consts::PI;

/// A part of time and frequency that a signal takes, in a channel's samples and cycles per sample
/// about the band's centre.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Extent {
    pub(super) start: f64,
    pub(super) length: f64,
    pub(super) frequency: f64,
    /// Energy over the noise's power density.
    pub(super) energy: f64,
}

/// Length by which the filter of a channel smears a pulse's ends, in samples.
pub(super) const SMEAR: f64 = 3.0;
/// Near a pulse's frequency, up to `NEAR` of its inverse length, up to this factor above the bound
/// is taken for leakage: 6 dB, as pulses have no exact shape. Farther off their ends are softer.
const MARGIN: f64 = 4.0;
const NEAR: f64 = 10.0;

impl Extent {
    fn end(&self) -> f64 {
        self.start + self.length
    }

    /// The most energy that a rectangular pulse like this has in a window of another one's place,
    /// length and frequency.
    ///
    /// Over an overlap o of both, at a distance Δ in frequency, a tone's sum is at most
    /// min(o, 1/(πΔ)) amplitudes.
    pub(super) fn leakage(&self, other: &Self) -> f64 {
        let overlap = self.overlap(other);
        let away = (other.frequency - self.frequency).abs();
        let sum = if away > 0.0 { overlap.min(1.0 / (PI * away)) } else { overlap };
        self.energy / self.length * sum * sum / other.length
    }

    fn overlap(&self, other: &Self) -> f64 {
        let first = other.start.max(self.start - SMEAR);
        (other.end().min(self.end() + SMEAR) - first).max(0.0)
    }

    /// Returns true if another, weaker one is part of this one: it is not above what leaks, or what
    /// is above that is below the threshold.
    pub(super) fn hides(&self, other: &Self, threshold: f64) -> bool {
        let overlap = self.overlap(other);
        if overlap <= 0.0 {
            return false;
        }
        let away = (other.frequency - self.frequency).abs();
        let near = away < 1.0 / other.length + 0.5 / self.length;
        if near && overlap >= 0.5 * self.length.min(other.length) {
            return true;
        }
        let leakage = self.leakage(other);
        let margin = if away * self.length < NEAR { MARGIN } else { 1.0 };
        // Screened on a grid, the other has lost up to 2.1 dB.
        let above = other.energy.sqrt() - leakage.sqrt();
        other.energy < margin * leakage || above < 0.78 * threshold.sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn side_lobes_are_hidden_and_others_are_not() {
        let strong = Extent { start: 1000.0, length: 100.0, frequency: 0.1, energy: 1e5 };
        let hides = |other: &Extent| strong.hides(other, 20.0);
        let weak = |start, length, frequency, energy| Extent { start, length, frequency, energy };
        // The first side lobe, −13 dB, and one far off, −40 dB.
        assert!(hides(&weak(1000.0, 100.0, 0.115, 5e3)));
        assert!(hides(&weak(1000.0, 100.0, 0.1 + 0.325, 10.0)));
        // 10 dB above the leakage there.
        assert!(!hides(&weak(1000.0, 100.0, 0.1 + 0.325, 100.0)));
        // Right after it, at the same frequency; and half in it.
        assert!(!hides(&weak(1104.0, 100.0, 0.1, 30.0)));
        assert!(hides(&weak(1050.0, 100.0, 0.1, 2e4)));
        // A narrow window inside it.
        assert!(hides(&weak(1040.0, 12.0, 0.1, 1.2e4)));
    }
}
