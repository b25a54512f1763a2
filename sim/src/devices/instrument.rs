use std::collections::VecDeque;

use foxhunt_core::{
    BeaconId, Measured, MeasuredError, MeasuredList, PatternSource, Quantity, Sweep,
};
use foxhunt_sensors::MagneticDipole;

use super::OnBoard;
use crate::{
    BeaconConfig, RangeDifferenceConfig, SimError, ThreeAxisConfig,
    truth::{Channel, Drone, Truth, beacon_of, is_due},
};

/// A simulated receiver whose sweeps hold no samples but quantities of the beacon's next pulse;
/// nothing where it does not reach the receiver.
///
/// One of three axes measures the magnetic field, in [`MagneticDipole::QUANTITIES`], up to its
/// sign; one that shares its clock with a reference receiver the range difference, in
/// [`Quantity::RANGE_DIFFERENCE`]. Several beacons are received one after the other.
#[derive(Clone, Debug)]
pub struct SimInstrument {
    on_board: OnBoard,
    instrument: Instrument,
    /// Reception that is still to come, and its earliest time.
    waiting: VecDeque<BeaconId>,
    since: f64,
}

/// Quantity that a [`SimInstrument`] measures.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Instrument {
    ThreeAxis(ThreeAxisConfig),
    RangeDifference(RangeDifferenceConfig),
}

impl Instrument {
    /// Returns the quantities of a pulse that is sent now.
    fn measure(
        self,
        drone: &mut Drone,
        channel: &Channel,
        beacon: &BeaconConfig,
        now: f64,
    ) -> Result<MeasuredList, MeasuredError> {
        match self {
            Self::ThreeAxis(config) => {
                let Some(field) = drone.magnetic_field(channel, beacon, &config, now) else {
                    return Ok(MeasuredList::default());
                };
                // σ follows from what is measured, as a receiver knows no more.
                let sigma = config.sigma(field.norm());
                let part = |n: usize| Measured::new(MagneticDipole::QUANTITIES[n], field[n], sigma);
                MeasuredList::new(&[part(0)?, part(1)?, part(2)?])
            }
            Self::RangeDifference(config) => {
                let Some(value) = drone.range_difference(channel, beacon, &config, now) else {
                    return Ok(MeasuredList::default());
                };
                let quantity = Quantity::RANGE_DIFFERENCE;
                MeasuredList::new(&[Measured::new(quantity, value, config.sigma_m)?])
            }
        }
    }
}

impl SimInstrument {
    pub(crate) fn new(on_board: OnBoard, instrument: Instrument) -> Self {
        Self { on_board, instrument, waiting: VecDeque::new(), since: 0.0 }
    }

    /// Returns the end of the pulse that is waited for; infinite without one.
    fn due(&self) -> Result<f64, SimError> {
        let Some(beacon) = self.waiting.front() else { return Ok(f64::INFINITY) };
        let due = |truth: &mut Truth, drone: usize| {
            let latency = truth.drones[drone].receiver.latency();
            Ok(beacon_of(&truth.beacons, *beacon)?.answer_after(self.since, latency))
        };
        self.on_board.with_truth(due)
    }
}

impl PatternSource for SimInstrument {
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
        let instrument = self.instrument;
        self.on_board.with_truth(|truth, drone| {
            let Truth { time, channel, beacons, drones, .. } = truth;
            let from = beacon_of(beacons, beacon)?;
            let drone = &mut drones[drone];
            let measured = instrument.measure(drone, channel, from, *time);
            Ok(Some(Sweep {
                beacon,
                time: *time,
                receiver: drone.reported_pose(),
                positions: 1,
                measured: measured.expect("places are finite, and there is room for three"),
                ..Sweep::default()
            }))
        })
    }

    fn next_event(&self) -> Option<f64> {
        self.due().ok()
    }
}
