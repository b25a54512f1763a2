use alloc::vec::Vec;
use core::f64::consts::TAU;

use foxhunt_core::{
    BeaconId, Pose, Sample, Sweep, Unheard,
    angle::{self, Resultant},
};
use nalgebra::Vector3;

/// What a source has heard over a turn for several beacons, and which of it it has lent.
#[derive(Clone, Debug, Default)]
pub(crate) struct HeardTurn {
    beacons: Vec<Heard>,
    /// When the turn ended, if it is over.
    ended: Option<f64>,
    lent: usize,
    /// The worst σ of the vehicle's places so far, each coordinate by itself.
    place_sigma: Option<Vector3<f64>>,
}

/// What was heard of one beacon.
#[derive(Clone, Debug)]
pub(crate) struct Heard {
    pub(crate) id: BeaconId,
    pub(crate) samples: Vec<Sample>,
    pub(crate) unheard: Vec<Unheard>,
}

impl HeardTurn {
    /// A turn that begins to listen for `beacons`.
    pub(crate) fn of(beacons: &[BeaconId]) -> Self {
        let nothing = |&id| Heard { id, samples: Vec::new(), unheard: Vec::new() };
        Self { beacons: beacons.iter().map(nothing).collect(), ..Self::default() }
    }

    /// One of the beacons, by its place among those asked for.
    pub(crate) fn beacon(&mut self, index: usize) -> &mut Heard {
        &mut self.beacons[index]
    }

    /// How many there are.
    pub(crate) fn count(&self) -> usize {
        self.beacons.len()
    }

    /// The vehicle told its place, with this σ.
    pub(crate) fn placed(&mut self, sigma: Option<Vector3<f64>>) {
        let worst = |sigma: Vector3<f64>| self.place_sigma.map_or(sigma, |worst| worst.sup(&sigma));
        self.place_sigma = sigma.map(worst).or(self.place_sigma);
    }

    /// Whether the turn is over.
    pub(crate) fn has_ended(&self) -> bool {
        self.ended.is_some()
    }

    /// All of them.
    pub(crate) fn beacons_mut(&mut self) -> impl Iterator<Item = &mut Heard> {
        self.beacons.iter_mut()
    }

    /// Whether nothing at all was heard.
    pub(crate) fn is_silent(&self) -> bool {
        self.beacons.iter().all(|heard| heard.samples.is_empty())
    }

    /// The turn is over: its sweeps may be lent.
    pub(crate) fn end(&mut self, time: f64) {
        self.ended = Some(time);
    }

    /// The next sweep of a turn that is over, each once; `fallback` is where the receiver was if
    /// no sample says it.
    pub(crate) fn lend(
        &mut self,
        positions: u16,
        floor_dbm: Option<f64>,
        fallback: Pose,
    ) -> Option<Sweep<'_>> {
        let time = self.ended?;
        let heard = self.beacons.get(self.lent)?;
        self.lent += 1;
        Some(Sweep {
            beacon: heard.id,
            time,
            receiver: heard.receiver().unwrap_or(fallback),
            positions,
            samples: &heard.samples,
            unheard: &heard.unheard,
            floor_dbm,
            receiver_sigma_m: self.place_sigma,
        })
    }
}

impl Heard {
    /// Where the turn took place: the mean over the samples.
    pub(crate) fn receiver(&self) -> Option<Pose> {
        let last = self.samples.last()?;
        let mut heading = Resultant::default();
        let mut position = Vector3::zeros();
        let (mut pitch, mut roll, mut count) = (0.0, 0.0, 0.0);
        for Sample { receiver, .. } in &self.samples {
            heading.add(receiver.heading, 1.0);
            position += receiver.position;
            (pitch, roll, count) = (pitch + receiver.pitch, roll + receiver.roll, count + 1.0);
        }
        // The attitude of a body that turned meanwhile is that of no one heading.
        if heading.length() < HELD {
            (pitch, roll) = (0.0, 0.0);
        }
        // Headings that cancel have no mean; then the last one is as good as any.
        let heading = heading.direction(1e-9).unwrap_or(last.receiver.heading);
        let (pitch, roll) = (pitch / count, roll / count);
        Some(Pose { pitch, roll, ..Pose::level(position / count, heading) })
    }
}

/// Headings whose mean resultant is shorter than this, which is a spread of 8°, did not hold.
const HELD: f64 = 0.99;

/// The position, of so many in a turn, that is nominally nearest to an angle in radians: a motor
/// that is stuck does not fill positions it has never been to.
pub(crate) fn nearest(angle: f64, positions: u16) -> u16 {
    let steps = libm::round(angle::wrap(angle) / TAU * f64::from(positions));
    #[expect(clippy::cast_possible_truncation, reason = "within a turn of at most u16::MAX steps")]
    let steps = (steps as i32).rem_euclid(i32::from(positions));
    u16::try_from(steps).unwrap_or(0)
}
