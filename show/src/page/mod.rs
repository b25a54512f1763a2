//! A page that shows a hunt in any browser: one file, without a network.
//!
//! `page.html`, `page.css` and the scripts are joined with the data, which stand in the page as
//! JSON. Plots over time are drawn by uPlot, which lies beside them with its licence. Where
//! bearings can be struck out, the page brings the estimators along: `foxhunt-replayer`, compiled
//! to WebAssembly, and the lines of the log, or the receptions of recordings, that it needs.

mod data;
mod ground;
mod points;
mod still;
mod strikable;

pub use data::{Live, LiveTiles, Mark};
pub use ground::Ground;
#[cfg(feature = "sqlite")]
pub(crate) use ground::{degrees, mercator};
pub use strikable::{NotStrikable, PageLog, page_line};

use foxhunt_hunt::document;

use crate::overview::{Overview, SearchOverview};
use foxhunt_archive::replay::Replay;

const HTML: &str = include_str!("page.html");
const STYLE: &str = include_str!("page.css");
const SCRIPT: &str = include_str!("page.js");
const PLACE: &str = include_str!("place.js");
const HEAT: &str = include_str!("heat.js");
const TOOLS: &str = include_str!("tools.js");
const STRIKE: &str = include_str!("strike.js");
const TILES: &str = include_str!("tiles.js");
const LIVE: &str = include_str!("live.js");
const UPLOT: &str = include_str!("uplot/uPlot.iife.min.js");
const UPLOT_STYLE: &str = include_str!("uplot/uPlot.min.css");

/// The replayer as WebAssembly, compressed by gzip, in base64; `.ci/replayer` makes it.
const REPLAYER: &str = include_str!("replayer.wasm.gz.base64");

/// The text of a page that shows a hunt or recordings.
///
/// Numbers are rounded to what can be seen: places to millimetres, times to hundredths of a second.
/// Names and reasons may hold any text. With the log bearings can be struck out, and the estimates
/// follow.
///
/// # Errors
///
/// The error of the JSON writer, which has none for these data.
pub fn page(
    overview: &Overview,
    log: Option<&Result<PageLog, NotStrikable>>,
) -> Result<String, serde_json::Error> {
    join(overview, log, None, None)
}

/// The text of a page as [`page`] has it, on a map that it brings along.
///
/// # Errors
///
/// The error of the JSON writer, which has none for these data.
pub fn page_on(
    overview: &Overview,
    log: Option<&Result<PageLog, NotStrikable>>,
    ground: &Ground,
) -> Result<String, serde_json::Error> {
    join(overview, log, None, Some(ground))
}

/// The text of the page of a hunt that goes on; [`news`] are what it shows besides, which it gets
/// as server-sent events from where it comes from.
///
/// # Errors
///
/// The error of the JSON writer, which has none for these data.
pub fn live_page(
    overview: &Overview,
    log: &Result<PageLog, NotStrikable>,
    live: Live,
) -> Result<String, serde_json::Error> {
    join(overview, Some(log), Some(live), None)
}

/// Returns the additions to an overview since a mark as JSON, and moves the mark to its end; `None`
/// where nothing is new.
///
/// # Errors
///
/// The error of the JSON writer, which has none for these data.
pub fn news(overview: &Overview, mark: &mut Mark) -> Result<Option<String>, serde_json::Error> {
    let news = data::News::since(overview, mark);
    if news.is_empty() { Ok(None) } else { document::to_json(&news).map(Some) }
}

/// Returns the estimates that a page shows instead of its own when receptions were struck out, as
/// JSON.
///
/// # Errors
///
/// The error of the JSON writer, which has none for these data.
pub fn restruck(overview: &Overview, replay: &Replay) -> Result<String, serde_json::Error> {
    document::to_json(&data::Restruck::of(overview, replay))
}

/// Returns the counterpart of [`restruck`] for a page of recordings, which locates again.
///
/// # Errors
///
/// The error of the JSON writer, which has none for these data.
pub fn relocated(searches: &[SearchOverview]) -> Result<String, serde_json::Error> {
    document::to_json(&data::Restruck::located(searches))
}

fn join(
    overview: &Overview,
    log: Option<&Result<PageLog, NotStrikable>>,
    live: Option<Live>,
    ground: Option<&Ground>,
) -> Result<String, serde_json::Error> {
    let not_strikable = log.and_then(|log| log.as_ref().err()).map(ToString::to_string);
    // "<" stands in strings alone; without it nothing in them can end the script.
    let safe = |text: String| text.replace('<', "\\u003c");
    let is_live = live.is_some();
    let has_tiles = ground.is_some() || live.as_ref().is_some_and(|live| live.tiles.is_some());
    let tiles = ground.map(|ground| document::to_json(ground)).transpose()?.unwrap_or_default();
    let data = document::to_json(&data::Data::of(overview, live, not_strikable))?;
    let log = log.and_then(|log| log.as_ref().ok());
    let lines = log.map_or_else(Vec::new, |log| log.lines().collect());
    let mut page = HTML.to_owned();
    for (mark, text) in [
        ("/* connect-src */", if is_live { "connect-src 'self'" } else { "" }),
        ("/* uplot.css */", UPLOT_STYLE),
        ("/* page.css */", STYLE),
        ("/* uplot.js */", UPLOT),
        ("/* page.js */", SCRIPT),
        ("/* place.js */", PLACE),
        ("/* heat.js */", HEAT),
        ("/* tools.js */", TOOLS),
        ("/* strike.js */", STRIKE),
        ("/* tiles.js */", if has_tiles { TILES } else { "" }),
        ("/* live.js */", if is_live { LIVE } else { "" }),
        ("/* replayer */", if log.is_some() { REPLAYER.trim_end() } else { "" }),
        // From the end of the page to its begin: a mark in one of these texts is behind the own
        // mark of the next, and stays.
        ("/* log */", &safe(lines.join("\n"))),
        ("/* tiles */", &safe(tiles)),
        ("/* data */", &safe(data)),
        ("/* still */", &still::still(overview)),
    ] {
        page = page.replacen(mark, text, 1);
    }
    Ok(page)
}

#[cfg(test)]
mod tests;
