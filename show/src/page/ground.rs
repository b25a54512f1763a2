use std::{collections::BTreeMap, ops::RangeInclusive};

use foxhunt_wire::{
    geodesy::{Geodetic, LocalFrame},
    packed::base64,
};
use nalgebra::{Vector2, Vector3};
use serde::Serialize;

use crate::overview::Overview;

/// Number of tiles of the finest level that a page brings along.
const MOST_FINE: u32 = 40;

/// Number of coarser levels, for a view from farther off.
const COARSER: u8 = 5;

/// Bytes of all tiles of a page, before they are written as text.
const MOST_BYTES: usize = 3_000_000;

/// Part of a hunt's size by which the map goes beyond it on each side.
const BEYOND: f64 = 0.6;

/// Least half-width of the map, in metres.
const LEAST_M: f64 = 100.0;

/// Map that a page brings along: tiles of Web Mercator about a hunt, counted from the North-West.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Ground {
    zooms: [u8; 2],
    attribution: Option<String>,
    /// Images in base64 by `zoom/column/row`.
    images: BTreeMap<String, String>,
}

impl Ground {
    /// Takes the tiles about an overview out of a map with these zoom levels: the finest level of
    /// which 40 tiles are enough, and five coarser ones, three megabytes in all. Returns `None` if
    /// the overview has no origin, or the map no tile there.
    pub fn about(
        overview: &Overview,
        zooms: [u8; 2],
        attribution: Option<String>,
        mut tile: impl FnMut(u8, u32, u32) -> Option<Vec<u8>>,
    ) -> Option<Self> {
        let frame = overview.frame?;
        let (centre, half) = extent(overview)?;
        let half = half * (1.0 + BEYOND);
        let [least, greatest] = zooms;
        let finest = (least..=greatest)
            .rev()
            .find(|zoom| count(&cover(&frame, centre, half, *zoom)) <= MOST_FINE)?;
        let coarsest = finest.saturating_sub(COARSER).max(least);
        let mut images = BTreeMap::new();
        let mut bytes = 0;
        for (zoom, farther) in (coarsest..=finest).rev().zip(1_u8..) {
            let [columns, rows] = cover(&frame, centre, half * f64::from(farther), zoom);
            for row in rows {
                for column in columns.clone() {
                    let Some(image) = tile(zoom, column, row) else { continue };
                    bytes += image.len();
                    if bytes <= MOST_BYTES {
                        let _ = images.insert(format!("{zoom}/{column}/{row}"), base64(&image));
                    }
                }
            }
        }
        let ground = Self { zooms: [coarsest, finest], attribution, images };
        (!ground.images.is_empty()).then_some(ground)
    }

    /// Returns the number of tiles.
    #[must_use]
    pub fn len(&self) -> usize {
        self.images.len()
    }

    /// Returns true if there is no tile.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.images.is_empty()
    }
}

/// Centre and half-size of the receptions, the paths and the last places of an overview.
pub(crate) fn extent(overview: &Overview) -> Option<(Vector2<f64>, Vector2<f64>)> {
    let paths = overview.receivers.iter().flat_map(|receiver| &receiver.path);
    let truths = overview.searches.iter().flat_map(|search| &search.truth);
    let knots = paths.chain(truths).map(|knot| knot.place.xy());
    let receptions = overview.received.iter().map(|received| received.place.xy());
    let last = overview.searches.iter().filter_map(|search| search.last());
    let places = knots.chain(receptions).chain(last.map(|belief| belief.estimate.mean));
    let mut corners: Option<(Vector2<f64>, Vector2<f64>)> = None;
    for place in places.filter(|place| place.iter().all(|metres| metres.is_finite())) {
        let (low, high) = corners.unwrap_or((place, place));
        corners = Some((low.inf(&place), high.sup(&place)));
    }
    let (low, high) = corners?;
    Some((0.5 * (low + high), (0.5 * (high - low)).map(|half| half.max(LEAST_M))))
}

/// Columns and rows of the tiles of a level that cover a rectangle.
fn cover(
    frame: &LocalFrame,
    centre: Vector2<f64>,
    half: Vector2<f64>,
    zoom: u8,
) -> [RangeInclusive<u32>; 2] {
    let signs = [[-1.0, -1.0], [-1.0, 1.0], [1.0, -1.0], [1.0, 1.0]];
    let tiles = signs.map(|[east, north]| {
        let corner = centre + Vector2::new(east * half.x, north * half.y);
        tile_at(&frame.to_geodetic(&Vector3::new(corner.x, corner.y, 0.0)), zoom)
    });
    [0, 1].map(|axis| {
        let along = tiles.map(|tile| tile[axis]);
        let least = along.iter().min().copied().unwrap_or_default();
        let greatest = along.iter().max().copied().unwrap_or_default();
        least..=greatest
    })
}

/// Number of the tiles of some columns and rows.
fn count([columns, rows]: &[RangeInclusive<u32>; 2]) -> u32 {
    let length = |range: &RangeInclusive<u32>| range.end() - range.start() + 1;
    length(columns).saturating_mul(length(rows))
}

/// Column and row of the tile of a level that holds a place.
fn tile_at(place: &Geodetic, zoom: u8) -> [u32; 2] {
    mercator(place).map(|share| {
        let side = f64::from(zoom.min(31)).exp2();
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped")]
        let tile = (share * side).floor().clamp(0.0, side - 1.0) as u32;
        tile
    })
}

/// Place in Web Mercator, from 0 in the North-West to 1 in the South-East.
pub(crate) fn mercator(place: &Geodetic) -> [f64; 2] {
    let lat = place.lat_deg.clamp(-85.06, 85.06).to_radians();
    let north = libm::asinh(libm::tan(lat)) / std::f64::consts::TAU;
    [(place.lon_deg + 180.0) / 360.0, 0.5 - north]
}

/// Latitude and longitude in degrees of a place in Web Mercator.
#[cfg(any(feature = "sqlite", test))]
pub(crate) fn degrees([column, row]: [f64; 2]) -> [f64; 2] {
    let north = libm::sinh(std::f64::consts::TAU * (0.5 - row));
    [libm::atan(north).to_degrees(), column * 360.0 - 180.0]
}

#[cfg(test)]
mod tests {
    use approx::assert_abs_diff_eq;

    use super::*;
    use crate::overview::Knot;

    fn overview(origin: Option<Geodetic>) -> Overview {
        let mut overview = Overview {
            frame: origin.map(|origin| LocalFrame::new(origin).expect("a place")),
            ..Overview::default()
        };
        let receiver = overview.receiver("walk");
        for (east, north) in [(0.0, 0.0), (400.0, 300.0)] {
            let place = Vector3::new(east, north, 2.0);
            overview.receivers[receiver].path.push(Knot { time: 0.0, place });
        }
        overview
    }

    #[test]
    fn the_tiles_about_a_hunt_are_taken_once_each() {
        let origin = Geodetic::new(50.0755, 14.4378, 200.0).expect("a place");
        let overview = overview(Some(origin));
        let mut asked = Vec::new();
        let ground = Ground::about(&overview, [3, 19], Some("us".to_owned()), |zoom, x, y| {
            asked.push((zoom, x, y));
            Some(vec![1, 2, 3])
        });
        let ground = ground.expect("there are tiles");
        let [coarsest, finest] = ground.zooms;
        assert_eq!(finest - coarsest, COARSER);
        let fine = asked.iter().filter(|(zoom, ..)| *zoom == finest).count();
        assert!((10..=40).contains(&fine), "{fine} tiles");
        // The tile of the origin, by the formula of OpenStreetMap's wiki.
        let side = f64::from(finest).exp2();
        let lat = 50.0755_f64.to_radians();
        let x = (14.4378 + 180.0) / 360.0 * side;
        let y = (1.0 - lat.tan().asinh() / std::f64::consts::PI) / 2.0 * side;
        let key = format!("{finest}/{}/{}", x.floor(), y.floor());
        assert_eq!(ground.images.get(&key).map(String::as_str), Some("AQID"));
        asked.sort_unstable();
        let all = asked.len();
        asked.dedup();
        assert_eq!((all, ground.len()), (asked.len(), all));
    }

    #[test]
    fn a_page_takes_no_more_than_it_can_hold() {
        let origin = Geodetic::new(-33.0, 151.0, 0.0).expect("a place");
        let ground =
            Ground::about(&overview(Some(origin)), [0, 24], None, |_, _, _| Some(vec![0; 250_000]));
        assert_eq!(ground.expect("some").len(), MOST_BYTES / 250_000);
        assert_eq!(Ground::about(&overview(None), [0, 19], None, |_, _, _| Some(vec![0])), None);
        let nowhere = Ground::about(&overview(Some(origin)), [0, 19], None, |_, _, _| None);
        assert_eq!(nowhere, None);
    }

    #[test]
    fn web_mercator_is_undone() {
        let place = Geodetic::new(-47.25, 166.75, 0.0).expect("a place");
        let [lat, lon] = degrees(mercator(&place));
        assert_abs_diff_eq!(lat, -47.25, epsilon = 1e-12);
        assert_abs_diff_eq!(lon, 166.75, epsilon = 1e-12);
    }
}
