use std::{io::Write, path::Path};

use super::{
    BagError,
    contents::{Bag, Message},
    message::{Kind, Place, Use, compass, level, place, reception},
};
use crate::recording::{Column, poses::surrounding};

/// Topics of a bag that are read.
#[derive(Clone, Debug, PartialEq)]
pub struct Topics {
    /// The topic with the receiver's places; the only one that has such unless given.
    pub pose: Option<String>,
    /// The topics with levels, each with the beacon's name if it has one; the only one that has
    /// levels unless given.
    pub levels: Vec<(String, Option<String>)>,
    /// Maximum distance in time between the places about a level, in seconds.
    pub gap_s: f64,
}

/// No topics by name, places at most two seconds apart.
impl Default for Topics {
    fn default() -> Self {
        Self { pose: None, levels: Vec::new(), gap_s: 2.0 }
    }
}

/// Counts of a conversion.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Converted {
    /// Rows that were written.
    pub rows: u64,
    /// Levels that were left out, since the receiver's place then is not known.
    pub without_place: u64,
}

/// Bags begin after this: recorders whose clock was not set count from when they were started. The
/// year 2000, in seconds since 1970.
const UTC_FROM_S: f64 = 946_684_800.0;

/// Writes what a bag holds as a recording in our own format: foxhunt's own receptions where there
/// are any, else each level at the place where the receiver was then, on a straight line between
/// the places before and after. Times are those at which messages were recorded.
///
/// # Errors
///
/// [`BagError`] where the bag or a message cannot be read, a topic is missing or not known to be
/// meant, or no level has a place.
pub fn convert(path: &Path, topics: &Topics, out: impl Write) -> Result<Converted, BagError> {
    if !(topics.gap_s > 0.0 && topics.gap_s.is_finite()) {
        return Err(BagError::Value { name: "gap_s", value: topics.gap_s });
    }
    let bag = Bag::open(path)?;
    let named = topics.pose.is_some() || !topics.levels.is_empty();
    let has_receptions = bag.topics.iter().any(|topic| topic.kind == Some(Kind::Reception));
    if has_receptions && !named { receptions(&bag, out) } else { joined(&bag, topics, out) }
}

impl Bag {
    fn of_topic(&self, topic: usize) -> impl Iterator<Item = (usize, &Message)> {
        self.messages.iter().enumerate().filter(move |(_, message)| message.topic == topic)
    }

    /// The number and kind of a topic that is of use, by its name or as the only one.
    fn chosen(
        &self,
        name: Option<&str>,
        of: Use,
        [what, flag]: [&'static str; 2],
    ) -> Result<(usize, Kind), BagError> {
        let of_use = |kind: &Kind| kind.used_for() == of;
        let fitting = self.topics.iter().enumerate();
        let fitting =
            fitting.filter_map(|(number, topic)| Some((number, topic.kind.filter(of_use)?)));
        let fitting: Vec<(usize, Kind)> = fitting
            .filter(|(number, _)| {
                name.is_none_or(|name| self.topics.get(*number).is_some_and(|t| t.name == name))
            })
            .collect();
        match fitting.as_slice() {
            [only] => Ok(*only),
            [] => {
                Err(BagError::NoTopic { name: name.map(str::to_owned), what, known: self.known() })
            }
            several => {
                let names = several.iter().filter_map(|(number, _)| self.topics.get(*number));
                let names: Vec<&str> = names.map(|topic| topic.name.as_str()).collect();
                Err(BagError::SeveralTopics { names: names.join(", "), what, flag })
            }
        }
    }

    /// The error of a message.
    fn wrong(&self, number: usize, source: BagError) -> BagError {
        let topic = self.messages.get(number).and_then(|message| self.topics.get(message.topic));
        let topic = topic.map_or_else(String::new, |topic| topic.name.clone());
        BagError::Message { topic, number: number + 1, source: Box::new(source) }
    }

    fn seconds(&self, message: &Message) -> f64 {
        #[expect(clippy::cast_precision_loss, reason = "to a quarter of a microsecond in 2030")]
        let seconds = message.time_ns as f64;
        seconds * 1e-9
    }

    fn time_column(&self) -> Column {
        let first = self.messages.first().map_or(0.0, |message| self.seconds(message));
        if first >= UTC_FROM_S { Column::TimeUtc } else { Column::TimeS }
    }
}

fn joined(bag: &Bag, topics: &Topics, out: impl Write) -> Result<Converted, BagError> {
    let (topic, kind) =
        bag.chosen(topics.pose.as_deref(), Use::Place, ["the receiver's places", "--pose-topic"])?;
    let mut places = Vec::new();
    for (number, message) in bag.of_topic(topic) {
        let place = place(kind, &message.data).map_err(|error| bag.wrong(number, error))?;
        places.extend(place.map(|place| (bag.seconds(message), place)));
    }
    let only = [(None, None)];
    let given = topics.levels.iter().map(|(name, beacon)| (Some(name.as_str()), beacon.as_deref()));
    let wanted: Vec<_> = if topics.levels.is_empty() { only.to_vec() } else { given.collect() };
    let mut levels = Vec::new();
    for (name, beacon) in wanted {
        let (topic, kind) = bag.chosen(name, Use::Level, ["levels", "--rssi-topic"])?;
        for (number, message) in bag.of_topic(topic) {
            let level = level(kind, &message.data).map_err(|error| bag.wrong(number, error))?;
            levels.push((bag.seconds(message), level, beacon));
        }
    }
    levels.sort_by(|a, b| a.0.total_cmp(&b.0));
    let on_earth = matches!(places.first(), Some((_, Place::Earth(_))));
    let local = [Column::EastM, Column::NorthM, Column::UpM, Column::HeadingDegCompass];
    let earth = [Column::LatDeg, Column::LonDeg, Column::AltM];
    let columns = if on_earth { &earth[..] } else { &local };
    let names_beacons = levels.iter().any(|(.., beacon)| beacon.is_some());
    let mut csv = csv::Writer::from_writer(out);
    let header = [bag.time_column(), Column::RssDbm].into_iter().chain(columns.iter().copied());
    let header = header.chain(names_beacons.then_some(Column::Beacon));
    csv.write_record(header.map(Column::name)).map_err(BagError::read)?;
    let mut converted = Converted::default();
    for (time, level, beacon) in &levels {
        let Some(place) = between(&places, *time, topics.gap_s) else {
            converted.without_place += 1;
            continue;
        };
        let mut cells = vec![time.to_string(), level.to_string()];
        match place {
            Place::Local(place, heading) => {
                cells.extend(place.map(|metres| metres.to_string()));
                cells.push(compass(heading).to_string());
            }
            Place::Earth(place) => cells.extend(place.map(|value| value.to_string())),
        }
        cells.extend(names_beacons.then(|| beacon.unwrap_or_default().to_owned()));
        csv.write_record(cells).map_err(BagError::read)?;
        converted.rows += 1;
    }
    csv.flush().map_err(BagError::read)?;
    match converted.rows {
        0 => Err(BagError::NoPlaces { levels: levels.len(), gap_s: topics.gap_s }),
        _ => Ok(converted),
    }
}

/// Place of a receiver at a time, interpolated between the places about it if they are at most
/// `gap_s` apart.
fn between(places: &[(f64, Place)], time: f64, gap_s: f64) -> Option<Place> {
    let (from, to, share) = surrounding(places, time, gap_s)?;
    let mix = |from: [f64; 3], to: [f64; 3]| {
        [0, 1, 2].map(|axis: usize| from[axis] + share * (to[axis] - from[axis]))
    };
    match (*from, *to) {
        (Place::Local(from, heading), Place::Local(to, last)) => {
            let turned = foxhunt_core::angle::wrap(last - heading);
            let heading = foxhunt_core::angle::wrap(heading + share * turned);
            Some(Place::Local(mix(from, to), heading))
        }
        (Place::Earth(from), Place::Earth(to)) => Some(Place::Earth(mix(from, to))),
        // A topic has one type.
        _ => None,
    }
}

fn receptions(bag: &Bag, out: impl Write) -> Result<Converted, BagError> {
    let columns = [
        bag.time_column(),
        Column::Drone,
        Column::Beacon,
        Column::EastM,
        Column::NorthM,
        Column::UpM,
        Column::HeadingDegCompass,
        Column::RssDbm,
        Column::BearingDegCompass,
        Column::BearingSigmaDeg,
    ];
    let mut csv = csv::Writer::from_writer(out);
    csv.write_record(columns.map(Column::name)).map_err(BagError::read)?;
    let mut converted = Converted::default();
    // The same reception is repeated until it is taken.
    let mut known = std::collections::BTreeSet::new();
    for (number, message) in bag.messages.iter().enumerate() {
        let topic = bag.topics.get(message.topic);
        let Some(topic) = topic.filter(|topic| topic.kind == Some(Kind::Reception)) else {
            continue;
        };
        if !known.insert((message.topic, message.data.as_slice())) {
            continue;
        }
        let read = reception(&message.data).map_err(|error| bag.wrong(number, error))?;
        let Some(read) = read else { continue };
        let number = |value: Option<f64>| value.map_or_else(String::new, |v| v.to_string());
        let [east, north, up] = read.place.map(|metres| metres.to_string());
        csv.write_record([
            bag.seconds(message).to_string(),
            topic.name.trim_matches('/').to_owned(),
            format!("beacon {}", u32::from(read.beacon) + 1),
            east,
            north,
            up,
            compass(read.heading).to_string(),
            number(read.rss_dbm),
            number(read.bearing.map(|[angle, _]| compass(angle))),
            number(read.bearing.map(|[_, sigma]| sigma.to_degrees())),
        ])
        .map_err(BagError::read)?;
        converted.rows += 1;
    }
    csv.flush().map_err(BagError::read)?;
    Ok(converted)
}

#[cfg(test)]
mod tests {
    use approx::assert_abs_diff_eq;
    use std::f64::consts::PI;

    use super::*;

    #[test]
    fn places_are_between_their_neighbours() {
        let local = |x: f64, heading: f64| Place::Local([x, 0.0, 4.0], heading);
        let places = [(10.0, local(0.0, PI - 0.1)), (12.0, local(4.0, -PI + 0.1))];
        assert_eq!(between(&places, 10.0, 2.0), Some(local(0.0, PI - 0.1)));
        let Some(Place::Local([x, _, up], heading)) = between(&places, 11.0, 2.0) else {
            panic!("a place")
        };
        assert_abs_diff_eq!(x, 2.0, epsilon = 1e-12);
        assert_abs_diff_eq!(up, 4.0, epsilon = 1e-12);
        // The short way round.
        assert_abs_diff_eq!(heading.abs(), PI, epsilon = 1e-12);
        for (time, gap_s) in [(11.0, 1.9), (9.0, 9.0), (12.1, 9.0)] {
            assert_eq!(between(&places, time, gap_s), None, "{time}");
        }
    }
}
