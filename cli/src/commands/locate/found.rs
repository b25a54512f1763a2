//! Places that were found, and the measurements that do not fit them.

use foxhunt::{
    core::Estimate,
    geodesy::Geodetic,
    hunt::PlaceEstimate,
    locate::{Measurand, Residual},
    overview::SearchOverview,
    page::{NotStrikable, PageLog},
    recorded::RowResidual,
    struck::RowId,
};
use serde::Serialize;

use crate::{
    commands::locating::Residuals,
    table::{table, text},
};

/// An estimate on Earth and in the local frame.
#[derive(Debug, Serialize)]
pub struct Estimated {
    /// Latitude; absent if the recordings are in local metres.
    pub lat_deg: Option<f64>,
    pub lon_deg: Option<f64>,
    pub east_m: f64,
    pub north_m: f64,
    covariance_m2: [[f64; 2]; 2],
}

impl Estimated {
    pub fn new(estimate: &Estimate<2>, on_earth: Option<Geodetic>) -> Self {
        Self {
            lat_deg: on_earth.map(|place| place.lat_deg),
            lon_deg: on_earth.map(|place| place.lon_deg),
            east_m: estimate.mean.x,
            north_m: estimate.mean.y,
            covariance_m2: PlaceEstimate::from(estimate).covariance_m2,
        }
    }
}

/// Place or track of a beacon, for the page and for exports.
pub struct Found {
    pub beacon: Option<String>,
    /// Name of the estimator.
    pub method: String,
    pub search: SearchOverview,
    /// Data with which a page tracks it again, if it is tracked.
    pub tracks: Option<Result<PageLog, NotStrikable>>,
    /// Rows that belong to it, where not all of its beacon do.
    pub rows: Option<Vec<RowId>>,
}

/// Rows that belong to no transmitter: some of a beacon, or all of them without a list.
pub struct Others<'a> {
    pub beacon: Option<&'a str>,
    pub rows: Option<&'a [RowId]>,
}

/// Returns the value with the largest probability, and that probability.
pub fn likeliest(values: &[(f64, f64)]) -> (f64, f64) {
    let best = values.iter().max_by(|a, b| a.1.total_cmp(&b.1)).copied();
    best.unwrap_or((f64::NAN, f64::NAN))
}

/// Probability of a residual somewhere among all rows, below which its row is listed unasked.
const DOES_NOT_FIT_P: f64 = 0.01;

/// Number of rows that are listed unasked.
const LISTED: usize = 5;

/// Returns true if a row does not fit, by the probability of its residual, or was left out.
fn is_odd(p: Option<f64>, left_out: bool, total: usize) -> bool {
    let all = f64::from(u32::try_from(total).unwrap_or(u32::MAX));
    left_out || p.is_some_and(|p| p * all < DOES_NOT_FIT_P)
}

/// Lists the `listed` rows that fit worst, or else the few that do not fit or were left out.
pub fn rows_of(rows: &Residuals, listed: Option<usize>, whose: &str) -> String {
    let total = rows.len();
    let is_listed = |of: &Residual| listed.is_some() || is_odd(of.p, of.left_out, total);
    let mut worst: Vec<RowResidual> = rows.chosen(is_listed).collect();
    worst.sort_by(|a, b| a.worst_first(b));
    let odd = worst.len();
    worst.truncate(listed.unwrap_or(LISTED));
    if worst.is_empty() {
        return String::new();
    }
    let mut table = table(&["row", "receiver", "measured", "residual", "p", "left out"]);
    for row in &worst {
        let unit = if row.unit == "deg" { "°" } else { row.unit };
        table.add_row([
            format!("{}:{}", row.file, row.line),
            row.receiver.clone().unwrap_or_default(),
            kind(row.kind).to_owned(),
            format!("{:+.1} {unit}", row.residual),
            text(row.p.map(|p| format!("{p:.1e}"))),
            if row.left_out { "yes" } else { "no" }.to_owned(),
        ]);
    }
    let which = match listed {
        Some(_) => format!("The {} of {total} measurements{whose} that fit worst", worst.len()),
        None => {
            let shown = worst.len();
            let of = if odd > shown { format!(", the worst {shown}") } else { String::new() };
            format!("Measurements{whose} that do not fit or were left out: {odd} of {total}{of}")
        }
    };
    format!("\n\n{which} (see --rows; --json has all):\n{table}")
}

/// Returns the word for a quantity.
fn kind(measurand: Measurand) -> &'static str {
    match measurand {
        Measurand::Bearing => "bearing",
        Measurand::Range => "range",
        Measurand::RangeDifference => "range difference",
        Measurand::Level => "level",
        Measurand::Silence => "silence",
        Measurand::Saturation => "saturation",
    }
}
