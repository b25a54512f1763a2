use std::f64::consts::PI;

/// A part of time and frequency that a signal takes, in a channel's samples and cycles per sample
/// about the band's centre.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Extent {
    pub(super) start: f64,
    pub(super) length: f64,
    pub(super) frequency: f64,
    /// Over the noise's power density.
    pub(super) energy: f64,
}

/// How far the filter of a channel smears a pulse's ends, in samples.
const SMEAR: f64 = 3.0;
/// What is taken for leakage: up to 6 dB above the bound, as pulses have no exact shape.
const MARGIN: f64 = 4.0;

impl Extent {
    fn end(&self) -> f64 {
        self.start + self.length
    }

    /// Whether another, weaker one is part of this one: what a window of the other's place and
    /// length would hold of a rectangular pulse like this.
    ///
    /// Over an overlap o of both, at a distance Δ in frequency, a tone's sum is at most
    /// min(o, 1/(πΔ)) amplitudes.
    pub(super) fn hides(&self, other: &Self) -> bool {
        let first = other.start.max(self.start - SMEAR);
        let overlap = other.end().min(self.end() + SMEAR) - first;
        if overlap <= 0.0 {
            return false;
        }
        let away = (other.frequency - self.frequency).abs();
        let near = away < 1.0 / other.length + 0.5 / self.length;
        if near && overlap >= 0.5 * self.length.min(other.length) {
            return true;
        }
        let sum = if away > 0.0 { overlap.min(1.0 / (PI * away)) } else { overlap };
        other.energy < MARGIN * self.energy / self.length * sum * sum / other.length
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn side_lobes_are_hidden_and_others_are_not() {
        let strong = Extent { start: 1000.0, length: 100.0, frequency: 0.1, energy: 1e5 };
        let weak = |start, length, frequency, energy| Extent { start, length, frequency, energy };
        // The first side lobe, −13 dB, and one far off, −40 dB.
        assert!(strong.hides(&weak(1000.0, 100.0, 0.115, 5e3)));
        assert!(strong.hides(&weak(1000.0, 100.0, 0.1 + 0.325, 10.0)));
        // 10 dB above the leakage there.
        assert!(!strong.hides(&weak(1000.0, 100.0, 0.1 + 0.325, 100.0)));
        // Right after it, at the same frequency; and half in it.
        assert!(!strong.hides(&weak(1104.0, 100.0, 0.1, 30.0)));
        assert!(strong.hides(&weak(1050.0, 100.0, 0.1, 2e4)));
        // A narrow window inside it.
        assert!(strong.hides(&weak(1040.0, 12.0, 0.1, 1.2e4)));
    }
}
