//! Real fleets: where they may fly, who flies where, and when.

mod airspace;
mod attendance;
mod config;
mod endurance;
mod flight;
mod formation;
mod way;

pub use airspace::Airspace;
pub use attendance::{Attendance, AttendanceConfig, Duty};
pub use config::{AirspaceConfig, AirspaceError, KeepOut, TrafficConfig, TrafficError};
pub use endurance::{Endurance, EnduranceConfig};
pub use flight::{Order, OrderReason, Traffic, Travel};
pub use formation::{Formation, Moved, MovedReason, assign};

use core::f64::consts::TAU;
use std::vec::Vec;

use foxhunt_core::Belief;
use geo::{Coord, Distance, Euclidean, Line, Point, coord};
use nalgebra::{Vector2, Vector3};

use crate::planners::spiral;

/// Distances that differ by less than this, in metres, are the same.
const EXACT: f64 = 1e-9;

/// Distance, in metres, that places are laid out farther than needed, so that the ways between them
/// stand up to exact tests; more than the grid of the polygon operations.
const SLACK: f64 = 2e-3;

/// Fewer places than this give a belief's moments and not where the target may be; then the
/// Gaussian of these moments replaces it.
const FEWEST_PLACES: usize = 16;

/// Number of places that replace a Gaussian.
const GAUSSIAN_PLACES: u32 = 200;

/// The way of a drone over ground: one degenerate line where it rests.
#[derive(Clone, Debug, PartialEq)]
struct Region(Vec<Line<f64>>);

impl Region {
    fn along(places: &[Vector3<f64>]) -> Self {
        Self(match places {
            [only] => [line(&only.xy(), &only.xy())].into(),
            _ => places.windows(2).map(|leg| line(&leg[0].xy(), &leg[1].xy())).collect(),
        })
    }

    fn add(&mut self, from: &Vector2<f64>, to: &Vector2<f64>) {
        self.0.push(line(from, to));
    }

    fn distance(&self, way: &Line<f64>) -> f64 {
        self.0.iter().map(|leg| Euclidean.distance(way, leg)).fold(f64::INFINITY, f64::min)
    }

    fn distance_between(&self, other: &Self) -> f64 {
        self.0.iter().map(|leg| other.distance(leg)).fold(f64::INFINITY, f64::min)
    }

    fn distance_to(&self, place: &Vector2<f64>) -> f64 {
        let place = geo::Point::from(point(place));
        self.0.iter().map(|leg| Euclidean.distance(&place, leg)).fold(f64::INFINITY, f64::min)
    }

    fn ends(&self) -> impl Iterator<Item = Vector2<f64>> {
        let ends = self.0.iter().flat_map(|leg| [leg.start, leg.end]);
        ends.map(|end| Vector2::new(end.x, end.y))
    }
}

/// Distance that drones keep from a target whose place is only believed: the probability that it is
/// within `radius_m` of a drone's place or way over ground is at most `probability` (the void
/// constraint of Beard, Vo, Vo & Arulampalam 2017, on weighted samples of the belief; where it
/// shows fewer than 16, on 200 of the Gaussian that has its moments).
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct Void {
    /// In metres.
    pub radius_m: f64,
    /// Between 0 and 1.
    pub probability: f64,
}

/// Places where a target may be.
#[derive(Clone, Debug)]
struct Cloud {
    places: Vec<(Point<f64>, f64)>,
    centre: Vector2<f64>,
    /// From the centre to the farthest place.
    reach: f64,
}

impl Cloud {
    fn of(belief: &dyn Belief) -> Self {
        let moments = belief.position();
        let mut places = Vec::new();
        belief.visit_positions(&mut |place, weight| places.push((*place, weight)));
        if places.len() < FEWEST_PLACES
            && let Some(factor) = moments.covariance.cholesky()
        {
            let weight = 1.0 / f64::from(GAUSSIAN_PLACES);
            let spiral = spiral(moments.mean, factor.unpack(), GAUSSIAN_PLACES);
            places = spiral.map(|place| (place, weight)).collect();
        }
        let far =
            |reach: f64, (place, _): &(Vector2<f64>, f64)| reach.max((place - moments.mean).norm());
        let reach = places.iter().fold(0.0, far);
        let places = places.iter().map(|(p, weight)| (Point::from(point(p)), *weight)).collect();
        Self { places, centre: moments.mean, reach }
    }

    fn near(&self, way: &Line<f64>, radius: f64) -> f64 {
        let centre = Point::from(point(&self.centre));
        if Euclidean.distance(&centre, way) > self.reach + radius {
            return 0.0;
        }
        let near = self.places.iter().filter(|(p, _)| Euclidean.distance(p, way) < radius);
        near.map(|(_, weight)| weight).sum()
    }

    /// The probability that the target is within `radius` of the beginning of a leg, and the
    /// greatest of all places on it, the end aside.
    fn nearest(&self, from: &Vector2<f64>, to: &Vector2<f64>, radius: f64) -> (f64, f64) {
        let leg = to - from;
        let length = leg.norm();
        let Some(along) = leg.try_normalize(0.0) else { return (0.0, 0.0) };
        // Where on the leg each place comes within the radius, and where it is no more.
        let mut changes = Vec::new();
        let mut first = 0.0;
        for (place, weight) in &self.places {
            let off = Vector2::new(place.x(), place.y()) - from;
            let half = libm::sqrt(radius * radius - along.perp(&off).powi(2));
            let enter = along.dot(&off) - half;
            let leave = along.dot(&off) + half;
            // Where the way misses the place these are no numbers.
            if enter < length && leave > 0.0 {
                if enter < 0.0 {
                    first += weight;
                } else {
                    changes.push((enter, *weight));
                }
                changes.push((leave, -weight));
            }
        }
        // What is left goes before what is come to: within is nearer than the radius.
        changes.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
        let mut near = first;
        let mut most = first;
        for (_, change) in changes {
            near += change;
            most = most.max(near);
        }
        (first, most)
    }
}

impl Void {
    fn permits(&self, clouds: &[Cloud], from: &Vector2<f64>, to: &Vector2<f64>) -> bool {
        let way = line(from, to);
        clouds.iter().all(|cloud| cloud.near(&way, self.radius_m) <= self.probability)
    }

    /// Returns true if a way leads out: no place on it is nearer to the target than its beginning
    /// is.
    fn leaves(&self, clouds: &[Cloud], from: &Vector2<f64>, to: &Vector2<f64>) -> bool {
        if !self.permits(clouds, to, to) {
            return false;
        }
        clouds.iter().all(|cloud| {
            let (first, most) = cloud.nearest(from, to, self.radius_m);
            // Sums in another order differ by rounding.
            most <= first.max(self.probability) + 1e-9
        })
    }

    /// Places about what is to be kept away from.
    fn bends(&self, clouds: &[Cloud]) -> Vec<Vector2<f64>> {
        let mut bends = Vec::new();
        for cloud in clouds {
            let far = cloud.reach + self.radius_m + SLACK;
            for out in ring_about(&cloud.centre, far, 16) {
                bends.push(out);
                // The permitted place nearest to the centre on this ray.
                let mut inside = 0.0;
                let mut outside = 1.0;
                for _ in 0..12 {
                    let middle = 0.5 * (inside + outside);
                    let place = cloud.centre.lerp(&out, middle);
                    let permitted = self.permits(core::slice::from_ref(cloud), &place, &place);
                    *(if permitted { &mut outside } else { &mut inside }) = middle;
                }
                bends.push(cloud.centre.lerp(&out, outside * 1.02));
            }
        }
        bends
    }
}

fn point(place: &Vector2<f64>) -> Coord<f64> {
    coord! { x: place.x, y: place.y }
}

fn line(from: &Vector2<f64>, to: &Vector2<f64>) -> Line<f64> {
    Line::new(point(from), point(to))
}

/// Corners of a regular polygon about a disc, which no side of it enters.
fn ring_about(
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

/// A length as a whole number of micrometres, which can be ordered and added without rounding.
fn micrometres(length_m: f64) -> i64 {
    #[expect(clippy::cast_possible_truncation, reason = "clamped to what an i64 holds")]
    let whole = libm::round(length_m.clamp(0.0, 1e9) * 1e6) as i64;
    whole
}
