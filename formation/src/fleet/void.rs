use std::vec::Vec;

use foxhunt_core::Belief;
use geo::{Distance, Euclidean, Line, Point};
use nalgebra::Vector2;

use super::ground::{SLACK, line, point, ring_about};

/// How far drones keep from a target whose place is only believed: the probability that it is
/// within `radius_m` of a drone's place or way over ground is at most `probability` (the void
/// constraint of Beard, Vo, Vo & Arulampalam 2017, on weighted samples of the belief).
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct Void {
    /// In metres.
    pub radius_m: f64,
    /// Between 0 and 1.
    pub probability: f64,
}

/// Where a target may be.
#[derive(Clone, Debug)]
pub(super) struct Cloud {
    places: Vec<(Point<f64>, f64)>,
    centre: Vector2<f64>,
    /// From the centre to the farthest place.
    reach: f64,
}

impl Cloud {
    pub(super) fn of(belief: &dyn Belief) -> Self {
        let mut places = Vec::new();
        let centre = belief.position().mean;
        let mut reach = 0.0_f64;
        belief.visit_positions(&mut |place, weight| {
            places.push((Point::from(point(place)), weight));
            reach = reach.max((place - centre).norm());
        });
        Self { places, centre, reach }
    }

    fn near(&self, way: &Line<f64>, radius: f64) -> f64 {
        let centre = Point::from(point(&self.centre));
        if Euclidean.distance(&centre, way) > self.reach + radius {
            return 0.0;
        }
        let near = self.places.iter().filter(|(p, _)| Euclidean.distance(p, way) < radius);
        near.map(|(_, weight)| weight).sum()
    }
}

impl Void {
    pub(super) fn permits(&self, clouds: &[Cloud], from: &Vector2<f64>, to: &Vector2<f64>) -> bool {
        let way = line(from, to);
        clouds.iter().all(|cloud| cloud.near(&way, self.radius_m) <= self.probability)
    }

    /// Whether a way leads out: no place on it is nearer to the target than its beginning is.
    pub(super) fn leaves(&self, clouds: &[Cloud], from: &Vector2<f64>, to: &Vector2<f64>) -> bool {
        if !self.permits(clouds, to, to) {
            return false;
        }
        clouds.iter().all(|cloud| {
            let near = |place: &Vector2<f64>| cloud.near(&line(place, place), self.radius_m);
            let most = near(from).max(self.probability);
            (1..32).all(|step| near(&from.lerp(to, f64::from(step) / 32.0)) <= most)
        })
    }

    /// Places about what is to be kept away from.
    pub(super) fn bends(&self, clouds: &[Cloud]) -> Vec<Vector2<f64>> {
        let mut bends = Vec::new();
        for cloud in clouds {
            let far = cloud.reach + self.radius_m + SLACK;
            for out in ring_about(&cloud.centre, far, 16) {
                bends.push(out);
                // The permitted place nearest to the centre on this ray.
                let (mut inside, mut outside) = (0.0, 1.0);
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
