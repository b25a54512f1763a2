use foxhunt_core::{
    BearingExtractor, Estimate, Estimator, EstimatorError, Fleet, FormationPlanner, Observation,
    ObservationError, PatternSource, Reception,
};

use super::{Command, Hunt, HuntError};

/// Moves data once between a hunt and its devices: asks where the drones are, lets time pass,
/// hands on what is to be done, and takes the sweeps that are ready. Call it until the hunt is
/// finished; it never blocks.
///
/// A device that fails is noted in the hunt and asked again next time, so one broken drone does
/// not stop the others; where a place is not finite, the drone is taken to be where it was.
///
/// # Errors
///
/// [`DriveError`] when the hunt cannot go on, or there are fewer sources than drones.
pub fn drive<X, P, F, E, S, L, const N: usize, const M: usize>(
    hunt: &mut Hunt<X, P, F, E, N, M>,
    sources: &mut [S],
    fleet: &mut L,
    time: f64,
) -> Result<(), DriveError>
where
    X: BearingExtractor,
    P: FormationPlanner,
    F: FnMut(&Estimate<2>) -> Result<E, EstimatorError>,
    E: Estimator<N, M>,
    S: PatternSource,
    L: Fleet + ?Sized,
    Observation<M>: for<'a> TryFrom<&'a Reception, Error = ObservationError>,
{
    if sources.len() < hunt.stations().len() {
        return Err(DriveError::Sources { sources: sources.len(), drones: hunt.stations().len() });
    }
    for drone in 0..hunt.stations().len() {
        match fleet.locate(drone) {
            Ok(pose) if pose.is_finite() => hunt.located(time, drone, pose),
            Ok(pose) => {
                let reason = format!("its place is not finite: {pose:?}");
                hunt.device_failed(time, Some(drone), reason);
            }
            Err(error) => hunt.device_failed(time, Some(drone), error.to_string()),
        }
    }
    hunt.advance(time)?;
    while let Some(command) = hunt.poll_command() {
        match command {
            Command::GoTo { drone, goal } => {
                if let Err(error) = fleet.send(drone, &goal) {
                    hunt.not_sent(time, drone, error.to_string());
                }
            }
            Command::Land { drone } => {
                if let Err(error) = fleet.land(drone) {
                    hunt.not_landed(time, drone, error.to_string());
                }
            }
            Command::Listen { drone, beacons } => {
                if let Err(error) = sources[drone].begin(&beacons) {
                    hunt.device_failed(time, Some(drone), error.to_string());
                }
            }
        }
    }
    for (drone, source) in sources.iter_mut().enumerate() {
        // A turn that is over lends a sweep for each beacon; a source that lends without end is
        // not asked for more.
        for _ in 0..hunt.beacon_count() {
            if !hunt.awaits(drone) {
                break;
            }
            match source.poll() {
                Ok(Some(sweep)) => hunt.sweep(time, drone, &sweep),
                Ok(None) => break,
                Err(error) => {
                    hunt.device_failed(time, Some(drone), error.to_string());
                    break;
                }
            }
        }
    }
    Ok(())
}

/// Why a hunt could not be driven on.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum DriveError {
    /// The hunt itself cannot go on.
    #[error(transparent)]
    Hunt(#[from] HuntError),
    /// Not every drone has a source.
    #[error("there are {sources} pattern sources for {drones} drones")]
    Sources {
        /// How many sources.
        sources: usize,
        /// How many drones.
        drones: usize,
    },
}
