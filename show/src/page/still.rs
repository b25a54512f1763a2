//! Fixes and a picture for browsers without JavaScript.

use std::fmt::Write as _;

use foxhunt_core::Ellipse;
use foxhunt_wire::geodesy::LocalFrame;
use nalgebra::Vector2;

use super::ground::extent;
use crate::overview::{Believed, Overview, Received, SearchOverview};

/// Number of receptions in the picture, decimated beyond.
const MOST: usize = 500;

/// Width of the picture in its own units.
const WIDTH: f64 = 900.0;

/// Colours of fixes, one for each search, as in the page by day.
const SEARCHES: [&str; 4] = ["#d55e00", "#7b3294", "#00624a", "#8c510a"];

/// Returns the table of fixes and a picture of the end, as HTML.
pub(super) fn still(overview: &Overview) -> String {
    let rows: String =
        overview.searches.iter().map(|search| row(search, overview.frame.as_ref())).collect();
    let table = format!(
        "<table class=\"reflow\"><thead><tr><th scope=\"col\">beacon</th>\
         <th scope=\"col\">place</th><th scope=\"col\">95 % ellipse</th></tr></thead>\
         <tbody>{rows}</tbody></table>"
    );
    let notice = "<p>JavaScript is switched off here: this is the end of the hunt. With \
                  JavaScript the page plays it in time.</p>";
    let searched = overview.searched.as_ref().map_or_else(String::new, |searched| {
        format!(
            "<p>Nothing was received. If the transmitter is in the area, {} silences would have \
             found it with {:.0} % (POS).</p>",
            searched.silences,
            100.0 * searched.pos
        )
    });
    let title = escaped(&overview.title);
    let fixes = if rows.is_empty() { "" } else { &table };
    format!(
        "<div id=\"still\"><h2>{title}</h2>{notice}{searched}{fixes}{}</div>",
        picture(overview)
    )
}

/// Text without the characters that HTML takes for its own.
fn escaped(text: &str) -> String {
    let mut safe = String::with_capacity(text.len());
    for letter in text.chars() {
        match letter {
            '&' => safe.push_str("&amp;"),
            '<' => safe.push_str("&lt;"),
            '>' => safe.push_str("&gt;"),
            '"' => safe.push_str("&quot;"),
            '\'' => safe.push_str("&#39;"),
            // Marks of the page's own parts begin with a slash and a star.
            '*' => safe.push_str("&#42;"),
            _ => safe.push(letter),
        }
    }
    safe
}

fn row(search: &SearchOverview, frame: Option<&LocalFrame>) -> String {
    let name = escaped(&search.name);
    let Some(Believed { estimate, ellipse_95, .. }) = search.last() else {
        let outcome = escaped(search.outcome.as_deref().unwrap_or("not located"));
        return format!("<tr><td>{name}</td><td>{outcome}</td><td></td></tr>");
    };
    let local = directed(&estimate.mean);
    let place = frame.map_or_else(String::new, |frame| {
        let place = frame.to_geodetic(&estimate.mean.push(0.0));
        format!("{:.6}, {:.6}; ", place.lat_deg, place.lon_deg)
    });
    let ellipse = ellipse_95.map_or_else(String::new, |ellipse| {
        format!("{:.2} × {:.2} m", ellipse.semi_major, ellipse.semi_minor)
    });
    format!(
        "<tr><td>{name}</td><td data-name=\"place\">{place}{local}</td>\
         <td data-name=\"95 % ellipse\">{ellipse}</td></tr>"
    )
}

/// East and North in the words of a compass.
fn directed(place: &Vector2<f64>) -> String {
    let east = if place.x < 0.0 { 'W' } else { 'E' };
    let north = if place.y < 0.0 { 'S' } else { 'N' };
    format!("{:.1} m {east}, {:.1} m {north}", place.x.abs(), place.y.abs())
}

/// A drawing in which one metre is `scale` units.
struct Drawing {
    low: Vector2<f64>,
    high: Vector2<f64>,
    scale: f64,
    svg: String,
}

impl Drawing {
    fn at(&self, place: &Vector2<f64>) -> [f64; 2] {
        [(place.x - self.low.x) * self.scale, (self.high.y - place.y) * self.scale]
    }

    fn add(&mut self, text: std::fmt::Arguments<'_>) {
        // Writing to a string does not fail.
        let _ = self.svg.write_fmt(text);
    }

    fn line(&mut self, places: impl Iterator<Item = Vector2<f64>>, style: &str) {
        let point = |place: Vector2<f64>| {
            let [x, y] = self.at(&place);
            format!("{x:.1},{y:.1}")
        };
        let points: Vec<String> = places.map(point).collect();
        self.add(format_args!("<polyline points=\"{}\" fill=\"none\" {style}/>", points.join(" ")));
    }
}

/// Paths, receptions, bearings, and fixes with their ellipses.
fn picture(overview: &Overview) -> String {
    let Some((centre, half)) = extent(overview) else { return String::new() };
    let half = half * 1.15;
    let scale = WIDTH / (2.0 * half.x);
    let height = (2.0 * half.y * scale).clamp(0.2 * WIDTH, 2.0 * WIDTH);
    let half = Vector2::new(half.x, 0.5 * height / scale);
    let mut drawing =
        Drawing { low: centre - half, high: centre + half, scale, svg: String::new() };
    for receiver in &overview.receivers {
        let every = receiver.path.len().div_ceil(10 * MOST).max(1);
        let places = receiver.path.iter().step_by(every).map(|knot| knot.place.xy());
        drawing.line(places, "stroke=\"#0072b2\" stroke-width=\"2\"");
    }
    let every = overview.received.len().div_ceil(MOST).max(1);
    for received in overview.received.iter().step_by(every) {
        reception(&mut drawing, received, half.norm());
    }
    for (search, colour) in overview.searches.iter().zip(SEARCHES.iter().cycle()) {
        fix(&mut drawing, search, colour);
    }
    format!(
        "<svg viewBox=\"0 0 {WIDTH} {height:.0}\" role=\"img\" aria-label=\"Map of receivers, \
         bearings and fixes; North is up and {WIDTH} units are {:.0} m\">{}</svg>",
        2.0 * half.x,
        drawing.svg
    )
}

fn reception(drawing: &mut Drawing, received: &Received, length_m: f64) {
    let place = received.place.xy();
    if let Some(bearing) = received.bearing.filter(|_| !received.struck) {
        let (sin, cos) = libm::sincos(bearing.angle);
        let end = place + 2.0 * length_m * Vector2::new(cos, sin);
        let dash = if received.used { "" } else { " stroke-dasharray=\"6 5\"" };
        let style = format!("stroke=\"#009e73\" stroke-opacity=\"0.5\"{dash}");
        drawing.line([place, end].into_iter(), &style);
    }
    let [x, y] = drawing.at(&place);
    drawing.add(format_args!("<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"3\" fill=\"#0072b2\"/>"));
}

fn fix(drawing: &mut Drawing, search: &SearchOverview, colour: &str) {
    if let Some(knot) = search.truth.last() {
        let [x, y] = drawing.at(&knot.place.xy());
        drawing.add(format_args!(
            "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"7\" fill=\"none\" stroke=\"#000\" \
             stroke-width=\"3\"><title>truth</title></circle>"
        ));
    }
    let Some(last) = search.last() else { return };
    let [x, y] = drawing.at(&last.estimate.mean);
    if let Some(Ellipse { semi_major, semi_minor, orientation }) = last.ellipse_95 {
        let [a, b] = [semi_major, semi_minor].map(|axis| axis * drawing.scale);
        let turn = -orientation.to_degrees();
        drawing.add(format_args!(
            "<ellipse rx=\"{a:.1}\" ry=\"{b:.1}\" fill=\"{colour}\" fill-opacity=\"0.2\" \
             stroke=\"{colour}\" stroke-width=\"3\" \
             transform=\"translate({x:.1} {y:.1}) rotate({turn:.1})\"/>"
        ));
    }
    let name = escaped(&search.name);
    drawing.add(format_args!(
        "<path d=\"M{:.1} {y:.1}h18m-9 -9v18\" stroke=\"{colour}\" stroke-width=\"3\"/>\
         <text x=\"{:.1}\" y=\"{:.1}\" fill=\"{colour}\" font-size=\"24\">{name}</text>",
        x - 9.0,
        x + 12.0,
        y - 10.0,
    ));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_words_of_a_compass() {
        assert_eq!(directed(&Vector2::new(-11.84, -14.06)), "11.8 m W, 14.1 m S");
        assert_eq!(directed(&Vector2::new(0.0, 3.0)), "0.0 m E, 3.0 m N");
    }

    #[test]
    fn no_text_breaks_out_of_the_html() {
        let hostile = "</noscript><script>alert('1')</script>& \" /* data */";
        let search = SearchOverview { name: hostile.to_owned(), ..SearchOverview::default() };
        let html = still(&Overview {
            title: hostile.to_owned(),
            searches: vec![search],
            ..Overview::default()
        });
        assert!(!html.contains("<script") && !html.contains("</noscript"), "{html}");
        assert!(!html.contains("/* data */"), "{html}");
        assert!(html.contains("not located"));
    }
}
