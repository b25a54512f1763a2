use nalgebra::Vector3;

use super::{
    ExportError,
    feature::{along_deg_compass, compass_deg, lon_lat, utc},
};
use crate::overview::Overview;

/// The columns; empty where a row does not have them.
const COLUMNS: [&str; 20] = [
    "kind",
    "name",
    "time_s",
    "time_utc",
    "lat_deg",
    "lon_deg",
    "east_m",
    "north_m",
    "up_m",
    "rss_dbm",
    "rss_sigma_db",
    "bearing_deg_compass",
    "bearing_sigma_deg",
    "confidence",
    "used",
    "nis",
    "semi_major_95_m",
    "semi_minor_95_m",
    "along_deg_compass",
    "error_m",
];

/// A row, by the names of its columns.
struct Row(Vec<String>);

impl Row {
    fn new(
        overview: &Overview,
        kind: &str,
        name: &str,
        time: Option<f64>,
        place: &Vector3<f64>,
    ) -> Self {
        let mut row = Self(vec![String::new(); COLUMNS.len()]);
        row.text("kind", kind);
        row.text("name", name);
        row.number("time_s", time, 3);
        row.text("time_utc", &time.and_then(|time| utc(overview, time)).unwrap_or_default());
        let on_earth = overview.frame.map(|frame| lon_lat(&frame, &place.xy()));
        row.number("lat_deg", on_earth.map(|[_, lat]| lat), 8);
        row.number("lon_deg", on_earth.map(|[lon, _]| lon), 8);
        row.number("east_m", Some(place.x), 3);
        row.number("north_m", Some(place.y), 3);
        row
    }

    fn text(&mut self, column: &str, text: &str) {
        let index = COLUMNS.iter().position(|known| *known == column);
        if let Some(cell) = index.and_then(|index| self.0.get_mut(index)) {
            text.clone_into(cell);
        }
    }

    fn number(&mut self, column: &str, value: Option<f64>, decimals: usize) {
        let finite = value.filter(|value| value.is_finite());
        self.text(column, &finite.map_or_else(String::new, |value| format!("{value:.decimals$}")));
    }
}

pub(super) fn write(overview: &Overview) -> Result<Vec<u8>, ExportError> {
    let mut csv = csv::Writer::from_writer(Vec::new());
    csv.write_record(COLUMNS).map_err(ExportError::write)?;
    for received in &overview.received {
        let name = overview.receivers.get(received.receiver).map_or("", |r| r.name.as_str());
        let mut row = Row::new(overview, "reception", name, Some(received.time), &received.place);
        row.number("up_m", Some(received.place.z), 3);
        row.number("rss_dbm", received.level.map(|level| level.rss_dbm), 2);
        row.number("rss_sigma_db", received.level.map(|level| level.sigma_db), 2);
        let bearing = received.bearing.as_ref();
        let frame = overview.frame.as_ref();
        let angle = bearing.map(|b| compass_deg(frame, &received.place, b.angle));
        row.number("bearing_deg_compass", angle, 3);
        row.number("bearing_sigma_deg", bearing.map(|b| b.sigma.to_degrees()), 3);
        row.number("confidence", bearing.map(|b| b.confidence), 3);
        row.text("used", if received.used { "1" } else { "0" });
        row.number("nis", received.nis.map(|(nis, _)| nis), 4);
        csv.write_record(&row.0).map_err(ExportError::write)?;
    }
    for search in &overview.searches {
        let beliefs = search.beliefs.iter().map(|believed| ("estimate", believed));
        let smoothed = search.smoothed.iter().map(|believed| ("smoothed", believed));
        for (kind, believed) in beliefs.chain(smoothed) {
            let place = believed.estimate.mean.push(0.0);
            let mut row = Row::new(overview, kind, &search.name, Some(believed.time), &place);
            if let Some(ellipse) = &believed.ellipse_95 {
                row.number("semi_major_95_m", Some(ellipse.semi_major), 3);
                row.number("semi_minor_95_m", Some(ellipse.semi_minor), 3);
                row.number("along_deg_compass", Some(along_deg_compass(ellipse)), 2);
            }
            row.number("error_m", believed.error_m, 3);
            csv.write_record(&row.0).map_err(ExportError::write)?;
        }
        for rival in &search.rivals {
            let place = rival.place.push(0.0);
            let row = Row::new(overview, "rival", &search.name, None, &place);
            csv.write_record(&row.0).map_err(ExportError::write)?;
        }
        for knot in &search.truth {
            let time = (search.truth.len() > 1).then_some(knot.time);
            let row = Row::new(overview, "truth", &search.name, time, &knot.place);
            csv.write_record(&row.0).map_err(ExportError::write)?;
        }
    }
    csv.into_inner().map_err(|error| ExportError::write(error.into_error()))
}
