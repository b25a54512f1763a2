use std::collections::HashMap;

use foxhunt_wire::geodesy::LocalFrame;
use nalgebra::Vector3;

use super::{
    ExportError,
    cot::{
        CotPlatform, HOLDS_S, Head, IN_THE_AIR, ON_THE_GROUND, Receivers, how, is_found, platform,
        put, uid, unique,
    },
    feature::{Feature, Kind, bearing, found, lon_lat, reach_m},
    xml::Xml,
};
use crate::overview::{Overview, Received};

/// Validity of a receiver's place, in seconds: half a minute of a turn, and a gap of the link.
const PLATFORM_HOLDS_S: f64 = 120.0;

/// Validity of a fix after its last renewal, in seconds.
const FIX_HOLDS_S: f64 = 300.0;

/// Validity of a bearing from its reception on, in seconds.
const BEARING_HOLDS_S: f64 = 600.0;

/// Time from one renewal of a fix that has not changed to the next, in seconds: receivers that
/// join late, or lost a datagram, get it then.
const RENEWED_S: f64 = 30.0;

/// Number of bearings of one receiver to one beacon; a new one takes the place of the oldest.
const BEARINGS: usize = 8;

/// An event in Cursor on Target, as XML without a declaration.
#[derive(Clone, Debug, PartialEq)]
pub struct CotEvent {
    /// Name of the thing: events of one name replace each other.
    pub uid: String,
    /// The event.
    pub xml: Vec<u8>,
    /// UNIX time at which the event ends to hold, in seconds.
    pub stale_unix_s: f64,
}

/// Events of a hunt that goes on: receivers, fixes, ellipses, rivals and the last bearings.
///
/// Each thing has one name for the whole hunt, so that a fix moves rather than multiplies. An
/// unchanged thing has the same event to the byte for half a minute.
#[derive(Clone, Debug, Default)]
pub struct CotFeed {
    receivers: Receivers,
    is_simulated: bool,
    /// True if the receivers are not where they were received from any more.
    is_past: bool,
    /// Times and lengths of what was shown, by its name.
    shown: HashMap<String, Shown>,
}

/// Time and length of a thing that was shown.
#[derive(Clone, Copy, Debug)]
struct Shown {
    /// Time of the hunt.
    time: f64,
    unix_s: f64,
    /// Length of a bearing; a line that grew with every reception would be sent as often.
    reach_m: f64,
}

impl CotFeed {
    /// Begins for receivers in the order of the hunt; those beyond have the hunt's own names, and
    /// are in the air. Events of a simulated hunt say so.
    #[must_use]
    pub fn new(platforms: Vec<CotPlatform>, is_simulated: bool) -> Self {
        Self { receivers: Receivers::new(platforms), is_simulated, ..Self::default() }
    }

    /// Returns the feed of recordings: their receivers and times are past, so that receivers are
    /// left out, and the answer is as of the first call.
    #[must_use]
    pub fn of_recordings() -> Self {
        Self { is_past: true, ..Self::default() }
    }

    /// Takes the place of a receiver at a time of the hunt: East, North and Up in metres.
    pub fn place(&mut self, receiver: usize, time: f64, place: Vector3<f64>) {
        self.receivers.place(receiver, time, place);
    }

    /// Returns the event of each thing at a UNIX time. A hunt without an epoch has its times by the
    /// first call that has them. `is_over` lets fixes, ellipses and bearings hold for a day.
    ///
    /// # Errors
    ///
    /// [`ExportError`] if the overview has no origin, or a time is no date.
    pub fn events(
        &mut self,
        overview: &Overview,
        now_unix_s: f64,
        is_over: bool,
    ) -> Result<Vec<CotEvent>, ExportError> {
        let frame = overview.frame.ok_or(ExportError::NoOrigin)?;
        let mut events = Vec::new();
        let receivers = unique(self.receivers.names(overview));
        let searches = unique(overview.searches.iter().map(|search| search.name.clone()));
        if !self.is_past {
            for (receiver, unique) in receivers.iter().enumerate() {
                events.extend(self.receiver(overview, &frame, receiver, unique, now_unix_s)?);
            }
        }
        let renewed = (now_unix_s / RENEWED_S).floor() * RENEWED_S;
        let named = overview.searches.iter().zip(&searches);
        for (search, unique) in named.filter(|(search, _)| is_found(search)) {
            for (feature, number) in numbered(found(search, &frame)) {
                let uid = uid(overview, feature.kind.name(), unique) + &number;
                let datum = self.shown(&uid, overview, feature.time.unwrap_or(0.0), now_unix_s);
                let time = datum.unix_s.max(renewed);
                let stale = time + if is_over { HOLDS_S } else { FIX_HOLDS_S };
                events.push(self.event(&frame, &feature, uid, [time, datum.unix_s, stale])?);
            }
        }
        let reach_m = reach_m(overview);
        let epoch = self.epoch_unix_s(overview);
        for (received, slot) in last_bearings(overview) {
            let of = received.search.and_then(|index| searches.get(index));
            let of = of.map_or("", String::as_str);
            let by = receivers.get(received.receiver).map_or("", String::as_str);
            let name = format!("{by}.{of}.{slot}");
            let uid = uid(overview, Kind::Bearing.name(), &name);
            let Shown { unix_s, reach_m, .. } = *self
                .shown
                .entry(uid.clone())
                .and_modify(|shown| shown.renew(epoch, received.time, now_unix_s, reach_m))
                .or_insert_with(|| Shown::new(epoch, received.time, now_unix_s, reach_m));
            let stale = unix_s + if is_over { HOLDS_S } else { BEARING_HOLDS_S };
            let name = self.receivers.name(overview, received.receiver);
            let Some(line) = bearing(overview, &frame, received, reach_m) else { continue };
            let line = Feature { name, ..line };
            events.push(self.event(&frame, &line, uid, [unix_s, unix_s, stale])?);
        }
        events.retain(|event| event.stale_unix_s > now_unix_s);
        Ok(events)
    }

    fn event(
        &self,
        frame: &LocalFrame,
        feature: &Feature,
        uid: String,
        times: [f64; 3],
    ) -> Result<CotEvent, ExportError> {
        let mut xml = Xml::new();
        put(&mut xml, frame, feature, &uid, self.how(how(feature.kind)), times)?;
        Ok(CotEvent { uid, xml: xml.into_bytes(), stale_unix_s: times[2] })
    }

    /// The event of a receiver, at its last known place; `unique` is its name in the UID.
    fn receiver(
        &mut self,
        overview: &Overview,
        frame: &LocalFrame,
        receiver: usize,
        unique: &str,
        now_unix_s: f64,
    ) -> Result<Option<CotEvent>, ExportError> {
        let Some((time, place)) = self.receivers.last(overview, receiver) else { return Ok(None) };
        let name = self.receivers.name(overview, receiver);
        let uid = uid(overview, "receiver", unique);
        let unix_s = self.shown(&uid, overview, time, now_unix_s).unix_s;
        let stale_unix_s = unix_s + PLATFORM_HOLDS_S;
        let on_the_ground = self.receivers.is_on_the_ground(receiver);
        let head = Head {
            uid: &uid,
            kind: if on_the_ground { ON_THE_GROUND } else { IN_THE_AIR },
            how: self.how("m-g"),
            place: lon_lat(frame, &place.xy()),
            radius_m: None,
            times: [unix_s, unix_s, stale_unix_s],
        };
        let mut xml = Xml::new();
        platform(&mut xml, &head, &name)?;
        Ok(Some(CotEvent { uid, xml: xml.into_bytes(), stale_unix_s }))
    }

    fn how(&self, real: &'static str) -> &'static str {
        if self.is_simulated { "m-s" } else { real }
    }

    /// Returns the times of a thing that is as of a time of the hunt.
    fn shown(&mut self, uid: &str, overview: &Overview, time: f64, now_unix_s: f64) -> Shown {
        let epoch = self.epoch_unix_s(overview);
        let shown = self.shown.entry(uid.to_owned());
        *shown
            .and_modify(|shown| shown.renew(epoch, time, now_unix_s, 0.0))
            .or_insert_with(|| Shown::new(epoch, time, now_unix_s, 0.0))
    }

    /// UNIX time of the hunt's zero, if the times of events are to be the hunt's.
    fn epoch_unix_s(&self, overview: &Overview) -> Option<f64> {
        overview.epoch_unix_s.filter(|_| !self.is_past)
    }
}

impl Shown {
    fn new(epoch_unix_s: Option<f64>, time: f64, now_unix_s: f64, reach_m: f64) -> Self {
        let unix_s = epoch_unix_s.map_or(now_unix_s, |epoch| epoch + time);
        Self { time, unix_s, reach_m }
    }

    fn renew(&mut self, epoch_unix_s: Option<f64>, time: f64, now_unix_s: f64, reach_m: f64) {
        if self.time.total_cmp(&time).is_ne() {
            *self = Self::new(epoch_unix_s, time, now_unix_s, reach_m);
        }
    }
}

/// The features, each with the end of its name: rivals are counted.
fn numbered(features: Vec<Feature>) -> impl Iterator<Item = (Feature, String)> {
    let mut rivals = 0;
    features.into_iter().map(move |feature| {
        if feature.kind != Kind::Rival {
            return (feature, String::new());
        }
        rivals += 1;
        (feature, format!(".{rivals}"))
    })
}

/// The last bearings of each receiver to each beacon that the estimator used, with their slots.
fn last_bearings(overview: &Overview) -> impl Iterator<Item = (&Received, usize)> {
    let mut slots: HashMap<(usize, Option<usize>), Vec<&Received>> = HashMap::new();
    let used = |received: &&Received| received.bearing.is_some() && received.used;
    for received in overview.received.iter().filter(used) {
        slots.entry((received.receiver, received.search)).or_default().push(received);
    }
    let mut of_each: Vec<_> = slots.into_iter().collect();
    of_each.sort_unstable_by_key(|(of, _)| *of);
    of_each.into_iter().flat_map(|(_, all)| {
        let first = all.len().saturating_sub(BEARINGS);
        let slots = (first..all.len()).map(|index| index % BEARINGS + 1);
        all.into_iter().skip(first).zip(slots)
    })
}
