//! Sources of a column's values in a mapping: fixed values, columns, directions of North.

use std::{collections::BTreeMap, fmt, str::FromStr};

use serde::{
    Deserialize, Deserializer,
    de::{Error, MapAccess, SeqAccess, Visitor, value::MapAccessDeserializer},
};

/// A value that a mapping or a user gives: a number or a text.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(untagged, expecting = "a number or a text")]
pub enum Value {
    /// A number.
    Number(f64),
    /// A text.
    Text(String),
}

impl Value {
    /// Returns true if a cell holds this value: the same text, or a number equal to it.
    pub(super) fn is(&self, cell: &str) -> bool {
        match self {
            Self::Text(text) => text == cell,
            Self::Number(number) => {
                cell.parse::<f64>().is_ok_and(|c| c.partial_cmp(number).is_some_and(|o| o.is_eq()))
            }
        }
    }
}

impl fmt::Display for Value {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Number(number) => write!(f, "{number}"),
            Self::Text(text) => f.write_str(text),
        }
    }
}

impl From<f64> for Value {
    fn from(number: f64) -> Self {
        Self::Number(number)
    }
}

impl From<&str> for Value {
    fn from(text: &str) -> Self {
        Self::Text(text.to_owned())
    }
}

/// North from which a recording's angles are counted: bearings, headings and boresights.
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize)]
#[serde(try_from = "Value")]
#[non_exhaustive]
pub enum North {
    /// True North, that of the meridian; North of the frame for places in metres.
    #[default]
    True,
    /// North of a compass, by the World Magnetic Model of place and day
    /// ([`foxhunt_wire::declination`]).
    Magnetic,
    /// North of the UTM grid, as on maps; North of the frame for places in metres.
    Grid,
    /// This many degrees east of true North: a declination that is known otherwise.
    Stated(f64),
}

impl TryFrom<Value> for North {
    type Error = String;

    fn try_from(value: Value) -> Result<Self, String> {
        match value {
            Value::Number(deg) if deg.abs() <= 180.0 => Ok(Self::Stated(deg)),
            Value::Text(text) if text == "true" => Ok(Self::True),
            Value::Text(text) if text == "magnetic" => Ok(Self::Magnetic),
            Value::Text(text) if text == "grid" => Ok(Self::Grid),
            value => Err(format!(
                "{value} is no North: true, magnetic, grid, or degrees east of true North from \
                 -180 to 180"
            )),
        }
    }
}

impl FromStr for North {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        text.parse().map_or_else(|_| Value::from(text), Value::Number).try_into()
    }
}

/// Source of one of our columns in a file: a column's name, or a table that says how its cells are
/// converted.
///
/// The cell is read as follows: empty or one of `missing` is no value; `lookup` replaces it;
/// a number is then multiplied by `scale`, raised by `offset` and, where it `wrap`s, brought to
/// within a circle. Of several columns the cells are joined to one; if one is empty, all are.
#[derive(Clone, Debug, PartialEq)]
pub struct Source {
    /// The file's columns: one, or several that together are a name or a time.
    pub columns: Vec<String>,
    /// Text between the cells of several columns; a space unless given.
    pub between: String,
    /// Factor of its numbers; 1 unless given.
    pub scale: f64,
    /// Number that is then added; 0 unless given.
    pub offset: f64,
    /// Meaning of each cell; a cell that is not listed is an error. Empty: cells are as they are.
    pub lookup: BTreeMap<String, Value>,
    /// Index of the number to read, in cells that hold two, as a latitude and a longitude.
    pub part: Option<usize>,
    /// Cells that mean "no value", besides empty ones.
    pub missing: Vec<Value>,
    /// True if an angle in degrees may be of any number of circles; otherwise it is refused beyond
    /// one.
    pub wrap: bool,
    /// True if files without this column are of the format too.
    pub optional: bool,
}

impl Source {
    /// A column taken as it is.
    #[must_use]
    pub fn column(name: &str) -> Self {
        Self {
            columns: vec![name.to_owned()],
            between: " ".to_owned(),
            scale: 1.0,
            offset: 0.0,
            lookup: BTreeMap::new(),
            part: None,
            missing: Vec::new(),
            wrap: false,
            optional: false,
        }
    }

    /// The columns that a number is the sum of, each with the sign that it has in the sum. Columns
    /// are named as `a`, `+a` or `-a`, or all in one text as `a + b - c`, but not if `has` finds a
    /// column of that very name.
    pub(super) fn terms(&self, has: impl Fn(&str) -> bool) -> Vec<(String, f64)> {
        let signed = |name: &str| {
            let name = name.trim();
            match (has(name), name.strip_prefix('-'), name.strip_prefix('+')) {
                (false, Some(rest), _) => (rest.trim().to_owned(), -1.0),
                (false, None, Some(rest)) => (rest.trim().to_owned(), 1.0),
                _ => (name.to_owned(), 1.0),
            }
        };
        let mut terms = Vec::new();
        for name in &self.columns {
            if has(name) {
                terms.push((name.clone(), 1.0));
                continue;
            }
            // A sign between spaces begins a term.
            let spelled = name.replace(" + ", "\n+").replace(" - ", "\n-");
            terms.extend(spelled.split('\n').map(signed));
        }
        terms
    }

    /// Returns the name of the source in messages: the names of its columns.
    pub(super) fn label(&self) -> String {
        self.columns.join(" and ")
    }
}

/// The table's form in TOML.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Table {
    column: Option<String>,
    columns: Option<Vec<String>>,
    between: Option<String>,
    #[serde(default = "one")]
    scale: f64,
    #[serde(default)]
    offset: f64,
    #[serde(default)]
    lookup: BTreeMap<String, Value>,
    part: Option<usize>,
    #[serde(default)]
    missing: Vec<Value>,
    #[serde(default)]
    wrap: bool,
    #[serde(default)]
    optional: bool,
}

const ONE_OR_SEVERAL: &str =
    "it needs either `column`, or `columns` with two or more names and, if need be, `between`";

fn one() -> f64 {
    1.0
}

// By hand and not as an untagged enum, whose errors would not name the field that is wrong.
impl<'de> Deserialize<'de> for Source {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct NameOrTable;
        impl<'de> Visitor<'de> for NameOrTable {
            type Value = Source;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str(
                    "a column's name, names that are added, or a table with `column` or `columns`",
                )
            }

            fn visit_str<E: Error>(self, name: &str) -> Result<Source, E> {
                Ok(Source::column(name))
            }

            fn visit_seq<A: SeqAccess<'de>>(self, mut names: A) -> Result<Source, A::Error> {
                let mut columns = Vec::new();
                while let Some(name) = names.next_element::<String>()? {
                    columns.push(name);
                }
                if columns.is_empty() {
                    return Err(A::Error::custom("a sum of columns names at least one"));
                }
                Ok(Source { columns, ..Source::column("") })
            }

            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Source, A::Error> {
                let table = Table::deserialize(MapAccessDeserializer::new(map))?;
                let (columns, between) = match (table.column, table.columns, table.between) {
                    (Some(column), None, None) => (vec![column], None),
                    (None, Some(columns), between) if columns.len() > 1 => (columns, between),
                    _ => return Err(A::Error::custom(ONE_OR_SEVERAL)),
                };
                Ok(Source {
                    columns,
                    between: between.unwrap_or_else(|| " ".to_owned()),
                    scale: table.scale,
                    offset: table.offset,
                    lookup: table.lookup,
                    part: table.part,
                    missing: table.missing,
                    wrap: table.wrap,
                    optional: table.optional,
                })
            }
        }
        deserializer.deserialize_any(NameOrTable)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_compared_as_numbers() {
        assert!(Value::from(-9999.0).is("-9999.0"));
        assert!(Value::from(5.0).is("5"));
        assert!(!Value::from(5.0).is("5.1") && !Value::from(5.0).is("five"));
        assert!(Value::from("none").is("none") && !Value::from("none").is("None"));
        assert!(!Value::from(f64::NAN).is("NaN"));
    }
}
