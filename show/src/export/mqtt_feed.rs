//! Messages of a hunt for MQTT: topics, states and discovery, with names that are safe in them.

use std::collections::HashSet;

use foxhunt_wire::geodesy::LocalFrame;
use nalgebra::Vector3;
use serde_json::{Map, Value, json};

use super::{
    ExportError,
    cot::{CotPlatform, Receivers, is_found},
    feature::{Feature, Kind, LonLat, Shape, bearing, found, lon_lat, utc},
};
use crate::overview::{Overview, Received};

/// First level of all topics with places, and beginning of all identifiers.
const ROOT: &str = "foxhunt";

/// Topics that Home Assistant finds its device trackers by.
const DISCOVERY: &str = "homeassistant/device_tracker";

/// Radius of the circle that holds 95 % of a round normal distribution, in standard deviations.
const RADIUS_95: f64 = 2.447_746_830_680_816;

/// A message that the broker keeps for those who join late.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MqttMessage {
    /// Topic of the message: it replaces an earlier one.
    pub topic: String,
    /// Object in JSON.
    pub payload: Vec<u8>,
}

/// Places of beacons and receivers of a hunt that goes on, as messages of MQTT.
///
/// Each thing has two topics for the whole hunt: its place as JSON under
/// `foxhunt/HUNT/beacon/NAME` or `foxhunt/HUNT/receiver/NAME`, and its configuration as a device
/// tracker of Home Assistant. An unchanged thing has the same message to the byte.
#[derive(Clone, Debug, Default)]
pub struct MqttFeed {
    receivers: Receivers,
    is_simulated: bool,
    /// True if the receivers are not where they were received from any more.
    is_past: bool,
}

/// A thing on the map.
struct Thing<'a> {
    /// Kind of the thing, as a level of its topic.
    kind: &'static str,
    name: &'a str,
    /// Name of the thing in topics and identifiers.
    safe: &'a str,
    icon: &'static str,
    /// Topic that says whether the thing is still followed, where that matters.
    availability: Option<String>,
    place: Map<String, Value>,
}

impl MqttFeed {
    /// Begins for receivers in the order of the hunt; those beyond have the hunt's own names, and
    /// are in the air. Messages of a simulated hunt say so.
    #[must_use]
    pub fn new(platforms: Vec<CotPlatform>, is_simulated: bool) -> Self {
        Self { receivers: Receivers::new(platforms), is_simulated, is_past: false }
    }

    /// Returns the feed of recordings: their receivers have left, and are not sent.
    #[must_use]
    pub fn of_recordings() -> Self {
        Self { is_past: true, ..Self::default() }
    }

    /// Takes the place of a receiver at a time of the hunt: East, North and Up in metres.
    pub fn place(&mut self, receiver: usize, time: f64, place: Vector3<f64>) {
        self.receivers.place(receiver, time, place);
    }

    /// Returns the messages of each thing that has a place.
    ///
    /// # Errors
    ///
    /// [`ExportError`] if the overview has no origin.
    pub fn messages(&self, overview: &Overview) -> Result<Vec<MqttMessage>, ExportError> {
        let frame = overview.frame.ok_or(ExportError::NoOrigin)?;
        let hunt = safe(&overview.title);
        let mut messages = Vec::new();
        if !self.is_past {
            let names: Vec<_> = self.receivers.names(overview).collect();
            let safes = unique_safe(names.iter().cloned());
            for (receiver, (name, safe)) in names.iter().zip(&safes).enumerate() {
                let Some(place) = self.receiver(overview, &frame, receiver) else { continue };
                let is_on_the_ground = self.receivers.is_on_the_ground(receiver);
                let thing = Thing {
                    kind: "receiver",
                    name,
                    safe,
                    icon: if is_on_the_ground { "mdi:walk" } else { "mdi:quadcopter" },
                    availability: Some(availability_topic(&overview.title)),
                    place,
                };
                messages.extend(self.of_thing(overview, &hunt, thing)?);
            }
        }
        let safes = unique_safe(overview.searches.iter().map(|search| search.name.clone()));
        for (index, (search, safe)) in overview.searches.iter().zip(&safes).enumerate() {
            let Some(place) = self.beacon(overview, &frame, index) else { continue };
            let thing = Thing {
                kind: "beacon",
                name: &search.name,
                safe,
                icon: "mdi:access-point",
                // A team goes to a fix after the hunt, too.
                availability: None,
                place,
            };
            messages.extend(self.of_thing(overview, &hunt, thing)?);
        }
        Ok(messages)
    }

    /// The configuration of a thing and its place.
    fn of_thing(
        &self,
        overview: &Overview,
        hunt: &str,
        thing: Thing<'_>,
    ) -> Result<[MqttMessage; 2], ExportError> {
        let Thing { kind, name, safe, icon, availability, mut place } = thing;
        let topic = format!("{ROOT}/{hunt}/{kind}/{safe}");
        let id = identifier(&[ROOT, hunt, kind, safe]);
        let version = env!("CARGO_PKG_VERSION");
        let mut config = json!({
            "name": name,
            "unique_id": id,
            "json_attributes_topic": topic,
            "source_type": "gps",
            "icon": icon,
            "device": {
                "identifiers": [identifier(&[ROOT, hunt])],
                "name": format!("foxhunt {}", overview.title),
                "manufacturer": "foxhunt",
                "model": "hunt",
            },
            "origin": { "name": "foxhunt", "sw_version": version },
        });
        if let (Some(topic), Some(config)) = (availability, config.as_object_mut()) {
            let _ = config.insert("availability_topic".to_owned(), topic.into());
        }
        let _ = place.insert("hunt".to_owned(), overview.title.clone().into());
        let _ = place.insert(kind.to_owned(), name.into());
        let _ = place.insert("simulated".to_owned(), self.is_simulated.into());
        let message = |topic, value: &Value| {
            let payload = serde_json::to_vec(value).map_err(ExportError::write)?;
            Ok(MqttMessage { topic, payload })
        };
        let place = message(topic, &Value::Object(place))?;
        Ok([message(format!("{DISCOVERY}/{id}/config"), &config)?, place])
    }

    /// The last known place of a receiver.
    fn receiver(
        &self,
        overview: &Overview,
        frame: &LocalFrame,
        receiver: usize,
    ) -> Option<Map<String, Value>> {
        let (time, place) = self.receivers.last(overview, receiver)?;
        let health = overview.receivers.get(receiver).and_then(|known| known.health.last());
        let sigma_m = health.and_then(|health| health.position_sigma_m);
        let radius_m = sigma_m.map(|sigma_m| sigma_m * RADIUS_95);
        let mut fields = placed(lon_lat(frame, &place.xy()), radius_m)?;
        timed(&mut fields, overview, Some(time));
        if let Some(battery) = health.and_then(|health| health.battery) {
            let _ = fields.insert("battery_level".to_owned(), (battery * 100.0).round().into());
        }
        Some(fields)
    }

    /// The fix of a beacon with its ellipse, its rivals and its last reception; `None` before the
    /// first reception, and while the belief has no ellipse.
    fn beacon(
        &self,
        overview: &Overview,
        frame: &LocalFrame,
        index: usize,
    ) -> Option<Map<String, Value>> {
        let search = overview.searches.get(index).filter(|search| is_found(search))?;
        let features = found(search, frame);
        let fix = features.iter().find(|feature| feature.kind == Kind::Fix)?;
        let Shape::Point(place) = fix.shape else { return None };
        // Without a radius Home Assistant would take the fix for exact.
        let mut fields = placed(place, Some(number(fix, "semi_major_95_m")?))?;
        timed(&mut fields, overview, fix.time);
        add_numbers(&mut fields, fix);
        let receptions = search.last().map_or(0, |last| last.steps);
        let _ = fields.insert("receptions".to_owned(), receptions.into());
        let _ = fields.insert("outcome".to_owned(), search.outcome.clone().into());
        let rivals = features.iter().filter(|feature| feature.kind == Kind::Rival);
        let rivals = rivals.filter_map(|rival| {
            let Shape::Point(place) = rival.shape else { return None };
            let mut fields = placed(place, None)?;
            add_numbers(&mut fields, rival);
            Some(Value::Object(fields))
        });
        let _ = fields.insert("rivals".to_owned(), rivals.collect());
        let last = overview.received.iter().rfind(|received| received.search == Some(index));
        let last = last.map(|last| self.reception(overview, frame, last));
        let _ = fields.insert("last_reception".to_owned(), last.into());
        Some(fields)
    }

    fn reception(
        &self,
        overview: &Overview,
        frame: &LocalFrame,
        received: &Received,
    ) -> Map<String, Value> {
        let name = self.receivers.name(overview, received.receiver);
        let mut fields = Map::new();
        let _ = fields.insert("receiver".to_owned(), name.into());
        timed(&mut fields, overview, Some(received.time));
        // Only the numbers of the line are sent, so its length does not matter.
        match (bearing(overview, frame, received, 0.0), received.level) {
            (Some(line), _) => add_numbers(&mut fields, &line),
            (None, Some(level)) => {
                let _ = fields.insert("rss_dbm".to_owned(), level.rss_dbm.into());
            }
            (None, None) => {}
        }
        let _ = fields.insert("used".to_owned(), received.used.into());
        fields
    }
}

/// Returns the topic on which a hunt says `online`, and the broker `offline` once it is lost.
#[must_use]
pub fn availability_topic(hunt: &str) -> String {
    format!("{ROOT}/{}/availability", safe(hunt))
}

/// A place by the names of Home Assistant; `None` if it is not finite.
fn placed([longitude, latitude]: LonLat, radius_m: Option<f64>) -> Option<Map<String, Value>> {
    let numbers = [("latitude", Some(latitude)), ("longitude", Some(longitude))];
    let mut fields = Map::new();
    for (name, value) in numbers.into_iter().chain([("gps_accuracy", radius_m)]) {
        let Some(value) = value else { continue };
        if !value.is_finite() {
            return None;
        }
        let _ = fields.insert(name.to_owned(), value.into());
    }
    Some(fields)
}

fn timed(fields: &mut Map<String, Value>, overview: &Overview, time: Option<f64>) {
    let Some(time) = time else { return };
    let _ = fields.insert("time_s".to_owned(), time.into());
    if let Some(utc) = utc(overview, time) {
        let _ = fields.insert("time".to_owned(), utc.into());
    }
}

fn add_numbers(fields: &mut Map<String, Value>, feature: &Feature) {
    for (name, value) in &feature.numbers {
        let _ = fields.insert((*name).to_owned(), (*value).into());
    }
}

fn number(feature: &Feature, name: &str) -> Option<f64> {
    feature.numbers.iter().find(|(known, _)| *known == name).map(|(_, value)| *value)
}

/// Maximum length of a name before the number that makes it unique, in bytes.
const MOST_BYTES: usize = 48;

/// Separator of names in an identifier: no safe name holds it, so that no two lists of names have
/// one identifier.
const SEPARATOR: &str = "__";

/// Returns a name of ASCII letters, digits, `-` and single `_`, as Home Assistant's identifiers and
/// MQTT's topics allow.
///
/// A name that is changed in more than its spaces has the checksum of its own letters behind it:
/// two names stay two, whatever other names there are.
fn safe(name: &str) -> String {
    let mut safe = String::new();
    for letter in name.chars() {
        match letter {
            'a'..='z' | 'A'..='Z' | '0'..='9' | '-' => safe.push(letter),
            'ä' => safe.push_str("ae"),
            'ö' => safe.push_str("oe"),
            'ü' => safe.push_str("ue"),
            'Ä' => safe.push_str("Ae"),
            'Ö' => safe.push_str("Oe"),
            'Ü' => safe.push_str("Ue"),
            'ß' => safe.push_str("ss"),
            _ if safe.ends_with('_') || safe.is_empty() => {}
            _ => safe.push('_'),
        }
    }
    safe.truncate(MOST_BYTES);
    let safe = safe.trim_end_matches('_');
    let checksum = checksum(name);
    match safe {
        "" => format!("{checksum:08x}"),
        _ if name.replace(' ', "_") == safe => safe.to_owned(),
        _ => format!("{safe}_{checksum:08x}"),
    }
}

/// Returns safe names of which no two are one: one that is used again has a number behind it.
fn unique_safe(names: impl Iterator<Item = String>) -> Vec<String> {
    let mut used = HashSet::new();
    let unique = |name: String| {
        let name = safe(&name);
        let mut free = name.clone();
        for number in 2_u32.. {
            if used.insert(free.clone()) {
                break;
            }
            free = format!("{name}_{number}");
        }
        free
    };
    names.map(unique).collect()
}

/// Returns the identifier of a list of safe names.
fn identifier(names: &[&str]) -> String {
    names.join(SEPARATOR)
}

/// FNV-1a of a text: the same in every build, unlike a hash of the standard library.
fn checksum(text: &str) -> u32 {
    text.bytes().fold(0x811c_9dc5, |sum, byte| (sum ^ u32::from(byte)).wrapping_mul(0x0100_0193))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn plain_names_stay_and_others_keep_apart() {
        for (name, expected) in [
            ("fox", "fox"),
            ("Fox-1", "Fox-1"),
            ("drone 1", "drone_1"),
            ("drone_1", "drone_1"),
            ("Füchse", "Fuechse_ec66bf45"),
        ] {
            assert_eq!(safe(name), expected);
        }
        let hostile = [
            "a+b", "a#b", "a/b", "a b", "a  b", " a b", "a b ", "a__b", "ä", "ae", "Ä", "狐", "狸",
            "", "$SYS", "_", "a\u{0}b", "fox\n",
        ];
        let long = ["x".repeat(300), "x".repeat(301)];
        let names: Vec<_> = hostile.map(str::to_owned).into_iter().chain(long).collect();
        let safes: HashSet<_> = names.iter().map(|name| safe(name)).collect();
        assert_eq!(safes.len(), names.len(), "{safes:?}");
        for safe in &safes {
            let allowed = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '-';
            assert!(!safe.is_empty() && safe.len() < 64 && safe.chars().all(allowed), "{safe:?}");
            let is_whole = !safe.contains(SEPARATOR) && safe.trim_matches('_') == safe;
            assert!(is_whole, "{safe:?} could belong to two lists of names");
        }
    }

    #[test]
    fn names_that_are_used_again_have_a_number_that_no_other_has() {
        let names = ["drone 1", "drone_1", "drone_1_2", "drone 1"].map(str::to_owned);
        let unique = unique_safe(names.into_iter());
        assert_eq!(unique, ["drone_1", "drone_1_2", "drone_1_2_2", "drone_1_3"]);
    }
}
