use alloc::vec::Vec;
use core::f64::consts::TAU;

use foxhunt_core::{
    angle,
    parameter::{ParameterError, as_value, finite, positive, require},
};

use super::lobe_db;

/// One of a station's fixed antennas.
#[derive(Clone, Debug, PartialEq)]
pub struct StationAntenna {
    /// The boresight in the recordings, in radians in the world frame, which names the antenna.
    pub recorded_boresight: f64,
    /// The fitted boresight, in radians in the world frame.
    pub boresight: f64,
    /// Standard deviation of that, in radians; zero where it is known.
    pub boresight_sigma: f64,
    /// Its gain over the others, in dB.
    pub gain_db: f64,
    /// Standard deviation of that, in dB; zero where it is known.
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
    pub(super) antennas: Vec<StationAntenna>,
    pub(super) beamwidth: f64,
    pub(super) front_to_back_db: f64,
    pub(super) residual_db: f64,
    pub(super) floor: Option<[f64; 2]>,
    pub(super) max_sigma: f64,
    /// σ of levels about the path-loss law, in dB.
    pub(super) level_sigma_db: f64,
    /// The gain of each antenna at each node.
    pub(super) gains: Vec<Vec<Gain>>,
    /// The mean of the lobe over a turn, in dB.
    pub(super) mean_db: f64,
}

/// Gain of an antenna in a direction, as far as it is known.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Gain {
    /// Its mean in dB.
    pub(super) mean_db: f64,
    /// Its variance in dB².
    pub(super) variance: f64,
}

/// σ of a level along a path-loss law over a wooded site, in dB, as the reference has it in its
/// field (Pritzl 2018, §7.5).
const RSS_SIGMA_DB: f64 = 7.9;

/// Number of equal steps from East at which directions are reckoned.
pub(super) const NODES: u16 = 180;

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
            level_sigma_db: RSS_SIGMA_DB,
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
    #[must_use]
    pub fn antenna_of(&self, recorded_boresight: f64) -> usize {
        let off = |antenna: &StationAntenna| {
            angle::distance(antenna.recorded_boresight, recorded_boresight)
        };
        let indexed = self.antennas.iter().enumerate();
        indexed.min_by(|a, b| off(a.1).total_cmp(&off(b.1))).map_or(0, |(index, _)| index)
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
