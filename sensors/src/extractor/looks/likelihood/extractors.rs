//! Extractors that know their antenna's gain.

use alloc::vec::Vec;

use foxhunt_core::{
    BearingExtractor, NoReading, Reading, Sample, Sweep, angle,
    parameter::{ParameterError, not_negative, positive, require},
};

use super::{
    super::{Looks, NODES, Node, Peak, node_offset, summit},
    Fit, Limits, Misfit,
    judge::{self, Judged},
    read_out,
    superposed::superposed,
    tables::{AmplitudeTable, Fading, GainTable},
};
use crate::Antenna;

/// Strengths of diffuse fading that are weighed: the reflected amplitude over the direct one.
const RATIOS: [f64; 5] = [0.05, 0.1, 0.2, 0.35, 0.6];

/// Degrees of freedom from which the scatter of a turn's readings outweighs the assumed one.
const PRIOR_FREEDOM: f64 = 4.0;
const FITTED: f64 = 2.0;

/// The model of the residuals that a fitted pattern leaves.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub enum Residuals {
    /// As Gaussian noise, larger than the readings' scatter where they are, and correlated as they
    /// are.
    #[default]
    Gaussian,
    /// As noise with Student's t, of [`degrees`](MaximumLikelihoodConfig::degrees) of freedom: a
    /// part of the pattern that does not fit loses its weight (Lange, Little & Taylor 1989).
    StudentT,
    /// As Gaussian noise about one path or two: a reflection of unknown direction, strength and
    /// phase may add its amplitude to the direct wave's, with a probability of 0.2 before the turn.
    /// The residuals of two paths are diffuse fading, Rician, so that the pattern's back weighs
    /// less than its main lobe. The one to use where the antenna is known.
    Reflection,
    /// As Gaussian noise about the sum of the powers of up to four transmitters that send at once
    /// on one frequency, as many as the turn warrants. Their directions are the reading's
    /// [`modes`](Reading::modes), each with its share of the power for a weight, and the level is
    /// that of the sum. What was not received counts where there is one transmitter alone.
    Superposed,
}

/// Default largest σ of a bearing, in degrees.
const MAX_SIGMA_DEG: f64 = 57.0;

/// Default least number of boresights with a reading.
const MIN_POSITIONS: u16 = 8;

/// Default degrees of freedom of Student's t.
const DEGREES: f64 = 4.0;

/// Requirement of a setting that the chosen residuals do not use.
const UNUSED: &str = "left out: this extractor does not use it";

/// Settings of [`MaximumLikelihood`], with the antenna that it knows.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct MaximumLikelihoodConfig<A> {
    /// The antenna.
    pub antenna: A,
    /// Elevation of beacons above the horizon, in degrees; below it where negative.
    pub elevation_deg: f64,
    /// Beacons may be anywhere from there to so far above the horizon, in degrees: the posterior is
    /// over elevations in equal steps of at most 5° too, each as likely before the turn. A pattern
    /// looked at from far above the beacon has other lobes, which at the horizon would stand for
    /// another direction. With [`Residuals::Gaussian`] alone; absent where beacons are at that
    /// elevation.
    #[cfg_attr(feature = "serde", serde(skip_serializing_if = "Option::is_none"))]
    pub steepest_deg: Option<f64>,
    /// σ of a reading in dB: it counts like four readings about their mean, and alone where no
    /// boresight has two readings.
    pub sample_sigma_db: f64,
    /// σ in dB of the residuals between the antenna's gain and each boresight's mean, whatever the
    /// number of readings: the effect of multipath on a handful of fixed antennas.
    pub misfit_sigma_db: f64,
    /// σ of the level against a path-loss law, in dB: it is added to that of the fit.
    pub rss_sigma_db: f64,
    /// Largest σ of a bearing, in degrees; turns with a larger one have no bearing.
    pub max_sigma_deg: f64,
    /// Turns in which fewer boresights hold a reading have no bearing.
    pub min_positions: u16,
    /// The degrees of freedom of [`Residuals::StudentT`], and of these alone.
    pub degrees: f64,
}

impl<A> MaximumLikelihoodConfig<A> {
    /// Readings with σ of about 2 dB through `antenna` by beacons on the horizon, no misfit, 7.9 dB
    /// for the level, bearings up to 57° of σ, from 8 boresights on, 4 degrees of freedom.
    #[must_use]
    pub fn of(antenna: A) -> Self {
        Self {
            antenna,
            elevation_deg: 0.0,
            steepest_deg: None,
            sample_sigma_db: Sample::SIGMA_DB,
            misfit_sigma_db: 0.0,
            rss_sigma_db: Reading::RSS_SIGMA_DB,
            max_sigma_deg: MAX_SIGMA_DEG,
            min_positions: MIN_POSITIONS,
            degrees: DEGREES,
        }
    }

    /// The settings with another antenna.
    #[must_use]
    pub fn through<B>(&self, antenna: B) -> MaximumLikelihoodConfig<B> {
        let Self {
            antenna: _,
            elevation_deg,
            steepest_deg,
            sample_sigma_db,
            misfit_sigma_db,
            rss_sigma_db,
            max_sigma_deg,
            min_positions,
            degrees,
        } = *self;
        MaximumLikelihoodConfig {
            antenna,
            elevation_deg,
            steepest_deg,
            sample_sigma_db,
            misfit_sigma_db,
            rss_sigma_db,
            max_sigma_deg,
            min_positions,
            degrees,
        }
    }

    /// Checks the settings for a model of residuals.
    fn check(&self, residuals: Residuals) -> Result<(), ParameterError> {
        let unused = |name, value| Err(ParameterError { name, value, requirement: UNUSED });
        let quarter = |name, elevation: f64| {
            require(elevation.abs() < 90.0, name, elevation, "between −90 and 90")
        };
        quarter("elevation_deg", self.elevation_deg)?;
        if let Some(steepest) = self.steepest_deg {
            if residuals != Residuals::Gaussian {
                return unused("steepest_deg", steepest);
            }
            quarter("steepest_deg", steepest)?;
        }
        positive("sample_sigma_db", self.sample_sigma_db)?;
        not_negative("misfit_sigma_db", self.misfit_sigma_db)?;
        not_negative("rss_sigma_db", self.rss_sigma_db)?;
        positive("max_sigma_deg", self.max_sigma_deg)?;
        // A level and a bearing leave nothing of two.
        let positions = self.min_positions;
        require(positions >= 3, "min_positions", positions.into(), "at least 3")?;
        positive("degrees", self.degrees)?;
        if residuals != Residuals::StudentT && self.degrees.to_bits() != DEGREES.to_bits() {
            return unused("degrees", self.degrees);
        }
        Ok(())
    }

    fn limits(&self) -> Limits {
        let max_sigma = self.max_sigma_deg.to_radians();
        Limits { rss_sigma_db: self.rss_sigma_db, max_sigma, min_positions: self.min_positions }
    }
}

impl<A: Default> Default for MaximumLikelihoodConfig<A> {
    fn default() -> Self {
        Self::of(A::default())
    }
}

/// The bearing and the level under which the readings are most likely, for an antenna whose gain
/// is known.
///
/// A reading is L + G(θ − φ) − Ḡ + noise: the level L that the turn has on average, the gain G over
/// the angle between the bearing θ and the boresight φ, its mean Ḡ, all in dB. The level is
/// free and profiled out; the posterior of the bearing under a uniform prior is reckoned over the
/// whole turn and gives bearing, σ, level, their covariance, and the directions that compete.
///
/// Readings are taken along their own boresight and through an antenna tilted like the body; what
/// was not received is not filled in. Where the sweep holds unanswered questions and the
/// receiver's floor, each question was either lost or below it. The noise is estimated from the
/// scatter along each boresight; readings in whole dB have no less of it than their rounding. σ
/// grows with the residuals where they exceed that, and with their correlation around the circle.
///
/// Beacons are at one elevation, or at any of a
/// [range](MaximumLikelihoodConfig::steepest_deg).
///
/// The confidence is [`resultant_confidence`](crate::resultant_confidence).
#[derive(Clone, Debug)]
pub struct MaximumLikelihood<A> {
    config: MaximumLikelihoodConfig<A>,
    residuals: Residuals,
    table: GainTable,
    /// For beacons at other elevations.
    steeper: Vec<GainTable>,
    /// Table of the amplitude, for waves that add up.
    amplitude: AmplitudeTable,
    fadings: Vec<Fading>,
}

impl<A: Antenna> MaximumLikelihood<A> {
    /// One with [Gaussian](Residuals::Gaussian) residuals and the settings of
    /// [`MaximumLikelihoodConfig::of`].
    #[must_use]
    pub fn new(antenna: A) -> Self {
        Self::checked(MaximumLikelihoodConfig::of(antenna), Residuals::Gaussian)
    }

    /// One with other settings, and a model of the residuals.
    ///
    /// # Errors
    ///
    /// If a setting is out of its range, or not used with these residuals; the error names it.
    pub fn with_config(
        config: MaximumLikelihoodConfig<A>,
        residuals: Residuals,
    ) -> Result<Self, ParameterError> {
        config.check(residuals)?;
        Ok(Self::checked(config, residuals))
    }

    /// Sets the model of the residuals.
    ///
    /// # Errors
    ///
    /// If a setting is not used with these residuals; the error names it.
    pub fn with_residuals(self, residuals: Residuals) -> Result<Self, ParameterError> {
        Self::with_config(self.config, residuals)
    }

    fn checked(config: MaximumLikelihoodConfig<A>, residuals: Residuals) -> Self {
        /// Steps of the elevation are no wider, in radians.
        const STEP: f64 = 0.0873;
        let elevation = config.elevation_deg.to_radians();
        let table = GainTable::new(&config.antenna, elevation);
        let mut steeper = Vec::new();
        if let Some(steepest) = config.steepest_deg.map(f64::to_radians) {
            let steps = libm::ceil((steepest - elevation).abs() / STEP);
            let mut step = 1.0;
            while step <= steps {
                let elevation = elevation + (steepest - elevation) * step / steps;
                steeper.push(GainTable::new(&config.antenna, elevation));
                step += 1.0;
            }
        }
        let amplitude = AmplitudeTable::new(&table);
        let fadings = RATIOS.iter().map(|ratio| Fading::new(&table, *ratio)).collect();
        Self { config, residuals, table, steeper, amplitude, fadings }
    }
}

impl<A: Antenna> MaximumLikelihood<A> {
    /// A turn laid against the antenna, and its judgement.
    fn judged<'s>(&'s self, sweep: &Sweep<'_>) -> Result<(Fit<'s, A>, Judged), NoReading> {
        let looks = Looks::new(sweep)?;
        let config = &self.config;
        let noise = looks.sample_variance(config.sample_sigma_db, PRIOR_FREEDOM);
        let misfit = config.misfit_sigma_db * config.misfit_sigma_db;
        let fit = |table: &'s GainTable| {
            Fit::new(&config.antenna, table, looks.clone(), sweep, noise, misfit)
        };
        let level = fit(&self.table);
        if !self.steeper.is_empty() {
            return Ok(judge::elevations(level, self.steeper.iter().map(fit)));
        }
        let judged = match self.residuals {
            Residuals::Gaussian => judge::gaussian(&level),
            Residuals::StudentT => judge::student(&level, config.degrees),
            Residuals::Reflection => judge::reflection(&level, &self.amplitude, &self.fadings),
            Residuals::Superposed => superposed(&level),
        };
        Ok((level, judged))
    }
}

impl<A: Antenna> BearingExtractor for MaximumLikelihood<A> {
    fn extract(&self, sweep: &Sweep<'_>) -> Result<Reading, NoReading> {
        let (fit, Judged { posterior, residual_db, .. }) = self.judged(sweep)?;
        let peaks = posterior.modes();
        let mut reading = read_out(sweep, &fit, &peaks, residual_db, &self.config.limits());
        // The level of a sum is known, though its directions have no common one.
        if let (Residuals::Superposed, Err(_), [peak, _, ..]) =
            (self.residuals, reading.bearing, &peaks[..])
            && !reading.modes.is_empty()
        {
            reading.rss_dbm = peak.level;
            let fitted = libm::sqrt(peak.level_variance);
            reading.rss_sigma_db = libm::hypot(self.config.rss_sigma_db, fitted);
        }
        Ok(reading)
    }

    /// The larger of the bearing's σ and of the Cramér-Rao bound at the bearing and the level that
    /// were found, over all questions, those below the floor censored. The bound does not depend on
    /// how the noise fell, so that a turn does not end as soon as the noise makes a narrow peak.
    fn expected_sigma(&self, sweep: &Sweep<'_>) -> Option<f64> {
        let (fit, Judged { posterior, residual_db, inflation }) = self.judged(sweep).ok()?;
        let reading = read_out(sweep, &fit, &posterior.modes(), residual_db, &self.config.limits());
        let bearing = reading.bearing.ok()?;
        let bound = fit.bound(angle::wrap(bearing.angle - fit.looks.origin), reading.rss_dbm);
        Some(bearing.sigma.max(libm::sqrt(bound? * inflation)))
    }
}

/// Settings of [`CrossCorrelation`], with the antenna that it knows.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct CrossCorrelationConfig<A> {
    /// The antenna.
    pub antenna: A,
    /// σ of the level against a path-loss law, in dB.
    pub rss_sigma_db: f64,
    /// Largest σ of a bearing, in degrees; turns with a larger one have no bearing.
    pub max_sigma_deg: f64,
}

impl<A> CrossCorrelationConfig<A> {
    /// A level's σ of 7.9 dB, bearings up to 57° of σ.
    #[must_use]
    pub fn of(antenna: A) -> Self {
        Self { antenna, rss_sigma_db: Reading::RSS_SIGMA_DB, max_sigma_deg: MAX_SIGMA_DEG }
    }

    /// The settings with another antenna.
    #[must_use]
    pub fn through<B>(&self, antenna: B) -> CrossCorrelationConfig<B> {
        let Self { antenna: _, rss_sigma_db, max_sigma_deg } = *self;
        CrossCorrelationConfig { antenna, rss_sigma_db, max_sigma_deg }
    }
}

impl<A: Default> Default for CrossCorrelationConfig<A> {
    fn default() -> Self {
        Self::of(A::default())
    }
}

/// The bearing under which the readings in dB correlate best with the gain of a known antenna
/// (cited in Isaacs et al. 2014, §II).
///
/// Over a whole turn this is the maximum-likelihood bearing. Where positions are missing it is not:
/// the gain that was not received is missing from the one side alone. σ is that of the readings'
/// scatter, with residuals that exceed it or correlate, and of the bias that a perfect pattern
/// would have over these boresights. The level is that of the fit.
#[derive(Clone, Debug)]
pub struct CrossCorrelation<A> {
    config: CrossCorrelationConfig<A>,
    table: GainTable,
}

impl<A: Antenna> CrossCorrelation<A> {
    /// One for readings by beacons on the horizon, from 8 boresights on, with the settings of
    /// [`CrossCorrelationConfig::of`].
    #[must_use]
    pub fn new(antenna: A) -> Self {
        Self::checked(CrossCorrelationConfig::of(antenna))
    }

    /// One with other settings.
    ///
    /// # Errors
    ///
    /// If one is out of its range; the error names it.
    pub fn with_config(config: CrossCorrelationConfig<A>) -> Result<Self, ParameterError> {
        not_negative("rss_sigma_db", config.rss_sigma_db)?;
        positive("max_sigma_deg", config.max_sigma_deg)?;
        Ok(Self::checked(config))
    }

    fn checked(config: CrossCorrelationConfig<A>) -> Self {
        let table = GainTable::new(&config.antenna, 0.0);
        Self { config, table }
    }
}

impl<A: Antenna> BearingExtractor for CrossCorrelation<A> {
    fn extract(&self, sweep: &Sweep<'_>) -> Result<Reading, NoReading> {
        let looks = Looks::new(sweep)?;
        let noise = looks.sample_variance(Sample::SIGMA_DB, PRIOR_FREEDOM);
        let fit = Fit::new(&self.config.antenna, &self.table, looks, sweep, noise, 0.0);
        let (mean, _) = fit.looks.spread();
        let mut gains = Vec::new();
        let node = |index| {
            let offset = node_offset(index);
            fit.gains(offset, &mut gains);
            let looks = fit.looks.looks.iter().zip(&gains);
            let mut product = 0.0;
            let mut rest = 0.0;
            for (look, gain) in looks {
                product += (look.mean_dbm - mean) * gain;
                rest += look.mean_dbm - gain;
            }
            Node { log_density: product, level: rest / fit.looks.len(), level_variance: 0.0 }
        };
        let nodes: Vec<Node> = (0..NODES).map(node).collect();
        let (offset, level) = summit(&nodes);
        let residuals = fit.residuals(offset, level);
        let misfit = Misfit::new(&fit, offset, &residuals, FITTED);
        let slopes = fit.slopes(offset);
        fit.gains(offset, &mut gains);
        let count = fit.looks.len();
        let (mean_gain, mean_slope) =
            (gains.iter().sum::<f64>() / count, slopes.iter().sum::<f64>() / count);
        let mut information = 0.0;
        let mut scatter = 0.0;
        let mut bias = 0.0;
        for ((slope, gain), variance) in slopes.iter().zip(&gains).zip(&fit.variances) {
            let centered = slope - mean_slope;
            information += centered * centered;
            scatter += centered * centered * variance;
            bias += (gain - mean_gain) * slope;
        }
        bias /= information;
        let variance = scatter / (information * information) * misfit.inflation() + bias * bias;
        // An antenna that is flat all round gives no direction.
        let variance = if variance.is_finite() { variance } else { f64::INFINITY };
        let mean_variance = fit.variances.iter().sum::<f64>() / count;
        let peak = Peak {
            weight: 1.0,
            offset,
            sigma: libm::sqrt(variance),
            level,
            level_variance: mean_variance / count * misfit.inflation(),
            covariance: 0.0,
        };
        let CrossCorrelationConfig { rss_sigma_db, max_sigma_deg, .. } = self.config;
        let max_sigma = max_sigma_deg.to_radians();
        let limits = Limits { rss_sigma_db, max_sigma, min_positions: MIN_POSITIONS };
        Ok(read_out(sweep, &fit, &[peak], misfit.residual_db, &limits))
    }
}
