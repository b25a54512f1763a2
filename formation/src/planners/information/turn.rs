use core::f64::consts::{FRAC_PI_2, LN_10};

use foxhunt_core::{
    Reception, angle, elementary,
    parameter::{ParameterError, positive, require},
    vectorised::{self, Kernel},
};
use nalgebra::{Matrix2, Vector2, Vector3};

/// The expected reading of a target in one turn of an antenna.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ExpectedReading {
    /// The level in dB, up to a constant that is the same everywhere.
    pub level_db: f64,
    /// Standard deviation of the level in dB.
    pub level_sigma_db: f64,
    /// The direction to the target, in radians counter-clockwise from East.
    pub bearing: f64,
    /// Standard deviation of the direction in radians.
    pub bearing_sigma: f64,
}

/// The Fisher information of one turn of an antenna about a target's place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TurnFisher {
    /// Gradient of the level over the target's East and North, in dB/m.
    pub level_gradient: Vector2<f64>,
    /// The inverse of the level's variance, in 1/dB².
    pub level_information: f64,
    /// The Fisher information of the bearing, in 1/m².
    pub bearing: Matrix2<f64>,
}

/// Number of targets that a model is given at once, so that it can go through them in loops over
/// columns.
pub const TARGETS: usize = 32;

/// The expected readings of many targets in one turn, a column for each field of
/// [`ExpectedReading`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ExpectedReadings {
    /// The levels in dB.
    pub level_db: [f64; TARGETS],
    /// Standard deviations of the levels in dB.
    pub level_sigma_db: [f64; TARGETS],
    /// The directions in radians counter-clockwise from East.
    pub bearing: [f64; TARGETS],
    /// Standard deviations of the directions in radians.
    pub bearing_sigma: [f64; TARGETS],
}

/// The Fisher information of one turn about the places of many targets, a column for each number of
/// [`TurnFisher`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TurnFishers {
    /// Gradient of the level over the target's East and North, in dB/m.
    pub level_gradient: [[f64; TARGETS]; 2],
    /// The inverse of the level's variance, in 1/dB².
    pub level_information: [f64; TARGETS],
    /// The Fisher information of the bearing about East, both and North, in 1/m².
    pub bearing: [[f64; TARGETS]; 3],
}

impl Default for ExpectedReadings {
    /// Zeros.
    fn default() -> Self {
        let zeros = [0.0; TARGETS];
        Self { level_db: zeros, level_sigma_db: zeros, bearing: zeros, bearing_sigma: zeros }
    }
}

impl Default for TurnFishers {
    /// Zeros.
    fn default() -> Self {
        let zeros = [0.0; TARGETS];
        Self { level_gradient: [zeros; 2], level_information: zeros, bearing: [zeros; 3] }
    }
}

impl TurnFisher {
    /// The Fisher information of both about East and North, in 1/m², if the transmitter's power is
    /// known (Kay 1993, §3.9; what σ's own dependence on the place would add is left out).
    #[must_use]
    pub fn total(&self) -> Matrix2<f64> {
        let gradient = self.level_gradient;
        gradient * gradient.transpose() * self.level_information + self.bearing
    }
}

/// A model of what one turn of an antenna reads, and so of how much it teaches about a target's
/// place.
///
/// One method is required. A closure of target (East, North) and receiver (East, North, Up), in
/// metres, that gives an [`ExpectedReading`] is a model as well.
///
/// ```
/// use foxhunt_core::Reception;
/// use foxhunt_formation::{ExpectedReading, Information, InformationConfig, TurnInformation};
/// use nalgebra::{Vector2, Vector3};
///
/// /// Levels alone, by free-space loss, as an omnidirectional antenna reads them.
/// struct LevelOnly {
///     sigma_db: f64,
/// }
///
/// impl TurnInformation for LevelOnly {
///     fn expected(&self, target: &Vector2<f64>, receiver: &Vector3<f64>) -> ExpectedReading {
///         let offset = target - receiver.xy();
///         let range = (offset.norm_squared() + receiver.z * receiver.z).sqrt().max(1.0);
///         ExpectedReading {
///             level_db: -20.0 * range.log10(),
///             level_sigma_db: self.sigma_db,
///             bearing: offset.y.atan2(offset.x),
///             // So wide that the bearing counts for nothing.
///             bearing_sigma: 1e3,
///         }
///     }
///
///     fn learn(&mut self, reception: &Reception) {
///         if let Some(level) = reception.level {
///             self.sigma_db = level.sigma_db;
///         }
///     }
/// }
///
/// let model = LevelOnly { sigma_db: 6.0 };
/// let near = model.fisher(&Vector2::zeros(), &Vector3::new(10.0, 0.0, 2.0));
/// let far = model.fisher(&Vector2::zeros(), &Vector3::new(50.0, 0.0, 2.0));
/// assert!(near.total().trace() > far.total().trace());
/// let planner = Information::with_turn(InformationConfig::default(), model)?;
/// # let _ = planner;
/// # Ok::<(), foxhunt_core::parameter::ParameterError>(())
/// ```
pub trait TurnInformation {
    /// Returns the reading that a receiver at `receiver` is expected to have of a target at
    /// `target`.
    fn expected(&self, target: &Vector2<f64>, receiver: &Vector3<f64>) -> ExpectedReading;

    /// Returns the reading's Jacobian over the target's place: level in the first row, in dB/m,
    /// bearing in the second, in rad/m. Unless overridden, by central differences.
    fn jacobian(&self, target: &Vector2<f64>, receiver: &Vector3<f64>) -> Matrix2<f64> {
        let mut jacobian = Matrix2::zeros();
        let offset = (target - receiver.xy()).norm();
        let step = 1e-5 * offset.max(1.0);
        for column in 0..2 {
            let mut shift = Vector2::zeros();
            shift[column] = step;
            let ahead = self.expected(&(target + shift), receiver);
            let behind = self.expected(&(target - shift), receiver);
            jacobian[(0, column)] = (ahead.level_db - behind.level_db) / (2.0 * step);
            jacobian[(1, column)] = angle::wrap(ahead.bearing - behind.bearing) / (2.0 * step);
        }
        jacobian
    }

    /// The Fisher information of a turn: the rows of the Jacobian over their variances.
    fn fisher(&self, target: &Vector2<f64>, receiver: &Vector3<f64>) -> TurnFisher {
        let reading = self.expected(target, receiver);
        let jacobian = self.jacobian(target, receiver);
        let bearing = jacobian.row(1).transpose();
        let bearing_variance = reading.bearing_sigma * reading.bearing_sigma;
        TurnFisher {
            level_gradient: jacobian.row(0).transpose(),
            level_information: 1.0 / (reading.level_sigma_db * reading.level_sigma_db),
            bearing: bearing * bearing.transpose() / bearing_variance,
        }
    }

    /// Sets what is expected of many targets, whose East and North are given; unless overridden,
    /// one after the other by [`expected`](Self::expected).
    fn expected_of_all(
        &self,
        targets: &[[f64; TARGETS]; 2],
        receiver: &Vector3<f64>,
        readings: &mut ExpectedReadings,
    ) {
        for (i, (east, north)) in targets[0].iter().zip(&targets[1]).enumerate() {
            let reading = self.expected(&Vector2::new(*east, *north), receiver);
            readings.level_db[i] = reading.level_db;
            readings.level_sigma_db[i] = reading.level_sigma_db;
            readings.bearing[i] = reading.bearing;
            readings.bearing_sigma[i] = reading.bearing_sigma;
        }
    }

    /// Sets the Fisher information about many targets, whose East and North are given; unless
    /// overridden, one after the other by [`fisher`](Self::fisher).
    fn fisher_of_all(
        &self,
        targets: &[[f64; TARGETS]; 2],
        receiver: &Vector3<f64>,
        fishers: &mut TurnFishers,
    ) {
        for (i, (east, north)) in targets[0].iter().zip(&targets[1]).enumerate() {
            let fisher = self.fisher(&Vector2::new(*east, *north), receiver);
            fishers.level_gradient[0][i] = fisher.level_gradient.x;
            fishers.level_gradient[1][i] = fisher.level_gradient.y;
            fishers.level_information[i] = fisher.level_information;
            fishers.bearing[0][i] = fisher.bearing[(0, 0)];
            fishers.bearing[1][i] = fisher.bearing[(0, 1)];
            fishers.bearing[2][i] = fisher.bearing[(1, 1)];
        }
    }

    /// Takes note of the σs of a reception. Unless overridden, nothing is learned.
    fn learn(&mut self, reception: &Reception) {
        let _ = reception;
    }
}

impl<F: Fn(&Vector2<f64>, &Vector3<f64>) -> ExpectedReading> TurnInformation for F {
    fn expected(&self, target: &Vector2<f64>, receiver: &Vector3<f64>) -> ExpectedReading {
        self(target, receiver)
    }
}

/// Level by a path-loss law over the slant range, and a bearing, of a target on the ground.
///
/// Both are as certain as the distance is short: with exponent γ and σ in dB, range alone has a
/// standard deviation of σ ln 10 d / (10 γ), and across the range that of the bearing times the
/// range (Patwari et al. 2005). Straight above the target the level changes no longer and the
/// bearing has no meaning: its σ grows with 1/cos ε of the elevation ε, and above the limit with
/// (tan ε / tan limit)² besides.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RssBearingTurn {
    /// 10 γ / ln 10: the level's change over the logarithm of range, in dB.
    slope: f64,
    level_variance: f64,
    bearing: Sigma,
    /// tan² of the limit.
    steep: f64,
}

impl RssBearingTurn {
    /// A turn with a path-loss exponent, σ of its level in dB and of its bearing in radians, of a
    /// target at the drone's own height, and the elevation in radians above which bearings are
    /// spoiled.
    ///
    /// # Errors
    ///
    /// [`ParameterError`] names the value that is not positive, or the limit that is not below π/2.
    pub fn new(
        exponent: f64,
        level_sigma_db: f64,
        bearing_sigma: f64,
        elevation_limit: f64,
    ) -> Result<Self, ParameterError> {
        positive("exponent", exponent)?;
        positive("level_sigma_db", level_sigma_db)?;
        positive("bearing_sigma", bearing_sigma)?;
        let in_range = elevation_limit > 0.0 && elevation_limit < FRAC_PI_2;
        require(in_range, "elevation_limit", elevation_limit, "above 0 and below π/2")?;
        let tan = libm::tan(elevation_limit);
        Ok(Self {
            slope: 10.0 * exponent / LN_10,
            level_variance: level_sigma_db * level_sigma_db,
            bearing: Sigma::assumed(bearing_sigma),
            steep: tan * tan,
        })
    }

    /// The bearing's variance at a horizontal distance and a height, both squared.
    #[inline(always)]
    fn bearing_variance(&self, ground2: f64, height2: f64) -> f64 {
        // A drone straight above has a bearing of next to no information.
        let ground2 = ground2.max(1e-12 * (1.0 + height2));
        let tan2 = height2 / ground2;
        let steep = (tan2 / self.steep).max(1.0);
        self.bearing.variance() * (1.0 + tan2) * steep * steep
    }

    /// The level's change with the target's offset, over that offset, and the bearing's information
    /// across it, over its square, at a horizontal distance and a height, both squared. One
    /// division for each target.
    #[inline(always)]
    fn slopes(&self, ground2: f64, height2: f64) -> [f64; 2] {
        let precision = 1.0 / self.bearing.variance();
        let limit = self.steep / height2;
        let range2 = (ground2 + height2).max(1e-24);
        let ground2 = ground2.max(1e-12 * (1.0 + height2));
        let both = 1.0 / (ground2 * range2);
        let steep = (ground2 * limit).min(1.0);
        [-self.slope * (ground2 * both), both * precision * (steep * steep)]
    }
}

struct ExpectedOfAll<'a> {
    turn: &'a RssBearingTurn,
    targets: &'a [[f64; TARGETS]; 2],
    receiver: &'a Vector3<f64>,
    readings: &'a mut ExpectedReadings,
}

impl Kernel for ExpectedOfAll<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Self { turn, targets: [east, north], receiver, readings } = self;
        let height2 = receiver.z * receiver.z;
        for i in 0..TARGETS {
            let x = east[i] - receiver.x;
            let y = north[i] - receiver.y;
            let ground2 = x * x + y * y;
            let range2 = (ground2 + height2).max(f64::MIN_POSITIVE);
            readings.level_db[i] = -0.5 * turn.slope * elementary::ln(range2);
            readings.bearing[i] = elementary::atan2(y, x);
            readings.bearing_sigma[i] = elementary::sqrt(turn.bearing_variance(ground2, height2));
        }
        readings.level_sigma_db = [libm::sqrt(turn.level_variance); TARGETS];
    }
}

struct FisherOfAll<'a> {
    turn: &'a RssBearingTurn,
    targets: &'a [[f64; TARGETS]; 2],
    receiver: &'a Vector3<f64>,
    fishers: &'a mut TurnFishers,
}

impl Kernel for FisherOfAll<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Self { turn, targets: [east, north], receiver, fishers } = self;
        for i in 0..TARGETS {
            let x = east[i] - receiver.x;
            let y = north[i] - receiver.y;
            let [level, across] = turn.slopes(x * x + y * y, receiver.z * receiver.z);
            fishers.level_gradient[0][i] = x * level;
            fishers.level_gradient[1][i] = y * level;
            fishers.bearing[0][i] = y * y * across;
            fishers.bearing[1][i] = -x * y * across;
            fishers.bearing[2][i] = x * x * across;
        }
        fishers.level_information = [1.0 / turn.level_variance; TARGETS];
    }
}

impl TurnInformation for RssBearingTurn {
    fn expected(&self, target: &Vector2<f64>, receiver: &Vector3<f64>) -> ExpectedReading {
        let offset = target - receiver.xy();
        let ground2 = offset.norm_squared();
        let height2 = receiver.z * receiver.z;
        let range2 = (ground2 + height2).max(f64::MIN_POSITIVE);
        ExpectedReading {
            level_db: -0.5 * self.slope * libm::log(range2),
            level_sigma_db: libm::sqrt(self.level_variance),
            bearing: libm::atan2(offset.y, offset.x),
            bearing_sigma: libm::sqrt(self.bearing_variance(ground2, height2)),
        }
    }

    fn jacobian(&self, target: &Vector2<f64>, receiver: &Vector3<f64>) -> Matrix2<f64> {
        let offset = target - receiver.xy();
        let ground2 = offset.norm_squared();
        let level = -self.slope / (ground2 + receiver.z * receiver.z).max(f64::MIN_POSITIVE);
        let bearing = 1.0 / ground2.max(1e-12);
        Matrix2::new(level * offset.x, level * offset.y, -bearing * offset.y, bearing * offset.x)
    }

    fn fisher(&self, target: &Vector2<f64>, receiver: &Vector3<f64>) -> TurnFisher {
        let offset = target - receiver.xy();
        let x = offset.x;
        let y = offset.y;
        let [level, across] = self.slopes(x * x + y * y, receiver.z * receiver.z);
        TurnFisher {
            level_gradient: offset * level,
            level_information: 1.0 / self.level_variance,
            bearing: Matrix2::new(y * y, -x * y, -x * y, x * x) * across,
        }
    }

    fn expected_of_all(
        &self,
        targets: &[[f64; TARGETS]; 2],
        receiver: &Vector3<f64>,
        readings: &mut ExpectedReadings,
    ) {
        vectorised::run(ExpectedOfAll { turn: self, targets, receiver, readings });
    }

    fn fisher_of_all(
        &self,
        targets: &[[f64; TARGETS]; 2],
        receiver: &Vector3<f64>,
        fishers: &mut TurnFishers,
    ) {
        vectorised::run(FisherOfAll { turn: self, targets, receiver, fishers });
    }

    /// The bearing's σ becomes that of the bearings received so far, what was assumed counting as
    /// three of them. The level's is left: that of extractors covers laws of propagation that do
    /// not hold, which estimators find out.
    fn learn(&mut self, reception: &Reception) {
        if let Some(bearing) = reception.bearing {
            self.bearing.add(bearing.sigma);
        }
    }
}

/// A standard deviation that is assumed first and then read off receptions: the root of the
/// harmonic mean of variances, so that the information is right on average.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Sigma {
    /// The sum of 1/σ² and how many are in it.
    information: f64,
    count: f64,
}

impl Sigma {
    const ASSUMED: f64 = 3.0;

    fn assumed(sigma: f64) -> Self {
        Self { information: Self::ASSUMED / (sigma * sigma), count: Self::ASSUMED }
    }

    fn add(&mut self, sigma: f64) {
        let information = 1.0 / (sigma * sigma);
        if information.is_finite() {
            self.information += information;
            self.count += 1.0;
        }
    }

    fn variance(&self) -> f64 {
        self.count / self.information
    }
}

#[cfg(test)]
mod tests {
    use approx::assert_abs_diff_eq;
    use proptest::prelude::*;

    use super::*;

    fn turn() -> RssBearingTurn {
        RssBearingTurn::new(2.765, 4.0, 0.5, 0.6).expect("all are in range")
    }

    proptest! {
        #[test]
        fn the_closed_form_is_the_numeric_one(
            east in -80.0..80.0, north in -80.0..80.0, up in 0.5..30.0,
        ) {
            let turn = turn();
            let numeric = |target: &Vector2<f64>, receiver: &Vector3<f64>| {
                turn.expected(target, receiver)
            };
            let target = Vector2::new(3.0, -7.0);
            let receiver = Vector3::new(east, north, up);
            prop_assume!((receiver.xy() - target).norm() > 0.5);
            let error = turn.jacobian(&target, &receiver) - numeric.jacobian(&target, &receiver);
            prop_assert!(error.norm() < 1e-6, "{error}");
            let closed = turn.fisher(&target, &receiver).total();
            let differences = numeric.fisher(&target, &receiver).total();
            prop_assert!((closed - differences).norm() < 1e-6 * (1.0 + closed.norm()));
        }
    }

    #[test]
    fn many_targets_are_as_each_of_them() {
        let turn = turn();
        let receiver = Vector3::new(3.0, -7.0, 4.0);
        let mut targets = [[0.0_f64; TARGETS]; 2];
        for i in 1..TARGETS {
            let range = libm::exp(0.2 * targets[0][i - 1].abs().min(25.0));
            targets[0][i] = 3.0 + range * libm::cos(2.4 * range);
            targets[1][i] = -7.0 + range * libm::sin(2.4 * range);
        }
        let mut readings = ExpectedReadings::default();
        let mut fishers = TurnFishers::default();
        turn.expected_of_all(&targets, &receiver, &mut readings);
        turn.fisher_of_all(&targets, &receiver, &mut fishers);
        for (i, (east, north)) in targets[0].iter().zip(&targets[1]).enumerate() {
            let target = Vector2::new(*east, *north);
            let (reading, fisher) =
                (turn.expected(&target, &receiver), turn.fisher(&target, &receiver));
            for (a, b) in [
                (readings.level_db[i], reading.level_db),
                (readings.level_sigma_db[i], reading.level_sigma_db),
                (readings.bearing[i], reading.bearing),
                (readings.bearing_sigma[i], reading.bearing_sigma),
                (fishers.level_gradient[0][i], fisher.level_gradient.x),
                (fishers.level_gradient[1][i], fisher.level_gradient.y),
                (fishers.level_information[i], fisher.level_information),
                (fishers.bearing[0][i], fisher.bearing[(0, 0)]),
                (fishers.bearing[1][i], fisher.bearing[(0, 1)]),
                (fishers.bearing[2][i], fisher.bearing[(1, 1)]),
            ] {
                assert_abs_diff_eq!(a, b, epsilon = 1e-12 * (1.0 + b.abs()));
            }
        }
    }

    #[test]
    fn sigmas_of_range_and_of_cross_range() {
        // Far off and low, along East: σ_range = σ ln 10 d / (10 γ), across σ_θ d.
        let information =
            turn().fisher(&Vector2::new(100.0, 0.0), &Vector3::new(0.0, 0.0, 1e-3)).total();
        let range = 4.0 * LN_10 * 100.0 / 27.65;
        assert_abs_diff_eq!(information[(0, 0)] * range * range, 1.0, epsilon = 1e-6);
        assert_abs_diff_eq!(information[(1, 1)] * 50.0 * 50.0, 1.0, epsilon = 1e-6);
        assert_abs_diff_eq!(information[(0, 1)], 0.0, epsilon = 1e-12);
    }

    #[test]
    fn straight_above_there_is_nothing_to_learn() {
        let target = Vector2::new(1.0, 1.0);
        let above = turn().fisher(&target, &Vector3::new(1.0, 1.0, 4.0)).total();
        assert!(above.norm() < 1e-6, "{above}");
        let beside = turn().fisher(&target, &Vector3::new(5.0, 1.0, 2.0)).total();
        assert!(beside.trace() > 0.1);
        // Steeper than the limit a bearing is worth less than 1/cos alone would have it.
        let (low, steep) = (
            turn().expected(&target, &Vector3::new(11.0, 1.0, 2.0)).bearing_sigma,
            turn().expected(&target, &Vector3::new(3.0, 1.0, 4.0)).bearing_sigma,
        );
        assert_abs_diff_eq!(low, 0.5 * libm::sqrt(1.04), epsilon = 1e-12);
        assert!(steep > 0.5 * libm::sqrt(5.0) * 2.0);
        assert!(above.iter().all(|number| number.is_finite()));
    }
}
