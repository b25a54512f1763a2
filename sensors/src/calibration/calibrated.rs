use foxhunt_core::{
    BearingExtractor, BearingMode, BearingModes, NoBearing, NoReading, Reading, Sample, Sweep,
    angle,
    parameter::{ParameterError, finite, in_range, not_negative, positive},
};

use super::BearingOffset;

/// An extractor whose bearings are calibrated: a known offset is taken off, and σ is made what
/// recordings with truth showed it to be, σ² → (scale · σ)² + floor².
///
/// Competing directions are corrected alike. The correlation of level and bearing stays. A σ that
/// grows beyond that of a direction of which nothing is known (π/√3) is no bearing. Bearings may be
/// outliers with some probability: then any direction competes with those that were found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Calibrated<X> {
    extractor: X,
    offset: BearingOffset,
    scale: f64,
    floor: f64,
    outlier_probability: f64,
}

impl<X> Calibrated<X> {
    /// The extractor as it is: no offset, its own σ.
    #[must_use]
    pub fn new(extractor: X) -> Self {
        let offset = BearingOffset::default();
        Self { extractor, offset, scale: 1.0, floor: 0.0, outlier_probability: 0.0 }
    }

    /// Sets the bearings' offset, measured minus true.
    ///
    /// # Errors
    ///
    /// If a number of it is not finite.
    pub fn with_offset(self, offset: BearingOffset) -> Result<Self, ParameterError> {
        finite("constant", offset.constant)?;
        finite("sin_heading", offset.sin_heading)?;
        finite("cos_heading", offset.cos_heading)?;
        Ok(Self { offset, ..self })
    }

    /// Sets σ² → (`scale` · σ)² + `floor`², the floor in radians.
    ///
    /// # Errors
    ///
    /// If the scale or the floor is negative or not finite, or both are 0.
    pub fn with_sigma(self, scale: f64, floor: f64) -> Result<Self, ParameterError> {
        let scale = not_negative("scale", scale)?;
        let floor = not_negative("floor", floor)?;
        positive("scale + floor", scale + floor)?;
        Ok(Self { scale, floor, ..self })
    }

    /// Sets the share of bearings that have nothing to do with the direction, as reflections and
    /// turns right above a transmitter give them. The reading's bearing stays what it was; an
    /// observation made of it takes the moments of all directions, so that estimators that do not
    /// weigh them one by one are careful: 2 % make 16° of a σ of 6°.
    ///
    /// # Errors
    ///
    /// If it is not from 0 to 0.5.
    pub fn with_outliers(self, probability: f64) -> Result<Self, ParameterError> {
        let outlier_probability =
            in_range("outlier_probability", probability, 0.0..=0.5, "from 0 to 0.5")?;
        Ok(Self { outlier_probability, ..self })
    }

    fn sigma(&self, sigma: f64) -> f64 {
        libm::hypot(self.scale * sigma, self.floor)
    }

    /// A direction with its error at the heading towards it taken off.
    fn angle(&self, sweep: &Sweep<'_>, direction: f64) -> f64 {
        if self.offset == BearingOffset::default() {
            return angle::wrap(direction);
        }
        angle::wrap(direction - self.offset.at(heading_towards(sweep, direction)))
    }

    /// The directions that compete, the only one where nothing else does.
    fn modes(&self, sweep: &Sweep<'_>, reading: &Reading) -> BearingModes {
        let alone = reading.bearing.as_ref().ok().map(|bearing| {
            [BearingMode { weight: 1.0, angle: bearing.angle, sigma: bearing.sigma }]
        });
        let own = match (reading.modes.as_slice(), &alone) {
            ([], Some(alone)) => alone,
            (modes, _) => modes,
        };
        let mut corrected = [BearingMode::default(); BearingModes::CAPACITY];
        let mut count = 0;
        for (new, mode) in corrected.iter_mut().zip(own) {
            let angle = self.angle(sweep, mode.angle);
            *new = BearingMode { angle, sigma: self.sigma(mode.sigma), ..*mode };
            count += 1;
        }
        if self.outlier_probability > 0.0 && count > 0 {
            // The most likely are first; where there is no room, any direction takes the last's.
            count = count.min(BearingModes::CAPACITY - 1);
            let found: f64 = corrected[..count].iter().map(|mode| mode.weight).sum();
            let weight = found * self.outlier_probability / (1.0 - self.outlier_probability);
            corrected[count] = BearingMode { weight, sigma: ANY_DIRECTION, ..corrected[0] };
            count += 1;
        }
        BearingModes::new(&corrected[..count]).unwrap_or_default()
    }
}

/// σ of a direction that may be any: the root of the mean square of a uniform angle.
const ANY_DIRECTION: f64 = 1.813_799_364_234_217_8;

impl<X: BearingExtractor> BearingExtractor for Calibrated<X> {
    fn extract(&self, sweep: &Sweep<'_>) -> Result<Reading, NoReading> {
        let reading = self.extractor.extract(sweep)?;
        // Directions that compete may be too far apart for a bearing.
        let modes = self.modes(sweep, &reading);
        let Ok(bearing) = reading.bearing else { return Ok(Reading { modes, ..reading }) };
        let angle = self.angle(sweep, bearing.angle);
        let sigma = self.sigma(bearing.sigma);
        if sigma > bearing.sigma.max(ANY_DIRECTION) {
            let too_wide = Err(NoBearing::TooWide { sigma, limit: ANY_DIRECTION });
            return Ok(Reading { bearing: too_wide, covariance: 0.0, modes, ..reading });
        }
        Ok(Reading {
            bearing: Ok(foxhunt_core::Bearing { angle, sigma, ..bearing }),
            covariance: reading.covariance * (sigma / bearing.sigma),
            modes,
            ..reading
        })
    }
}

/// Heading of the nose while the antenna looked to a direction: that of the nearest sample, so that
/// it holds for an antenna that is turned by a body, too.
#[must_use]
pub fn heading_towards(sweep: &Sweep<'_>, direction: f64) -> f64 {
    let off = |sample: &Sample| (angle::distance(sample.boresight, direction), sample.receiver);
    let nearest = sweep.samples.iter().map(off).min_by(|a, b| a.0.total_cmp(&b.0));
    nearest.map_or(sweep.receiver.heading, |(_, receiver)| receiver.heading)
}
