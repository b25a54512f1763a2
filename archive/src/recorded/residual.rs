use std::cmp::Ordering;

use foxhunt_hunt::locate::{Measurand, Residual};
use serde::Serialize;

use crate::struck::RowId;

/// Residual of a row of a recording from a place, in the units of recordings.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RowResidual {
    /// Name of the recording.
    pub file: String,
    /// Line of the row, or of the first one of the turn, from 1.
    pub line: u64,
    /// Name of the receiver, where it is known.
    pub receiver: Option<String>,
    /// Quantity that was measured.
    pub kind: Measurand,
    /// Measured minus expected; of bearings clockwise, as a compass counts.
    pub residual: f64,
    /// Unit of the residual: `deg`, `m` or `dB`.
    pub unit: &'static str,
    /// Probability of a residual as large; absent where the other measurements cannot tell.
    pub p: Option<f64>,
    /// True if the measurement did not count.
    pub left_out: bool,
}

impl RowResidual {
    /// Returns the residual of the row with this key.
    #[must_use]
    pub fn new(row: &RowId, receiver: Option<&str>, of: &Residual) -> Self {
        let Residual { kind, residual, p, left_out, .. } = *of;
        let (residual, unit) = match kind {
            Measurand::Bearing => (-residual.to_degrees(), "deg"),
            Measurand::Range | Measurand::RangeDifference => (residual, "m"),
            Measurand::Level | Measurand::Silence | Measurand::Saturation => (residual, "dB"),
        };
        Self {
            file: row.file.clone(),
            line: row.line,
            receiver: receiver.map(str::to_owned),
            kind,
            residual,
            unit,
            p,
            left_out,
        }
    }

    /// Compares two residuals by how badly they fit, the worst first; untested ones are last.
    #[must_use]
    pub fn worst_first(&self, other: &Self) -> Ordering {
        let p = |of: &Self| of.p.unwrap_or(f64::INFINITY);
        let size = |of: &Self| of.residual.abs();
        p(self).total_cmp(&p(other)).then(size(other).total_cmp(&size(self)))
    }
}

/// Returns the words by which sentences call a row: file and line.
#[must_use]
pub fn row_name(row: &RowId) -> String {
    format!("{}, line {}", row.file, row.line)
}
