use foxhunt_core::{
    Bearing, BearingExtractor, BearingModes, NoBearing, NoReading, Reading, Sweep,
    angle::{self, Resultant},
    parameter::{ParameterError, positive, require},
};
use nalgebra::{Matrix3, Vector3};

use crate::extractor::{
    Cell, Pattern, likelihood::Looks, resultant_confidence, rounding::LEAST_RESULTANT,
};

/// The top of the parabola in dB that fits the readings about the maximum best: a lobe that is
/// Gaussian in power is one.
///
/// The parabola is laid by least squares about the maximum of the moving mean, then once more about
/// its own top. σ is that of the regression, from the readings' scatter or from its residuals,
/// whichever is larger. A lobe that a second path distorts stays a parabola: σ does not know of it.
/// The level is the mean over the measured positions; the confidence is [`resultant_confidence`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MainLobeFit {
    half_width: f64,
    sample_sigma_db: f64,
    rss_sigma_db: f64,
    max_sigma: f64,
}

/// 40° to either side: the main lobe of a patch to 4 dB below its top; readings of 2 dB where a
/// turn does not show their scatter, a level's σ of 7.9 dB, bearings up to 1 rad of σ.
impl Default for MainLobeFit {
    fn default() -> Self {
        let half_width = 40.0_f64.to_radians();
        Self { half_width, sample_sigma_db: 2.0, rss_sigma_db: 7.9, max_sigma: 1.0 }
    }
}

/// A parabola goes through any three.
const FEWEST: u16 = 4;

/// The moving mean that the maximum is sought in.
const WINDOW: u16 = 7;

const PRIOR_FREEDOM: f64 = 4.0;

impl MainLobeFit {
    /// Sets the half-width of the parabola, in radians.
    ///
    /// # Errors
    ///
    /// If it is not between 0 and half a turn.
    pub fn with_half_width(self, half_width: f64) -> Result<Self, ParameterError> {
        let holds = half_width > 0.0 && half_width < core::f64::consts::PI;
        let half_width = require(holds, "half_width", half_width, "between 0 and π")?;
        Ok(Self { half_width, ..self })
    }

    /// Sets another standard deviation of the level, in dB.
    ///
    /// # Errors
    ///
    /// If it is not a positive number.
    pub fn with_rss_sigma_db(self, sigma: f64) -> Result<Self, ParameterError> {
        Ok(Self { rss_sigma_db: positive("rss_sigma_db", sigma)?, ..self })
    }

    /// Sets the largest standard deviation of bearings that are used, in radians.
    ///
    /// # Errors
    ///
    /// If it is not a positive number.
    pub fn with_max_sigma(self, sigma: f64) -> Result<Self, ParameterError> {
        Ok(Self { max_sigma: positive("max_sigma", sigma)?, ..self })
    }

    fn bearing(&self, looks: &Looks, pattern: &Pattern) -> Result<Bearing, NoBearing> {
        let maximum =
            pattern.cells().iter().filter_map(Cell::smoothed_dbm).fold(f64::NEG_INFINITY, f64::max);
        let strongest = |cell: &&Cell| cell.smoothed_dbm().is_some_and(|dbm| dbm > maximum - 1e-9);
        let strongest: Resultant =
            pattern.cells().iter().filter(strongest).map(Cell::angle).collect();
        let Some(angle) = strongest.direction(LEAST_RESULTANT) else {
            return Err(NoBearing::Ambiguous { resultant: strongest.length() });
        };
        let noise = looks.sample_variance(self.sample_sigma_db, PRIOR_FREEDOM);
        let first = self.parabola(looks, angle::wrap(angle - looks.origin), noise)?;
        let (offset, sigma) = self.parabola(looks, first.0, noise)?;
        if sigma > self.max_sigma {
            return Err(NoBearing::TooWide { sigma, limit: self.max_sigma });
        }
        let angle = angle::wrap(looks.origin + offset);
        Ok(Bearing { angle, sigma: sigma.max(1e-5), confidence: resultant_confidence(pattern) })
    }

    /// The top of the parabola about `center`, and its σ.
    fn parabola(&self, looks: &Looks, center: f64, noise: f64) -> Result<(f64, f64), NoBearing> {
        let near = || {
            looks.looks.iter().filter_map(|look| {
                let off = angle::wrap(look.offset - center);
                (off.abs() <= self.half_width).then_some((off, look))
            })
        };
        let mut normal = Matrix3::zeros();
        let mut pull = Vector3::zeros();
        let mut measured = 0_u16;
        let reference = near().map(|(_, look)| look.mean_dbm).fold(f64::NEG_INFINITY, f64::max);
        for (off, look) in near() {
            let row = Vector3::new(1.0, off, off * off);
            normal += look.count * row * row.transpose();
            pull += look.count * (look.mean_dbm - reference) * row;
            measured = measured.saturating_add(1);
        }
        let sparse = NoBearing::TooSparse { measured, needed: FEWEST };
        if measured < FEWEST {
            return Err(sparse);
        }
        let factor = normal.cholesky().ok_or(sparse)?;
        let fitted = factor.solve(&pull);
        let slope = fitted.y;
        let bend = fitted.z;
        let top = -0.5 * slope / bend;
        let flat = NoBearing::TooWide { sigma: core::f64::consts::PI, limit: self.max_sigma };
        // No lobe, or one whose top is elsewhere.
        if !(bend < 0.0 && top.abs() <= self.half_width) {
            return Err(flat);
        }
        let square = |(off, look): (f64, &crate::extractor::likelihood::Look)| {
            let rest = look.mean_dbm - reference - fitted.dot(&Vector3::new(1.0, off, off * off));
            look.count * rest * rest
        };
        let left = f64::from(measured) - 3.0;
        let scale = near().map(square).sum::<f64>() / left;
        // ∂top/∂(slope, bend).
        let gradient = Vector3::new(0.0, -0.5 / bend, 0.5 * slope / (bend * bend));
        let variance = gradient.dot(&factor.solve(&gradient)) * scale.max(noise);
        Ok((center + top, libm::sqrt(variance)))
    }
}

impl BearingExtractor for MainLobeFit {
    fn extract(&self, sweep: &Sweep<'_>) -> Result<Reading, NoReading> {
        let pattern = Pattern::new(sweep, WINDOW)?;
        let looks = Looks::new(sweep)?;
        Ok(Reading {
            rss_dbm: pattern.rss_dbm(),
            rss_sigma_db: self.rss_sigma_db,
            bearing: self.bearing(&looks, &pattern),
            covariance: 0.0,
            modes: BearingModes::default(),
        })
    }
}
