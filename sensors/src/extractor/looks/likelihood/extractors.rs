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
    /// As noise with Student's t: a part of the pattern that does not fit loses its weight
    /// (Lange, Little & Taylor 1989).
    StudentT {
        /// The degrees of freedom; the fewer, the less weight. A number that is not positive counts
        /// as
        /// 1.
        degrees: f64,
    },
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
/// Beacons are at one elevation, or at any of a [range](Self::with_steepest).
///
/// The confidence is [`resultant_confidence`](crate::resultant_confidence).
#[derive(Clone, Debug)]
pub struct MaximumLikelihood<A> {
    antenna: A,
    table: GainTable,
    /// For beacons at other elevations.
    steeper: Vec<GainTable>,
    sample_sigma_db: f64,
    misfit_sigma_db: f64,
    limits: Limits,
    residuals: Residuals,
    /// Table of the amplitude, for waves that add up.
    amplitude: AmplitudeTable,
    fadings: Vec<Fading>,
}

impl<A: Antenna> MaximumLikelihood<A> {
    /// One for readings with σ of about 2 dB through `antenna`, by beacons on the horizon; a
    /// level's σ of 7.9 dB about a path-loss law, bearings up to 1 rad of σ, from 8 boresights on.
    #[must_use]
    pub fn new(antenna: A) -> Self {
        let table = GainTable::new(&antenna, 0.0);
        let (amplitude, fadings) = of_table(&table);
        Self {
            antenna,
            table,
            steeper: Vec::new(),
            sample_sigma_db: Sample::SIGMA_DB,
            misfit_sigma_db: 0.0,
            limits: Limits::default(),
            residuals: Residuals::Gaussian,
            amplitude,
            fadings,
        }
    }

    /// Replaces the judgement of residuals, for beacons at one elevation.
    #[must_use]
    pub fn with_residuals(self, residuals: Residuals) -> Self {
        Self { residuals, steeper: Vec::new(), ..self }
    }

    /// Sets the beacons' elevation, in radians above the horizon.
    ///
    /// # Errors
    ///
    /// If it is not within a quarter of a turn.
    pub fn with_elevation(self, elevation: f64) -> Result<Self, ParameterError> {
        let holds = elevation.abs() < core::f64::consts::FRAC_PI_2;
        let elevation = require(holds, "elevation", elevation, "between −π/2 and π/2")?;
        let table = GainTable::new(&self.antenna, elevation);
        let (amplitude, fadings) = of_table(&table);
        Ok(Self { table, steeper: Vec::new(), amplitude, fadings, ..self })
    }

    /// Takes beacons anywhere from its elevation to `steepest`, in radians above the horizon: the
    /// posterior is over elevations in equal steps of at most 5° too, each as likely before the
    /// turn. A pattern looked at from far above the beacon has other lobes, which at the horizon
    /// would stand for another direction. Residuals are Gaussian.
    ///
    /// # Errors
    ///
    /// If it is not within a quarter of a turn.
    pub fn with_steepest(self, steepest: f64) -> Result<Self, ParameterError> {
        const STEP: f64 = 0.0873;
        let holds = steepest.abs() < core::f64::consts::FRAC_PI_2;
        let steepest = require(holds, "steepest", steepest, "between −π/2 and π/2")?;
        let from = self.table.elevation();
        let steps = libm::ceil((steepest - from).abs() / STEP);
        let mut steeper = Vec::new();
        let mut step = 1.0;
        while step <= steps {
            let elevation = from + (steepest - from) * step / steps;
            steeper.push(GainTable::new(&self.antenna, elevation));
            step += 1.0;
        }
        Ok(Self { steeper, residuals: Residuals::Gaussian, ..self })
    }

    /// Sets another σ of a reading, in dB: it counts like four readings about their mean,
    /// and alone where no boresight has two readings.
    ///
    /// # Errors
    ///
    /// If it is not a positive number.
    pub fn with_sample_sigma_db(self, sigma: f64) -> Result<Self, ParameterError> {
        Ok(Self { sample_sigma_db: positive("sample_sigma_db", sigma)?, ..self })
    }

    /// Sets σ in dB of the residuals between the antenna's gain and each boresight's mean, whatever
    /// the number of readings: the effect of multipath on a handful of fixed antennas.
    ///
    /// # Errors
    ///
    /// If it is negative or not finite.
    pub fn with_misfit_sigma_db(self, sigma: f64) -> Result<Self, ParameterError> {
        Ok(Self { misfit_sigma_db: not_negative("misfit_sigma_db", sigma)?, ..self })
    }

    /// Sets another σ of the level against a path-loss law, in dB: it is added to that of
    /// the fit.
    ///
    /// # Errors
    ///
    /// If it is negative or not finite.
    pub fn with_rss_sigma_db(mut self, sigma: f64) -> Result<Self, ParameterError> {
        self.limits.rss_sigma_db = not_negative("rss_sigma_db", sigma)?;
        Ok(self)
    }

    /// Sets the largest standard deviation of bearings that are used, in radians.
    ///
    /// # Errors
    ///
    /// If it is not a positive number.
    pub fn with_max_sigma(mut self, sigma: f64) -> Result<Self, ParameterError> {
        self.limits.max_sigma = positive("max_sigma", sigma)?;
        Ok(self)
    }

    /// Sets the minimum number of received positions for a bearing.
    ///
    /// # Errors
    ///
    /// If it is below 3: a level and a bearing leave nothing of two.
    pub fn with_min_positions(mut self, positions: u16) -> Result<Self, ParameterError> {
        let valid = positions >= 3;
        require(valid, "min_positions", positions.into(), "at least 3")?;
        self.limits.min_positions = positions;
        Ok(self)
    }
}

impl<A: Antenna> MaximumLikelihood<A> {
    /// A turn laid against the antenna, and its judgement.
    fn judged<'s>(&'s self, sweep: &Sweep<'_>) -> Result<(Fit<'s, A>, Judged), NoReading> {
        let looks = Looks::new(sweep)?;
        let noise = looks.sample_variance(self.sample_sigma_db, PRIOR_FREEDOM);
        let misfit = self.misfit_sigma_db * self.misfit_sigma_db;
        let fit = |table: &'s GainTable| {
            Fit::new(&self.antenna, table, looks.clone(), sweep, noise, misfit)
        };
        let level = fit(&self.table);
        if !self.steeper.is_empty() {
            return Ok(judge::elevations(level, self.steeper.iter().map(fit)));
        }
        let judged = match self.residuals {
            Residuals::Gaussian => judge::gaussian(&level),
            Residuals::StudentT { degrees } => judge::student(&level, degrees),
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
        let mut reading = read_out(sweep, &fit, &peaks, residual_db, &self.limits);
        // The level of a sum is known, though its directions have no common one.
        if let (Residuals::Superposed, Err(_), [peak, _, ..]) =
            (self.residuals, reading.bearing, &peaks[..])
            && !reading.modes.is_empty()
        {
            reading.rss_dbm = peak.level;
            let fitted = libm::sqrt(peak.level_variance);
            reading.rss_sigma_db = libm::hypot(self.limits.rss_sigma_db, fitted);
        }
        Ok(reading)
    }

    /// The larger of the bearing's σ and of the Cramér-Rao bound at the bearing and the level that
    /// were found, over all questions, those below the floor censored. The bound does not depend on
    /// how the noise fell, so that a turn does not end as soon as the noise makes a narrow peak.
    fn expected_sigma(&self, sweep: &Sweep<'_>) -> Option<f64> {
        let (fit, Judged { posterior, residual_db, inflation }) = self.judged(sweep).ok()?;
        let reading = read_out(sweep, &fit, &posterior.modes(), residual_db, &self.limits);
        let bearing = reading.bearing.ok()?;
        let bound = fit.bound(angle::wrap(bearing.angle - fit.looks.origin), reading.rss_dbm);
        Some(bearing.sigma.max(libm::sqrt(bound? * inflation)))
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
    antenna: A,
    table: GainTable,
    limits: Limits,
}

impl<A: Antenna> CrossCorrelation<A> {
    /// One for readings through `antenna` by beacons on the horizon; a level's σ of 7.9 dB,
    /// bearings up to 1 rad of σ, from 8 boresights on.
    #[must_use]
    pub fn new(antenna: A) -> Self {
        let table = GainTable::new(&antenna, 0.0);
        Self { antenna, table, limits: Limits::default() }
    }

    /// Sets another σ of the level against a path-loss law, in dB.
    ///
    /// # Errors
    ///
    /// If it is negative or not finite.
    pub fn with_rss_sigma_db(mut self, sigma: f64) -> Result<Self, ParameterError> {
        self.limits.rss_sigma_db = not_negative("rss_sigma_db", sigma)?;
        Ok(self)
    }

    /// Sets the largest standard deviation of bearings that are used, in radians.
    ///
    /// # Errors
    ///
    /// If it is not a positive number.
    pub fn with_max_sigma(mut self, sigma: f64) -> Result<Self, ParameterError> {
        self.limits.max_sigma = positive("max_sigma", sigma)?;
        Ok(self)
    }
}

impl<A: Antenna> BearingExtractor for CrossCorrelation<A> {
    fn extract(&self, sweep: &Sweep<'_>) -> Result<Reading, NoReading> {
        let looks = Looks::new(sweep)?;
        let noise = looks.sample_variance(Sample::SIGMA_DB, PRIOR_FREEDOM);
        let fit = Fit::new(&self.antenna, &self.table, looks, sweep, noise, 0.0);
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
        Ok(read_out(sweep, &fit, &[peak], misfit.residual_db, &self.limits))
    }
}

/// Tables of a gain's amplitude and its fading.
fn of_table(table: &GainTable) -> (AmplitudeTable, Vec<Fading>) {
    let fadings = RATIOS.iter().map(|ratio| Fading::new(table, *ratio)).collect();
    (AmplitudeTable::new(table), fadings)
}
