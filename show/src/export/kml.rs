//! Features as KML 2.2, and beliefs as an overlay of it on the ground, with their picture in one
//! file.

use std::io;

use flate2::Crc;
use foxhunt_wire::geodesy::{Geodetic, LocalFrame};
use nalgebra::Vector2;

use super::{
    ExportError,
    feature::{Feature, Kind, LonLat, Shape, features, utc},
    paint::{Paint, size},
    xml::Xml,
};
use crate::overview::Overview;

/// Line colour (aabbggrr), width and area colour of each kind.
const STYLES: [(Kind, &str, &str, &str); 9] = [
    (Kind::Fix, "ff005ed5", "3", "40005ed5"),
    (Kind::Rival, "ff005ed5", "2", "40005ed5"),
    (Kind::Ellipse, "ff005ed5", "3", "40005ed5"),
    (Kind::Region, "ff005ed5", "2", "60005ed5"),
    (Kind::Track, "ff005ed5", "2", "40005ed5"),
    (Kind::Smoothed, "ffa779cc", "3", "40a779cc"),
    (Kind::Truth, "ff000000", "3", "40000000"),
    (Kind::Path, "ffb27200", "3", "40b27200"),
    (Kind::Bearing, "ff739e00", "1.5", "40739e00"),
];

pub(super) fn write(overview: &Overview, frame: &LocalFrame) -> Result<Vec<u8>, ExportError> {
    let features = features(overview, frame);
    let mut xml = Xml::document()?;
    xml.element("kml", &[("xmlns", "http://www.opengis.net/kml/2.2")], |xml| {
        xml.element("Document", &[], |xml| {
            xml.text("name", &overview.title)?;
            for (kind, line, width, area) in STYLES {
                style(xml, kind, line, width, area)?;
            }
            for (kind, ..) in STYLES {
                let of_kind: Vec<_> = features.iter().filter(|one| one.kind == kind).collect();
                if of_kind.is_empty() {
                    continue;
                }
                xml.element("Folder", &[], |xml| {
                    xml.text("name", kind.name())?;
                    of_kind.iter().try_for_each(|feature| placemark(xml, overview, feature))
                })?;
            }
            Ok(())
        })
    })?;
    Ok(xml.into_bytes())
}

fn style(
    xml: &mut Xml,
    kind: Kind,
    line: &str,
    width: &str,
    area: &str,
) -> Result<(), ExportError> {
    xml.element("Style", &[("id", kind.name())], |xml| {
        xml.element("LineStyle", &[], |xml| {
            xml.text("color", line)?;
            xml.text("width", width)
        })?;
        xml.element("PolyStyle", &[], |xml| xml.text("color", area))
    })
}

fn placemark(xml: &mut Xml, overview: &Overview, feature: &Feature) -> Result<(), ExportError> {
    xml.element("Placemark", &[], |xml| {
        xml.text("name", &feature.name)?;
        if let Some(utc) = feature.time.and_then(|time| utc(overview, time)) {
            xml.element("TimeStamp", &[], |xml| xml.text("when", &utc))?;
        }
        xml.text("styleUrl", &format!("#{}", feature.kind.name()))?;
        if !feature.numbers.is_empty() {
            xml.element("ExtendedData", &[], |xml| {
                feature.numbers.iter().try_for_each(|(name, value)| {
                    xml.element("Data", &[("name", name)], |xml| {
                        xml.text("value", &format!("{value:.6}"))
                    })
                })
            })?;
        }
        match &feature.shape {
            Shape::Point(place) => {
                xml.element("Point", &[], |xml| xml.text("coordinates", &tuples([place])))
            }
            Shape::Line(line) => xml.element("LineString", &[], |xml| {
                xml.text("tessellate", "1")?;
                xml.text("coordinates", &tuples(line.iter().map(|(place, _)| place)))
            }),
            Shape::Area(rings) => xml.element("Polygon", &[], |xml| {
                xml.text("tessellate", "1")?;
                rings.iter().enumerate().try_for_each(|(index, ring)| {
                    let name = if index == 0 { "outerBoundaryIs" } else { "innerBoundaryIs" };
                    xml.element(name, &[], |xml| {
                        xml.element("LinearRing", &[], |xml| xml.text("coordinates", &tuples(ring)))
                    })
                })
            }),
        }
    })
}

fn tuples<'a>(places: impl IntoIterator<Item = &'a LonLat>) -> String {
    let tuples = places.into_iter().map(|[lon, lat]| format!("{lon},{lat}"));
    tuples.collect::<Vec<_>>().join(" ")
}

/// Name of the picture in the file.
const PICTURE: &str = "belief.png";

pub(super) fn write_overlay(
    overview: &Overview,
    frame: &LocalFrame,
) -> Result<Vec<u8>, ExportError> {
    let paint = Paint::of(overview).ok_or(ExportError::NoBelief)?;
    let (low, high) = paint.corners();
    let origin = frame.origin();
    let (south, west, north, east) = bounds(frame, low, high);
    let (width, height) = size(&(high - low));
    let picture = paint.picture(width, height, |x, y| {
        let lat_deg = north + (south - north) * y / f64::from(height);
        let lon_deg = west + (east - west) * x / f64::from(width);
        frame.to_local(&Geodetic { lat_deg, lon_deg, alt_m: origin.alt_m }).xy()
    });
    let picture = picture.png().map_err(ExportError::write)?;
    let mut xml = Xml::document()?;
    xml.element("kml", &[("xmlns", "http://www.opengis.net/kml/2.2")], |xml| {
        xml.element("GroundOverlay", &[], |xml| {
            xml.text("name", &overview.title)?;
            xml.text("description", "Regions that hold the transmitter with 50, 80 and 95 %")?;
            xml.element("Icon", &[], |xml| xml.text("href", PICTURE))?;
            xml.element("LatLonBox", &[], |xml| {
                for (name, degrees) in
                    [("north", north), ("south", south), ("east", east), ("west", west)]
                {
                    xml.text(name, &format!("{degrees:.9}"))?;
                }
                Ok(())
            })
        })
    })?;
    zip(&[("doc.kml", &xml.into_bytes()), (PICTURE, &picture)]).map_err(ExportError::write)
}

/// Returns the least box of degrees, South, West, North and East, about an area of the frame.
pub(super) fn bounds(
    frame: &LocalFrame,
    low: Vector2<f64>,
    high: Vector2<f64>,
) -> (f64, f64, f64, f64) {
    let middle = 0.5 * (low + high);
    let sides = [low, middle, high];
    let mut bounds = (f64::INFINITY, f64::INFINITY, f64::NEG_INFINITY, f64::NEG_INFINITY);
    for (east, north) in sides.iter().flat_map(|a| sides.iter().map(|b| (a.x, b.y))) {
        let place = frame.to_geodetic(&Vector2::new(east, north).push(0.0));
        bounds.0 = bounds.0.min(place.lat_deg);
        bounds.1 = bounds.1.min(place.lon_deg);
        bounds.2 = bounds.2.max(place.lat_deg);
        bounds.3 = bounds.3.max(place.lon_deg);
    }
    bounds
}

/// Puts files into one (ZIP of APPNOTE 6.3.4, stored as they are).
fn zip(files: &[(&str, &[u8])]) -> io::Result<Vec<u8>> {
    let number = |length: usize| u32::try_from(length).map_err(io::Error::other);
    let mut whole = Vec::new();
    let mut directory = Vec::new();
    for (name, bytes) in files {
        let mut sum = Crc::new();
        sum.update(bytes);
        let length = number(bytes.len())?.to_le_bytes();
        let name_length = u16::try_from(name.len()).map_err(io::Error::other)?.to_le_bytes();
        // Version 2.0, no flags, stored, the first day of MS-DOS, and no extra field.
        let mut about = vec![20, 0, 0, 0, 0, 0, 0, 0, 0x21, 0];
        about.extend(sum.sum().to_le_bytes());
        about.extend(length);
        about.extend(length);
        about.extend(name_length);
        about.extend([0, 0]);
        directory.extend(b"PK\x01\x02\x14\x00");
        directory.extend(&about);
        // No comment, the first disk, no attributes.
        directory.extend([0; 10]);
        directory.extend(number(whole.len())?.to_le_bytes());
        directory.extend(name.as_bytes());
        whole.extend(b"PK\x03\x04");
        whole.extend(&about);
        whole.extend(name.as_bytes());
        whole.extend(*bytes);
    }
    let begin = number(whole.len())?.to_le_bytes();
    let count = u16::try_from(files.len()).map_err(io::Error::other)?.to_le_bytes();
    let length = number(directory.len())?.to_le_bytes();
    whole.extend(directory);
    whole.extend(b"PK\x05\x06\0\0\0\0");
    whole.extend([count, count].concat());
    whole.extend([length, begin].concat());
    whole.extend([0, 0]);
    Ok(whole)
}
