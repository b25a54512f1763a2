//! A page that shows a hunt in any browser: one file, without a network.
//!
//! `page.html`, `page.css` and `page.js` are joined with the data, which stand in the page as JSON.
//! Plots over time are drawn by uPlot, which lies beside them with its licence.

mod data;
mod points;

use crate::overview::Overview;

const HTML: &str = include_str!("page.html");
const STYLE: &str = include_str!("page.css");
const SCRIPT: &str = include_str!("page.js");
const UPLOT: &str = include_str!("uplot/uPlot.iife.min.js");
const UPLOT_STYLE: &str = include_str!("uplot/uPlot.min.css");

/// The text of a page that shows a hunt or recordings.
///
/// Numbers are rounded to what can be seen: places to millimetres, times to hundredths of a second.
/// Names and reasons may hold any text.
///
/// # Errors
///
/// The error of the JSON writer, which has none for these data.
pub fn page(overview: &Overview) -> Result<String, serde_json::Error> {
    // "<" stands in strings alone; without it nothing in them can end the script.
    let data = serde_json::to_string(&data::Data::of(overview))?.replace('<', "\\u003c");
    let mut page = HTML.to_owned();
    for (mark, text) in [
        ("/* uplot.css */", UPLOT_STYLE),
        ("/* page.css */", STYLE),
        ("/* uplot.js */", UPLOT),
        ("/* page.js */", SCRIPT),
        // The last: what it holds is not looked at any more.
        ("/* data */", &data),
    ] {
        page = page.replacen(mark, text, 1);
    }
    Ok(page)
}

#[cfg(test)]
mod tests;
