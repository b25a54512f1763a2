use contour::ContourBuilder;
#[cfg(feature = "batch")]
use foxhunt_core::Estimate;
use foxhunt_filters::PosteriorMap;
use geo::{Area, Contains, LineString, Point, Polygon};
use nalgebra::Vector2;
use serde::Serialize;

/// A connected part of the smallest region that holds a transmitter with a given probability.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Region {
    /// The probability that the transmitter is in this part.
    pub probability: f64,
    /// Area in square metres.
    pub area_m2: f64,
    /// The border, East and North in metres, counter-clockwise; the last place is the first.
    pub outline: Vec<Vector2<f64>>,
    /// Borders of the holes in the part, as of [`outline`](Self::outline).
    pub holes: Vec<Vec<Vector2<f64>>>,
}

impl Region {
    /// Returns true if a place lies within the border and in no hole.
    #[must_use]
    pub fn holds(&self, place: &Vector2<f64>) -> bool {
        is_within(&self.outline, place) && !self.holes.iter().any(|hole| is_within(hole, place))
    }
}

/// Corners of the outline of an ellipse.
#[cfg(feature = "batch")]
const CORNERS: u32 = 72;

/// Returns the region of highest density of a mixture of Gaussians that do not overlap, each with
/// its density at its mean over that of the first: an ellipse about each that is dense enough.
#[cfg(feature = "batch")]
pub(super) fn of_modes(modes: &[(Estimate<2>, f64)], probability: f64) -> Vec<Region> {
    let area = |estimate: &Estimate<2>| estimate.covariance.determinant().max(0.0).sqrt();
    let total: f64 = modes.iter().map(|(estimate, density)| density * area(estimate)).sum();
    // With the density t at the border an ellipse of peak p holds the share 1 - t/p of its mode.
    let held = |border: f64, (estimate, density): &(Estimate<2>, f64)| {
        density * area(estimate) / total * (1.0 - border / density).max(0.0)
    };
    let mut bounds = (0.0, modes.iter().map(|(_, density)| *density).fold(0.0, f64::max));
    for _ in 0..60 {
        let border = 0.5 * (bounds.0 + bounds.1);
        let sum: f64 = modes.iter().map(|mode| held(border, mode)).sum();
        bounds = if sum > probability { (border, bounds.1) } else { (bounds.0, border) };
    }
    let border = 0.5 * (bounds.0 + bounds.1);
    let region = |mode: &(Estimate<2>, f64)| {
        let (estimate, density) = mode;
        let own = 1.0 - border / density;
        let ellipse = estimate.ellipse(own).filter(|_| own > 0.0)?;
        let (sin, cos) = libm::sincos(ellipse.orientation);
        let corner = |number: u32| {
            let turn = std::f64::consts::TAU * f64::from(number % CORNERS) / f64::from(CORNERS);
            let along = ellipse.semi_major * libm::cos(turn);
            let across = ellipse.semi_minor * libm::sin(turn);
            let away = Vector2::new(cos * along - sin * across, sin * along + cos * across);
            estimate.mean + away
        };
        Some(Region {
            probability: held(border, mode),
            area_m2: std::f64::consts::PI * ellipse.semi_major * ellipse.semi_minor,
            outline: (0..=CORNERS).map(corner).collect(),
            holes: Vec::new(),
        })
    };
    let mut regions: Vec<Region> = modes.iter().filter_map(region).collect();
    regions.sort_by(|a, b| b.probability.total_cmp(&a.probability));
    regions
}

/// Returns true if a line from a place to the East crosses a closed border an odd number of times.
fn is_within(border: &[Vector2<f64>], place: &Vector2<f64>) -> bool {
    let crosses = |pair: &&[Vector2<f64>]| match pair {
        [a, b] if (a.y > place.y) != (b.y > place.y) => {
            place.x < a.x + (b.x - a.x) * (place.y - a.y) / (b.y - a.y)
        }
        _ => false,
    };
    border.windows(2).filter(crosses).count() % 2 == 1
}

/// The region of highest posterior density with a probability (Box & Tiao 1973), the most probable
/// part first.
pub(super) fn regions(map: &PosteriorMap, probability: f64) -> Vec<Region> {
    let cell_m = map.cell_m();
    let corner = map.south_west() - Vector2::repeat(0.5 * cell_m);
    // The contour goes between the last cell that belongs to the region and the first that does
    // not, by their masses.
    let least = map.highest_density(probability);
    let contours = ContourBuilder::new(map.columns(), map.rows(), true)
        .x_origin(corner.x)
        .y_origin(corner.y)
        .x_step(cell_m)
        .y_step(cell_m)
        .contours(map.mass(), &[least]);
    let Ok([contour]) = contours.as_deref() else { return Vec::new() };
    let held: Vec<(Point, f64)> = (map.cells().filter(|&(_, mass)| mass >= least))
        .map(|(place, mass)| (Point::new(place.x, place.y), mass))
        .collect();
    let ring = |ring: &LineString| -> Vec<Vector2<f64>> {
        ring.coords().map(|at| Vector2::new(at.x, at.y)).collect()
    };
    let region = |polygon: &Polygon| Region {
        probability: held.iter().filter(|(at, _)| polygon.contains(at)).map(|(_, mass)| mass).sum(),
        area_m2: polygon.unsigned_area(),
        outline: ring(polygon.exterior()),
        holes: polygon.interiors().iter().map(ring).collect(),
    };
    let mut regions: Vec<Region> = contour.geometry().iter().map(region).collect();
    regions.sort_by(|a, b| b.probability.total_cmp(&a.probability));
    regions
}
