use std::collections::VecDeque;

use foxhunt_core::{BeaconId, Measured, MeasuredList, PatternSource, Sweep};
use foxhunt_sensors::MagneticDipole;

use super::OnBoard;
use crate::{
    SimError, ThreeAxisConfig,
    truth::{Truth, beacon_of, is_due},
};

/// A simulated receiver of three axes: its sweeps hold no samples but the magnetic field of the
/// beacon's next pulse, in [`MagneticDipole::QUANTITIES`], up to its sign; nothing where that is
/// too weak.
///
/// Several beacons are received one after the other.
#[derive(Clone, Debug)]
pub struct SimThreeAxis {
    on_board: OnBoard,
    config: ThreeAxisConfig,
    /// What is still to be received, and from when on.
    waiting: VecDeque<BeaconId>,
    since: f64,
}

impl SimThreeAxis {
    pub(crate) fn new(on_board: OnBoard, config: ThreeAxisConfig) -> Self {
        Self { on_board, config, waiting: VecDeque::new(), since: 0.0 }
    }

    /// When the pulse ends that is waited for; infinite where none is.
    fn due(&self) -> Result<f64, SimError> {
        let Some(beacon) = self.waiting.front() else { return Ok(f64::INFINITY) };
        let due = |truth: &mut Truth, drone: usize| {
            let latency = truth.drones[drone].receiver.latency();
            Ok(beacon_of(&truth.beacons, *beacon)?.answer_after(self.since, latency))
        };
        self.on_board.with_truth(due)
    }
}

impl PatternSource for SimThreeAxis {
    type Error = SimError;

    fn begin(&mut self, beacons: &[BeaconId]) -> Result<(), SimError> {
        self.waiting = beacons.iter().copied().collect();
        self.since = self.on_board.with(|_, now| now);
        Ok(())
    }

    fn poll(&mut self) -> Result<Option<Sweep<'_>>, SimError> {
        let now = self.on_board.with(|_, now| now);
        let due = self.due()?;
        if !is_due(due, now) {
            return Ok(None);
        }
        let Some(beacon) = self.waiting.pop_front() else { return Ok(None) };
        self.since = now;
        let config = self.config;
        self.on_board.with_truth(|truth, drone| {
            let Truth { time, channel, beacons, drones, .. } = truth;
            let from = beacon_of(beacons, beacon)?;
            let drone = &mut drones[drone];
            let field = drone.magnetic_field(channel, from, &config, *time);
            let measured = field.map_or(Ok(MeasuredList::default()), |field| {
                // σ follows from what is measured, as a receiver knows no more.
                let sigma = config.sigma(field.norm());
                let part = |n: usize| Measured::new(MagneticDipole::QUANTITIES[n], field[n], sigma);
                MeasuredList::new(&[part(0)?, part(1)?, part(2)?])
            });
            Ok(Some(Sweep {
                beacon,
                time: *time,
                receiver: drone.reported_pose(),
                positions: 1,
                measured: measured.expect("a field is finite, and there is room for three"),
                ..Sweep::default()
            }))
        })
    }

    fn next_event(&self) -> Option<f64> {
        self.due().ok()
    }
}
