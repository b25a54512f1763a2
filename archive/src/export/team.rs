use std::collections::HashMap;

use nalgebra::Vector3;

use crate::overview::{Overview, SearchOverview};

/// A receiver as teams see it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CotPlatform {
    /// Name of the receiver.
    pub name: String,
    /// True for a person, a car, a boat or a station.
    pub on_the_ground: bool,
}

/// Receivers of a hunt that goes on: names, and places that were reported beside receptions.
#[derive(Clone, Debug, Default)]
pub(super) struct Receivers {
    platforms: Vec<CotPlatform>,
    /// Reported places with their times.
    places: Vec<Option<(f64, Vector3<f64>)>>,
}

impl Receivers {
    /// Begins for receivers in the order of the hunt; those beyond have the hunt's own names, and
    /// are in the air.
    pub(super) fn new(platforms: Vec<CotPlatform>) -> Self {
        Self { platforms, places: Vec::new() }
    }

    /// Takes the place of a receiver at a time of the hunt: East, North and Up in metres.
    pub(super) fn place(&mut self, receiver: usize, time: f64, place: Vector3<f64>) {
        if self.places.len() <= receiver {
            self.places.resize(receiver + 1, None);
        }
        if let Some(kept) = self.places.get_mut(receiver) {
            *kept = Some((time, place));
        }
    }

    /// Returns the last known place of a receiver with its time.
    pub(super) fn last(&self, overview: &Overview, receiver: usize) -> Option<(f64, Vector3<f64>)> {
        let reported = self.places.get(receiver).copied().flatten();
        let of_hunt = overview.receivers.get(receiver).and_then(|receiver| receiver.path.last());
        // The hunt has a drone whose link is lost where it was sent.
        reported.or(of_hunt.map(|knot| (knot.time, knot.place)))
    }

    /// Returns the name of a receiver.
    pub(super) fn name(&self, overview: &Overview, receiver: usize) -> String {
        let own = self.platforms.get(receiver).map(|platform| &platform.name);
        let of_hunt = overview.receivers.get(receiver).map(|receiver| &receiver.name);
        let name = own.or(of_hunt).filter(|name| !name.is_empty());
        name.map_or_else(|| format!("receiver {}", receiver + 1), Clone::clone)
    }

    /// Returns the names of all receivers.
    pub(super) fn names<'a>(&'a self, overview: &'a Overview) -> impl Iterator<Item = String> + 'a {
        let receivers = overview.receivers.len().max(self.places.len());
        (0..receivers).map(|receiver| self.name(overview, receiver))
    }

    /// Returns true for a person, a car, a boat or a station.
    pub(super) fn is_on_the_ground(&self, receiver: usize) -> bool {
        self.platforms.get(receiver).is_some_and(|platform| platform.on_the_ground)
    }
}

/// Unique names. A name that is used again has a number behind it.
#[derive(Default)]
pub(super) struct Names(HashMap<String, usize>);

impl Names {
    /// Returns the name, with a number behind it if it is used again.
    pub(super) fn unique(&mut self, name: String) -> String {
        let count = self.0.entry(name.clone()).or_default();
        *count += 1;
        if *count == 1 { name } else { format!("{name}.{count}") }
    }
}

/// Returns names of which no two are one: one that is used again has a number behind it.
pub(super) fn unique(names: impl Iterator<Item = String>) -> Vec<String> {
    let mut used = Names::default();
    names.map(|name| used.unique(name)).collect()
}

/// Returns true if the belief is about receptions: a prior is no fix.
pub(super) fn is_found(search: &SearchOverview) -> bool {
    search.last().is_some_and(|last| last.steps > 0)
}
