use foxhunt_core::{Estimate, Estimator, EstimatorError, Pose};
use foxhunt_filters::MomentGrid;
use foxhunt_sensors::MagneticDipole;
use nalgebra::Vector2;

/// σ of each component of an avalanche beacon's moment: EN 300 718-1 demands 0.5 µA/m abeam 10 m
/// off, 6.3 mA m², and allows some four times that.
const MOMENT_SIGMA_MA_M2: f64 = 10.0;

/// The place of a coil by its magnetic field on a grid, its moment integrated out.
///
/// # Errors
///
/// The errors of [`MomentGrid::new`].
pub fn dipole_grid(
    model: MagneticDipole,
    prior: Estimate<2>,
) -> Result<Box<dyn Estimator<2, 3>>, EstimatorError> {
    let field =
        move |place: &Vector2<f64>, receiver: &Pose| model.field_per_moment(place, receiver);
    let grid = MomentGrid::new(prior, MOMENT_SIGMA_MA_M2, MagneticDipole::QUANTITIES, field)?;
    Ok(Box::new(grid))
}
