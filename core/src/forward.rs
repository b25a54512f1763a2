//! The traits through `&mut T` and `Box<T>`; models and terrain, which are only read, through `&T`
//! and `Arc<T>`.
#![deny(
    clippy::missing_trait_methods,
    reason = "a provided method left out would lose its override"
)]

use core::fmt;

#[cfg(feature = "alloc")]
use alloc::vec::Vec;
#[cfg(feature = "alloc")]
use nalgebra::{DMatrix, DVector};
use nalgebra::{SMatrix, SVector, Vector2, Vector3};

#[cfg(feature = "alloc")]
use crate::{DynamicMeasurement, DynamicMotion};

use crate::{
    Axis, BeaconId, BearingExtractor, Belief, Correction, Decision, Estimate, Estimator,
    EstimatorError, FormationPlanner, MeasurementModel, MotionModel, NoReading, Observation,
    PatternSource, PlanError, Pose, Quantity, Radio, Reading, Reception, Rotator, Spinner, State,
    Station, SteadyMotion, Sweep, Target, Terrain, Vehicle, Waypoint,
};

macro_rules! forward {
    ($($pointer:ty),+) => {$(
        impl<T, const N: usize, const M: usize> Estimator<N, M> for $pointer
        where
            T: ?Sized + Estimator<N, M>,
        {
            fn predict(&mut self, dt: f64) -> Result<(), EstimatorError> {
                (**self).predict(dt)
            }
            fn update(&mut self, new: &Observation<M>) -> Result<Correction, EstimatorError> {
                (**self).update(new)
            }
            fn estimate(&self) -> Estimate<N> {
                (**self).estimate()
            }
            fn quantities(&self) -> [Quantity; M] {
                (**self).quantities()
            }
            fn visit_samples(&self, visit: &mut dyn FnMut(&State<N>, f64)) {
                (**self).visit_samples(visit);
            }
        }

        impl<T: ?Sized + PatternSource> PatternSource for $pointer {
            type Error = T::Error;
            fn begin(&mut self, beacons: &[BeaconId]) -> Result<(), T::Error> {
                (**self).begin(beacons)
            }
            fn poll(&mut self) -> Result<Option<Sweep<'_>>, T::Error> {
                (**self).poll()
            }
            fn next_event(&self) -> Option<f64> {
                (**self).next_event()
            }
        }

        impl<T: ?Sized + BearingExtractor> BearingExtractor for $pointer {
            fn extract(&self, sweep: &Sweep<'_>) -> Result<Reading, NoReading> {
                (**self).extract(sweep)
            }
            fn expected_sigma(&self, sweep: &Sweep<'_>) -> Option<f64> {
                (**self).expected_sigma(sweep)
            }
        }

        impl<T: ?Sized + FormationPlanner> FormationPlanner for $pointer {
            fn begin(&mut self, stations: &mut [Station]) -> Result<(), PlanError> {
                (**self).begin(stations)
            }
            fn resume(
                &mut self,
                belief: &dyn Belief,
                stations: &mut [Station],
            ) -> Result<(), PlanError> {
                (**self).resume(belief, stations)
            }
            fn plan(
                &mut self,
                belief: &dyn Belief,
                stations: &mut [Station],
            ) -> Result<Decision, PlanError> {
                (**self).plan(belief, stations)
            }
            fn plan_together(
                &mut self,
                targets: &[Target<'_>],
                stations: &mut [Station],
            ) -> Result<Decision, PlanError> {
                (**self).plan_together(targets, stations)
            }
            fn goes_on_without_signal(&self) -> bool {
                (**self).goes_on_without_signal()
            }
            fn observe(&mut self, reception: &Reception) {
                (**self).observe(reception);
            }
            fn explain(&self, to: &mut dyn fmt::Write) -> fmt::Result {
                (**self).explain(to)
            }
        }

        impl<T: ?Sized + Vehicle> Vehicle for $pointer {
            type Error = T::Error;
            fn pose(&mut self) -> Result<Pose, T::Error> {
                (**self).pose()
            }
            fn position_sigma(&self) -> Option<Vector3<f64>> {
                (**self).position_sigma()
            }
            fn go_to(&mut self, goal: &Waypoint) -> Result<(), T::Error> {
                (**self).go_to(goal)
            }
            fn land(&mut self) -> Result<(), T::Error> {
                (**self).land()
            }
            fn steady_motion(&self) -> Option<SteadyMotion> {
                (**self).steady_motion()
            }
        }

        impl<T: ?Sized + Spinner> Spinner for $pointer {
            fn spin(&mut self, rate: Option<f64>) -> Result<(), T::Error> {
                (**self).spin(rate)
            }
        }

        impl<T: ?Sized + Radio> Radio for $pointer {
            type Error = T::Error;
            fn request(&mut self, beacon: BeaconId) -> Result<(), T::Error> {
                (**self).request(beacon)
            }
            fn interrogate(
                &mut self,
                beacon: BeaconId,
                until: f64,
                answers: &mut [(f64, f64)],
            ) -> Result<usize, T::Error> {
                (**self).interrogate(beacon, until, answers)
            }
            fn poll(&mut self) -> Result<Option<f64>, T::Error> {
                (**self).poll()
            }
            fn measured_at(&self) -> Option<f64> {
                (**self).measured_at()
            }
            fn next_event(&self) -> Option<f64> {
                (**self).next_event()
            }
        }

        impl<T: ?Sized + Rotator> Rotator for $pointer {
            type Error = T::Error;
            fn turn_to(&mut self, angle: f64) -> Result<(), T::Error> {
                (**self).turn_to(angle)
            }
            fn poll(&mut self) -> Result<Option<f64>, T::Error> {
                (**self).poll()
            }
            fn next_event(&self) -> Option<f64> {
                (**self).next_event()
            }
        }
    )+};
}

forward!(&mut T);
#[cfg(feature = "alloc")]
forward!(alloc::boxed::Box<T>);

macro_rules! forward_shared {
    ($($pointer:ty),+) => {$(
        impl<T: ?Sized + MeasurementModel<N, M>, const N: usize, const M: usize>
            MeasurementModel<N, M> for $pointer
        {
            fn quantities(&self) -> [Quantity; M] {
                (**self).quantities()
            }
            fn axes(&self) -> [Axis; M] {
                (**self).axes()
            }
            fn expected(&self, state: &State<N>, receiver: &Pose) -> SVector<f64, M> {
                (**self).expected(state, receiver)
            }
            fn expected_many(
                &self,
                states: &[State<N>],
                receiver: &Pose,
                out: &mut [SVector<f64, M>],
            ) {
                (**self).expected_many(states, receiver, out);
            }
            fn residual(&self, z: &SVector<f64, M>, expected: &SVector<f64, M>) -> SVector<f64, M> {
                (**self).residual(z, expected)
            }
            fn expected_change(
                &self,
                state: &State<N>,
                expected: &SVector<f64, M>,
                offset: &State<N>,
                receiver: &Pose,
            ) -> SVector<f64, M> {
                (**self).expected_change(state, expected, offset, receiver)
            }
            fn expected_parts(
                &self,
                state: &State<N>,
                expected: &SVector<f64, M>,
                offset: &State<N>,
                receiver: &Pose,
            ) -> [SVector<f64, M>; 2] {
                (**self).expected_parts(state, expected, offset, receiver)
            }
            fn jacobian(&self, state: &State<N>, receiver: &Pose) -> SMatrix<f64, M, N> {
                (**self).jacobian(state, receiver)
            }
            fn log_likelihood(&self, state: &State<N>, observation: &Observation<M>) -> f64 {
                (**self).log_likelihood(state, observation)
            }
            #[inline(always)]
            fn log_likelihoods(
                &self,
                columns: [&[f64]; N],
                observation: &Observation<M>,
                out: &mut [f64],
            ) {
                (**self).log_likelihoods(columns, observation, out);
            }
            #[inline(always)]
            fn residuals(
                &self,
                columns: [&[f64]; N],
                z: &SVector<f64, M>,
                receiver: &Pose,
                out: [&mut [f64]; M],
            ) {
                (**self).residuals(columns, z, receiver, out);
            }
        }

        impl<T: ?Sized + MotionModel<N>, const N: usize> MotionModel<N> for $pointer {
            fn propagate(&self, state: &State<N>, dt: f64) -> State<N> {
                (**self).propagate(state, dt)
            }
            fn propagated_change(
                &self,
                state: &State<N>,
                propagated: &State<N>,
                offset: &State<N>,
                dt: f64,
            ) -> State<N> {
                (**self).propagated_change(state, propagated, offset, dt)
            }
            fn is_linear(&self) -> bool {
                (**self).is_linear()
            }
            fn noise_factor(&self, state: &State<N>, dt: f64) -> SMatrix<f64, N, N> {
                (**self).noise_factor(state, dt)
            }
            fn axes(&self) -> [Axis; N] {
                (**self).axes()
            }
            fn jacobian(&self, state: &State<N>, dt: f64) -> SMatrix<f64, N, N> {
                (**self).jacobian(state, dt)
            }
            #[inline(always)]
            fn move_columns(&self, columns: [&mut [f64]; N], white: [&[f64]; N], dt: f64) {
                (**self).move_columns(columns, white, dt);
            }
        }

        impl<T: ?Sized + Terrain> Terrain for $pointer {
            fn height(&self, place: &Vector2<f64>) -> Option<f64> {
                (**self).height(place)
            }
            fn step_m(&self) -> f64 {
                (**self).step_m()
            }
        }
    )+};
}

#[cfg(feature = "alloc")]
macro_rules! forward_dynamic {
    ($($pointer:ty),+) => {$(
        impl<T: ?Sized + DynamicMotion> DynamicMotion for $pointer {
            fn propagate(&self, state: &DVector<f64>, dt: f64) -> DVector<f64> {
                (**self).propagate(state, dt)
            }
            fn noise_factor(&self, state: &DVector<f64>, dt: f64) -> DMatrix<f64> {
                (**self).noise_factor(state, dt)
            }
            fn is_linear(&self) -> bool {
                (**self).is_linear()
            }
            fn axes(&self, dimension: usize) -> Vec<Axis> {
                (**self).axes(dimension)
            }
            fn jacobian(&self, state: &DVector<f64>, dt: f64) -> DMatrix<f64> {
                (**self).jacobian(state, dt)
            }
            fn propagated_parts(
                &self,
                state: &DVector<f64>,
                propagated: &DVector<f64>,
                offset: &DVector<f64>,
                dt: f64,
            ) -> [DVector<f64>; 2] {
                (**self).propagated_parts(state, propagated, offset, dt)
            }
        }

        impl<T: ?Sized + DynamicMeasurement> DynamicMeasurement for $pointer {
            fn quantities(&self) -> Vec<Quantity> {
                (**self).quantities()
            }
            fn expected(&self, state: &DVector<f64>, receiver: &Pose) -> DVector<f64> {
                (**self).expected(state, receiver)
            }
            fn components(&self) -> Option<&[usize]> {
                (**self).components()
            }
            fn residual(&self, z: &DVector<f64>, expected: &DVector<f64>) -> DVector<f64> {
                (**self).residual(z, expected)
            }
            fn jacobian(&self, state: &DVector<f64>, receiver: &Pose) -> DMatrix<f64> {
                (**self).jacobian(state, receiver)
            }
            fn expected_parts(
                &self,
                state: &DVector<f64>,
                expected: &DVector<f64>,
                offset: &DVector<f64>,
                receiver: &Pose,
            ) -> [DVector<f64>; 2] {
                (**self).expected_parts(state, expected, offset, receiver)
            }
        }
    )+};
}

#[cfg(feature = "alloc")]
forward_dynamic!(&T, alloc::boxed::Box<T>);
#[cfg(all(feature = "alloc", target_has_atomic = "ptr"))]
forward_dynamic!(alloc::sync::Arc<T>);

forward_shared!(&T);
#[cfg(all(feature = "alloc", target_has_atomic = "ptr"))]
forward_shared!(alloc::sync::Arc<T>);
#[cfg(feature = "alloc")]
forward_shared!(alloc::boxed::Box<T>);
