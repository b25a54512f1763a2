use std::{collections::BTreeMap, fmt};

use serde::{
    Deserialize, Deserializer,
    de::{Error, MapAccess, Visitor, value::MapAccessDeserializer},
};

use super::Value;

/// Where a column of ours comes from in a file: a column's name, or a table with
/// how its cells are converted.
///
/// The cell is read as follows: empty or one of `missing` is no value; `lookup` replaces it;
/// a number is then multiplied by `scale` and raised by `offset`.
#[derive(Clone, Debug, PartialEq)]
pub struct Source {
    /// The file's column.
    pub column: String,
    /// What its numbers are multiplied by; 1 unless given.
    pub scale: f64,
    /// What is then added; 0 unless given.
    pub offset: f64,
    /// What each cell means; a cell that is not listed is an error. Empty: cells are as they are.
    pub lookup: BTreeMap<String, Value>,
    /// Cells that mean "no value", besides empty ones.
    pub missing: Vec<Value>,
    /// Whether files without this column are of the format too.
    pub optional: bool,
}

impl Source {
    /// A column taken as it is.
    #[must_use]
    pub fn column(name: &str) -> Self {
        Self {
            column: name.to_owned(),
            scale: 1.0,
            offset: 0.0,
            lookup: BTreeMap::new(),
            missing: Vec::new(),
            optional: false,
        }
    }
}

/// The table's form in TOML.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Table {
    column: String,
    #[serde(default = "one")]
    scale: f64,
    #[serde(default)]
    offset: f64,
    #[serde(default)]
    lookup: BTreeMap<String, Value>,
    #[serde(default)]
    missing: Vec<Value>,
    #[serde(default)]
    optional: bool,
}

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
                f.write_str("a column's name or a table with `column`")
            }

            fn visit_str<E: Error>(self, name: &str) -> Result<Source, E> {
                Ok(Source::column(name))
            }

            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Source, A::Error> {
                let table = Table::deserialize(MapAccessDeserializer::new(map))?;
                Ok(Source {
                    column: table.column,
                    scale: table.scale,
                    offset: table.offset,
                    lookup: table.lookup,
                    missing: table.missing,
                    optional: table.optional,
                })
            }
        }
        deserializer.deserialize_any(NameOrTable)
    }
}
