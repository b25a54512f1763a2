//! Plane geometry over ground, which all of the fleet shares.

use core::f64::consts::TAU;
use std::vec::Vec;

use geo::{Coord, Distance, Euclidean, Line, coord};
use nalgebra::{Vector2, Vector3};

/// Distances that differ by less than this, in metres, are the same.
pub(super) const EXACT: f64 = 1e-9;

/// Distance, in metres, that places are laid out farther than needed, so that the ways between them
/// stand up to exact tests; more than the grid of the polygon operations.
pub(super) const SLACK: f64 = 2e-3;

pub(super) fn point(place: &Vector2<f64>) -> Coord<f64> {
    coord! { x: place.x, y: place.y }
}

pub(super) fn line(from: &Vector2<f64>, to: &Vector2<f64>) -> Line<f64> {
    Line::new(point(from), point(to))
}

/// Corners of a regular polygon about a disc, which no side of it enters.
pub(super) fn ring_about(
    centre: &Vector2<f64>,
    radius: f64,
    count: u32,
) -> impl Iterator<Item = Vector2<f64>> + use<> {
    let centre = *centre;
    let out = radius / libm::cos(TAU / f64::from(2 * count.max(3)));
    (0..count).map(move |index| {
        let angle = TAU * f64::from(index) / f64::from(count);
        centre + Vector2::new(libm::cos(angle), libm::sin(angle)) * out
    })
}

/// The way of a drone over ground: one degenerate line where it rests.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Region(Vec<Line<f64>>);

impl Region {
    pub(super) fn along(places: &[Vector3<f64>]) -> Self {
        Self(match places {
            [only] => [line(&only.xy(), &only.xy())].into(),
            _ => places.windows(2).map(|leg| line(&leg[0].xy(), &leg[1].xy())).collect(),
        })
    }

    pub(super) fn add(&mut self, from: &Vector2<f64>, to: &Vector2<f64>) {
        self.0.push(line(from, to));
    }

    pub(super) fn distance(&self, way: &Line<f64>) -> f64 {
        self.0.iter().map(|leg| Euclidean.distance(way, leg)).fold(f64::INFINITY, f64::min)
    }

    pub(super) fn distance_between(&self, other: &Self) -> f64 {
        self.0.iter().map(|leg| other.distance(leg)).fold(f64::INFINITY, f64::min)
    }

    pub(super) fn distance_to(&self, place: &Vector2<f64>) -> f64 {
        let place = geo::Point::from(point(place));
        self.0.iter().map(|leg| Euclidean.distance(&place, leg)).fold(f64::INFINITY, f64::min)
    }

    pub(super) fn ends(&self) -> impl Iterator<Item = Vector2<f64>> {
        let ends = self.0.iter().flat_map(|leg| [leg.start, leg.end]);
        ends.map(|end| Vector2::new(end.x, end.y))
    }
}

/// A length as a whole number of micrometres, which can be ordered and added without rounding.
pub(super) fn micrometres(length_m: f64) -> i64 {
    #[expect(clippy::cast_possible_truncation, reason = "clamped to what an i64 holds")]
    let whole = libm::round(length_m.clamp(0.0, 1e9) * 1e6) as i64;
    whole
}
