use alloc::vec::Vec;
use core::{
    f64::consts::{FRAC_PI_2, PI, TAU},
    fmt,
};

use foxhunt_core::Estimate;
use nalgebra::{Vector2, Vector3};

use super::cells::{Cell, Cells};
use crate::{
    planners::altitude::AltitudeRule,
    shape::{Polygon, number},
};

/// The distance that a target at a Gaussian place about the drone is within with 10 %, over the
/// root mean square distance: √(−ln 0.9).
const NEAR: f64 = 0.324_592_845_974_501_2;

/// Shape of a formation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Form {
    /// Everyone stays.
    Stay,
    /// A regular polygon of this circumradius in metres.
    Polygon(f64),
    /// A straight line of this length in metres.
    Line(f64),
    /// Half a circle of this radius in metres.
    Arc(f64),
    /// Each at a part of the belief.
    Scattered,
}

impl fmt::Display for Form {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Stay => f.write_str("turn again"),
            Self::Polygon(radius) => write!(f, "polygon of {radius:.1} m"),
            Self::Line(length) => write!(f, "line of {length:.1} m"),
            Self::Arc(radius) => write!(f, "arc of {radius:.1} m"),
            Self::Scattered => f.write_str("scattered"),
        }
    }
}

/// A formation that might be flown.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Candidate {
    pub(super) form: Form,
    pub(super) places: Vec<Vector3<f64>>,
}

/// Data that candidates are made of.
pub(super) struct Drawing<'a> {
    pub(super) rule: AltitudeRule,
    pub(super) count: usize,
    /// Mean place of the drones now.
    pub(super) from: Vector2<f64>,
    pub(super) separation_m: f64,
    /// The distance at which a drone measures a target best.
    pub(super) best_m: f64,
    pub(super) belief: &'a Cells,
}

impl Drawing<'_> {
    /// A place at the altitude for a target that is near.
    pub(super) fn raise(&self, place: &Vector2<f64>) -> Vector3<f64> {
        low_over(&self.rule, &self.belief.moments, place)
    }

    /// Every formation that is worth a look, over the belief of one target.
    pub(super) fn candidates(&self, all: &mut Vec<Candidate>) {
        let moments = &self.belief.moments;
        let covariance = &moments.covariance;
        let [large, small] = super::worth::axes(covariance).map(libm::sqrt);
        let along =
            0.5 * libm::atan2(2.0 * covariance[(0, 1)], covariance[(0, 0)] - covariance[(1, 1)]);
        let sigma = libm::sqrt(0.5 * covariance.trace());
        let mean = moments.mean;
        let towards = self.from - mean;
        let bearing = if towards.norm() > 1e-9 { libm::atan2(towards.y, towards.x) } else { 0.0 };

        let mut radii: Vec<f64> = Vec::new();
        let side = 2.0 * libm::sin(PI / number(self.count.max(2)));
        let least = if self.count > 1 { self.separation_m / side } else { 0.0 };
        for radius in [self.best_m, 1.4 * self.best_m, 0.6 * sigma, sigma, 1.5 * sigma] {
            let radius = radius.max(least);
            if radii.iter().all(|known| (known - radius).abs() > 0.1 * known) {
                radii.push(radius);
            }
        }
        for centre in self.centres(along, large) {
            for &radius in &radii {
                for turned in self.rotations() {
                    self.polygon(&centre, radius, along + turned, all);
                }
            }
        }
        for (direction, length) in [
            (along, 2.0 * large),
            (along, 3.0 * large),
            (along + FRAC_PI_2, 2.0 * small.max(self.best_m)),
            (along + FRAC_PI_2, 2.0 * large),
        ] {
            self.line(&mean, direction, length, all);
        }
        for radius in [sigma, 1.5 * sigma, 2.0 * sigma] {
            self.arc(&mean, bearing, radius.max(self.best_m), all);
        }
        self.scattered(all);
        // Abreast on the way, and as wide triangles the other way round.
        for share in [0.5, 0.65, 0.8, 0.9] {
            let centre = self.from + (mean - self.from) * share;
            for length in [sigma, 2.0 * sigma, 3.0 * sigma] {
                self.line(&centre, bearing + FRAC_PI_2, length, all);
            }
        }
        for radius in [sigma, 1.5 * sigma] {
            for rotation in [bearing + FRAC_PI_2, bearing + PI] {
                self.polygon(&mean, radius, rotation, all);
            }
        }
    }

    /// The mean, places about it along the major axis, on the way to it, and modes.
    fn centres(&self, along: f64, large: f64) -> Vec<Vector2<f64>> {
        let mean = self.belief.moments.mean;
        let axis = Vector2::new(libm::cos(along), libm::sin(along)) * large;
        let mut centres = alloc::vec![mean, mean + axis * 0.7, mean - axis * 0.7];
        let way = mean - self.from;
        if way.norm() > 4.0 * self.best_m {
            centres.extend([0.4, 0.6, 0.8].map(|share| self.from + way * share));
        }
        if !self.belief.gaussian {
            centres.extend(self.spread(3).map(|cell| cell.mean));
        }
        centres
    }

    /// Angles that turn a polygon into something else.
    fn rotations(&self) -> impl Iterator<Item = f64> {
        let count = number(self.count.max(1));
        let steps: u8 = if self.count > 4 { 1 } else { 3 };
        (0..steps).map(move |step| f64::from(step) * TAU / count / 3.0)
    }

    /// The densest cell, then those that are far from all before.
    fn spread(&self, count: usize) -> impl Iterator<Item = &Cell> {
        let cells = &self.belief.cells;
        let density = |cell: &Cell| cell.weight / (cell.covariance.determinant() + 1e-6);
        let densest = cells.iter().max_by(|a, b| density(a).total_cmp(&density(b)));
        let mut chosen: Vec<&Cell> = densest.into_iter().collect();
        while chosen.len() < count.min(cells.len()) {
            let far = |cell: &Cell| {
                let square = |known: &&Cell| (known.mean - cell.mean).norm_squared();
                chosen.iter().map(square).fold(f64::INFINITY, f64::min) * cell.weight
            };
            match cells.iter().max_by(|a, b| far(a).total_cmp(&far(b))) {
                Some(next) => chosen.push(next),
                None => break,
            }
        }
        chosen.into_iter()
    }

    fn push(&self, form: Form, places: Vec<Vector2<f64>>, all: &mut Vec<Candidate>) {
        let places: Vec<_> = places.iter().map(|place| self.raise(place)).collect();
        if apart(&places, self.separation_m) {
            all.push(Candidate { form, places });
        }
    }

    fn polygon(&self, centre: &Vector2<f64>, radius: f64, rotation: f64, all: &mut Vec<Candidate>) {
        let polygon = Polygon { circumradius: radius };
        let place = |index| polygon.vertex(centre, rotation, 0.0, index, self.count).xy();
        self.push(Form::Polygon(radius), (0..self.count).map(place).collect(), all);
    }

    fn line(&self, centre: &Vector2<f64>, direction: f64, length: f64, all: &mut Vec<Candidate>) {
        let between = number(self.count.max(2) - 1);
        let length = length.max(self.separation_m * between * 1.001);
        let along = Vector2::new(libm::cos(direction), libm::sin(direction));
        // A drone alone is at its end.
        let place = |index: usize| centre + along * length * (number(index) / between - 0.5);
        self.push(Form::Line(length), (0..self.count).map(place).collect(), all);
    }

    fn arc(&self, centre: &Vector2<f64>, bearing: f64, radius: f64, all: &mut Vec<Candidate>) {
        let between = number(self.count.max(2) - 1);
        let place = |index: usize| {
            let angle = bearing + PI * (number(index) / between - 0.5);
            centre + Vector2::new(libm::cos(angle), libm::sin(angle)) * radius
        };
        self.push(Form::Arc(radius), (0..self.count).map(place).collect(), all);
    }

    /// Each at its own part of the belief, beside it on the side of the drones.
    fn scattered(&self, all: &mut Vec<Candidate>) {
        let beside = |cell: &Cell| {
            let way = self.from - cell.mean;
            let norm = way.norm();
            let unit = if norm > 1e-9 { way / norm } else { Vector2::x() };
            cell.mean + unit * self.best_m.min(norm)
        };
        let places: Vec<_> = self.spread(self.count).map(beside).collect();
        if places.len() == self.count {
            self.push(Form::Scattered, places, all);
        }
    }
}

/// A place at the altitude for a target that is near.
pub(super) fn low_over(
    rule: &AltitudeRule,
    belief: &Estimate<2>,
    place: &Vector2<f64>,
) -> Vector3<f64> {
    let square = (place - belief.mean).norm_squared() + belief.covariance.trace();
    place.push(rule.altitude(NEAR * libm::sqrt(square)))
}

/// Returns true if no two places are nearer to each other over ground than the separation.
pub(super) fn apart(places: &[Vector3<f64>], separation_m: f64) -> bool {
    let least = separation_m * separation_m * (1.0 - 1e-9);
    places
        .iter()
        .enumerate()
        .all(|(index, a)| places[..index].iter().all(|b| (a.xy() - b.xy()).norm_squared() >= least))
}
