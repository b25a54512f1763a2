//! Your own source: a phased array that switches sixteen beams at once while its boom turns,
//! and times and tunes the signal against a reference; and an extractor for it.

use foxhunt::core::{NoReading, OwnedSweep, angle};
use foxhunt::hunt::{BoxedSource, boxed_source};
use foxhunt::nalgebra::Vector3;
use foxhunt::prelude::*;
use foxhunt::sensors::Patch;
use foxhunt::sim::{SimError, World};
use rand::{RngExt, SeedableRng, rngs::Xoshiro256PlusPlus};
use rand_distr::StandardNormal;

use crate::model::{DOPPLER, TdoaDopplerBearing};

/// Number of beams that the array switches.
pub const BEAMS: u16 = 16;

/// σ of range difference in metres and of the Doppler shift in hertz.
pub const SIGMAS: [f64; 2] = [6.0, 0.8];

/// The array under one drone of a simulated world.
struct PhasedArray {
    world: World,
    drone: usize,
    model: TdoaDopplerBearing,
    beam: Patch,
    rng: Xoshiro256PlusPlus,
    /// Beacons whose sweep is due, and when.
    pending: Vec<BeaconId>,
    due: f64,
    lent: OwnedSweep,
}

impl PatternSource for PhasedArray {
    type Error = SimError;

    fn begin(&mut self, beacons: &[BeaconId]) -> Result<(), SimError> {
        self.pending = beacons.to_vec();
        self.due = self.world.time() + 0.5;
        Ok(())
    }

    fn poll(&mut self) -> Result<Option<Sweep<'_>>, SimError> {
        if self.pending.is_empty() || self.world.time() < self.due {
            return Ok(None);
        }
        let beacon = self.pending.remove(0);
        self.lent = self.measure(beacon)?;
        Ok(Some(self.lent.as_sweep()))
    }
}

impl PhasedArray {
    fn measure(&mut self, beacon: BeaconId) -> Result<OwnedSweep, SimError> {
        let time = self.world.time();
        // The tip of the boom goes round at 8 m/s, somewhere on its way.
        let turned = self.rng.random_range(0.0..std::f64::consts::TAU);
        let velocity = Some(Vector3::new(-turned.sin(), turned.cos(), 0.0) * 8.0);
        let receiver = Pose { velocity, ..self.world.pose(self.drone)? };
        let mut samples = Vec::new();
        self.world.begin_pattern(self.drone)?;
        for position in 0..BEAMS {
            let turned = std::f64::consts::TAU * f64::from(position) / f64::from(BEAMS);
            let received = self.world.receive(self.drone, beacon, &self.beam, turned)?;
            let boresight = angle::wrap(receiver.heading + turned);
            samples.extend(received.map(|rss_dbm| Sample {
                time,
                receiver,
                boresight,
                position,
                rss_dbm,
            }));
        }
        let mut measured = MeasuredList::default();
        if let Some(target) = self.world.truth(beacon) {
            let mut noise = |sigma: f64| sigma * self.rng.sample::<f64, _>(StandardNormal);
            let truth = self.model.values(&target, &receiver);
            let values = [
                Measured::new(Quantity::RANGE_DIFFERENCE, truth[0] + noise(SIGMAS[0]), SIGMAS[0]),
                Measured::new(DOPPLER, truth[1] + noise(SIGMAS[1]), SIGMAS[1]),
            ];
            let values: Vec<Measured> = values.into_iter().filter_map(Result::ok).collect();
            measured = MeasuredList::new(&values).unwrap_or_default();
        }
        Ok(OwnedSweep {
            beacon,
            time,
            receiver,
            positions: BEAMS,
            samples,
            measured,
            ..OwnedSweep::default()
        })
    }
}

// ANCHOR: source
/// The source of a drone. Its noise follows the seed of the hunt.
pub fn source(
    world: &World,
    drone: usize,
    model: TdoaDopplerBearing,
) -> Result<BoxedSource, SimError> {
    let beam = Patch::new(0.6, 0.6, 15.0).map_err(SimError::Source)?;
    let rng = Xoshiro256PlusPlus::seed_from_u64(world.source_seed(drone));
    Ok(boxed_source(PhasedArray {
        world: world.clone(),
        drone,
        model,
        beam,
        rng,
        pending: Vec::new(),
        due: 0.0,
        lent: OwnedSweep::default(),
    }))
}
// ANCHOR_END: source

/// The centre of the three beams around the strongest one, weighed by their power.
#[derive(Clone, Copy, Debug)]
pub struct ThreeBeams;

impl BearingExtractor for ThreeBeams {
    fn extract(&self, sweep: &Sweep<'_>) -> Result<Reading, NoReading> {
        let power = |sample: &Sample| 10.0_f64.powf(sample.rss_dbm / 10.0);
        let strongest = sweep.samples.iter().max_by(|a, b| a.rss_dbm.total_cmp(&b.rss_dbm));
        let strongest = strongest.ok_or(NoReading::Empty)?;
        let near = |sample: &&Sample| {
            angle::distance(sample.boresight, strongest.boresight)
                < 1.5 * std::f64::consts::TAU / f64::from(BEAMS)
        };
        let mut sum = angle::Resultant::default();
        for sample in sweep.samples.iter().filter(near) {
            sum.add(sample.boresight, power(sample));
        }
        let count = sweep.samples.iter().map(|_| 1.0).sum::<f64>();
        let rss_dbm = sweep.samples.iter().map(|sample| sample.rss_dbm).sum::<f64>() / count;
        let direction = sum.direction(1e-9).unwrap_or(strongest.boresight);
        Ok(Reading {
            rss_dbm,
            rss_sigma_db: 6.0,
            bearing: Ok(Bearing { angle: direction, sigma: 0.15, confidence: 0.8 }),
            covariance: 0.0,
            modes: Default::default(),
        })
    }
}
