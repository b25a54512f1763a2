use foxhunt_core::{Estimate, Receptions};
#[cfg(feature = "batch")]
use foxhunt_sensors::FreePowerRssBearing;
use foxhunt_sensors::{LogDistance, ParameterError, Propagation};
use nalgebra::Vector2;

#[cfg(feature = "batch")]
use super::Power;

/// σ of the reference power before the first reception, in dB: from a tag to a hand-held radio.
pub const FREE_POWER_SIGMA_DB: f64 = 20.0;

/// Least σ of a calibrated reference power in dB: below it, covariances lose their digits.
#[cfg(feature = "batch")]
const LEAST_SIGMA_DB: f64 = 0.01;

/// Share of a half side beyond which a place is at the edge of the area.
const WELL_WITHIN: f64 = 0.95;

/// The square that is searched: it holds every receiver and the margin about them.
#[derive(Clone, Copy, Debug)]
pub struct Area {
    centre: Vector2<f64>,
    half_side: f64,
}

/// The south-western and the north-eastern corner of the box about all receivers.
fn corners(receptions: &Receptions) -> (Vector2<f64>, Vector2<f64>) {
    let nowhere = Vector2::repeat(f64::INFINITY);
    let places = receptions.places().map(|place| place.xy());
    places.fold((nowhere, -nowhere), |(low, high), place| (low.inf(&place), high.sup(&place)))
}

/// The diagonal of the box about all receivers, in metres.
pub fn extent_m(receptions: &Receptions) -> f64 {
    let (low, high) = corners(receptions);
    (high - low).norm()
}

impl Area {
    /// The square about all receivers, with a margin in metres.
    pub fn about(receptions: &Receptions, margin: f64) -> Self {
        let (low, high) = corners(receptions);
        Self { centre: (low + high) / 2.0, half_side: (high - low).max() / 2.0 + margin }
    }

    /// A Gaussian with the moments of a uniform density over the square.
    pub fn prior(&self) -> Estimate<2> {
        Estimate::isotropic(self.centre, self.half_side / 3.0_f64.sqrt())
    }

    /// Returns true if a place is within the square, and not at its edge.
    pub(crate) fn holds_well(&self, place: &Vector2<f64>) -> bool {
        (place - self.centre).amax() <= WELL_WITHIN * self.half_side
    }

    /// Returns the centre and half a side, in metres.
    pub(crate) fn square(&self) -> (Vector2<f64>, f64) {
        (self.centre, self.half_side)
    }

    /// The length of a side in metres.
    pub fn side(&self) -> f64 {
        2.0 * self.half_side
    }

    /// The centres of as many equal squares along each side, row by row from the south-west.
    #[cfg(feature = "batch")]
    pub(crate) fn lattice(&self, along: u8) -> impl Iterator<Item = Vector2<f64>> {
        let step = self.side() / f64::from(along);
        let corner = self.centre - Vector2::repeat(self.half_side - 0.5 * step);
        let at = move |east: u8, north: u8| {
            corner + Vector2::new(f64::from(east), f64::from(north)) * step
        };
        (0..along).flat_map(move |north| (0..along).map(move |east| at(east, north)))
    }
}

/// The model of a transmitter of unknown power, and the prior of its place and power: a calibrated
/// power with its error over the area, or the one of a transmitter in the middle of the area, to
/// within 20 dB.
#[cfg(feature = "batch")]
pub(crate) fn free_power(
    receptions: &Receptions,
    area: &Area,
    up: f64,
    power: Power,
) -> Result<(FreePowerRssBearing, Estimate<3>), ParameterError> {
    let exponent = power.exponent();
    let model = FreePowerRssBearing::new(exponent)?.with_target_up(up)?;
    let place = area.prior();
    let (power, sigma_db) = match power.centroid() {
        Some(centroid) => (
            centroid.reference_dbm(exponent),
            centroid.most_sigma_db(area.side()).max(LEAST_SIGMA_DB),
        ),
        None => (reference_power(receptions, &place.mean, up, exponent)?, FREE_POWER_SIGMA_DB),
    };
    let mut prior = Estimate::isotropic(place.mean.push(power), sigma_db);
    prior.covariance.fixed_view_mut::<2, 2>(0, 0).copy_from(&place.covariance);
    Ok((model, prior))
}

/// The reference power that the levels have on average if the transmitter is at a place.
pub fn reference_power(
    receptions: &Receptions,
    place: &Vector2<f64>,
    up: f64,
    exponent: f64,
) -> Result<f64, ParameterError> {
    let unit = LogDistance::new(0.0, exponent)?;
    let levels: Vec<f64> = receptions
        .iter()
        .filter_map(|reception| {
            let range = (place.push(up) - reception.receiver.position).norm();
            Some(reception.level?.rss_dbm - unit.rss_dbm(range))
        })
        .collect();
    let count = u32::try_from(levels.len()).unwrap_or(u32::MAX).max(1);
    Ok(levels.iter().sum::<f64>() / f64::from(count))
}

#[cfg(all(test, feature = "batch"))]
mod tests {
    use approx::assert_abs_diff_eq;
    use foxhunt_core::{Pose, Reception};

    use super::*;

    #[test]
    fn the_starts_are_spread_over_the_square() {
        let at = |east, north| Reception {
            receiver: Pose::at(east, north, 0.0),
            ..Reception::default()
        };
        // 100 m wide and a margin of 10 m: a half side of 60 m about (50, 20).
        let area = Area::about(&[at(0.0, 0.0), at(100.0, 40.0)].into_iter().collect(), 10.0);
        let starts: Vec<_> = area.lattice(3).collect();
        assert_eq!(starts.len(), 9);
        for (start, place) in [(0, (10.0, -20.0)), (4, (50.0, 20.0)), (5, (90.0, 20.0))] {
            assert!((starts[start] - Vector2::new(place.0, place.1)).norm() < 1e-9, "{start}");
        }
        let prior = area.prior();
        assert_abs_diff_eq!(prior.covariance[(0, 0)], 1200.0, epsilon = 1e-9);
    }
}
