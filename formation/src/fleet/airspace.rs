use std::{vec, vec::Vec};

use foxhunt_core::parameter::{finite, not_negative, positive};
use geo::{
    Area, BooleanOps, BoundingRect, Buffer, Closest, ClosestPoint, Contains, Distance, Euclidean,
    LineString, MultiPolygon, Orient, Point, Polygon, Validation,
    algorithm::buffer::{BufferStyle, LineJoin},
    coord,
    orient::Direction,
    unary_union,
};
use nalgebra::{Vector2, Vector3};

use super::{AirspaceConfig, AirspaceError, EXACT, KeepOut, SLACK, line, point, ring_about};

/// Number of corners of a disc where a polygon is made of it.
const DISC_CORNERS: u32 = 64;

/// Space where drones may fly: inside the fence, outside the keep-outs, by a margin, within a band
/// of altitudes. Built once; all questions are about places in the local East-North-Up frame.
#[derive(Clone, Debug)]
pub struct Airspace {
    fence: Option<Polygon<f64>>,
    zones: Vec<Zone>,
    band: Option<[f64; 2]>,
    margin: f64,
    /// The permitted area, a little less at round edges; unlimited where absent.
    free: Option<MultiPolygon<f64>>,
    /// Places where the shortest ways bend.
    corners: Vec<Vector2<f64>>,
}

#[derive(Clone, Debug)]
enum Zone {
    Disc { centre: Vector2<f64>, radius: f64 },
    Polygon(Polygon<f64>),
}

impl AirspaceConfig {
    /// Narrows it to a disc: the fence becomes the part of it that lies in the disc, the largest
    /// where there are several, or the disc where there is no fence.
    ///
    /// # Errors
    ///
    /// [`AirspaceError`] names what is wrong with the fence or the disc, or that nothing is left.
    pub fn within_disc(&self, centre_m: [f64; 2], radius_m: f64) -> Result<Self, AirspaceError> {
        let centre = Vector2::from(centre_m);
        finite("centre_m", centre.x + centre.y)?;
        positive("radius_m", radius_m)?;
        // The corners of the disc's polygon lie on its edge.
        let inner = radius_m * libm::cos(core::f64::consts::PI / f64::from(DISC_CORNERS));
        let ring = ring_about(&centre, inner, DISC_CORNERS).map(|corner| point(&corner));
        let disc = Polygon::new(LineString(ring.collect()), vec![]);
        let left = match self.fence_m.as_slice() {
            [] => Some(disc),
            corners => {
                let parts = polygon("fence_m", corners)?.intersection(&disc);
                parts.0.into_iter().max_by(|a, b| a.unsigned_area().total_cmp(&b.unsigned_area()))
            }
        };
        let left = left.ok_or(AirspaceError::NothingLeft { margin_m: 0.0 })?;
        let mut fence_m: Vec<[f64; 2]> = left.exterior().coords().map(|at| [at.x, at.y]).collect();
        // A closed ring has its first corner twice.
        fence_m.pop();
        Ok(Self { fence_m, ..self.clone() })
    }

    /// Narrows the band of altitudes.
    ///
    /// # Errors
    ///
    /// [`AirspaceError::Band`] where nothing is left of it.
    pub fn within_band(&self, lowest: f64, highest: f64) -> Result<Self, AirspaceError> {
        let [least, most] = self.altitude_m.unwrap_or([f64::NEG_INFINITY, f64::INFINITY]);
        let lowest = lowest.max(least);
        let highest = highest.min(most);
        if lowest > highest {
            return Err(AirspaceError::Band { lowest, highest });
        }
        Ok(Self { altitude_m: Some([lowest, highest]), ..self.clone() })
    }
}

impl Airspace {
    /// An airspace with no margin: its edges may be touched.
    ///
    /// # Errors
    ///
    /// [`AirspaceError`] names the field with its value.
    pub fn new(config: &AirspaceConfig) -> Result<Self, AirspaceError> {
        let fence = match config.fence_m.as_slice() {
            [] => None,
            corners => Some(polygon("fence_m", corners)?),
        };
        let zones = config.keep_out.iter().map(zone).collect::<Result<_, _>>()?;
        if let Some([lowest, highest]) = config.altitude_m {
            finite("altitude_m", lowest)?;
            finite("altitude_m", highest)?;
            if lowest > highest {
                return Err(AirspaceError::Band { lowest, highest });
            }
        }
        Self::build(fence, zones, config.altitude_m, 0.0)
    }

    /// An airspace of the same limits, where places and ways keep `margin_m` metres away from the
    /// fence and the keep-outs.
    ///
    /// # Errors
    ///
    /// [`AirspaceError`] where the margin is negative or leaves nothing.
    pub fn with_margin(&self, margin_m: f64) -> Result<Self, AirspaceError> {
        not_negative("margin_m", margin_m)?;
        Self::build(self.fence.clone(), self.zones.clone(), self.band, margin_m)
    }

    fn build(
        fence: Option<Polygon<f64>>,
        zones: Vec<Zone>,
        band: Option<[f64; 2]>,
        margin: f64,
    ) -> Result<Self, AirspaceError> {
        let mut airspace = Self { fence, zones, band, margin, free: None, corners: vec![] };
        airspace.free = airspace.free_polygons();
        if airspace.free.as_ref().is_some_and(|free| free.0.is_empty()) {
            return Err(AirspaceError::NothingLeft { margin_m: margin });
        }
        let candidates = airspace.bends();
        airspace.corners = candidates.into_iter().filter(|c| airspace.holds(c)).collect();
        Ok(airspace)
    }

    /// Returns true if a drone may be at a place.
    #[must_use]
    pub fn permits(&self, place: &Vector3<f64>) -> bool {
        self.holds(&place.xy()) && self.in_band(place.z)
    }

    /// The permitted place nearest to `place`, over ground first; the altitude is the nearest of
    /// the band. None where `place` is not finite.
    #[must_use]
    pub fn nearest(&self, place: &Vector3<f64>) -> Option<Vector3<f64>> {
        let ground = self.nearest_over_ground(&place.xy())?;
        let altitude = self.altitude(place.z);
        altitude.is_finite().then(|| Vector3::new(ground.x, ground.y, altitude))
    }

    /// Returns true if the straight way between two places is permitted throughout. A way that
    /// touches an edge is not.
    #[must_use]
    pub fn clear(&self, from: &Vector3<f64>, to: &Vector3<f64>) -> bool {
        self.in_band(from.z)
            && self.in_band(to.z)
            && self.clear_by(&from.xy(), &to.xy(), self.margin)
    }

    /// Returns the distance of a place inside the fence and outside the keep-outs, in metres;
    /// negative where it is not permitted. Infinite where there are no limits, NaN for a place that
    /// is not finite.
    #[must_use]
    pub fn clearance(&self, place: &Vector2<f64>) -> f64 {
        if !(place.x.is_finite() && place.y.is_finite()) {
            return f64::NAN;
        }
        let here = Point::from(point(place));
        let fence = self.fence.as_ref().map(|fence| inside_by(&here, fence));
        let zones = self.zones.iter().map(|zone| match zone {
            Zone::Disc { centre, radius } => (place - centre).norm() - radius,
            Zone::Polygon(polygon) => -inside_by(&here, polygon),
        });
        fence.into_iter().chain(zones).fold(f64::INFINITY, f64::min)
    }

    /// The nearest altitude of the band.
    #[must_use]
    pub fn altitude(&self, up: f64) -> f64 {
        self.band.map_or(up, |[lowest, highest]| up.clamp(lowest, highest))
    }

    pub(super) fn holds(&self, place: &Vector2<f64>) -> bool {
        self.clearance(place) >= self.margin - EXACT
    }

    pub(super) fn corners(&self) -> &[Vector2<f64>] {
        &self.corners
    }

    pub(super) fn margin(&self) -> f64 {
        self.margin
    }

    /// Returns true if a straight way keeps `margin`, in place of this airspace's.
    pub(super) fn clear_by(&self, from: &Vector2<f64>, to: &Vector2<f64>, margin: f64) -> bool {
        let least = (margin - EXACT).max(EXACT);
        let ends = self.clearance(from).min(self.clearance(to));
        if ends.is_nan() || ends < margin - EXACT {
            return false;
        }
        let way = line(from, to);
        self.fence.as_ref().is_none_or(|f| Euclidean.distance(&way, f.exterior()) >= least)
            && self.zones.iter().all(|zone| match zone {
                Zone::Disc { centre, radius } => {
                    Euclidean.distance(&Point::from(point(centre)), &way) >= radius + least
                }
                Zone::Polygon(polygon) => Euclidean.distance(&way, polygon) >= least,
            })
    }

    pub(super) fn nearest_over_ground(&self, place: &Vector2<f64>) -> Option<Vector2<f64>> {
        if self.holds(place) {
            return Some(*place);
        }
        if !(place.x.is_finite() && place.y.is_finite()) {
            return None;
        }
        match self.free.as_ref()?.closest_point(&Point::from(point(place))) {
            Closest::Intersection(p) | Closest::SinglePoint(p) => Some(Vector2::new(p.x(), p.y())),
            Closest::Indeterminate => None,
        }
        .filter(|found| self.holds(found))
    }

    fn in_band(&self, up: f64) -> bool {
        up.is_finite()
            && self.band.is_none_or(|[low, high]| up >= low - EXACT && up <= high + EXACT)
    }

    fn free_polygons(&self) -> Option<MultiPolygon<f64>> {
        let away = self.margin * 1.002 + SLACK;
        let grown: Vec<MultiPolygon<f64>> = self.zones.iter().map(|z| z.grown(away)).collect();
        let within = match &self.fence {
            Some(fence) => buffered(fence, -away),
            None => {
                let all = unary_union(grown.iter());
                let bounds = all.bounding_rect()?;
                // Far enough out that no way out of a keep-out is shorter.
                let more = 2.0 * (bounds.width() + bounds.height());
                let low = bounds.min();
                let high = bounds.max();
                let more = coord! { x: more, y: more };
                MultiPolygon(vec![geo::Rect::new(low - more, high + more).to_polygon()])
            }
        };
        Some(if grown.is_empty() { within } else { within.difference(&unary_union(grown.iter())) })
    }

    /// Places about everything that sticks into the airspace, so that the ways between
    /// neighbouring ones keep the margin.
    fn bends(&self) -> Vec<Vector2<f64>> {
        let about = self.margin + SLACK;
        let mut bends = vec![];
        let mut round = |polygon: &Polygon<f64>| {
            for corner in &polygon.exterior().0[1..] {
                bends.extend(ring_about(&Vector2::new(corner.x, corner.y), about, 8));
            }
        };
        self.fence.iter().for_each(&mut round);
        for zone in &self.zones {
            if let Zone::Polygon(polygon) = zone {
                round(polygon);
            }
        }
        for zone in &self.zones {
            if let Zone::Disc { centre, radius } = zone {
                bends.extend(ring_about(centre, radius + about, 16));
            }
        }
        bends
    }
}

impl Zone {
    fn grown(&self, by: f64) -> MultiPolygon<f64> {
        match self {
            Self::Disc { centre, radius } => {
                let corners = ring_about(centre, radius + by, DISC_CORNERS).map(|c| point(&c));
                MultiPolygon(vec![Polygon::new(LineString(corners.collect()), vec![])])
            }
            Self::Polygon(polygon) => buffered(polygon, by),
        }
    }
}

fn buffered(polygon: &Polygon<f64>, by: f64) -> MultiPolygon<f64> {
    polygon.buffer_with_style(BufferStyle::new(by).line_join(LineJoin::Round(0.1)))
}

/// The distance to the edge, positive inside.
fn inside_by(place: &Point<f64>, polygon: &Polygon<f64>) -> f64 {
    let edge = Euclidean.distance(place, polygon.exterior());
    if polygon.contains(place) { edge } else { -edge }
}

fn zone(keep_out: &KeepOut) -> Result<Zone, AirspaceError> {
    match keep_out {
        KeepOut::Disc { centre_m: [east, north], radius_m } => {
            finite("keep_out.centre_m", *east)?;
            finite("keep_out.centre_m", *north)?;
            positive("keep_out.radius_m", *radius_m)?;
            Ok(Zone::Disc { centre: Vector2::new(*east, *north), radius: *radius_m })
        }
        KeepOut::Polygon { corners_m } => {
            polygon("keep_out.corners_m", corners_m).map(Zone::Polygon)
        }
    }
}

fn polygon(field: &'static str, corners: &[[f64; 2]]) -> Result<Polygon<f64>, AirspaceError> {
    for coordinate in corners.iter().flatten() {
        finite(field, *coordinate)?;
    }
    // The first corner may be given again at the end.
    let corners = match corners {
        [rest @ .., last] if rest.first() == Some(last) => rest,
        _ => corners,
    };
    if corners.len() < 3 {
        return Err(AirspaceError::Corners { field, corners: corners.len() });
    }
    let ring: Vec<_> = corners.iter().map(|&[x, y]| coord! { x: x, y: y }).collect();
    let polygon = Polygon::new(LineString(ring), vec![]);
    if polygon.is_valid() && polygon.unsigned_area() > 0.0 {
        Ok(polygon.orient(Direction::Default))
    } else {
        let [east, north] = corners[0];
        Err(AirspaceError::NotSimple { field, east, north })
    }
}
