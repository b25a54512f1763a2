//! The textbook's formulas, as it writes them: an oracle that shares nothing with the crate.

use foxhunt_core::{
    Covariance, Estimate, MeasurementModel, Observation, State,
    nalgebra::{DMatrix, DVector, SMatrix, SVector},
};

/// The results of an update of the textbook.
#[derive(Clone, Debug)]
pub(super) struct Posterior<const N: usize> {
    pub(super) estimate: Estimate<N>,
    pub(super) nis: f64,
    pub(super) log_evidence: f64,
}

/// The components that are present.
fn present<const M: usize>(observation: &Observation<M>) -> Vec<usize> {
    let ones = observation.mask(SMatrix::<f64, 1, M>::repeat(1.0));
    (0..M).filter(|&i| ones[i] > 0.5).collect()
}

/// K = Pxz S⁻¹, x̂ + K y, P − K S Kᵀ, with missing components cut out of every matrix.
pub(super) fn condition<const N: usize, const M: usize>(
    prior: &Estimate<N>,
    spread: &Covariance<M>,
    cross: &SMatrix<f64, N, M>,
    residual: &SVector<f64, M>,
    observation: &Observation<M>,
) -> Posterior<N> {
    let keep = present(observation);
    let m = keep.len();
    let total = spread + observation.noise();
    let s = DMatrix::from_fn(m, m, |i, j| total[(keep[i], keep[j])]);
    let pxz = DMatrix::from_fn(N, m, |i, j| cross[(i, keep[j])]);
    let y = DVector::from_fn(m, |i, _| residual[keep[i]]);
    let inverse = s.clone().try_inverse().expect("an innovation has a covariance");
    let gain = &pxz * &inverse;
    let mean = prior.mean + SVector::from_fn(|i, _| (&gain * &y)[i]);
    let lost = &gain * &s * gain.transpose();
    let covariance = prior.covariance - Covariance::from_fn(|i, j| lost[(i, j)]);
    let nis = y.dot(&(&inverse * &y));
    let dof = f64::from(u8::try_from(m).expect("a few components"));
    let log_evidence = -0.5 * (nis + s.determinant().ln() + dof * std::f64::consts::TAU.ln());
    Posterior { estimate: Estimate { mean, covariance }, nis, log_evidence }
}

/// The scaled unscented update by its weights (Pritzl 2018, eqs. 4.7-4.9 and 4.13-4.21), with the
/// mean of angles about the centre point, wrapped once.
pub(super) fn unscented<const N: usize, const M: usize>(
    prior: &Estimate<N>,
    model: &impl MeasurementModel<N, M>,
    observation: &Observation<M>,
    (alpha, beta, kappa): (f64, f64, f64),
) -> Posterior<N> {
    let n = f64::from(u8::try_from(N).expect("a few components"));
    let lambda = alpha * alpha * (n + kappa) - n;
    let root = (prior.covariance * (n + lambda)).cholesky().expect("a proper prior").unpack();
    let mut points = vec![prior.mean];
    points.extend((0..N).map(|i| prior.mean + root.column(i)));
    points.extend((0..N).map(|i| prior.mean - root.column(i)));
    let wm = |i: usize| if i == 0 { lambda / (n + lambda) } else { 0.5 / (n + lambda) };
    let wc = |i: usize| wm(i) + if i == 0 { 1.0 - alpha * alpha + beta } else { 0.0 };

    let images: Vec<_> = points.iter().map(|x| model.expected(x, observation.receiver())).collect();
    let deviations: Vec<_> = images.iter().map(|z| model.residual(z, &images[0])).collect();
    let shift: SVector<f64, M> = deviations.iter().enumerate().map(|(i, d)| d * wm(i)).sum();
    let mut spread = Covariance::<M>::zeros();
    let mut cross = SMatrix::<f64, N, M>::zeros();
    for (i, (x, d)) in points.iter().zip(&deviations).enumerate() {
        let d = d - shift;
        spread += d * d.transpose() * wc(i);
        cross += (x - prior.mean) * d.transpose() * wc(i);
    }
    let residual = model.residual(observation.value(), &(images[0] + shift));
    condition(prior, &spread, &cross, &residual, observation)
}

/// The extended update: H by the model, K = P Hᵀ S⁻¹ (Bar-Shalom, Li & Kirubarajan 2001, §10.3).
pub(super) fn extended<const N: usize, const M: usize>(
    prior: &Estimate<N>,
    model: &impl MeasurementModel<N, M>,
    observation: &Observation<M>,
) -> Posterior<N> {
    let h = model.jacobian(&prior.mean, observation.receiver());
    let cross = prior.covariance * h.transpose();
    let expected = model.expected(&prior.mean, observation.receiver());
    let residual = model.residual(observation.value(), &expected);
    condition(prior, &(h * cross), &cross, &residual, observation)
}

/// The prediction of a linear motion: F x̂, F P Fᵀ + Q.
pub(super) fn predict<const N: usize>(
    prior: &Estimate<N>,
    f: &SMatrix<f64, N, N>,
    q: &Covariance<N>,
) -> Estimate<N> {
    let mean: State<N> = f * prior.mean;
    Estimate { mean, covariance: f * prior.covariance * f.transpose() + q }
}
