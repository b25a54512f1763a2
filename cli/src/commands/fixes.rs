//! The table of fixes that `hunt` and `replay` end with.

use foxhunt::{
    core::{Ellipse, Remark},
    hunt::PlaceEstimate,
    report::HuntedTransmitter,
};

use crate::table::{Table, number, table, text};

/// A row of the table.
#[derive(Debug)]
pub struct Row<'a> {
    pub beacon: &'a str,
    pub estimate: PlaceEstimate,
    pub ellipse_95: Option<Ellipse>,
    pub error_m: Option<f64>,
    pub nees: Option<f64>,
    pub steps: u32,
    pub outcome: String,
}

/// A table of fixes. Lengths are metres, directions degrees counter-clockwise from East.
pub fn fixes<'a>(rows: impl IntoIterator<Item = Row<'a>>) -> Table {
    let mut fixes = table(&[
        "beacon",
        "east m",
        "north m",
        "95 % ellipse m",
        "along °",
        "error m",
        "NEES",
        "steps",
        "outcome",
    ]);
    for row in rows {
        fixes.add_row([
            row.beacon.to_owned(),
            number(row.estimate.east_m, 2),
            number(row.estimate.north_m, 2),
            axes(row.ellipse_95),
            number(row.ellipse_95.map(|e| e.orientation.to_degrees()), 0),
            number(row.error_m, 2),
            number(row.nees, 2),
            row.steps.to_string(),
            row.outcome,
        ]);
    }
    fixes
}

/// A table of the transmitters on a beacon's frequency: existence, place and ellipse of each.
pub fn transmitters(beacon: &str, found: &[HuntedTransmitter]) -> Table {
    let mut rows = table(&["transmitter", "east m", "north m", "95 % ellipse m", "existence"]);
    for (transmitter, rank) in found.iter().zip(1_u32..) {
        rows.add_row([
            format!("{beacon} {rank}"),
            number(transmitter.estimate.east_m, 2),
            number(transmitter.estimate.north_m, 2),
            axes(transmitter.ellipse_95),
            number(transmitter.existence, 3),
        ]);
    }
    rows
}

/// The semi-axes of an ellipse.
fn axes(ellipse: Option<Ellipse>) -> String {
    text(ellipse.map(|e| format!("{:.2} × {:.2}", e.semi_major, e.semi_minor)))
}

/// Returns a list of the doubts about a place, each on a line of its own; empty without any.
pub fn doubts<'a>(remarks: impl IntoIterator<Item = &'a Remark>, whose: &str) -> String {
    let lines: String = remarks.into_iter().map(|remark| format!("\n- {remark}")).collect();
    if lines.is_empty() { lines } else { format!("\n\nThe place{whose} is in doubt:{lines}") }
}

/// Meaning of the columns of [`fixes`].
pub const LEGEND: &str = "East and north from the origin of the field; the ellipse's \
     semi-axes, and the direction of the longer one counter-clockwise from East; NEES is 2 on \
     average when the estimator is consistent.";
