/// The topic of diagnostics, as everywhere in ROS.
pub(in crate::link) const DIAGNOSTICS: &str = "/diagnostics";

/// The name of a drone's node, counted from 0.
pub(in crate::link) fn drone_name(drone: usize) -> String {
    format!("drone_{drone}")
}

/// A topic of a drone, counted from 0.
pub(in crate::link) fn drone_topic(drone: usize, what: &str) -> String {
    format!("/foxhunt/drone_{drone}/{what}")
}

/// A topic of a beacon, by its number in the hunt's list.
pub(in crate::link) fn beacon_topic(beacon: u16, what: &str) -> String {
    format!("/foxhunt/beacon_{beacon}/{what}")
}
