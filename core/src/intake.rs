use nalgebra::{SMatrix, SVector};

use crate::{Observation, ObservationError, Quantity, Reception};

/// Makes an observation of `M` components of a reception: the link between a reception and an
/// estimator's measurement model.
///
/// [`ByQuantity`] serves every model that names what it measures; a measurement that needs more
/// than picking values, such as one with correlated components, brings its own.
///
/// ```
/// use foxhunt_core::{Intake, Observation, ObservationError, Quantity, Reception};
/// use nalgebra::{Matrix1, Vector1};
///
/// /// The range from the level, by a law that is known: 60 dB are 10 m, 20 dB a decade.
/// struct RangeFromLevel;
///
/// impl Intake<1> for RangeFromLevel {
///     fn quantities(&self) -> [Quantity; 1] {
///         [Quantity::RANGE]
///     }
///
///     fn observation(
///         &self,
///         reception: &Reception,
///     ) -> Result<Option<Observation<1>>, ObservationError> {
///         let Some(level) = reception.level else { return Ok(None) };
///         let range = 10.0_f64.powf(1.0 + (-60.0 - level.rss_dbm) / 20.0);
///         let sigma = range * level.sigma_db * 10.0_f64.ln() / 20.0;
///         let (value, noise) = (Vector1::new(range), Matrix1::new(sigma * sigma));
///         Observation::new(reception.time, reception.receiver, value, noise).map(Some)
///     }
/// }
/// ```
pub trait Intake<const M: usize> {
    /// The quantities of its observations' components. They must equal the quantities of the
    /// estimator's model, which is checked where the two are joined.
    fn quantities(&self) -> [Quantity; M];

    /// The observation, or `None` where the reception holds nothing of these quantities.
    ///
    /// # Errors
    ///
    /// [`ObservationError`] names the number that cannot be one of an observation.
    fn observation(
        &self,
        reception: &Reception,
    ) -> Result<Option<Observation<M>>, ObservationError>;
}

/// An intake that picks each component from the reception by the name of its quantity: level and
/// bearing with their covariance and the directions that compete, anything else from
/// [`Reception::measured`]. Components that the reception does not hold are missing in the
/// observation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ByQuantity<const M: usize>(pub [Quantity; M]);

impl<const M: usize> Intake<M> for ByQuantity<M> {
    fn quantities(&self) -> [Quantity; M] {
        self.0
    }

    fn observation(
        &self,
        reception: &Reception,
    ) -> Result<Option<Observation<M>>, ObservationError> {
        // A component that is missing needs a proper stand-in, which is struck out again.
        let mut value = SVector::<f64, M>::zeros();
        let mut noise = SMatrix::<f64, M, M>::identity();
        let mut present = [false; M];
        let mut level_at = None;
        let mut bearing_at = None;
        for (i, quantity) in self.0.iter().enumerate() {
            let measured = if *quantity == Quantity::RSS {
                level_at = reception.level.map(|_| i);
                reception.level.map(|level| (level.rss_dbm, level.sigma_db))
            } else if *quantity == Quantity::BEARING {
                bearing_at = reception.has_bearing().then_some(i);
                // Directions that compete bring their own moments.
                let stand_in = reception.has_bearing().then_some((0.0, 1.0));
                reception.bearing.map(|bearing| (bearing.angle, bearing.sigma)).or(stand_in)
            } else {
                reception.measured.get(*quantity).map(|m| (m.value, m.sigma))
            };
            if let Some((number, sigma)) = measured {
                value[i] = number;
                noise[(i, i)] = sigma * sigma;
                present[i] = true;
            }
        }
        if let (Some(level), Some(bearing), Some(_)) = (level_at, bearing_at, reception.bearing) {
            noise[(level, bearing)] = reception.covariance;
            noise[(bearing, level)] = reception.covariance;
        }
        if present == [false; M] {
            return Ok(None);
        }
        let mut observation = Observation::new(reception.time, reception.receiver, value, noise)?;
        if let Some(bearing) = bearing_at {
            observation = observation.with_bearing_modes(bearing, reception.modes);
        }
        if let Some(sigma) = reception.receiver_sigma_m {
            observation = observation.with_receiver_sigma(sigma)?;
        }
        let missing = (0..M).filter(|i| !present[*i]);
        Ok(Some(missing.fold(observation, Observation::without)))
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix2, Vector2};

    use super::*;
    use crate::{Bearing, BearingMode, BearingModes, Level, Measured, MeasuredList, Pose};

    fn reception() -> Reception {
        let range = Measured::new(Quantity::RANGE, 12.5, 0.5).expect("proper");
        Reception {
            time: 2.0,
            receiver: Pose::at(1.0, 2.0, 3.0),
            level: Some(Level { rss_dbm: -60.0, sigma_db: 2.0 }),
            bearing: Some(Bearing { angle: 0.4, sigma: 0.1, confidence: 1.0 }),
            covariance: 0.05,
            measured: MeasuredList::new(&[range]).expect("one"),
            ..Reception::default()
        }
    }

    #[test]
    fn level_and_bearing_keep_their_covariance_in_either_order() {
        let made = |order| ByQuantity(order).observation(&reception()).expect("proper");
        let pair = made([Quantity::RSS, Quantity::BEARING]).expect("both are there");
        let noise = Matrix2::new(4.0, 0.05, 0.05, 0.1 * 0.1);
        let direct =
            Observation::new(2.0, Pose::at(1.0, 2.0, 3.0), Vector2::new(-60.0, 0.4), noise);
        assert_eq!(pair, direct.expect("proper"));
        let turned = made([Quantity::BEARING, Quantity::RSS]).expect("both are there");
        assert_eq!(turned.noise(), Matrix2::new(0.1 * 0.1, 0.05, 0.05, 4.0));
    }

    #[test]
    fn what_the_reception_does_not_hold_is_missing() {
        let intake = ByQuantity([Quantity::RANGE, Quantity::RANGE_DIFFERENCE]);
        let observation = intake.observation(&reception()).expect("proper").expect("a range");
        assert!(observation.has(0) && !observation.has(1));
        assert!((observation.value()[0] - 12.5).abs() <= 0.0);
        let none = ByQuantity([Quantity::RANGE_DIFFERENCE]).observation(&reception());
        assert_eq!(none, Ok(None));
    }

    #[test]
    fn directions_that_compete_stand_in_for_a_bearing() {
        let mode = |angle| BearingMode { weight: 0.5, angle, sigma: 0.1 };
        let modes = BearingModes::new(&[mode(0.0), mode(1.0)]).expect("proper");
        let several = Reception { bearing: None, modes, ..reception() };
        let made = ByQuantity([Quantity::BEARING]).observation(&several).expect("proper");
        assert_eq!(made.and_then(|o| o.bearing_modes().map(|(_, m)| *m)), Some(modes));
    }

    #[test]
    fn a_number_that_is_none_is_refused() {
        let bad =
            Reception { level: Some(Level { rss_dbm: f64::NAN, sigma_db: 2.0 }), ..reception() };
        let refused = ByQuantity([Quantity::RSS]).observation(&bad);
        assert!(matches!(refused, Err(ObservationError::Value { component: 0, .. })));
    }
}
