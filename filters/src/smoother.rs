use alloc::vec::Vec;

use foxhunt_core::{Axis, Covariance, Estimate, EstimatorError, MotionModel, Role, State};

/// Returns the beliefs at some times given all observations until the last: the Rauch, Tung &
/// Striebel smoother, linearised about the filtered means (Särkkä 2013, eqs. 8.6 and 9.2).
///
/// `filtered` are the times in seconds, ascending, and the Gaussian posteriors of a filter with
/// this motion at them. With F and Q those of the step from one to the next and P⁻ = F P Fᵀ + Q,
/// G = P Fᵀ P⁻⁻¹, the mean is x̂ + G (x̂ˢ₊ ⊖ f(x̂)) and the covariance, as a sum of squares,
/// (I − G F) P (I − G F)ᵀ + G (Q + Pˢ₊) Gᵀ. The last one stays as it is.
///
/// # Errors
///
/// [`EstimatorError::TimeStep`] when times do not ascend;
/// [`EstimatorError::NotPositiveDefinite`] when a predicted covariance is not.
pub fn rauch_tung_striebel<const N: usize>(
    motion: &(impl MotionModel<N> + ?Sized),
    filtered: &[(f64, Estimate<N>)],
) -> Result<Vec<(f64, Estimate<N>)>, EstimatorError> {
    let mut smoothed = filtered.to_vec();
    for k in (1..smoothed.len()).rev() {
        let (time, later) = smoothed[k];
        let (before, belief) = smoothed[k - 1];
        let dt = time - before;
        EstimatorError::check_time_step(dt)?;
        smoothed[k - 1].1 = step(motion, &belief, &later, dt)?;
    }
    Ok(smoothed)
}

fn step<const N: usize>(
    motion: &(impl MotionModel<N> + ?Sized),
    belief: &Estimate<N>,
    later: &Estimate<N>,
    dt: f64,
) -> Result<Estimate<N>, EstimatorError> {
    let axes = motion.axes();
    let transition = motion.jacobian(&belief.mean, dt);
    let factor = motion.noise_factor(&belief.mean, dt);
    let noise = factor * factor.transpose();
    let carried = transition * belief.covariance;
    let predicted = (carried * transition.transpose() + noise)
        .cholesky()
        .ok_or(EstimatorError::NotPositiveDefinite { role: Role::Prior })?;
    let gain = predicted.solve(&carried).transpose();
    let news = Axis::difference(&axes, &later.mean, &motion.propagate(&belief.mean, dt));
    let mean = belief.mean + gain * news;
    let kept = Covariance::<N>::identity() - gain * transition;
    let mut covariance = kept * belief.covariance * kept.transpose()
        + gain * (noise + later.covariance) * gain.transpose();
    covariance.fill_upper_triangle_with_lower_triangle();
    Ok(Estimate { mean: Axis::difference(&axes, &mean, &State::zeros()), covariance })
}
