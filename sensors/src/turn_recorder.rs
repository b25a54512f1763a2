use alloc::vec::Vec;
use core::f64::consts::TAU;

use foxhunt_core::{
    BeaconId, OwnedSweep, Pose, Sample, Sweep,
    angle::{self, Resultant},
};
use nalgebra::Vector3;

use crate::turn_goal::TurnGoal;

/// A recorder of one turn for several beacons: it collects their samples, and lends a sweep for
/// each once the turn is over.
#[derive(Clone, Debug, Default)]
pub(crate) struct TurnRecorder {
    /// One for each beacon; time, place and limits are filled in when it is lent.
    sweeps: Vec<OwnedSweep>,
    /// Time of the turn's end, if it is over.
    ended: Option<f64>,
    lent: usize,
    /// The worst σ of the vehicle's places so far, each coordinate by itself.
    place_sigma: Option<Vector3<f64>>,
    /// Each beacon's number of samples when it was last held against a goal, and true if it reached
    /// it.
    judged: Vec<(usize, bool)>,
}

impl TurnRecorder {
    /// A turn that begins for `beacons`.
    pub(crate) fn new(beacons: &[BeaconId]) -> Self {
        let empty = |&beacon| OwnedSweep { beacon, ..OwnedSweep::default() };
        Self { sweeps: beacons.iter().map(empty).collect(), ..Self::default() }
    }

    /// Makes room for `samples` samples of each beacon.
    pub(crate) fn reserve(&mut self, samples: usize) {
        for sweep in &mut self.sweeps {
            sweep.samples.reserve_exact(samples);
        }
    }

    /// The record of one of the beacons, by its index in the turn.
    pub(crate) fn beacon(&mut self, index: usize) -> &mut OwnedSweep {
        &mut self.sweeps[index]
    }

    /// Number of beacons.
    pub(crate) fn count(&self) -> usize {
        self.sweeps.len()
    }

    /// Takes the σ of a place that the vehicle reported.
    pub(crate) fn add_place_sigma(&mut self, sigma: Option<Vector3<f64>>) {
        let worst = |sigma: Vector3<f64>| self.place_sigma.map_or(sigma, |worst| worst.sup(&sigma));
        self.place_sigma = sigma.map(worst).or(self.place_sigma);
    }

    /// Returns true if the turn is over.
    pub(crate) fn has_ended(&self) -> bool {
        self.ended.is_some()
    }

    /// The records of all beacons.
    pub(crate) fn beacons_mut(&mut self) -> impl Iterator<Item = &mut OwnedSweep> {
        self.sweeps.iter_mut()
    }

    /// Returns true if no sample was taken at all.
    pub(crate) fn is_empty(&self) -> bool {
        self.sweeps.iter().all(|sweep| sweep.samples.is_empty())
    }

    /// Returns true if the records of all beacons that were received at all reach a goal.
    /// `from_nose`: boresights of unanswered questions are still counted from the nose.
    pub(crate) fn reaches(
        &mut self,
        goal: &TurnGoal,
        positions: u16,
        floor_dbm: Option<f64>,
        from_nose: bool,
    ) -> bool {
        self.judged.resize(self.sweeps.len(), (0, true));
        self.sweeps.iter().zip(&mut self.judged).all(|(sweep, judged)| {
            // What did not come teaches too little to be worth a fit of its own.
            if judged.0 != sweep.samples.len() {
                let receiver = mean_pose(&sweep.samples).unwrap_or_default();
                let mut record = sweep.clone();
                for unanswered in record.unanswered.iter_mut().filter(|_| from_nose) {
                    unanswered.boresight = angle::wrap(receiver.heading + unanswered.boresight);
                }
                let sweep = Sweep { receiver, positions, floor_dbm, ..record.as_sweep() };
                *judged = (sweep.samples.len(), goal.is_reached(&sweep));
            }
            judged.1
        })
    }

    /// Ends the turn: its sweeps may be lent.
    pub(crate) fn end(&mut self, time: f64) {
        self.ended = Some(time);
    }

    /// Returns true if there is a sweep that was not lent yet, of a turn that is over or not.
    pub(crate) fn has_more(&self) -> bool {
        self.lent < self.sweeps.len()
    }

    /// The next sweep of a turn that is over, each once; `fallback` is where the receiver was if
    /// there is no sample.
    pub(crate) fn lend(
        &mut self,
        positions: u16,
        floor_dbm: Option<f64>,
        fallback: Pose,
    ) -> Option<Sweep<'_>> {
        let time = self.ended?;
        let sweep = self.sweeps.get(self.lent)?;
        self.lent += 1;
        Some(Sweep {
            time,
            receiver: mean_pose(&sweep.samples).unwrap_or(fallback),
            positions,
            floor_dbm,
            receiver_sigma_m: self.place_sigma,
            ..sweep.as_sweep()
        })
    }
}

/// The mean pose of the samples' receivers; with a velocity where all of them have one.
pub(crate) fn mean_pose(samples: &[Sample]) -> Option<Pose> {
    let last = samples.last()?;
    let mut heading = Resultant::default();
    let mut position = Vector3::zeros();
    let mut pitch = 0.0;
    let mut roll = 0.0;
    let mut count = 0.0;
    // A drone that hovers has one heading for all samples.
    let mut held = f64::NAN;
    let mut unit = Resultant::default();
    for Sample { receiver, .. } in samples {
        if receiver.heading.to_bits() != held.to_bits() {
            held = receiver.heading;
            unit = Resultant::from_iter([held]);
        }
        heading += unit;
        position += receiver.position;
        pitch += receiver.pitch;
        roll += receiver.roll;
        count += 1.0;
    }
    let velocities = samples.iter().map(|sample| sample.receiver.velocity);
    let velocity = velocities.sum::<Option<Vector3<f64>>>();
    // The attitude of a body that turned meanwhile is that of no one heading.
    if heading.length() < HELD {
        pitch = 0.0;
        roll = 0.0;
    }
    // Headings that cancel have no mean; then the last one is as good as any.
    let heading = heading.direction(1e-9).unwrap_or(last.receiver.heading);
    Some(Pose {
        position: position / count,
        heading,
        pitch: pitch / count,
        roll: roll / count,
        velocity: velocity.map(|sum| sum / count),
    })
}

/// Headings whose mean resultant is shorter than this, which is a spread of 8°, did not hold.
const HELD: f64 = 0.99;

/// The nominal position, of `positions` in a turn, that is nearest to a boresight's angle in
/// radians: a motor that is stuck does not fill positions that it never reached.
pub(crate) fn nearest_position(angle: f64, positions: u16) -> u16 {
    let steps = libm::round(angle::wrap(angle) / TAU * f64::from(positions));
    #[expect(clippy::cast_possible_truncation, reason = "within a turn of at most u16::MAX steps")]
    let steps = (steps as i32).rem_euclid(i32::from(positions));
    u16::try_from(steps).unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample(velocity: Option<Vector3<f64>>) -> Sample {
        let receiver = Pose { velocity, ..Pose::at(1.0, 2.0, 3.0) };
        Sample { time: 0.0, receiver, boresight: 0.0, position: 0, rss_dbm: -60.0 }
    }

    #[test]
    fn a_mean_pose_has_the_mean_velocity_where_all_samples_have_one() {
        let with = [1.0, 2.0, 6.0].map(|east| sample(Some(Vector3::new(east, -east, 0.0))));
        let mean = mean_pose(&with).and_then(|pose| pose.velocity);
        assert_eq!(mean, Some(Vector3::new(3.0, -3.0, 0.0)));
        let one_without = [with[0], sample(None), with[1]];
        assert_eq!(mean_pose(&one_without).map(|pose| pose.velocity), Some(None));
        assert_eq!(mean_pose(&[]), None);
    }
}
