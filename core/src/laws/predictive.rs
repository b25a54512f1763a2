//! Laws over all observations that may come: integrals over the predictive density.

use core::{f64::consts::TAU, fmt};

use nalgebra::SVector;

use crate::{
    Axis, Correction, Covariance, Estimate, Estimator, MeasurementModel, Observation, Quantity,
    State,
};

/// Log-density below the largest one, in nats, at which an integral ends: a Gaussian's seventh
/// standard deviation.
const DEPTH: f64 = 25.0;

/// The most nodes of an integral, over all components together.
const MOST_NODES: u32 = 100_000;

/// Laws over the predictive density p(z) = exp(`log_evidence`) of an estimator, checked by
/// integrals over each component and over all components together.
///
/// - ∫ p(z) dz = 1;
/// - E\[m⁺\] = m and E\[P⁺\] + Var\[m⁺\] = P, with m and P the moments before the update,
///   m⁺ and P⁺ after it: an observation that is still to come cannot change what is known;
/// - E\[NIS\] is the number of components.
///
/// An exact filter keeps these laws for every problem. So does a Kalman filter over any model, as
/// it is exact for the linear model that it puts in the true one's place. An iterated filter and
/// one on cells keep them as well as their approximation holds, so check them where the
/// measurement is nearly linear over the prior. Bearings must be precise enough that half a turn
/// is beyond the predictive density: σ of 0.4 rad or less.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Predictive {
    /// Largest breach of a law, as a share: of 1, of the prior's spread, of the number of
    /// components.
    pub tolerance: f64,
    /// Monte Carlo standard errors that a cloud's breach may have besides; a cloud is an estimator
    /// that reports an effective sample size, its error √(2 / n) for its largest such size n.
    pub standard_errors: f64,
    /// False leaves out E\[NIS\], for an estimator whose innovation is not that of its predictive
    /// density: a mixture that reports its best component's.
    pub nis: bool,
    /// Index of a component that is known and not measured, such as an antenna's boresight: the
    /// integrals are over the others.
    pub given: Option<usize>,
}

/// A hundredth, and four standard errors.
impl Default for Predictive {
    fn default() -> Self {
        Self { tolerance: 0.01, standard_errors: 4.0, nis: true, given: None }
    }
}

/// Code that takes an estimator.
pub(super) type Act<'a, const N: usize, const M: usize> = dyn FnMut(&mut dyn Estimator<N, M>) + 'a;

/// Source of the same estimator each time, which it lends: one type for all estimators of as many
/// states and components, so that their laws are compiled once.
pub(super) struct Fresh<'a, const N: usize, const M: usize> {
    /// The name of the estimator's type.
    pub name: &'static str,
    /// Code that calls its argument once, with a fresh estimator.
    pub lend: &'a dyn Fn(&mut Act<'_, N, M>),
}

impl<const N: usize, const M: usize> Fresh<'_, N, M> {
    /// Lends a fresh estimator to `act`, and returns what that does.
    pub(super) fn lent<R>(&self, act: impl FnOnce(&mut dyn Estimator<N, M>) -> R) -> R {
        let mut act = Some(act);
        let mut result = None;
        (self.lend)(&mut |estimator| result = act.take().map(|act| act(estimator)));
        result.expect("an estimator is lent once")
    }

    /// Lends a fresh estimator after a step in seconds to `act`, and returns what that does.
    pub(super) fn predicted<R>(
        &self,
        step: f64,
        act: impl FnOnce(&mut dyn Estimator<N, M>) -> R,
    ) -> R {
        self.lent(|estimator| {
            if let Err(error) = estimator.predict(step) {
                panic!("{}: a step of {step} s was refused: {error}", self.name);
            }
            act(estimator)
        })
    }
}

/// Least number of nodes round a turn in the integral of a likelihood: a wide Gaussian of the short
/// way round has a kink at half a turn, where a sum over nodes is good to its square.
const ROUND: f64 = 64.0;

/// Observations on a lattice: evenly spaced, so that sums over them are integrals to far more
/// digits than a law needs, as each density is as smooth as the noise.
struct Lattice<const M: usize> {
    about: Observation<M>,
    step: SVector<f64, M>,
    low: [i32; M],
    high: [i32; M],
}

impl<const M: usize> Lattice<M> {
    /// The lattice over the present components of `about`, wide enough for a density that is not
    /// negligible about it, with at least `round` nodes to a turn.
    fn over(
        name: &str,
        about: &Observation<M>,
        axes: [Axis; M],
        given: Option<usize>,
        round: f64,
        log_density: &mut dyn FnMut(&Observation<M>) -> f64,
    ) -> Self {
        let present = |i: usize| about.has(i) && Some(i) != given;
        let root = about.noise().cholesky().expect("an observation's noise is positive definite");
        let precision = root.inverse();
        let mut lattice =
            Self { about: *about, step: SVector::repeat(1.0), low: [0; M], high: [0; M] };
        for i in (0..M).filter(|i| present(*i)) {
            // A sum over steps of one standard deviation errs by 10⁻⁸.
            let sigma = 1.0 / libm::sqrt(precision[(i, i)]);
            #[expect(
                clippy::cast_possible_truncation,
                reason = "more nodes than there are integers are refused below"
            )]
            let (step, half) = match axes[i] {
                Axis::Angle => {
                    let count = libm::ceil(TAU / sigma).max(round);
                    (TAU / count, [count / 2.0, (count - 1.0) / 2.0].map(|half| half as i32))
                }
                Axis::Linear => (sigma, [i32::MAX; 2]),
            };
            lattice.step[i] = step;
            let others = (0..M).filter(|j| *j != i && Some(*j) != given);
            let alone = others.fold(*about, Observation::without);
            let mut best = f64::NEG_INFINITY;
            let mut march = |sign: i32, most: i32| {
                let mut before = f64::NEG_INFINITY;
                for k in 0..most {
                    let mut value = *about.value();
                    value[i] += step * f64::from(sign * k);
                    let here = log_density(&moved(&alone, value));
                    best = best.max(here);
                    if here <= before && here < best - DEPTH {
                        return k;
                    }
                    before = here;
                    assert!(
                        u32::try_from(k).is_ok_and(|k| k < MOST_NODES),
                        "{name}: component {i} is uncertain by more than {MOST_NODES} σ; \
                         check at a noise that is not so small, near what is expected"
                    );
                }
                most
            };
            lattice.high[i] = march(1, half[0]);
            lattice.low[i] = -march(-1, half[1]);
        }
        let nodes = (0..M).map(|i| f64::from(lattice.high[i] - lattice.low[i] + 1));
        let nodes: f64 = nodes.product();
        assert!(
            nodes <= f64::from(MOST_NODES),
            "{name}: the law would take {nodes} updates, more than {MOST_NODES}; check at a noise \
             that is not so small beside the belief"
        );
        lattice
    }

    /// Calls `visit` with each observation.
    fn for_each(&self, visit: &mut dyn FnMut(&Observation<M>)) {
        let mut at = self.low;
        loop {
            let value = SVector::<f64, M>::from_fn(|i, _| {
                self.about.value()[i] + self.step[i] * f64::from(at[i])
            });
            visit(&moved(&self.about, value));
            let mut i = 0;
            loop {
                if i == M {
                    return;
                }
                if at[i] < self.high[i] {
                    at[i] += 1;
                    break;
                }
                at[i] = self.low[i];
                i += 1;
            }
        }
    }

    /// The volume of a cell.
    fn cell(&self) -> f64 {
        self.step.product()
    }
}

/// An observation with another value and nothing but its noise and missing components kept.
pub(super) fn moved<const M: usize>(
    observation: &Observation<M>,
    value: SVector<f64, M>,
) -> Observation<M> {
    let time = observation.time();
    let whole = Observation::new(time, *observation.receiver(), value, observation.noise())
        .expect("a finite value with the noise of an observation");
    (0..M).filter(|i| !observation.has(*i)).fold(whole, Observation::without)
}

/// The integral of a model's likelihood over all measurements.
pub(super) fn likelihood_is_a_density<const N: usize, const M: usize>(
    name: &str,
    model: &dyn MeasurementModel<N, M>,
    state: &State<N>,
    observation: &Observation<M>,
) {
    if observation.is_empty() {
        return;
    }
    let about = moved(observation, model.expected(state, observation.receiver()));
    let axes = model.axes();
    let mut log_density = |z: &Observation<M>| model.log_likelihood(state, z);
    let lattice = Lattice::over(name, &about, axes, None, ROUND, &mut log_density);
    let mut integral = 0.0;
    lattice.for_each(&mut |z| integral += libm::exp(log_density(z)) * lattice.cell());
    // A Gaussian of the short way round lacks its own tails beyond half a turn.
    let lack = |i: usize| match axes[i] {
        Axis::Angle if observation.has(i) => {
            let sigma = libm::sqrt(observation.noise()[(i, i)]);
            libm::erfc(core::f64::consts::PI / (sigma * core::f64::consts::SQRT_2))
        }
        _ => 0.0,
    };
    let lack: f64 = (0..M).map(lack).sum();
    assert!(
        (-1e-3 - lack..=1e-3).contains(&(integral - 1.0)),
        "{name}: the likelihood integrates to {integral:.6} over all measurements, not to 1"
    );
}

/// Deviations from the laws of an estimator's predictive density; `None` where a law holds.
struct Breaches {
    components: usize,
    evidence: Option<f64>,
    mean: Option<f64>,
    covariance: Option<f64>,
    nis: Option<f64>,
}

impl fmt::Display for Breaches {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "over {} of the components", self.components)?;
        if let Some(integral) = self.evidence {
            write!(f, "; exp(log_evidence) integrates to {integral:.6}, not to 1")?;
        }
        if let Some(off) = self.mean {
            write!(f, "; E[m⁺] is off the prior's mean by {off:.6} of its σ")?;
        }
        if let Some(off) = self.covariance {
            write!(f, "; E[P⁺] + Var[m⁺] is off the prior's P by {off:.6} of it")?;
        }
        if let Some(nis) = self.nis {
            write!(f, "; E[NIS] is {nis:.6}, not the number of components")?;
        }
        Ok(())
    }
}

/// The laws of the predictive density about one observation, for its present components.
pub(super) fn predictive<const N: usize, const M: usize>(
    fresh: &Fresh<'_, N, M>,
    observation: &Observation<M>,
    step: f64,
    laws: &Predictive,
) {
    let measured = |i: &usize| observation.has(*i) && Some(*i) != laws.given;
    let present = || (0..M).filter(measured);
    for i in present() {
        let others = (0..M).filter(|j| *j != i && Some(*j) != laws.given);
        let alone = others.fold(*observation, Observation::without);
        over(fresh, &alone, step, laws);
    }
    if present().count() > 1 {
        over(fresh, observation, step, laws);
    }
}

fn over<const N: usize, const M: usize>(
    fresh: &Fresh<'_, N, M>,
    observation: &Observation<M>,
    step: f64,
    laws: &Predictive,
) {
    let name = fresh.name;
    let prior = fresh.predicted(step, |estimator| estimator.estimate());
    let axes = fresh.lent(|estimator| Quantity::axes(&estimator.quantities()));
    let update = |z: &Observation<M>| {
        fresh.predicted(step, |estimator| match estimator.update(z) {
            Ok(Correction::Fused { nis, log_evidence, effective_sample_size }) => {
                Some((log_evidence, nis, effective_sample_size, estimator.estimate()))
            }
            Ok(Correction::Empty) => panic!("{name}: an observation was taken for an empty one"),
            // Of no weight: the integrals then lack it.
            Ok(Correction::Rejected { .. }) | Err(_) => None,
        })
    };
    let mut log_density = |z: &Observation<M>| update(z).map_or(f64::NEG_INFINITY, |u| u.0);
    let about = moved(observation, *observation.value());
    let lattice = Lattice::over(name, &about, axes, laws.given, 3.0, &mut log_density);

    let root = prior.covariance.cholesky();
    let root = root.unwrap_or_else(|| panic!("{name}: the predicted covariance is not definite"));
    let mut total = 0.0;
    let mut mean = State::<N>::zeros();
    let mut spread = Covariance::<N>::zeros();
    let mut nis = Some(0.0);
    let mut samples = 0.0;
    lattice.for_each(&mut |z| {
        let Some((log, own, size, Estimate { mean: m, covariance })) = update(z) else { return };
        let weight = libm::exp(log) * lattice.cell();
        let off = m - prior.mean;
        total += weight;
        mean += off * weight;
        spread += (covariance + off * off.transpose()) * weight;
        nis = nis.zip(own).map(|(sum, own)| sum + own * weight);
        samples = libm::fmax(samples, size.unwrap_or(0.0));
    });
    assert!(total > 0.0, "{name}: no observation is possible");
    let white = root
        .l()
        .solve_lower_triangular(&(spread / total))
        .and_then(|half| root.l().solve_lower_triangular(&half.transpose()));
    let shift = root.l().solve_lower_triangular(&(mean / total));
    let (Some(white), Some(shift)) = (white, shift) else {
        panic!("{name}: the predicted covariance is not definite")
    };
    // The largest of some numbers may hide one that is none.
    let is_finite = shift.iter().chain(&white).all(|value| value.is_finite());
    assert!(is_finite, "{name}: a posterior mean or covariance is not finite");
    let random = match samples > 0.0 {
        true => laws.standard_errors * libm::sqrt(2.0 / samples),
        false => 0.0,
    };
    let room = laws.tolerance + random;
    let breach = |off: f64| off.is_nan() || off > room;
    let is_given = laws.given.is_some_and(|given| observation.has(given));
    let components = observation.len() - usize::from(is_given);
    #[expect(clippy::cast_precision_loss, reason = "as many as an observation has components")]
    let expected_nis = components as f64;
    let covariance = (white - Covariance::<N>::identity()).amax();
    let nis = nis.map(|sum| sum / total).filter(|_| laws.nis);
    let breaches = Breaches {
        components,
        evidence: Some(total).filter(|total| breach((total - 1.0).abs())),
        mean: Some(shift.amax()).filter(|off| breach(*off)),
        covariance: Some(covariance).filter(|off| breach(*off)),
        nis: nis.filter(|nis| breach((nis / expected_nis - 1.0).abs())),
    };
    let Breaches { evidence: None, mean: None, covariance: None, nis: None, .. } = breaches else {
        panic!("{name}: {breaches}")
    };
}
