use foxhunt_wire::receivers::NarrowBand;

use super::RtlTcpConfig;

/// Gathers the powers of a window.
#[derive(Clone, Debug)]
pub(super) struct Gather {
    band: NarrowBand,
    /// In the order in which they came; as many as are wanted at most.
    powers: Vec<f64>,
    wanted: usize,
}

impl Gather {
    /// Creates an empty one; `None` if the band is invalid.
    pub(super) fn new(config: &RtlTcpConfig) -> Option<Self> {
        let rate = f64::from(config.sample_rate_hz);
        let band = NarrowBand::new(rate, f64::from(config.beside_hz), config.bandwidth_hz)?;
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "at most 10 s of 10 MS/s"
        )]
        let count = (config.window_s * rate).clamp(0.0, 1e8) as u32;
        let wanted = usize::try_from(count / band.block()).ok()?.max(1);
        Some(Self { band, powers: Vec::new(), wanted })
    }

    /// Takes what has come; returns true if that is enough.
    pub(super) fn push(&mut self, bytes: &[u8]) -> bool {
        let powers = &mut self.powers;
        let wanted = self.wanted;
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
}
