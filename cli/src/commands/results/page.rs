//! The contents of a store: seed by seed, as distributions, and as one HTML file without scripts.

use foxhunt::{
    campaign::{BeaconCampaign, EstimatorCampaign},
    picture::{Distribution, distributions_svg},
    store::{Filter, Held, SeedBySeed, Store, StoreError, Summary, compare},
};

use crate::{
    commands::storing::reading,
    error::CliError,
    table::{number, text},
};

/// The columns of a comparison.
pub const COMPARED: [&str; 10] = [
    "beacon",
    "figure",
    "pairs",
    "mean",
    "95 %",
    "p (t)",
    "p (ranks)",
    "ratio",
    "95 %",
    "p (t of ratio)",
];

/// A comparison in these columns.
pub fn compared_row(one: &SeedBySeed) -> [String; 10] {
    let interval = |at: Option<[f64; 2]>, decimals: usize| match at {
        Some([low, high]) => format!("{low:.decimals$} to {high:.decimals$}"),
        None => "-".to_owned(),
    };
    let difference = one.difference;
    let ratio = one.ratio;
    [
        one.beacon.clone(),
        one.figure.to_owned(),
        difference.map_or(0, |d| d.pairs).to_string(),
        number(difference.map(|d| d.mean), 3),
        interval(difference.map(|d| d.mean_interval), 3),
        probability(difference.and_then(|d| d.t_p_value)),
        probability(difference.and_then(|d| d.signed_rank_p_value)),
        number(ratio.map(|r| r.ratio), 3),
        interval(ratio.map(|r| r.ratio_interval), 3),
        probability(ratio.map(|r| r.p_value)),
    ]
}

/// Formats a probability; one that four digits do not show as `< 0.0001`.
fn probability(value: Option<f64>) -> String {
    match value {
        Some(value) if value < 1e-4 => "< 0.0001".to_owned(),
        value => number(value, 4),
    }
}

/// Returns the distributions of one campaign's runs for one beacon, and their title.
pub fn titled_distributions(
    store: &Store,
    filter: &Filter,
) -> Result<(String, Vec<Distribution>), CliError> {
    let summaries = store.summaries(filter).map_err(reading)?;
    let [summary] = &summaries[..] else {
        return Err(CliError::input(format!(
            "a picture shows one campaign, and {} fit; choose with --scenario and --planner",
            summaries.len()
        )));
    };
    let campaign = &summary.campaign;
    let wanted = |name: &&String| filter.beacon.as_ref().is_none_or(|beacon| beacon == *name);
    let names: Vec<&String> = campaign.beacons.iter().filter(wanted).collect();
    let [name] = names[..] else {
        return Err(CliError::input(format!(
            "a picture shows one beacon; choose one of {} with --beacon",
            campaign.beacons.join(", ")
        )));
    };
    let beacon = campaign.beacons.iter().position(|beacon| beacon == name).unwrap_or(0);
    let distributions = distributions(store, filter, summary, beacon)?;
    let title = format!("{}, {name}, planner {}", campaign.scenario, campaign.planner);
    Ok((title, distributions))
}

/// Returns the errors and the NEES of each contender's runs for the beacon of an index.
fn distributions(
    store: &Store,
    filter: &Filter,
    summary: &Summary,
    beacon: usize,
) -> Result<Vec<Distribution>, CliError> {
    let distribution = |(held, of): (&Held, &EstimatorCampaign)| {
        let [errors_m, nees] = store.samples(&held.contender, beacon, filter)?;
        Ok(Distribution { name: of.estimator.clone(), errors_m, nees })
    };
    let of = summary.held.iter().zip(&summary.report.estimators).map(distribution);
    of.collect::<Result<_, StoreError>>().map_err(reading)
}

/// Black on white, as wide as the window, and on paper without a figure torn in two.
const STYLE: &str = "\
:root { font: 16px/1.4 system-ui, sans-serif; color: #000; background: #fff; }
body { margin: 0 auto; max-width: 1180px; padding: 0 12px 24px; }
h1 { font-size: 1.5rem; overflow-wrap: anywhere; }
h2 { font-size: 1.25rem; margin-top: 2rem; } h3 { font-size: 1.05rem; }
.wide { overflow-x: auto; }
table { border-collapse: collapse; font-size: .9rem; font-variant-numeric: tabular-nums; }
th, td { text-align: right; padding: 3px 8px; border-bottom: 1px solid #ccc; white-space: nowrap; }
th:first-child, td:first-child { text-align: left; }
svg { width: 100%; min-width: 720px; height: auto; }
p { color: #333; max-width: 75ch; }
pre { white-space: pre-wrap; overflow-wrap: anywhere; font-size: .85rem; }
@media print { svg, table { break-inside: avoid; } details { display: none; } }";

/// Meaning of the columns.
const LEGEND: &str = "Errors in metres. A consistent estimator's ANEES lies in the interval with \
     95 %, and its ellipses of 95 % hold the truth in 95 % of the runs. To 3 m: the median number \
     of steps until the semi-major axis of the 95 % ellipse is below 3 m.";

const COLUMNS: [&str; 13] = [
    "estimator",
    "runs",
    "p10",
    "p50",
    "p90",
    "rms",
    "to 3 m",
    "path m",
    "ANEES",
    "interval",
    "verdict",
    "in 95 %",
    "failed",
];

/// The page of the campaigns that a filter lets through.
///
/// # Errors
///
/// An unreadable store, or a figure that cannot be drawn.
pub fn page(store: &Store, filter: &Filter, summaries: &[Summary]) -> Result<String, CliError> {
    let name = store.path().file_name().unwrap_or_default();
    let file = escaped(&name.to_string_lossy());
    let mut parts = vec![format!(
        "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <title>{file}</title>\n<style>\n{STYLE}\n</style>\n</head>\n<body>\n<h1>{file}</h1>"
    )];
    for summary in summaries {
        parts.push(campaign(store, filter, summary)?);
    }
    parts.push("</body>\n</html>\n".to_owned());
    Ok(parts.join("\n"))
}

/// Returns a campaign: its description, and for each beacon its table and its figure.
fn campaign(store: &Store, filter: &Filter, summary: &Summary) -> Result<String, CliError> {
    let campaign = &summary.campaign;
    let mut parts = vec![
        format!("<h2>{}, planner {}</h2>", escaped(&campaign.scenario), escaped(&campaign.planner)),
        format!(
            "<p>{}, campaign {}. {LEGEND}</p>",
            escaped(&campaign.program),
            campaign.digest.get(..8).unwrap_or_default()
        ),
    ];
    let shown = summary.report.estimators.first().map_or(&[][..], |first| &first.beacons);
    for (place, beacon) in shown.iter().enumerate() {
        parts.push(format!("<h3>{}</h3>", escaped(&beacon.name)));
        let of = summary.held.iter().zip(&summary.report.estimators);
        let rows = of.filter_map(|(held, of)| Some(row(held.runs, of, of.beacons.get(place)?)));
        parts.push(table(&COLUMNS, rows));
        let index = campaign.beacons.iter().position(|name| *name == beacon.name);
        let all = distributions(store, filter, summary, index.unwrap_or(place))?;
        let figure = distributions_svg("", &all).map_err(CliError::failure)?;
        parts.push(format!("<div class=\"wide\">{figure}</div>"));
    }
    let compared = against_the_first(store, filter, summary)?;
    if let Some(one) = compared.first() {
        parts.push(format!("<h3>Seed by seed, {} minus each other</h3>", escaped(&one.first)));
        let rows = compared.iter().map(|one| {
            let other = [one.second.clone()].into_iter();
            other.chain(compared_row(one)).collect()
        });
        let columns: Vec<&str> = ["other"].into_iter().chain(COMPARED).collect();
        parts.push(table(&columns, rows));
    }
    let definition = escaped(&campaign.definition);
    parts.push(format!(
        "<details><summary>What was flown</summary>\n<pre>{definition}</pre></details>"
    ));
    Ok(parts.join("\n"))
}

fn row(runs: u32, of: &EstimatorCampaign, beacon: &BeaconCampaign) -> Vec<String> {
    let error = |pick: fn(&foxhunt::Spread) -> f64| number(beacon.error_m.as_ref().map(pick), 2);
    let interval = beacon.anees_interval.map(|[low, high]| format!("{low:.2} to {high:.2}"));
    let share = |share: f64| format!("{:.1} %", 100.0 * share);
    vec![
        of.estimator.clone(),
        runs.to_string(),
        error(|e| e.p10),
        error(|e| e.p50),
        error(|e| e.p90),
        error(|e| e.rms),
        number(beacon.steps_to_3m.and_then(|steps| steps.p50), 1),
        number(beacon.path_m.map(|path| path.p50), 0),
        number(beacon.anees, 2),
        text(interval),
        beacon.verdict.to_string(),
        text(beacon.coverage_95.map(share)),
        beacon.failed.to_string(),
    ]
}

/// The first contender compared with each other one.
fn against_the_first(
    store: &Store,
    filter: &Filter,
    summary: &Summary,
) -> Result<Vec<SeedBySeed>, CliError> {
    let Some((first, others)) = summary.held.split_first() else { return Ok(Vec::new()) };
    let first = first.contender.full_name();
    let mut compared = Vec::new();
    for other in others {
        let other = other.contender.full_name();
        compared.extend(compare(store, filter, &first, &other).map_err(reading)?);
    }
    Ok(compared)
}

fn table(columns: &[&str], rows: impl Iterator<Item = Vec<String>>) -> String {
    let line = |tag: &str, cells: &mut dyn Iterator<Item = &str>| {
        let cells = cells.map(|cell| format!("<{tag}>{}</{tag}>", escaped(cell)));
        format!("<tr>{}</tr>", cells.collect::<String>())
    };
    let head = line("th", &mut columns.iter().copied());
    let body: Vec<String> =
        rows.map(|row| line("td", &mut row.iter().map(String::as_str))).collect();
    format!("<div class=\"wide\"><table>\n{head}\n{}\n</table></div>", body.join("\n"))
}

/// Escapes a text for HTML.
fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texts_cannot_end_their_element() {
        let rows = [vec!["<b>&\"".to_owned(), "1".to_owned()]];
        let table = table(&["a", "b"], rows.into_iter());
        assert!(table.contains("<td>&lt;b&gt;&amp;&quot;</td><td>1</td>"), "{table}");
        assert_eq!(table.matches("<th>").count(), 2);
    }
}
