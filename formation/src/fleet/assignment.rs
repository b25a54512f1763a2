use std::vec::Vec;

use nalgebra::Vector2;
use pathfinding::{kuhn_munkres::kuhn_munkres_min, matrix::Matrix};

use super::ground::micrometres;

/// Assigns drones to places, so that all travel together as little as possible.
///
/// The result holds the place of each drone, in the order of `from`; None where there are fewer
/// places than drones and it is left out. Lengths count in whole micrometres. The Hungarian method
/// (Kuhn 1955; Munkres 1957), O(n³).
///
/// Straight ways of least total length do not cross properly: by the triangle inequality two that
/// do could be exchanged for two that are shorter together. (Turpin, Michael & Kumar 2014 minimise
/// the sum of squared distances instead, which also keeps drones apart that fly at the same time.)
#[must_use]
pub fn assign(from: &[Vector2<f64>], to: &[Vector2<f64>]) -> Vec<Option<usize>> {
    assign_by(from.len(), to.len(), |drone, place| (from[drone] - to[place]).norm())
}

/// Assigns drones to places by lengths of any kind, in metres.
pub(super) fn assign_by(
    drones: usize,
    places: usize,
    length: impl Fn(usize, usize) -> f64,
) -> Vec<Option<usize>> {
    let mut places_of = std::vec![None; drones];
    if drones == 0 || places == 0 {
        return places_of;
    }
    // The method needs at least as many columns as rows.
    if drones <= places {
        let costs = Matrix::from_fn(drones, places, |(d, p)| micrometres(length(d, p)));
        let (_, columns) = kuhn_munkres_min(&costs);
        places_of.iter_mut().zip(columns).for_each(|(of, place)| *of = Some(place));
    } else {
        let costs = Matrix::from_fn(places, drones, |(p, d)| micrometres(length(d, p)));
        let (_, columns) = kuhn_munkres_min(&costs);
        columns.into_iter().enumerate().for_each(|(place, d)| places_of[d] = Some(place));
    }
    places_of
}
