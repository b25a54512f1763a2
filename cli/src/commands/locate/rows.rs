use foxhunt::{
    locate::{Measurand, Residual},
    recorded::RowResidual,
};

use super::super::locating::Residuals;
use crate::table::{table, text};

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
pub(super) fn rows_of(rows: &Residuals, listed: Option<usize>, whose: &str) -> String {
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
