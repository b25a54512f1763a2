use std::collections::BTreeMap;

use foxhunt_core::{BeaconId, Estimate, Reception};
use foxhunt_hunt::{
    hunt::{Event, Fix},
    log::{LogHeader, LoggedBeacon},
};
use nalgebra::Vector2;

use super::frame::Extent;

/// Contents of a picture, in metres East and North, all of it finite.
#[derive(Debug, Default)]
pub(super) struct Scene {
    /// Places where each drone listened, in order.
    pub drones: BTreeMap<usize, Vec<Vector2<f64>>>,
    /// The bearings.
    pub rays: Vec<Ray>,
    /// The searches, one for each beacon that was begun with.
    pub searches: Vec<Search>,
    /// Every beacon whose place is known: where it was at its last reception.
    pub beacons: Vec<(String, Vector2<f64>)>,
    /// The ways of moving beacons since the beginning.
    pub courses: Vec<Vec<Vector2<f64>>>,
    /// Beacon of the last reception.
    received: BeaconId,
}

/// One bearing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Ray {
    pub drone: usize,
    pub from: Vector2<f64>,
    /// Radians counter-clockwise from East.
    angle: f64,
    /// True if the estimator fused it.
    pub fused: bool,
}

impl Ray {
    /// End of the ray when it is drawn this long.
    pub(super) fn end(&self, length: f64) -> Vector2<f64> {
        let (sin, cos) = libm::sincos(self.angle);
        self.from + Vector2::new(cos, sin) * length
    }
}

/// The search for one beacon.
#[derive(Debug, Default)]
pub(super) struct Search {
    beacon: BeaconId,
    pub name: String,
    /// The prior's mean, then one estimate for each reception.
    pub track: Vec<Vector2<f64>>,
    /// Places of equal weight, drawn from the last belief, where two moments do not do.
    pub cloud: Vec<Vector2<f64>>,
    /// The last belief.
    pub estimate: Option<Estimate<2>>,
    pub truth: Option<Vector2<f64>>,
    /// The result, where the search ended.
    pub fix: Option<Fix>,
}

/// Farther than this from the origin, in metres, is no place in a local frame.
const FAR: f64 = 1e7;

pub(super) fn drawable(place: &Vector2<f64>) -> bool {
    // NaN is not below anything.
    place.iter().all(|c| c.abs() < FAR)
}

/// Time of the last reception of the beacon with an index, in seconds; 0 without receptions.
fn last_received(events: &[Event], index: usize) -> f64 {
    let times = events.iter().filter_map(|event| match event {
        Event::Received { reception, .. } if usize::from(reception.beacon.0) == index => {
            Some(reception.time).filter(|time| time.is_finite())
        }
        _ => None,
    });
    times.fold(0.0, f64::max)
}

/// The way of a beacon that moves, up to a time.
fn course(beacon: &LoggedBeacon, until: f64) -> Option<Vec<Vector2<f64>>> {
    const STEPS: u16 = 400;
    beacon.course.as_ref()?;
    let at = |step: u16| beacon.place_at(until * f64::from(step) / f64::from(STEPS));
    Some((0..=STEPS).filter_map(at).filter(drawable).collect())
}

impl Scene {
    pub(super) fn new(header: &LogHeader, events: &[Event]) -> Self {
        let mut scene = Self::default();
        for (index, beacon) in header.beacons.iter().enumerate() {
            let last = last_received(events, index);
            if let Some(place) = beacon.place_at(last).filter(drawable) {
                scene.beacons.push((beacon.name.clone(), place));
                scene.courses.extend(course(beacon, last));
            }
            for (other, number) in beacon.others.iter().filter(|other| drawable(other)).zip(2..) {
                scene.beacons.push((format!("{} {number}", beacon.name), *other));
            }
        }
        for event in events {
            scene.add(event);
        }
        scene
    }

    fn add(&mut self, event: &Event) {
        match event {
            Event::BeaconStarted { beacon, name, prior, .. } => {
                let truth = self.beacons.iter().find(|(known, _)| known == name).map(|b| b.1);
                let track = Some(prior.mean).filter(drawable).into_iter().collect();
                self.searches.push(Search {
                    beacon: *beacon,
                    name: name.clone(),
                    track,
                    truth,
                    ..Search::default()
                });
            }
            Event::Received { drone, reception, .. } => self.receive(*drone, reception),
            Event::Corrected { drone, beacon, correction, estimate, .. } => {
                if correction.is_rejected() {
                    self.discard(*drone);
                }
                self.believe(beacon.unwrap_or(self.received), estimate);
            }
            Event::Cloud { beacon, places, .. } => {
                if let Some(search) = self.search(*beacon) {
                    search.cloud = places.iter().filter(|place| drawable(place)).copied().collect();
                }
            }
            Event::Refused { drone, .. } => self.discard(*drone),
            Event::BeaconFinished { fix, .. } => {
                self.believe(fix.beacon, &fix.estimate);
                if let Some(search) = self.search(fix.beacon) {
                    search.fix = Some(fix.clone());
                }
            }
            _ => {}
        }
    }

    /// The last search that was begun for a beacon.
    fn search(&mut self, beacon: BeaconId) -> Option<&mut Search> {
        self.searches.iter_mut().rfind(|search| search.beacon == beacon)
    }

    fn receive(&mut self, drone: usize, reception: &Reception) {
        self.received = reception.beacon;
        let from = reception.receiver.position.xy();
        if !drawable(&from) {
            return;
        }
        self.drones.entry(drone).or_default().push(from);
        if let Some(bearing) = reception.bearing.filter(|b| b.angle.is_finite()) {
            self.rays.push(Ray { drone, from, angle: bearing.angle, fused: true });
        }
    }

    /// The last bearing was of no use, if it is this drone's.
    fn discard(&mut self, drone: usize) {
        if let Some(ray) = self.rays.last_mut().filter(|ray| ray.drone == drone) {
            ray.fused = false;
        }
    }

    fn believe(&mut self, beacon: BeaconId, estimate: &Estimate<2>) {
        if let Some(search) = self.search(beacon)
            && drawable(&estimate.mean)
        {
            search.estimate = Some(*estimate);
            if search.track.last() != Some(&estimate.mean) {
                search.track.push(estimate.mean);
            }
        }
    }

    /// The field that holds all of it: every place whole, an ellipse that is much larger than
    /// the rest only in part.
    pub(super) fn extent(&self) -> Extent {
        let mut extent = Extent::default();
        let tracks = self.searches.iter().map(|search| &search.track);
        for place in self.drones.values().chain(tracks).flatten() {
            extent.add(place);
        }
        for truth in
            self.beacons.iter().map(|(_, truth)| truth).chain(self.courses.iter().flatten())
        {
            extent.add(truth);
        }
        let allowed = extent.grown(0.5);
        for outline in self.searches.iter().filter_map(Search::outline) {
            for place in &outline {
                extent.add(&allowed.clamp(place));
            }
        }
        extent
    }
}

impl Search {
    /// The 95 % ellipse as a closed line, where there is one that can be drawn.
    pub(super) fn outline(&self) -> Option<Vec<Vector2<f64>>> {
        outline(self.estimate.as_ref()?)
    }
}

/// The 95 % ellipse of an estimate as a closed line, where there is one that can be drawn.
pub(super) fn outline(estimate: &Estimate<2>) -> Option<Vec<Vector2<f64>>> {
    const CORNERS: u32 = 120;
    let ellipse = estimate.ellipse(0.95).filter(|e| e.semi_major < FAR)?;
    let (sin, cos) = libm::sincos(ellipse.orientation);
    let corner = |i: u32| {
        let (s, c) = libm::sincos(std::f64::consts::TAU * f64::from(i) / f64::from(CORNERS));
        let along = ellipse.semi_major * c;
        let across = ellipse.semi_minor * s;
        estimate.mean + Vector2::new(along * cos - across * sin, along * sin + across * cos)
    };
    Some((0..=CORNERS).map(corner).collect())
}

#[cfg(test)]
mod tests {
    use approx::assert_relative_eq;
    use nalgebra::Matrix2;

    use super::*;

    #[test]
    fn the_outline_is_a_level_of_the_nees() {
        let covariance = Matrix2::new(9.0, 2.0, 2.0, 1.0);
        let estimate = Estimate { mean: Vector2::new(5.0, -3.0), covariance };
        let name = "fox".to_owned();
        let estimate = Some(estimate);
        let search = Search { name, estimate, ..Search::default() };
        let outline = search.outline().expect("the covariance is positive definite");
        for corner in outline {
            let nees = search.estimate.and_then(|e| e.nees(&corner)).expect("positive definite");
            // χ²₂ at 95 %; what is left is rounding.
            assert_relative_eq!(nees, -2.0 * 0.05_f64.ln(), epsilon = 1e-9);
        }
    }

    #[test]
    fn a_ray_to_the_north_ends_in_the_north() {
        let from = Vector2::new(1.0, 2.0);
        let angle = std::f64::consts::FRAC_PI_2;
        let end = Ray { drone: 0, from, angle, fused: true }.end(10.0);
        assert_relative_eq!(end, Vector2::new(1.0, 12.0), epsilon = 1e-12);
    }
}
