#[cfg(any(feature = "batch", feature = "maps"))]
use foxhunt_core::Pose;
use foxhunt_core::{Belief, Ellipse, Estimate, Reception, Receptions, Remark};
#[cfg(feature = "batch")]
use foxhunt_core::{ByQuantity, Intake, Observation, Quantity, State};
#[cfg(feature = "batch")]
use foxhunt_filters::BatchFix;
use foxhunt_filters::{Censoring, Marginal, PosteriorMap, ShadowedReading};
use nalgebra::{Matrix2, Vector2};
use serde::Serialize;

#[cfg(feature = "batch")]
use super::region::of_modes;
use super::{
    FoundOffset, LocateConfig, LocateError, Region,
    parts::{Part, parts},
};

/// With more probability than this on the border of the area the place is in doubt.
const MUCH_ON_BORDER: f64 = 0.05;

/// Places with less than this share of the best one's density are not reported.
const LEAST_RELATIVE_DENSITY: f64 = 0.01;

/// A transmitter's place.
#[derive(Clone, Debug, PartialEq)]
pub struct Located {
    /// Mean and covariance of the place.
    pub estimate: Estimate<2>,
    /// The ellipse that holds the transmitter with 95 %, where the covariance does not give it: for
    /// few bearings whose σ was itself estimated it follows an F distribution.
    pub own_ellipse_95: Option<Ellipse>,
    /// Number of receptions used.
    pub observations: usize,
    /// Number of receptions that a gate or a weight of zero kept out, or whose measurement was left
    /// out.
    pub rejected: usize,
    /// Indices of the receptions that a gate or a weight of zero kept out.
    pub left_out: Vec<usize>,
    /// Indices of the receptions whose bearing, range or difference was left out as an outlier;
    /// their levels count.
    pub outliers: Vec<usize>,
    /// Indices of the receptions whose level was left out, in order: it stands far from the levels
    /// beside it.
    pub levels_left_out: Vec<usize>,
    /// The probability on the border of the area that was searched, where the estimator searches an
    /// area: where it is large, the transmitter may lie outside.
    pub border_mass: Option<f64>,
    /// Law that explains the receptions, where the estimator weighs explanations.
    pub explanation: Option<Explanation>,
    /// Errors that the bearings of each place share, where the estimator weighs them and there are
    /// places with several bearings.
    pub common_errors: Option<CommonErrors>,
    /// Bias that all measured ranges share, where the estimator found one.
    pub range_bias: Option<RangeBias>,
    /// Offset between the clocks of levels and places, where the levels showed one and it was taken
    /// off.
    pub clock_offset: Option<FoundOffset>,
    /// The smallest region that holds the transmitter with 95 %, in parts that do not touch, where
    /// the estimator has a posterior density: an ellipse is a poor picture of two places, of a
    /// ridge and of a border.
    pub regions_95: Vec<Region>,
    /// The posterior over the cells of a grid, where the estimator has one.
    pub map: Option<PosteriorMap>,
    /// Places of equal weight that stand for the belief, where neither its two moments do nor
    /// there is a map.
    pub places: Vec<Vector2<f64>>,
    /// Other places that are nearly as probable, the most probable first, where the estimator
    /// looks for them: levels from a straight flight are the same on either side.
    pub rivals: Vec<Rival>,
    /// Doubts about the place, each with a sentence that says what to do (docs/remarks.md). An
    /// answer without any stands as it is.
    pub remarks: Vec<Remark>,
}

/// Bias of ranges: each is the scale times the distance, and the offset.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RangeBias {
    /// Offset in metres.
    pub offset_m: Marginal,
    /// Scale, 1 for ranges without a bias.
    pub scale: Marginal,
}

impl RangeBias {
    /// Returns a range without the bias.
    pub(crate) fn without(&self, range_m: f64) -> f64 {
        (range_m - self.offset_m.mean) / self.scale.mean
    }
}

/// Another place where the posterior density has a maximum.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rival {
    /// East and North of the place, in metres.
    pub place: Vector2<f64>,
    /// The density there over that at the estimate, from 0.01 to 1.
    pub relative_density: f64,
}

/// Law of propagation that explains the receptions: means and deviations, or values with their
/// probabilities, over all places and all else that is not known.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Explanation {
    /// The path-loss exponent γ.
    pub exponent: Marginal,
    /// Number of vertical dipoles on the way: 0 where no antenna's gain falls with the elevation, 2
    /// where the receiver's and the transmitter's do. `None` where the antennas are known.
    pub dipoles: Option<Marginal>,
    /// Height of the transmitter in metres. `None` where it was taken for known.
    pub target_up_m: Option<Marginal>,
    /// σ of shadowing and noise together, in dB.
    pub sigma_db: Marginal,
    /// The distances over which shadowing falls to 1/e, in metres, each with its probability.
    pub correlation_lengths_m: Vec<(f64, f64)>,
    /// The shares of the variance that are each reading's own, each with its probability.
    pub own_shares: Vec<(f64, f64)>,
}

/// The errors that all bearings of one place share, as a compass and a site make them.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CommonErrors {
    /// The values of their σ in degrees, each with its probability.
    pub sigmas_deg: Vec<(f64, f64)>,
    /// Each place.
    pub stations: Vec<StationError>,
}

/// The error that all bearings of a place share.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct StationError {
    /// Place of the first bearing, East and North in metres.
    pub place: Vector2<f64>,
    /// Number of bearings.
    pub bearings: usize,
    /// The error, measured minus true, in degrees counter-clockwise.
    pub error_deg_ccw: Marginal,
}

impl Located {
    /// Place of a belief: its moments; of one in several parts the mean of the densest, with the
    /// mean squared deviations of all from it, the other parts being rivals.
    pub fn of_belief(belief: &dyn Belief) -> Self {
        let whole = belief.position();
        let parts = parts(belief);
        let [first, others @ ..] = &parts[..] else { return Self::at(whole) };
        if others.is_empty() {
            return Self::at(whole);
        }
        let away = whole.mean - first.estimate.mean;
        let covariance = whole.covariance + away * away.transpose();
        let rival = |part: &Part| Rival {
            place: part.estimate.mean,
            relative_density: part.density() / first.density(),
        };
        let rivals = others.iter().map(rival);
        Self {
            rivals: rivals.filter(|r| r.relative_density >= LEAST_RELATIVE_DENSITY).collect(),
            ..Self::at(Estimate { mean: first.estimate.mean, covariance })
        }
    }

    /// A place without anything else.
    #[must_use]
    pub fn at(estimate: Estimate<2>) -> Self {
        Self {
            estimate,
            own_ellipse_95: None,
            observations: 0,
            rejected: 0,
            left_out: Vec::new(),
            outliers: Vec::new(),
            levels_left_out: Vec::new(),
            border_mass: None,
            explanation: None,
            common_errors: None,
            range_bias: None,
            clock_offset: None,
            regions_95: Vec::new(),
            map: None,
            places: Vec::new(),
            rivals: Vec::new(),
            remarks: Vec::new(),
        }
    }

    /// Widens the place by an unknown error that the receivers' places share, N(0, `sigma_m`²) on
    /// each axis.
    pub fn shifted(mut self, sigma_m: f64) -> Self {
        self.estimate.covariance += Matrix2::identity() * (sigma_m * sigma_m);
        if let Some(ellipse) = &mut self.own_ellipse_95 {
            let shift_m = sigma_m * (-2.0 * libm::log(0.05_f64)).sqrt();
            ellipse.semi_major = libm::hypot(ellipse.semi_major, shift_m);
            ellipse.semi_minor = libm::hypot(ellipse.semi_minor, shift_m);
        }
        self
    }

    /// The answer with an offset of the clocks that was taken off; without it the place was
    /// `before`.
    pub fn with_clock(mut self, found: FoundOffset, before: &Vector2<f64>) -> Self {
        let text = format!(
            "{}: the clocks of levels and places are taken to differ by that, which moves the \
             place by {:.0} m; --clock-offset-s states another offset, 0 for none",
            found.finding(),
            (self.estimate.mean - before).norm(),
        );
        self.remarks.retain(|remark| remark.code != "clocks-differ");
        self.remarks.insert(0, Remark::new("clock-taken-off", text));
        self.clock_offset = Some(found);
        self
    }

    /// The ellipse that holds the transmitter with 95 %; `None` when the covariance is not positive
    /// definite.
    #[must_use]
    pub fn ellipse_95(&self) -> Option<Ellipse> {
        self.own_ellipse_95.or_else(|| self.estimate.ellipse(0.95))
    }

    /// Returns true if the [`ellipse_95`](Self::ellipse_95) holds a place; `None` without one.
    #[must_use]
    pub fn ellipse_95_holds(&self, place: &Vector2<f64>) -> Option<bool> {
        self.ellipses_away(place).map(|away| away <= 1.0)
    }

    /// Returns the factor by which the [`ellipse_95`](Self::ellipse_95) has to be scaled so that
    /// its border meets a place; `None` without one.
    #[must_use]
    pub fn ellipses_away(&self, place: &Vector2<f64>) -> Option<f64> {
        let ellipse = self.ellipse_95()?;
        let (sin, cos) = libm::sincos(ellipse.orientation);
        let away = place - self.estimate.mean;
        let along = (cos * away.x + sin * away.y) / ellipse.semi_major;
        let across = (cos * away.y - sin * away.x) / ellipse.semi_minor;
        Some(libm::hypot(along, across))
    }

    /// Returns true if the region that a user is shown holds a place: the
    /// [`regions_95`](Self::regions_95) where the ellipse is a poor picture of them, and else the
    /// [`ellipse_95`](Self::ellipse_95). `None` without either.
    #[must_use]
    pub fn region_95_holds(&self, place: &Vector2<f64>) -> Option<bool> {
        if self.ellipse_is_poor() && !self.regions_95.is_empty() {
            return Some(self.regions_95.iter().any(|region| region.holds(place)));
        }
        self.ellipse_95_holds(place)
    }

    /// Returns the negative logarithm of the density at a place, in nats, the density in 1/m²: the
    /// logarithmic score (Good 1952) of the estimate, for which a wide ellipse costs as much as a
    /// miss. The density is the normal one of the estimate; each rival adds the same about its own
    /// place, by its relative density. `None` when the covariance is not positive definite.
    #[must_use]
    pub fn log_score(&self, place: &Vector2<f64>) -> Option<f64> {
        let Estimate { mean, covariance } = &self.estimate;
        let factor = covariance.cholesky()?;
        let kernel = |centre: &Vector2<f64>| -> f64 {
            let away = place - centre;
            -0.5 * away.dot(&factor.solve(&away))
        };
        let mut terms = vec![(1.0, kernel(mean))];
        terms.extend(self.rivals.iter().map(|r| (r.relative_density, kernel(&r.place))));
        // The largest term is taken out, as all of them may underflow.
        let most = terms.iter().map(|(_, log)| *log).fold(f64::NEG_INFINITY, f64::max);
        let sum: f64 = terms.iter().map(|(weight, log)| weight * libm::exp(log - most)).sum();
        let weights: f64 = terms.iter().map(|(weight, _)| weight).sum();
        let log_norm =
            libm::log(core::f64::consts::TAU) + factor.l_dirty().diagonal().map(libm::log).sum();
        Some(log_norm + libm::log(weights) - most - libm::log(sum))
    }

    /// Returns the height of the transmitter above the ground in metres: the estimated one, or that
    /// of the settings.
    #[must_use]
    pub fn up_m(&self, config: &LocateConfig) -> f64 {
        let estimated = self.explanation.as_ref().and_then(|explanation| explanation.target_up_m);
        estimated.map_or(config.target_up_m, |height| height.mean)
    }

    /// Returns true if the ellipse is a poor picture of where the transmitter may be: the region
    /// that holds it is in parts, fills less than half of the ellipse, or reaches the border of the
    /// area that was searched.
    #[must_use]
    pub fn ellipse_is_poor(&self) -> bool {
        let ellipse_m2 = self.ellipse_95().map_or(f64::INFINITY, |ellipse| {
            core::f64::consts::PI * ellipse.semi_major * ellipse.semi_minor
        });
        let region_m2: f64 = self.regions_95.iter().map(|region| region.area_m2).sum();
        let parts = self.regions_95.iter().filter(|region| region.probability >= 0.02).count();
        let has_regions = !self.regions_95.is_empty();
        parts > 1 || has_regions && region_m2 < 0.5 * ellipse_m2 || self.is_at_border()
    }

    /// Returns true if so much probability lies on the border of the area that was searched that
    /// the transmitter may lie outside.
    #[must_use]
    pub fn is_at_border(&self) -> bool {
        self.border_mass.is_some_and(|mass| mass > MUCH_ON_BORDER)
    }
}

/// Locates a transmitter from all receptions at once.
///
/// ```
/// use foxhunt_core::{Estimate, Reception, Receptions};
/// use foxhunt_locate::{LocateConfig, LocateError, Located, Locator};
///
/// /// Where the level was highest.
/// struct Strongest;
///
/// impl Locator for Strongest {
///     fn locate(
///         &self,
///         receptions: &Receptions,
///         _: &LocateConfig,
///     ) -> Result<Located, LocateError> {
///         let level = |r: &Reception| r.level.map_or(f64::NEG_INFINITY, |l| l.rss_dbm);
///         let strongest = receptions.iter().max_by(|a, b| level(a).total_cmp(&level(b)));
///         let strongest = strongest.ok_or(LocateError::Nothing { receptions: 0 })?;
///         Ok(Located::at(Estimate::isotropic(strongest.receiver.position.xy(), 50.0)))
///     }
/// }
/// ```
pub trait Locator: Send + Sync {
    /// The place of a transmitter that stays where it is, from the receptions of one or more
    /// drones: one drone after the other, each in the order of its path.
    ///
    /// # Errors
    ///
    /// [`LocateError`] when there is too little to go by, or they cannot be used.
    fn locate(
        &self,
        receptions: &Receptions,
        config: &LocateConfig,
    ) -> Result<Located, LocateError>;

    /// Returns true if [`LocateConfig::pattern`] is in its model of levels; where not, known
    /// antennas are refused.
    fn uses_antennas(&self) -> bool {
        false
    }

    /// Returns true if it estimates the transmitter's height where that is free.
    fn estimates_height(&self) -> bool {
        false
    }

    /// Returns true if [`Reception::receiver_sigma_m`] is in its answers; where not, it is added to
    /// them, as the errors of one receiver's places are much alike.
    fn uses_receiver_sigma(&self) -> bool {
        false
    }
}

/// σ of the receivers' own positions on each horizontal axis in metres, the root of the mean
/// variance; 0 where they are known.
pub fn receiver_sigma_m(receptions: &Receptions) -> f64 {
    let variance = |r: Reception| r.receiver_sigma_m.map_or(0.0, |s| 0.5 * s.xy().norm_squared());
    let count = u32::try_from(receptions.len()).unwrap_or(u32::MAX).max(1);
    (receptions.iter().map(variance).sum::<f64>() / f64::from(count)).sqrt()
}

/// Level or silence, and bearing, of each reception.
#[cfg(feature = "batch")]
pub(super) fn pairs(receptions: &Receptions) -> Result<Vec<Observation<2>>, LocateError> {
    let intake = ByQuantity([Quantity::RSS, Quantity::BEARING]);
    let mut observations = Vec::with_capacity(receptions.len());
    for (index, reception) in receptions.iter().enumerate() {
        // A silence is an observation of the floor, below which the level lay.
        let stood_in = Reception { level: reception.level.or(reception.silence), ..reception };
        let made = intake.observation(&stood_in).map_err(|source| LocateError::Reception {
            index,
            time: reception.time,
            source: source.into(),
        })?;
        let is_silence = reception.level.is_none() && reception.silence.is_some();
        observations.extend(made.map(|o| if is_silence { o.below(0) } else { o }));
    }
    Ok(observations)
}

/// The levels along the path, with the floors of silences and the ceilings of saturated receivers
/// among them; at least one level.
pub(super) fn levels_and_silences(
    receptions: &Receptions,
) -> Result<impl Iterator<Item = ShadowedReading>, LocateError> {
    let reading = |r: Reception| {
        let level = r.any_level()?;
        let censoring = match (r.level, r.silence) {
            (Some(_), _) => Censoring::None,
            (None, Some(_)) => Censoring::Below,
            (None, None) => Censoring::Above,
        };
        Some(ShadowedReading { receiver: r.receiver, value: level.rss_dbm, censoring })
    };
    let has_levels = receptions.iter().any(|r| r.level.is_some());
    if has_levels { Ok(receptions.iter().filter_map(reading)) } else { Err(LocateError::NoLevels) }
}

/// Returns the other optima of a batch, each with the logarithm of its density over the best one's.
#[cfg(feature = "batch")]
pub(super) fn rivals<const N: usize>(optima: &[(State<N>, f64)]) -> Vec<Rival> {
    let rival = |(state, log_ratio): &(State<N>, f64)| Rival {
        place: state.fixed_rows::<2>(0).into_owned(),
        relative_density: libm::exp(*log_ratio),
    };
    optima.iter().map(rival).filter(|r| r.relative_density >= LEAST_RELATIVE_DENSITY).collect()
}

/// Returns the regions about a batch's optimum and its rivals; empty where there are no rivals.
#[cfg(feature = "batch")]
pub(super) fn regions_with_rivals<const N: usize>(fix: &BatchFix<N>) -> Vec<Region> {
    let rivals = fix.rival_estimates.iter().zip(&fix.rivals);
    let rivals = rivals
        .map(|(estimate, (_, log_ratio))| (in_plane(estimate), libm::exp(*log_ratio)))
        .filter(|(_, density)| *density >= LEAST_RELATIVE_DENSITY);
    let mut modes = vec![(in_plane(&fix.estimate), 1.0)];
    modes.extend(rivals);
    if modes.len() < 2 { Vec::new() } else { of_modes(&modes, 0.95) }
}

/// Returns the place alone of an estimate.
#[cfg(feature = "batch")]
fn in_plane<const N: usize>(estimate: &Estimate<N>) -> Estimate<2> {
    Estimate {
        mean: estimate.mean.fixed_rows::<2>(0).into_owned(),
        covariance: estimate.covariance.fixed_view::<2, 2>(0, 0).into_owned(),
    }
}

/// Refuses receptions of a single place for a quantity that fixes none from there.
#[cfg(feature = "batch")]
pub(super) fn several_places(
    what: &'static str,
    mut receivers: impl Iterator<Item = Pose>,
) -> Result<(), LocateError> {
    let Some(first) = receivers.next().map(|receiver| receiver.position.xy()) else {
        return Ok(());
    };
    if receivers.all(|receiver| (receiver.position.xy() - first).norm() < ONE_PLACE_M) {
        return Err(LocateError::OnePlace { what, east: first.x, north: first.y });
    }
    Ok(())
}

/// Receivers nearer to each other than this are in one place.
#[cfg(feature = "batch")]
const ONE_PLACE_M: f64 = 0.1;

/// The levels, each with its receiver, along the path.
#[cfg(feature = "maps")]
pub(super) fn levels(receptions: &Receptions) -> Result<Vec<(Pose, f64)>, LocateError> {
    let level = |r: Reception| Some((r.receiver, r.level?.rss_dbm));
    let levels: Vec<_> = receptions.iter().filter_map(level).collect();
    if levels.is_empty() { Err(LocateError::NoLevels) } else { Ok(levels) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_abs_diff_eq;

    fn square(from: f64, to: f64) -> Vec<Vector2<f64>> {
        let corners = [(from, from), (to, from), (to, to), (from, to), (from, from)];
        corners.iter().map(|(x, y)| Vector2::new(*x, *y)).collect()
    }

    #[test]
    fn the_score_is_that_of_the_normal_density_and_of_its_rivals() {
        let place = Vector2::new(3.0, 4.0);
        let mut located = Located::at(Estimate::isotropic(Vector2::zeros(), 2.0));
        let normal = |square: f64| (-0.5 * square).exp() / (core::f64::consts::TAU * 4.0);
        let alone = located.log_score(&place).expect("positive definite");
        assert_abs_diff_eq!(alone + normal(25.0 / 4.0).ln(), 0.0, epsilon = 1e-12);
        located.rivals = vec![Rival { place: Vector2::new(3.0, 3.0), relative_density: 0.5 }];
        let both = (normal(25.0 / 4.0) + 0.5 * normal(0.25)) / 1.5;
        let score = located.log_score(&place).expect("positive definite");
        assert_abs_diff_eq!(score + both.ln(), 0.0, epsilon = 1e-12);
        let far = located.log_score(&Vector2::new(1e6, 0.0)).expect("positive definite");
        assert!(far.is_finite() && far > 1e9, "{far}");
    }

    #[test]
    fn regions_stand_for_an_ellipse_that_is_a_poor_picture() {
        let mut located = Located::at(Estimate::isotropic(Vector2::zeros(), 10.0));
        assert!(!located.ellipse_is_poor());
        assert_eq!(located.region_95_holds(&Vector2::zeros()), Some(true));
        let ring = Region {
            probability: 0.95,
            area_m2: 100.0 - 4.0,
            outline: square(-5.0, 5.0),
            holes: vec![square(-1.0, 1.0)],
        };
        located.regions_95 = vec![ring];
        assert!(located.ellipse_is_poor());
        assert_eq!(located.region_95_holds(&Vector2::zeros()), Some(false));
        assert_eq!(located.region_95_holds(&Vector2::new(3.0, -2.0)), Some(true));
        assert_eq!(located.region_95_holds(&Vector2::new(6.0, 0.0)), Some(false));
        assert_eq!(located.ellipse_95_holds(&Vector2::new(6.0, 0.0)), Some(true));
    }
}
