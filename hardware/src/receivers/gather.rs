use foxhunt_wire::receivers::NarrowBand;

use super::RtlTcpConfig;

/// Gathers the powers of a window after the settling.
#[derive(Clone, Debug)]
pub(super) struct Gather {
    /// Bytes that are left out before it.
    skip: u64,
    band: NarrowBand,
    /// In the order in which they came; as many as are wanted at most.
    powers: Vec<f64>,
    wanted: usize,
    /// Bytes at an end of the scale, of all.
    clipped: u64,
    taken: u64,
}

impl Gather {
    /// From the present byte on, which may be a Q whose I is gone. `None` if the band is none.
    pub(super) fn new(config: &RtlTcpConfig, odd: bool) -> Option<Self> {
        let rate = f64::from(config.sample_rate_hz);
        let band = NarrowBand::new(rate, f64::from(config.beside_hz), config.bandwidth_hz)?;
        let count = |seconds: f64| {
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "at most 10 s of 10 MS/s"
            )]
            let count = (seconds * rate).clamp(0.0, 1e8) as u32;
            count
        };
        let wanted = usize::try_from(count(config.window_s) / band.block()).ok()?.max(1);
        let skip = 2 * u64::from(count(config.settling_s)) + u64::from(odd);
        Some(Self { skip, band, powers: Vec::new(), wanted, clipped: 0, taken: 0 })
    }

    /// Takes what has come; whether that is enough.
    pub(super) fn push(&mut self, bytes: &[u8]) -> bool {
        let skipped = usize::try_from(self.skip).unwrap_or(usize::MAX).min(bytes.len());
        self.skip -= u64::try_from(skipped).unwrap_or(0);
        let bytes = bytes.get(skipped..).unwrap_or_default();
        let at_end = bytes.iter().filter(|byte| matches!(byte, 0 | 255)).count();
        self.clipped += u64::try_from(at_end).unwrap_or(0);
        self.taken += u64::try_from(bytes.len()).unwrap_or(0);
        let (powers, wanted) = (&mut self.powers, self.wanted);
        self.band.push(bytes, |power| {
            if powers.len() < wanted {
                powers.push(power);
            }
        });
        powers.len() >= wanted
    }

    /// The power in dB over full scale below which a share of the window lies.
    pub(super) fn level_dbfs(&self, share: f64) -> f64 {
        let mut sorted = self.powers.clone();
        sorted.sort_by(f64::total_cmp);
        let last = u32::try_from(sorted.len().saturating_sub(1)).unwrap_or(u32::MAX);
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to last")]
        let index = (f64::from(last) * share).round() as usize;
        // Zeros alone: less than any that a byte holds.
        sorted.get(index).map_or(-200.0, |power| 10.0 * power.max(1e-20).log10())
    }

    /// Whether the receiver is overdriven: more than a hundredth of its bytes are at an end of the
    /// scale.
    pub(super) fn is_overdriven(&self) -> bool {
        self.clipped * 100 > self.taken
    }
}
