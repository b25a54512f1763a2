use foxhunt::store::SeedBySeed;

use crate::table::number;

/// The columns of a comparison.
pub(super) const COMPARED: [&str; 10] = [
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
pub(super) fn compared_row(one: &SeedBySeed) -> [String; 10] {
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
