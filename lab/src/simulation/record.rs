use foxhunt_core::Correction;
use foxhunt_hunt::hunt::{Event, Fix};
use foxhunt_sim::{SimError, World};
use nalgebra::Vector2;

/// The semi-major axis of the 95 % ellipse that [`SearchProgress`] is about, in metres.
const SEMI_MAJOR_M: f64 = 3.0;

/// The result of a simulated hunt.
#[derive(Clone, Debug, PartialEq)]
pub struct Simulated {
    /// The fixes, in the order of the beacons, and the truth.
    pub found: Vec<Found>,
    /// Duration of the hunt, in simulated seconds.
    pub duration_s: f64,
    /// The distance that each drone flew, in metres.
    pub path_m: Vec<f64>,
}

/// A fix against the truth.
#[derive(Clone, Debug, PartialEq)]
pub struct Found {
    /// The fix.
    pub fix: Fix,
    /// The beacon's true place at its last reception, which is when the estimate is of; East and
    /// North in metres.
    pub truth: Vector2<f64>,
    /// The progress of the search.
    pub progress: SearchProgress,
    /// The normalised innovations squared of its receptions, with their degrees of freedom.
    pub nis: Vec<(f64, usize)>,
}

impl Found {
    /// Distance from the estimate to the truth, in metres.
    #[must_use]
    pub fn error_m(&self) -> f64 {
        (self.fix.estimate.mean - self.truth).norm()
    }

    /// The normalised estimation error squared; `None` when the covariance is not positive
    /// definite.
    #[must_use]
    pub fn nees(&self) -> Option<f64> {
        self.fix.estimate.nees(&self.truth)
    }
}

/// The progress of the search for one beacon, whatever its last estimate was.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SearchProgress {
    /// The number of filter steps on this beacon after which the semi-major axis of its 95 %
    /// ellipse was below 3 m for the first time; `None` if it never was. A step is one reception.
    pub steps_to_3m: Option<u32>,
    /// Time until then in simulated seconds, from the moment at which the search began: for the
    /// first beacon, and for all where turns are shared, the beginning of the hunt.
    pub time_to_3m_s: Option<f64>,
    /// The distance that all drones together flew from the beginning of the search to its end, in
    /// metres. Where turns are shared, the same metres count for every beacon that is searched for.
    pub path_m: f64,
}

/// The record of a hunt while it is flown.
#[derive(Debug, Default)]
pub(super) struct Record {
    searches: Vec<SearchRecord>,
}

#[derive(Clone, Debug, Default)]
struct SearchRecord {
    began: f64,
    path_before_m: f64,
    steps: u32,
    progress: SearchProgress,
    /// The time of the last reception.
    received: f64,
    nis: Vec<(f64, usize)>,
}

impl Record {
    fn search(&mut self, beacon: foxhunt_core::BeaconId) -> &mut SearchRecord {
        let index = usize::from(beacon.0);
        if self.searches.len() <= index {
            self.searches.resize_with(index + 1, SearchRecord::default);
        }
        &mut self.searches[index]
    }

    /// Takes note of an event.
    pub(super) fn note(&mut self, event: &Event, world: &World) {
        match event {
            Event::BeaconStarted { time, beacon, .. } => {
                let path_before_m = flown_m(world);
                *self.search(*beacon) =
                    SearchRecord { began: *time, path_before_m, ..SearchRecord::default() };
            }
            Event::Received { reception, .. } => {
                let search = self.search(reception.beacon);
                search.received = reception.time.max(search.received);
            }
            Event::Corrected {
                time,
                beacon: Some(beacon),
                correction,
                degrees_of_freedom,
                estimate,
                ..
            } => {
                let search = self.search(*beacon);
                search.nis.extend(correction.nis().zip(*degrees_of_freedom));
                search.steps += u32::from(*correction != Correction::Empty);
                let small = estimate.ellipse(0.95).is_some_and(|e| e.semi_major < SEMI_MAJOR_M);
                if small && search.progress.steps_to_3m.is_none() {
                    search.progress.steps_to_3m = Some(search.steps);
                    search.progress.time_to_3m_s = Some(time - search.began);
                }
            }
            Event::BeaconFinished { fix, .. } => {
                let flown_m = flown_m(world);
                let search = self.search(fix.beacon);
                search.progress.path_m = flown_m - search.path_before_m;
            }
            _ => {}
        }
    }

    /// The result of the hunt.
    pub(super) fn finish(mut self, fixes: &[Fix], world: &World) -> Result<Simulated, SimError> {
        let mut fixes: Vec<&Fix> = fixes.iter().collect();
        fixes.sort_by_key(|fix| fix.beacon);
        let mut found = Vec::with_capacity(fixes.len());
        for fix in fixes {
            let SearchRecord { received, progress, nis, .. } =
                std::mem::take(self.search(fix.beacon));
            let Some(truth) = world.truth_at(fix.beacon, received) else { continue };
            found.push(Found { fix: fix.clone(), truth: truth.xy(), progress, nis });
        }
        let path_m = (0..world.drone_count()).map(|drone| world.path_length(drone));
        Ok(Simulated { found, duration_s: world.time(), path_m: path_m.collect::<Result<_, _>>()? })
    }
}

/// The distance that all drones have flown together, in metres.
fn flown_m(world: &World) -> f64 {
    (0..world.drone_count()).filter_map(|drone| world.path_length(drone).ok()).sum()
}
