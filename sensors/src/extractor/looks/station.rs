//! Fixed antennas that look several ways at once, as one coarse pattern.

use alloc::{vec, vec::Vec};
use core::f64::consts::{LN_2, TAU};

use foxhunt_core::{
    Bearing, BearingExtractor, BearingMode, BearingModes, NoBearing, NoReading, Reading, Sweep,
    angle, elementary,
    parameter::{ParameterError, as_value, finite, positive, require},
};

use super::{Node, Peak, normal_cdf, peaks, summit};
use crate::extractor::pattern::check;

/// Number of equal steps from East at which directions are reckoned.
const NODES: u16 = 180;

/// Degrees of freedom of the residuals' Student's t.
pub(crate) const TAIL: f64 = 4.0;

/// Log likelihood of a residual in units of its scale, but for a constant: Student's t with [`TAIL`]
/// degrees of freedom.
pub(crate) fn log_student(residual: f64) -> f64 {
    -0.5 * (TAIL + 1.0) * elementary::ln(1.0 + residual * residual / TAIL)
}

/// The probability that an antenna loses a burst above its floor.
pub(crate) const LOST: f64 = 0.03;

/// The level is integrated from so far below the strongest reading to so far above it, in dB: an
/// antenna's front receives it at its level, its back some 15 dB below. A step is this share of the
/// residuals' scale.
const BELOW: f64 = 15.0;
const ABOVE: f64 = 35.0;
const STEP: f64 = 0.4;

/// Largest distance from an antenna's recorded boresight of a boresight of its own, in radians: a
/// degree.
const SAME_ANTENNA: f64 = 0.0175;

/// One of a station's fixed antennas.
#[derive(Clone, Debug, PartialEq)]
pub struct StationAntenna {
    /// The boresight in the recordings, in radians in the world frame, which names the antenna.
    pub recorded_boresight: f64,
    /// The fitted boresight, in radians in the world frame.
    pub boresight: f64,
    /// Standard deviation of the fitted boresight, in radians; zero where it is known.
    pub boresight_sigma: f64,
    /// Gain of the antenna over the others, in dB.
    pub gain_db: f64,
    /// Standard deviation of the gain, in dB; zero where it is known.
    pub gain_sigma_db: f64,
    /// The site's effect on it, as a Fourier series over the world direction in dB: the
    /// coefficients of cos θ, sin θ, cos 2θ, sin 2θ, …; empty where unknown.
    pub site_db: Vec<f64>,
}

/// A ground station's fixed antennas taken as one coarse pattern: all of them receive
/// each burst of the transmitter at once, and their readings, or silences, give the direction.
///
/// As an extractor it takes sweeps whose samples name their antenna by its recorded boresight. A
/// reading is L + g(θ) + a residual with the tails of a Student's t (four degrees of freedom); an
/// antenna that receives nothing was below the receiver's floor, or lost the burst. The level L is
/// integrated out under a uniform prior, the posterior of the direction reckoned over the circle.
/// The residual's scale comes from recordings with truth, so that σ is wide where the site is
/// treacherous. Boresights and gains that are not known are integrated out: an antenna's gain has
/// the mean of its lobe over them, and their variance is added to the residual's. The reported
/// level is the mean over a turn of one such antenna.
///
/// One antenna alone shows no direction; its level then includes all that its lobe may have taken.
///
/// The bearing is the most likely direction, and its σ the root of the mean square about that over
/// all of the circle, so that it covers the other peaks; [`Reading::modes`] has them all. The mean
/// direction of peaks that lie opposite each other would point to neither, and that of a broad peak
/// is drawn away from where the strongest antenna looks by all that is only possible.
///
/// [`Reading::modes`]: foxhunt_core::Reading::modes
#[derive(Clone, Debug, PartialEq)]
pub struct StationPattern {
    antennas: Vec<StationAntenna>,
    beamwidth: f64,
    front_to_back_db: f64,
    residual_db: f64,
    floor: Option<[f64; 2]>,
    max_sigma: f64,
    /// σ of levels about the path-loss law, in dB.
    level_sigma_db: f64,
    /// The gain of each antenna at each node.
    gains: Vec<Vec<Gain>>,
    /// The mean of the lobe over a turn, in dB.
    mean_db: f64,
}

/// Gain of an antenna in a direction, as far as it is known.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Gain {
    /// Mean of the gain in dB.
    mean_db: f64,
    /// Variance of the gain in dB².
    variance: f64,
}

impl StationPattern {
    /// The station with these antennas, 1 to 16 of them, of one half-power beamwidth in radians and
    /// one front-to-back ratio in dB; a residual of 6 dB, no floor, and bearings up to a σ of
    /// 1.7 rad unless set otherwise.
    ///
    /// # Errors
    ///
    /// Names the parameter that is out of its range.
    pub fn new(
        antennas: Vec<StationAntenna>,
        beamwidth: f64,
        front_to_back_db: f64,
    ) -> Result<Self, ParameterError> {
        let count = antennas.len();
        require((1..=16).contains(&count), "antennas", as_value(count), "1 to 16")?;
        let holds = beamwidth > 0.0 && beamwidth < 0.5 * TAU;
        require(holds, "beamwidth", beamwidth, "between 0 and π rad")?;
        positive("front_to_back_db", front_to_back_db)?;
        for antenna in &antennas {
            finite("recorded_boresight", antenna.recorded_boresight)?;
            finite("boresight", antenna.boresight)?;
            finite("gain_db", antenna.gain_db)?;
            let sigmas = [
                ("boresight_sigma", antenna.boresight_sigma),
                ("gain_sigma_db", antenna.gain_sigma_db),
            ];
            for (name, sigma) in sigmas {
                require(sigma >= 0.0 && sigma.is_finite(), name, sigma, "finite, zero or more")?;
            }
            let harmonics = antenna.site_db.len();
            let whole = harmonics.is_multiple_of(2) && harmonics <= 64;
            require(whole, "site_db", as_value(harmonics), "pairs, at most 32")?;
            for value in &antenna.site_db {
                finite("site_db", *value)?;
            }
        }
        let node = |node: u16| TAU * f64::from(node) / f64::from(NODES);
        let lobe = |angle: f64| lobe_db(angle, beamwidth, front_to_back_db);
        let gain = |antenna: &StationAntenna, direction: f64| {
            let Gain { mean_db, variance } =
                blurred(&lobe, direction - antenna.boresight, antenna.boresight_sigma);
            Gain {
                mean_db: antenna.gain_db + mean_db + antenna.site(direction),
                variance: variance + antenna.gain_sigma_db * antenna.gain_sigma_db,
            }
        };
        let gains = antennas
            .iter()
            .map(|antenna| (0..NODES).map(|n| gain(antenna, node(n))).collect())
            .collect();
        let mean_db = (0..NODES).map(|n| lobe(node(n))).sum::<f64>() / f64::from(NODES);
        Ok(Self {
            antennas,
            beamwidth,
            front_to_back_db,
            residual_db: 6.0,
            floor: None,
            max_sigma: 1.7,
            level_sigma_db: Reading::RSS_SIGMA_DB,
            gains,
            mean_db,
        })
    }

    /// Sets the scale of the residuals in dB, as other recordings of the station show it.
    ///
    /// # Errors
    ///
    /// If it is not at least 0.1 dB.
    pub fn with_residual_db(self, residual_db: f64) -> Result<Self, ParameterError> {
        let holds = residual_db >= 0.1 && residual_db.is_finite();
        let residual_db = require(holds, "residual_db", residual_db, "at least 0.1 dB")?;
        Ok(Self { residual_db, ..self })
    }

    /// Sets the receivers' floor: half the bursts are received at `floor_dbm`; the probability
    /// rises over a Gaussian of the standard deviation `width_db`.
    ///
    /// # Errors
    ///
    /// If the floor is not finite or the width not positive.
    pub fn with_floor(self, floor_dbm: f64, width_db: f64) -> Result<Self, ParameterError> {
        let floor = [finite("floor_dbm", floor_dbm)?, positive("width_db", width_db)?];
        Ok(Self { floor: Some(floor), ..self })
    }

    /// Sets the largest standard deviation of bearings that are used, in radians.
    ///
    /// # Errors
    ///
    /// If it is not a positive number.
    pub fn with_max_sigma(self, sigma: f64) -> Result<Self, ParameterError> {
        Ok(Self { max_sigma: positive("max_sigma", sigma)?, ..self })
    }

    /// Sets the σ of levels about the path-loss law in dB, to which the extraction's own is added;
    /// 7.9 dB unless set.
    ///
    /// # Errors
    ///
    /// If it is not a positive number.
    pub fn with_level_sigma_db(self, sigma_db: f64) -> Result<Self, ParameterError> {
        Ok(Self { level_sigma_db: positive("level_sigma_db", sigma_db)?, ..self })
    }

    /// The antennas.
    #[must_use]
    pub fn antennas(&self) -> &[StationAntenna] {
        &self.antennas
    }

    /// The half-power beamwidth of each, in radians.
    #[must_use]
    pub fn beamwidth(&self) -> f64 {
        self.beamwidth
    }

    /// The front-to-back ratio of each in dB.
    #[must_use]
    pub fn front_to_back_db(&self) -> f64 {
        self.front_to_back_db
    }

    /// The scale of the residuals, in dB.
    #[must_use]
    pub fn residual_db(&self) -> f64 {
        self.residual_db
    }

    /// The receivers' floor in dBm and its width in dB, where it is known.
    #[must_use]
    pub fn floor(&self) -> Option<[f64; 2]> {
        self.floor
    }

    /// Index of the antenna that recordings mean by a boresight: the one recorded nearest to it.
    fn antenna_of(&self, recorded_boresight: f64) -> usize {
        let off = |antenna: &StationAntenna| {
            angle::distance(antenna.recorded_boresight, recorded_boresight)
        };
        let indexed = self.antennas.iter().enumerate();
        indexed.min_by(|a, b| off(a.1).total_cmp(&off(b.1))).map_or(0, |(index, _)| index)
    }
}

impl StationAntenna {
    /// An antenna that looks where it is recorded to look, and has the gain of the others.
    #[must_use]
    pub fn as_recorded(boresight: f64) -> Self {
        Self {
            recorded_boresight: boresight,
            boresight,
            boresight_sigma: 0.0,
            gain_db: 0.0,
            gain_sigma_db: 0.0,
            site_db: Vec::new(),
        }
    }

    /// The site's effect in a direction, in dB.
    pub(crate) fn site(&self, direction: f64) -> f64 {
        let mut sum = 0.0;
        let mut k = 1.0;
        for pair in self.site_db.chunks(2) {
            if let [cos, sin] = pair {
                sum += cos * libm::cos(k * direction) + sin * libm::sin(k * direction);
            }
            k += 1.0;
        }
        sum
    }
}

/// The pattern that stations of one make have in common, and how far single ones differ from it.
///
/// It stands for a station of which nothing but the recorded boresights is known: these are
/// wrong by N(0, κ²), and the gains of the antennas differ by N(0, τ²).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StationModel {
    /// The half-power beamwidth of each antenna, in radians.
    pub beamwidth: f64,
    /// Attenuation of each antenna from behind, in dB.
    pub front_to_back_db: f64,
    /// The scale of the residuals at a station that was not fitted, in dB.
    pub residual_db: f64,
    /// The receivers' floor in dBm and its width in dB, where it is known.
    pub floor: Option<[f64; 2]>,
    /// κ: standard deviation of the recorded boresights' errors, in radians.
    pub boresight_sigma: f64,
    /// τ: standard deviation of the antennas' gains, in dB.
    pub gain_sigma_db: f64,
}

impl StationModel {
    /// Returns the pattern of a station with antennas of these recorded boresights, in radians.
    ///
    /// # Errors
    ///
    /// Names the parameter that is out of its range.
    pub fn pattern(&self, recorded: &[f64]) -> Result<StationPattern, ParameterError> {
        let antenna = |boresight: &f64| StationAntenna {
            boresight_sigma: self.boresight_sigma,
            gain_sigma_db: self.gain_sigma_db,
            ..StationAntenna::as_recorded(*boresight)
        };
        let antennas = recorded.iter().map(antenna).collect();
        let pattern = StationPattern::new(antennas, self.beamwidth, self.front_to_back_db)?
            .with_residual_db(self.residual_db)?;
        match self.floor {
            Some([floor_dbm, width_db]) => pattern.with_floor(floor_dbm, width_db),
            None => Ok(pattern),
        }
    }
}

impl StationPattern {
    /// The mean reading of each antenna in dBm, where it received the burst.
    fn measured(&self, sweep: &Sweep<'_>) -> Vec<Option<f64>> {
        let mut sums = vec![(0.0, 0.0); self.antennas.len()];
        for sample in sweep.samples {
            if let Some((sum, count)) = sums.get_mut(self.antenna_of(sample.boresight)) {
                *sum += sample.rss_dbm;
                *count += 1.0;
            }
        }
        sums.into_iter().map(|(sum, count)| (count > 0.0).then(|| sum / count)).collect()
    }

    /// The log posterior of the direction, the level integrated out, with the moments of the level.
    fn nodes(&self, measured: &[Option<f64>]) -> Vec<Node> {
        let strongest = measured.iter().flatten().fold(f64::NEG_INFINITY, |a, &b| a.max(b));
        let step = STEP * self.residual_db;
        let variance = self.residual_db * self.residual_db;
        #[expect(clippy::cast_possible_truncation, reason = "the scale is bounded from below")]
        #[expect(clippy::cast_sign_loss, reason = "all three are positive")]
        let steps = libm::ceil((BELOW + ABOVE) / step) as u32;
        let node = |node: usize| {
            let at_node = |(reading, gains): (&Option<f64>, &Vec<Gain>)| {
                let Gain { mean_db, variance: own } = gains.get(node).copied().unwrap_or_default();
                (*reading, mean_db, libm::sqrt(variance + own))
            };
            let each: Vec<(Option<f64>, f64, f64)> =
                measured.iter().zip(&self.gains).map(at_node).collect();
            let log_likelihood = |off: f64| -> f64 {
                let one = |&(reading, gain, scale): &(Option<f64>, f64, f64)| {
                    self.log_likelihood(reading, strongest + off + gain, scale)
                };
                each.iter().map(one).sum()
            };
            // Normalises the readings' densities, whose scales vary over the circle.
            let scales = each.iter().filter(|(reading, ..)| reading.is_some());
            let widths: f64 = scales.map(|(.., scale)| libm::log(scale / self.residual_db)).sum();
            let mut best = f64::NEG_INFINITY;
            let mut ones = 0.0;
            let mut sum = 0.0;
            let mut squares = 0.0;
            for k in 0..=steps {
                let off = f64::from(k) * step - BELOW;
                let log = log_likelihood(off);
                if log > best {
                    let shrink = libm::exp(best - log);
                    (ones, sum, squares) = (ones * shrink, sum * shrink, squares * shrink);
                    best = log;
                }
                let weight = libm::exp(log - best);
                ones += weight;
                sum += weight * off;
                squares += weight * off * off;
            }
            let mean = sum / ones;
            Node {
                log_density: best + libm::log(ones) - widths,
                level: strongest + mean,
                level_variance: (squares / ones - mean * mean).max(0.0),
            }
        };
        (0..usize::from(NODES)).map(node).collect()
    }

    /// The log likelihood of an antenna's reading, or of its silence, at an expected power whose
    /// residuals have this scale.
    fn log_likelihood(&self, reading: Option<f64>, expected: f64, scale: f64) -> f64 {
        match (reading, self.floor) {
            (Some(reading), _) => log_student((reading - expected) / scale),
            (None, Some([floor, width])) => {
                let x = (floor - expected) / libm::hypot(width, scale);
                libm::log(LOST + (1.0 - LOST) * normal_cdf(x))
            }
            (None, None) => 0.0,
        }
    }
}

impl BearingExtractor for StationPattern {
    fn extract(&self, sweep: &Sweep<'_>) -> Result<Reading, NoReading> {
        check(sweep)?;
        for (index, sample) in sweep.samples.iter().enumerate() {
            let boresight = sample.boresight;
            let of = self.antennas.get(self.antenna_of(boresight));
            let off =
                of.map_or(f64::INFINITY, |a| angle::distance(a.recorded_boresight, boresight));
            if off > SAME_ANTENNA {
                return Err(NoReading::Boresight { index, boresight });
            }
        }
        let measured = self.measured(sweep);
        let nodes = self.nodes(&measured);
        let found = peaks(&nodes);
        let (leading, _) = summit(&nodes);
        let mut directions = [BearingMode::default(); BearingModes::CAPACITY];
        let mut level = 0.0;
        let mut second = 0.0;
        let mut square = 0.0;
        for (mode, peak) in directions.iter_mut().zip(&found) {
            let angle = angle::wrap(peak.offset);
            let off = angle::wrap(peak.offset - leading);
            *mode = BearingMode { weight: peak.weight, angle, sigma: peak.sigma };
            let mean = peak.level + self.mean_db;
            level += peak.weight * mean;
            second += peak.weight * (mean * mean + peak.level_variance);
            square += peak.weight * (peak.sigma * peak.sigma + off * off);
        }
        let product = |peak: &Peak| {
            let (off, rise) =
                (angle::wrap(peak.offset - leading), peak.level + self.mean_db - level);
            peak.weight * (peak.covariance + off * rise)
        };
        let level_variance = (second - level * level).max(0.0);
        // Without a peak the pattern or the readings are beyond reckoning.
        let sigma = if found.is_empty() { f64::INFINITY } else { libm::sqrt(square) };
        // What is left of certainty; of a direction of which nothing is known, hardly any.
        let confidence = libm::exp(-0.5 * square);
        let bearing = if sigma > self.max_sigma {
            Err(NoBearing::TooWide { sigma, limit: self.max_sigma })
        } else {
            Ok(Bearing { angle: angle::wrap(leading), sigma, confidence })
        };
        let covariance = if bearing.is_ok() { found.iter().map(product).sum() } else { 0.0 };
        Ok(Reading {
            rss_dbm: level,
            rss_sigma_db: libm::hypot(self.level_sigma_db, libm::sqrt(level_variance)),
            bearing,
            covariance,
            modes: BearingModes::new(directions.get(..found.len()).unwrap_or(&[]))
                .unwrap_or_default(),
        })
    }
}

/// Mean and variance of a lobe at an angle that is uncertain by a Gaussian of `sigma` radians,
/// which is cut off at half a turn.
fn blurred(lobe: &impl Fn(f64) -> f64, angle: f64, sigma: f64) -> Gain {
    /// Angles on either side, over three σ.
    const SIDE: i16 = 16;
    if sigma <= 0.0 {
        return Gain { mean_db: lobe(angle), variance: 0.0 };
    }
    let step = (3.0 * sigma).min(0.5 * TAU) / f64::from(SIDE);
    let mut ones = 0.0;
    let mut sum = 0.0;
    let mut squares = 0.0;
    for k in -SIDE..=SIDE {
        let off = f64::from(k) * step;
        let weight = libm::exp(-0.5 * (off / sigma) * (off / sigma));
        let value = lobe(angle + off);
        ones += weight;
        sum += weight * value;
        squares += weight * value * value;
    }
    let mean_db = sum / ones;
    Gain { mean_db, variance: (squares / ones - mean_db * mean_db).max(0.0) }
}

/// The gain in dB about that on boresight, `angle` radians off it: a lobe ((1 + cos a)/2)ⁿ of
/// this half-power beamwidth in radians over a back lobe that is the same everywhere.
///
/// Pattern of a short Yagi in its place: the side lobes of its free-space pattern drown in what the
/// site scatters.
pub(crate) fn lobe_db(angle: f64, beamwidth: f64, front_to_back_db: f64) -> f64 {
    let power = |a: f64| libm::log(0.5 * (1.0 + libm::cos(a)).max(1e-300));
    let exponent = -LN_2 / power(0.5 * beamwidth);
    let back = libm::exp10(-0.1 * front_to_back_db);
    10.0 * libm::log10(libm::exp(exponent * power(angle)) + back)
}

#[cfg(test)]
mod tests {
    use approx::assert_abs_diff_eq;
    use core::f64::consts::PI;

    use super::*;

    #[test]
    fn half_the_power_is_at_half_the_beamwidth() {
        for width in [0.6, 1.2, 2.4] {
            let fall = lobe_db(0.0, width, 60.0) - lobe_db(0.5 * width, width, 60.0);
            assert_abs_diff_eq!(fall, 3.0103, epsilon = 1e-3);
            assert_abs_diff_eq!(lobe_db(PI, width, 16.0), -16.0, epsilon = 1e-6);
        }
    }
}
