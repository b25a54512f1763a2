//! Receptions, and their intake as observations.

use nalgebra::{SMatrix, SVector, Vector3};

use crate::{
    BeaconId, Bearing, BearingModes, MeasuredList, Observation, ObservationError, Pose, Quantity,
    Reading, Sweep,
};
#[cfg(feature = "alloc")]
use crate::{Measured, Sample};

/// σ of a boresight in radians: that of a compass that is well calibrated, 1°.
#[cfg(feature = "alloc")]
const BORESIGHT_SIGMA: f64 = 0.017;

/// One receiver's measurements of one beacon in one turn: the datum that is logged and replayed.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(from = "Written", into = "Written"))]
pub struct Reception {
    /// The beacon whose signal was received.
    pub beacon: BeaconId,
    /// The time of the reception, in seconds.
    pub time: f64,
    /// The receiver's pose.
    pub receiver: Pose,
    /// The received power, if the receiver measures it.
    pub level: Option<Level>,
    /// The receiver's floor with the σ of a level, where nothing but its own noise was received:
    /// the beacon's level lay below it. `level` is absent then.
    pub silence: Option<Level>,
    /// The receiver's ceiling with the σ of a level, where the receiver was at it: the beacon's
    /// level lay above. `level` is absent then.
    pub saturation: Option<Level>,
    /// The direction of arrival, if the sweep had one.
    pub bearing: Option<Bearing>,
    /// The covariance of level and bearing, in dB rad.
    pub covariance: f64,
    /// The directions that compete for the bearing, where there is more than one.
    pub modes: BearingModes,
    /// σ of the receiver's own place to East, North and Up in metres; known where absent.
    pub receiver_sigma_m: Option<Vector3<f64>>,
    /// Anything else that was measured, by the names of its quantities.
    pub measured: MeasuredList,
}

impl Reception {
    /// An extractor's reading of a sweep, with the sweep's other measurements.
    #[must_use]
    pub fn new(sweep: &Sweep<'_>, reading: &Reading) -> Self {
        Self {
            level: Some(Level { rss_dbm: reading.rss_dbm, sigma_db: reading.rss_sigma_db }),
            bearing: reading.bearing.ok(),
            covariance: reading.covariance,
            modes: reading.modes,
            ..Self::without_pattern(sweep)
        }
    }

    /// Each sample of a sweep, one level along one boresight, and each question without an answer
    /// where the receiver's floor is known, as a reception of its own: a level, or a silence, with
    /// σ [`Sample::SIGMA_DB`], and where the antenna looked ([`Quantity::BORESIGHT`]). In the
    /// order of time.
    #[cfg(feature = "alloc")]
    #[must_use]
    pub fn of_samples(sweep: &Sweep<'_>) -> alloc::vec::Vec<Self> {
        let whole = Self { measured: MeasuredList::default(), ..Self::without_pattern(sweep) };
        let along = |boresight: f64| {
            // The list has room for one value; a direction that is not finite makes no observation.
            let direction = Measured::new(Quantity::BORESIGHT, boresight, BORESIGHT_SIGMA);
            direction.and_then(|direction| MeasuredList::new(&[direction])).unwrap_or_default()
        };
        let level = |rss_dbm| Some(Level { rss_dbm, sigma_db: Sample::SIGMA_DB });
        let samples = sweep.samples.iter().map(|sample| Self {
            time: sample.time,
            receiver: sample.receiver,
            level: level(sample.rss_dbm),
            measured: along(sample.boresight),
            ..whole
        });
        let silent = sweep.floor_dbm.into_iter().flat_map(|floor| {
            sweep.unanswered.iter().map(move |missed| Self {
                time: missed.time,
                silence: level(floor),
                measured: along(missed.boresight),
                ..whole
            })
        });
        let mut receptions: alloc::vec::Vec<_> = samples.chain(silent).collect();
        receptions.sort_by(|a, b| a.time.total_cmp(&b.time));
        receptions
    }

    /// The measurements of a sweep besides the power along boresights.
    #[must_use]
    pub fn without_pattern(sweep: &Sweep<'_>) -> Self {
        Self {
            beacon: sweep.beacon,
            time: sweep.time,
            receiver: sweep.receiver,
            receiver_sigma_m: sweep.receiver_sigma_m,
            measured: sweep.measured,
            ..Self::default()
        }
    }

    /// The level, or the limit that hides it: the floor of a silence, the ceiling of a saturated
    /// receiver.
    #[must_use]
    pub fn any_level(&self) -> Option<Level> {
        self.level.or(self.silence).or(self.saturation)
    }

    /// Checks the level as [`ByQuantity`] does, without building the observation.
    ///
    /// # Errors
    ///
    /// [`ObservationError`] names the number that cannot be one of an observation.
    pub fn check_level(&self) -> Result<(), ObservationError> {
        let Some(Level { rss_dbm, sigma_db }) = self.level else { return Ok(()) };
        let component = core::iter::once((rss_dbm, sigma_db * sigma_db));
        ObservationError::check(self.time, &self.receiver, component)?;
        self.receiver_sigma_m.iter().try_for_each(ObservationError::check_receiver_sigma)
    }

    /// Returns true if it holds a direction: a bearing, or several that compete for one, which may
    /// be too far apart to have a common one.
    #[must_use]
    pub fn has_bearing(&self) -> bool {
        self.bearing.is_some() || !self.modes.is_empty()
    }
}

#[cfg(feature = "serde")]
impl From<Written> for Reception {
    fn from(written: Written) -> Self {
        let level = |dbm: Option<f64>| {
            let level = dbm.zip(written.rss_sigma_db);
            level.map(|(rss_dbm, sigma_db)| Level { rss_dbm, sigma_db })
        };
        Self {
            beacon: written.beacon,
            time: written.time,
            receiver: written.receiver,
            level: level(written.rss_dbm),
            silence: level(written.floor_dbm),
            saturation: level(written.ceiling_dbm),
            bearing: written.bearing,
            covariance: written.covariance,
            modes: written.modes,
            receiver_sigma_m: written.receiver_sigma_m,
            measured: written.measured,
        }
    }
}

/// A received power.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Level {
    /// The power in dBm.
    pub rss_dbm: f64,
    /// Standard deviation of the power in dB.
    pub sigma_db: f64,
}

/// A reception as it stands in a file.
#[cfg(feature = "serde")]
#[derive(serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct Written {
    beacon: BeaconId,
    time: f64,
    receiver: Pose,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    rss_dbm: Option<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    rss_sigma_db: Option<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    floor_dbm: Option<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    ceiling_dbm: Option<f64>,
    bearing: Option<Bearing>,
    covariance: f64,
    #[serde(default, skip_serializing_if = "BearingModes::is_empty")]
    modes: BearingModes,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    receiver_sigma_m: Option<Vector3<f64>>,
    #[serde(default, skip_serializing_if = "MeasuredList::is_empty")]
    measured: MeasuredList,
}

#[cfg(feature = "serde")]
impl From<Reception> for Written {
    fn from(reception: Reception) -> Self {
        Self {
            beacon: reception.beacon,
            time: reception.time,
            receiver: reception.receiver,
            rss_dbm: reception.level.map(|level| level.rss_dbm),
            rss_sigma_db: reception.any_level().map(|level| level.sigma_db),
            floor_dbm: reception.silence.map(|floor| floor.rss_dbm),
            ceiling_dbm: reception.saturation.map(|ceiling| ceiling.rss_dbm),
            bearing: reception.bearing,
            covariance: reception.covariance,
            modes: reception.modes,
            receiver_sigma_m: reception.receiver_sigma_m,
            measured: reception.measured,
        }
    }
}

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
    use approx::assert_abs_diff_eq;
    use nalgebra::{Matrix2, Vector2};

    use super::*;
    use crate::{BearingMode, Measured};
    #[cfg(feature = "serde")]
    use crate::{Sample, Unanswered};

    /// A level is refused as the observation of it is.
    #[test]
    fn a_level_is_checked_as_its_observation_is() {
        let numbers = [f64::NAN, f64::INFINITY, -1.0, 0.0, 1.0];
        let sound = Reception {
            time: 1.0,
            receiver: Pose::at(1.0, 2.0, 3.0),
            level: Some(Level { rss_dbm: -60.0, sigma_db: 4.0 }),
            receiver_sigma_m: Some(Vector3::repeat(3.0)),
            ..Reception::default()
        };
        assert_eq!(sound.check_level(), Ok(()));
        for number in numbers {
            let level =
                |rss_dbm, sigma_db| Reception { level: Some(Level { rss_dbm, sigma_db }), ..sound };
            for reception in [
                level(number, 4.0),
                level(-60.0, number),
                Reception { time: number, ..sound },
                Reception { time: number, level: None, ..sound },
                Reception { receiver: Pose { pitch: number, ..sound.receiver }, ..sound },
                Reception { receiver_sigma_m: Some(Vector3::repeat(number)), ..sound },
            ] {
                let observed = ByQuantity([Quantity::RSS]).observation(&reception).map(|_| ());
                let checked = reception.check_level();
                let texts = [checked, observed].map(|result| alloc::format!("{result:?}"));
                assert_eq!(texts[0], texts[1], "{reception:?}");
            }
        }
    }

    #[cfg(feature = "serde")]
    #[test]
    fn samples_and_misses_are_receptions_in_the_order_of_time() {
        let sample = |time, boresight| Sample {
            time,
            receiver: Pose::at(time, 0.0, 5.0),
            boresight,
            position: 0,
            rss_dbm: -70.0,
        };
        let samples = [sample(1.0, 0.5), sample(3.0, 1.5)];
        let unanswered = [Unanswered { time: 2.0, boresight: 1.0, position: 0 }];
        let sweep = Sweep { samples: &samples, unanswered: &unanswered, ..Sweep::default() };
        let known = Sweep { floor_dbm: Some(-90.0), ..sweep };
        let receptions = Reception::of_samples(&known);
        let boresight = |r: &Reception| r.measured.get(Quantity::BORESIGHT).map(|m| m.value);
        assert_eq!(
            receptions.iter().map(boresight).collect::<alloc::vec::Vec<_>>(),
            [Some(0.5), Some(1.0), Some(1.5)]
        );
        assert_eq!(receptions[0].level, Some(Level { rss_dbm: -70.0, sigma_db: 2.0 }));
        assert_eq!(receptions[0].receiver, samples[0].receiver);
        assert_eq!(receptions[1].silence, Some(Level { rss_dbm: -90.0, sigma_db: 2.0 }));
        assert!(receptions[1].level.is_none());
        // Where the floor is not known, a miss may have any reason.
        assert_eq!(Reception::of_samples(&sweep).len(), 2);
    }

    #[cfg(feature = "serde")]
    #[test]
    fn a_reception_is_written_as_it_was_before_there_were_other_quantities() {
        let reception = Reception {
            level: Some(Level { rss_dbm: -60.5, sigma_db: 2.0 }),
            ..Reception::default()
        };
        let text = serde_json::to_string(&reception).expect("plain data");
        assert!(text.contains(r#""rss_dbm":-60.5,"rss_sigma_db":2.0,"bearing":null"#), "{text}");
        assert!(!text.contains("measured"), "{text}");
        assert_eq!(serde_json::from_str::<Reception>(&text).expect("as written"), reception);
        let silent = Reception { level: None, silence: reception.level, ..reception };
        let text = serde_json::to_string(&silent).expect("plain data");
        assert_eq!(serde_json::from_str::<Reception>(&text).expect("as written"), silent);
        let bare = serde_json::to_string(&Reception::default()).expect("plain data");
        assert_eq!(
            serde_json::from_str::<Reception>(&bare).expect("as written"),
            Reception::default()
        );
        assert!(serde_json::from_str::<Reception>(&bare.replace("time", "when")).is_err());
    }

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
        assert_abs_diff_eq!(observation.value()[0], 12.5, epsilon = 0.0);
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
