use foxhunt_core::{Pose, Receptions};
use foxhunt_hunt::locate::Listener;

use crate::recording::{Record, Recording};

/// A receiver that has moved by less than this stays where it is, in metres.
const STILL_M: f64 = 1.0;

/// The receivers that stay in one place throughout a recording: they listen from their first record
/// to their last, whatever beacon those are of, down to the lowest level of all receptions there.
#[must_use]
pub fn listeners(recordings: &[Recording], receptions: &Receptions) -> Vec<Listener> {
    let mut listeners = Vec::new();
    for recording in recordings {
        for drone in recording.drones() {
            let records = || recording.records().iter().filter(|record| &*record.drone == drone);
            let Some(receiver) = records().find_map(|record| record.receiver()) else { continue };
            let here = |pose: Pose| (pose.position - receiver.position).norm() < STILL_M;
            let stays = |record: &Record| record.receiver().is_some_and(here);
            let times = || records().filter_map(|record| record.time);
            let levels = receptions.iter().filter(|reception| here(reception.receiver));
            let levels = levels.filter_map(|reception| reception.level);
            let floor_dbm = levels.map(|level| level.rss_dbm).fold(f64::INFINITY, f64::min);
            if floor_dbm.is_finite() && records().all(stays) {
                let from = times().fold(f64::INFINITY, f64::min);
                let until = times().fold(f64::NEG_INFINITY, f64::max);
                listeners.push(Listener { receiver, from, until, floor_dbm });
            }
        }
    }
    listeners
}
