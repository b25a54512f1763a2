use foxhunt_wire::geodesy::LocalFrame;

use super::{
    ExportError,
    feature::{Feature, Kind, LonLat, Shape, features, utc},
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
