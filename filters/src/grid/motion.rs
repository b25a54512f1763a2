use foxhunt_core::{
    Covariance, MotionModel, State,
    parameter::{ParameterError, require},
};
use nalgebra::Matrix2;

/// Returns ∂f/∂x over the place.
///
/// # Errors
///
/// When the further components do not walk at random, as a velocity does not.
pub(super) fn slope_of_place<const N: usize>(
    motion: &impl MotionModel<N>,
    state: &State<N>,
    dt: f64,
) -> Result<Matrix2<f64>, ParameterError> {
    let slope = motion.jacobian(state, dt);
    let mut rest = slope - Covariance::<N>::identity();
    rest.fixed_view_mut::<2, 2>(0, 0).fill(0.0);
    let coupling = rest.norm();
    let name = "the motion of the components beside the place";
    require(coupling <= 1e-9, name, coupling, "a random walk independent of the place")?;
    Ok(slope.fixed_view::<2, 2>(0, 0).into_owned())
}
