//! Reads and writes TOML and JSON.
//!
//! Code that serde derives is compiled once for each pair of type and format. A scenario holds some
//! two hundred types, and TOML and JSON each buffer tagged enums in formats of their own, so that
//! derived code was near half of what this package gave the optimiser. Here a text becomes a tree
//! first, whatever its format, and every type is read from that tree, and written through an erased
//! serializer.

mod node;

use std::{fmt, io};

use erased_serde::Serialize;
use serde::Deserializer as _;
use serde::de::{
    Deserialize, DeserializeOwned, DeserializeSeed, Error, IgnoredAny, MapAccess, SeqAccess,
    Visitor,
};

use self::node::{Misfit, Node, Step};

/// Reads a value from TOML.
///
/// # Errors
///
/// The error of the TOML reader, which names the line and shows it.
pub fn from_toml<T: DeserializeOwned>(text: &str) -> Result<T, toml::de::Error> {
    let table: toml::Table = toml::from_str(text)?;
    T::deserialize(Node::from(table)).map_err(|misfit| in_toml(text, misfit))
}

/// Leads the TOML reader to the place of a misfit, where it fails with that message and knows the
/// line.
fn in_toml(text: &str, misfit: Misfit) -> toml::de::Error {
    let steps: Vec<Step> = misfit.steps.into_iter().rev().collect();
    let failure = Failure { steps: &steps, key: misfit.key.as_deref(), message: &misfit.message };
    let read = toml::Deserializer::parse(text).and_then(|toml| toml.deserialize_any(failure));
    read.err().unwrap_or_else(|| toml::de::Error::custom(&misfit.message))
}

/// Reads a value from JSON.
///
/// # Errors
///
/// The error of the JSON reader, which names line and column of what is no JSON; for a value that
/// does not fit its place, the path to it.
pub fn from_json<T: DeserializeOwned>(text: &str) -> Result<T, serde_json::Error> {
    T::deserialize(serde_json::from_str::<Node>(text)?).map_err(serde_json::Error::custom)
}

/// Writes a value as TOML.
///
/// # Errors
///
/// The error of the TOML writer for a value that TOML cannot hold.
pub fn to_toml(value: &dyn Serialize) -> Result<String, toml::ser::Error> {
    toml::to_string(value)
}

/// Writes a value as one line of JSON.
///
/// # Errors
///
/// The error of the JSON writer for a value that JSON cannot hold.
pub fn to_json(value: &dyn Serialize) -> Result<String, serde_json::Error> {
    serde_json::to_string(value)
}

/// Writes a value as indented JSON.
///
/// # Errors
///
/// The error of the JSON writer for a value that JSON cannot hold.
pub fn to_pretty_json(value: &dyn Serialize) -> Result<String, serde_json::Error> {
    serde_json::to_string_pretty(value)
}

/// Writes a value as indented JSON to `out`.
///
/// # Errors
///
/// The error of `out`, or that of the JSON writer for a value that JSON cannot hold.
pub fn write_pretty_json(
    out: &mut dyn io::Write,
    value: &dyn Serialize,
) -> Result<(), serde_json::Error> {
    serde_json::to_writer_pretty(out, value)
}

/// Writes a value as one line of JSON to `out`.
///
/// # Errors
///
/// The error of `out`, or that of the JSON writer for a value that JSON cannot hold.
pub fn write_json(out: &mut dyn io::Write, value: &dyn Serialize) -> Result<(), serde_json::Error> {
    serde_json::to_writer(out, value)
}

/// Fails with a message at the end of a way through a document.
#[derive(Clone, Copy)]
struct Failure<'a> {
    /// The steps that are still to go.
    steps: &'a [Step],
    /// The key of the last table that the message is about; `None` where it is about the value.
    key: Option<&'a str>,
    message: &'a str,
}

impl<'de> DeserializeSeed<'de> for Failure<'_> {
    type Value = ();

    fn deserialize<D: serde::Deserializer<'de>>(self, document: D) -> Result<(), D::Error> {
        if self.steps.is_empty() && self.key.is_none() {
            return Err(D::Error::custom(self.message));
        }
        document.deserialize_any(self)
    }
}

impl<'de> Visitor<'de> for Failure<'_> {
    type Value = ();

    fn expecting(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.write_str(self.message)
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<(), A::Error> {
        while let Some(key) = map.next_key_seed(FailureKey(self))? {
            match self.steps {
                [Step::Key(next), steps @ ..] if *next == key => {
                    map.next_value_seed(Self { steps, ..self })?;
                }
                _ => {
                    map.next_value::<IgnoredAny>()?;
                }
            }
        }
        Err(A::Error::custom(self.message))
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<(), A::Error> {
        if let [Step::Index(index), steps @ ..] = self.steps {
            for _ in 0..*index {
                list.next_element::<IgnoredAny>()?;
            }
            list.next_element_seed(Self { steps, ..self })?;
        }
        Err(A::Error::custom(self.message))
    }
}

/// A key on the way of a [`Failure`]; fails at the key that the message is about.
struct FailureKey<'a>(Failure<'a>);

impl<'de> DeserializeSeed<'de> for FailureKey<'_> {
    type Value = String;

    fn deserialize<D: serde::Deserializer<'de>>(self, key: D) -> Result<String, D::Error> {
        let key = String::deserialize(key)?;
        let Self(Failure { steps, key: wrong, message }) = self;
        if steps.is_empty() && wrong == Some(key.as_str()) {
            return Err(D::Error::custom(message));
        }
        Ok(key)
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::*;

    #[derive(Clone, Debug, PartialEq, serde::Deserialize, serde::Serialize)]
    #[serde(deny_unknown_fields)]
    struct Survey {
        name: String,
        count: u64,
        offsets: [f64; 2],
        #[serde(default, skip_serializing_if = "Option::is_none")]
        note: Option<String>,
        shapes: Vec<Shape>,
        ends: BTreeMap<String, End>,
    }

    #[derive(Clone, Debug, PartialEq, serde::Deserialize, serde::Serialize)]
    #[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
    enum Shape {
        Point,
        Ring { radius: f64 },
    }

    #[derive(Clone, Debug, PartialEq, serde::Deserialize, serde::Serialize)]
    #[serde(rename_all = "kebab-case")]
    enum End {
        Open,
        After(u32),
        At { east: f64 },
    }

    const TEXT: &str = r#"
name = "a survey"
count = 3
offsets = [1, -2.5]
shapes = [{ kind = "point" }, { kind = "ring", radius = 4 }]

[ends]
first = "open"
second = { after = 7 }
third = { at = { east = -1.5 } }
"#;

    fn survey() -> Survey {
        Survey {
            name: "a survey".to_owned(),
            count: 3,
            offsets: [1.0, -2.5],
            note: None,
            shapes: vec![Shape::Point, Shape::Ring { radius: 4.0 }],
            ends: [
                ("first".to_owned(), End::Open),
                ("second".to_owned(), End::After(7)),
                ("third".to_owned(), End::At { east: -1.5 }),
            ]
            .into(),
        }
    }

    #[test]
    fn reads_what_the_formats_themselves_read() {
        assert_eq!(from_toml::<Survey>(TEXT), Ok(survey()));
        let json = to_json(&survey()).expect("plain fields");
        assert_eq!(from_json::<Survey>(&json).expect("as written"), survey());
        assert_eq!(json, serde_json::to_string(&survey()).expect("plain fields"));
        let toml = to_toml(&survey()).expect("plain fields");
        assert_eq!(from_toml::<Survey>(&toml), Ok(survey()));
        assert_eq!(toml, toml::to_string(&survey()).expect("plain fields"));
        let mut out = Vec::new();
        write_json(&mut out, &survey()).expect("a list takes everything");
        assert_eq!(out, json.into_bytes());
    }

    #[test]
    fn keeps_every_bit_of_a_number() {
        for value in [0.1, -0.0, 1e-310, f64::MAX, 14.349_999_999_999_739] {
            let read: f64 = from_json(&to_json(&value).expect("a number")).expect("as written");
            assert_eq!(read.to_bits(), value.to_bits(), "{value}");
        }
        assert_eq!(from_json::<u64>("18446744073709551615").expect("it fits"), u64::MAX);
        assert_eq!(from_json::<i64>("-9223372036854775808").expect("it fits"), i64::MIN);
        let read = from_toml::<BTreeMap<String, f64>>("a = inf").expect("TOML has it");
        assert!(read["a"].is_infinite());
    }

    #[test]
    fn a_misfit_in_toml_is_shown_in_its_line() {
        for (from, to, line, message) in [
            ("count = 3", "count = -3", 3, "expected u64"),
            ("count = 3", "counts = 3", 3, "unknown field `counts`"),
            ("-2.5]", "\"west\"]", 4, "expected f64"),
            ("-2.5]", "-2.5, 3]", 4, "fewer elements"),
            ("radius = 4", "radius = true", 5, "expected f64"),
            ("after = 7", "after = \"x\"", 9, "expected u32"),
            ("first = \"open\"", "first = \"shut\"", 8, "unknown variant `shut`"),
            ("name = \"a survey\"", "", 1, "missing field `name`"),
        ] {
            let text = TEXT.replace(from, to);
            let error = from_toml::<Survey>(&text).expect_err(to).to_string();
            assert!(error.contains(&format!("line {line},")), "{to}: {error}");
            assert!(error.contains(message), "{to}: {error}");
        }
        let error = from_toml::<Survey>("name = ").expect_err("no value").to_string();
        assert!(error.contains("line 1,"), "{error}");
    }

    #[test]
    fn a_misfit_in_json_is_named_by_its_path() {
        let json = to_json(&survey()).expect("plain fields");
        for (from, to, message) in [
            ("\"count\":3", "\"count\":\"x\"", "count: invalid type: string \"x\", expected u64"),
            ("-2.5]", "null]", "offsets[1]: invalid type: unit value, expected f64"),
            ("\"after\":7", "\"after\":-7", "ends.second.after: invalid value: integer `-7`"),
        ] {
            let error = from_json::<Survey>(&json.replace(from, to)).expect_err(to).to_string();
            assert!(error.contains(message), "{to}: {error}");
        }
        let torn = from_json::<Survey>(&json[..40]).expect_err("torn").to_string();
        assert!(torn.contains("line 1 column 40"), "{torn}");
    }
}
