use super::{bound::Bound, geodesy::Origin, recording::DrawnFile};

/// East, North and Up in metres.
pub(super) type At = [f64; 3];

/// A row of a recording: who received what, where and when.
#[derive(Clone, Debug, Default)]
pub(super) struct Row {
    /// Number of the transmitter, where the recording names them.
    pub(super) beacon: Option<u32>,
    /// Number of the receiver, where there are several.
    pub(super) receiver: Option<u32>,
    pub(super) time_s: f64,
    /// Recorded place of the receiver.
    pub(super) at: At,
    /// True place of the transmitter.
    pub(super) truth: Option<[f64; 2]>,
    /// Further columns by name.
    pub(super) values: Vec<(&'static str, f64)>,
}

impl Row {
    /// Creates a row without values.
    pub(super) fn new(time_s: f64, at: At, truth: At) -> Self {
        Self { time_s, at, truth: Some([truth[0], truth[1]]), ..Self::default() }
    }

    /// Sets the value of a column.
    pub(super) fn with(mut self, column: &'static str, value: f64) -> Self {
        self.set(column, value);
        self
    }

    /// Sets the value of a column.
    pub(super) fn set(&mut self, column: &'static str, value: f64) {
        match self.values.iter_mut().find(|(name, _)| *name == column) {
            Some(known) => known.1 = value,
            None => self.values.push((column, value)),
        }
    }

    /// Returns the value of a column.
    pub(super) fn get(&self, column: &str) -> Option<f64> {
        self.values.iter().find(|(name, _)| *name == column).map(|(_, value)| *value)
    }

    /// Replaces the value of a column, where there is one.
    pub(super) fn change(&mut self, column: &'static str, change: impl FnOnce(f64) -> f64) {
        if let Some(value) = self.get(column) {
            self.set(column, change(value));
        }
    }
}

/// Separators of cells and decimals.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Spelling {
    /// Commas between cells, decimal points.
    #[default]
    Point,
    /// Semicolons between cells, decimal commas.
    Comma,
}

/// All of a drawn recording before it becomes text.
#[derive(Clone, Debug, Default)]
pub(super) struct Scene {
    pub(super) rows: Vec<Row>,
    /// Places are written in degrees from here, and in metres without.
    pub(super) origin: Option<Origin>,
    pub(super) spelling: Spelling,
    /// Lines above the header.
    pub(super) preamble: Vec<String>,
    /// Columns that the file calls by another name.
    pub(super) renamed: Vec<(&'static str, &'static str)>,
    /// Files beside it.
    pub(super) beside: Vec<DrawnFile>,
    pub(super) flags: Vec<String>,
    pub(super) bound: Option<Bound>,
    /// Nothing was transmitted: any place is wrong.
    pub(super) is_empty: bool,
    /// Names of columns of truth are left out of the file.
    pub(super) hides_truth: bool,
}

impl Scene {
    /// Creates a scene of rows in metres.
    pub(super) fn of(rows: Vec<Row>) -> Self {
        Self { rows, ..Self::default() }
    }

    /// Adds a flag with its value.
    pub(super) fn with_flag(mut self, flag: &str, value: impl ToString) -> Self {
        self.flags.push(format!("{flag}={}", value.to_string()));
        self
    }

    /// Writes places in degrees.
    pub(super) fn in_degrees(mut self, lat_deg: f64, lon_deg: f64) -> Self {
        self.origin = Some(Origin { lat_deg, lon_deg });
        self
    }

    /// Writes the rows as a table with a header.
    pub(super) fn text(&self) -> String {
        let has_beacons = self.rows.iter().any(|row| row.beacon.is_some());
        let has_receivers = self.rows.iter().any(|row| row.receiver.is_some());
        let mut columns: Vec<&'static str> = Vec::new();
        for (name, _) in self.rows.iter().flat_map(|row| &row.values) {
            if !columns.contains(name) {
                columns.push(name);
            }
        }
        let mut header: Vec<&str> = Vec::new();
        header.extend(has_beacons.then_some("beacon"));
        header.extend(has_receivers.then_some("drone"));
        header.push("time_s");
        header.extend(match self.origin {
            Some(_) => ["lat_deg", "lon_deg", "alt_agl_m"],
            None => ["east_m", "north_m", "up_m"],
        });
        header.extend(&columns);
        let has_truth = !self.hides_truth && self.rows.iter().any(|row| row.truth.is_some());
        header.extend(match (has_truth, self.origin) {
            (false, _) => &[][..],
            (true, Some(_)) => &["truth_lat_deg", "truth_lon_deg"],
            (true, None) => &["truth_east_m", "truth_north_m"],
        });
        for name in &mut header {
            if let Some((_, other)) = self.renamed.iter().find(|(own, _)| own == name) {
                *name = other;
            }
        }
        let separator = match self.spelling {
            Spelling::Point => ",",
            Spelling::Comma => ";",
        };
        let mut lines = self.preamble.clone();
        lines.push(header.join(separator));
        for row in &self.rows {
            let mut cells = Vec::with_capacity(header.len());
            cells.extend(row.beacon.filter(|_| has_beacons).map(|number| format!("fox{number}")));
            if has_receivers {
                cells.push(format!("rx{}", row.receiver.unwrap_or(0)));
            }
            cells.push(number(row.time_s, 3));
            cells.extend(self.place([row.at[0], row.at[1]]));
            cells.push(number(row.at[2], 2));
            let cell = |name: &&str| row.get(name).map_or_else(String::new, |v| number(v, 3));
            cells.extend(columns.iter().map(cell));
            if has_truth {
                let missing = [String::new(), String::new()];
                cells.extend(row.truth.map_or(missing, |truth| self.place(truth)));
            }
            if self.spelling == Spelling::Comma {
                cells.iter_mut().for_each(|cell| *cell = cell.replace('.', ","));
            }
            lines.push(cells.join(separator));
        }
        lines.push(String::new());
        lines.join("\n")
    }

    fn place(&self, at: [f64; 2]) -> [String; 2] {
        match self.origin {
            Some(origin) => origin.degrees(at).map(|degrees| number(degrees, 7)),
            None => at.map(|metres| number(metres, 2)),
        }
    }
}

/// Writes a number with at most `decimals` decimals.
fn number(value: f64, decimals: usize) -> String {
    let text = format!("{value:.decimals$}");
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}
