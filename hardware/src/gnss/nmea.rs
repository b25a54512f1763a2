use chrono::{NaiveTime, Timelike};
use foxhunt_wire::{FixQuality, geodesy::Geodetic};
use nalgebra::Vector3;
use nmea::{
    SentenceType, parse_nmea_sentence,
    sentences::{
        FixType, GgaData, GstData, RmcData, parse_gga, parse_gst, parse_rmc, rmc::RmcStatusOfFix,
    },
};

use super::{GnssDecoder, GnssFix, Line, over_ground, sane, sane_sigma, seconds};

/// The longest sentence that is read, in bytes: what the crate takes.
const LONGEST: usize = nmea::SENTENCE_MAX_LEN;

/// Longest time by which a GST or the velocity of an RMC may precede its fix, in seconds: the last
/// one, at 1 Hz.
const COMPANION_AGE_S: f64 = 2.0;

/// Metres per second in a knot.
const KNOT_MPS: f64 = 1852.0 / 3600.0;

const DAY_S: f64 = 86_400.0;

/// Reads GGA for the place and its quality, GST for σ, RMC for date and velocity, of any talker
/// (NMEA 0183). A sentence without the right checksum is dropped.
///
/// A GGA is a fix at once, with σ of the GST and the velocity of the RMC before it where these are
/// not older than 2 s; when the GST or RMC of the same moment comes after it, the fix is repeated.
/// RMC has no climb: Up is taken to be 0. A course is missing while the receiver stands. A receiver
/// that does not send the geoid's height is taken to send heights above the ellipsoid.
#[derive(Clone, Debug)]
pub struct NmeaDecoder {
    line: Line,
    sentences: Sentences,
}

/// Values of the sentences until now.
#[derive(Clone, Copy, Debug, Default)]
struct Sentences {
    /// Beginning of the day of the last date, in seconds of UNIX time, and the time of that day.
    date: Option<(f64, f64)>,
    /// Time of the day and σ of the last GST.
    gst: Option<(f64, Vector3<f64>)>,
    /// Time of the day and velocity of the last RMC.
    velocity: Option<(f64, Vector3<f64>)>,
    /// Time of the day and fix of the last GGA.
    gga: Option<(f64, GnssFix)>,
    alt_m: Option<f64>,
    messages: u64,
    refused: u64,
}

impl Default for NmeaDecoder {
    fn default() -> Self {
        Self::new()
    }
}

impl NmeaDecoder {
    /// A decoder without any bytes so far.
    #[must_use]
    pub fn new() -> Self {
        Self { line: Line::new(LONGEST, Some(b'$')), sentences: Sentences::default() }
    }
}

impl GnssDecoder for NmeaDecoder {
    fn name(&self) -> &'static str {
        "NMEA"
    }

    fn set_up(&self) -> Vec<u8> {
        Vec::new()
    }

    fn decode(&mut self, bytes: &[u8], emit: &mut dyn FnMut(GnssFix)) {
        let Self { line, sentences } = self;
        for &byte in bytes {
            if let Some(fix) = line.push(byte, |text| sentences.sentence(text)).flatten() {
                emit(fix);
            }
        }
    }

    fn reset(&mut self) {
        self.line.clear();
        let Sentences { messages, refused, .. } = self.sentences;
        self.sentences = Sentences { messages, refused, ..Sentences::default() };
    }

    fn messages(&self) -> u64 {
        self.sentences.messages
    }

    fn refused(&self) -> u64 {
        self.sentences.refused
    }
}

impl Sentences {
    fn sentence(&mut self, text: &str) -> Option<GnssFix> {
        let read = self.read(text);
        if read.is_none() {
            self.refused += 1;
        } else {
            self.messages += 1;
        }
        read.flatten()
    }

    /// `None` where it is no proper sentence; otherwise the fix that it completes, if any.
    fn read(&mut self, text: &str) -> Option<Option<GnssFix>> {
        if !text.is_ascii() {
            return None;
        }
        let mut sentence = match parse_nmea_sentence(text) {
            Ok(sentence) if sentence.calc_checksum() == sentence.checksum => sentence,
            Ok(_) => return None,
            // Sentences of a maker's own, and those that the crate does not know.
            Err(_) => return is_whole(text).then_some(None),
        };
        match sentence.message_id {
            SentenceType::GGA => parse_gga(sentence).ok().map(|gga| self.gga(&gga)),
            SentenceType::GST => parse_gst(sentence).ok().map(|gst| self.gst(&gst)),
            SentenceType::RMC => {
                let mended = without_variation(sentence.data);
                sentence.data = &mended;
                parse_rmc(sentence).ok().map(|rmc| self.rmc(&rmc))
            }
            _ => Some(None),
        }
    }

    fn rmc(&mut self, rmc: &RmcData) -> Option<GnssFix> {
        let time = of_day(rmc.fix_time?);
        if let Some(date) = rmc.fix_date {
            let midnight = date.and_time(NaiveTime::MIN).and_utc().timestamp_millis();
            self.date = Some((seconds(midnight), time));
        }
        if rmc.status_of_fix == RmcStatusOfFix::Invalid {
            return None;
        }
        let speed_mps = f64::from(rmc.speed_over_ground?) * KNOT_MPS;
        let velocity = over_ground(speed_mps, f64::from(rmc.true_course?), 0.0)?;
        self.velocity = Some((time, velocity));
        let fix = self.fix_at(time).filter(|fix| fix.velocity_mps != Some(velocity))?;
        self.repeat(GnssFix { velocity_mps: Some(velocity), ..fix })
    }

    /// The fix of a time of the day, if it is the last one.
    fn fix_at(&self, time: f64) -> Option<GnssFix> {
        let (of, fix) = self.gga?;
        ((of - time).abs() < 1e-3 && fix.place.is_some()).then_some(fix)
    }

    /// The last fix with what came after it.
    fn repeat(&mut self, fix: GnssFix) -> Option<GnssFix> {
        let (_, last) = self.gga.as_mut()?;
        *last = fix;
        Some(fix)
    }

    fn gga(&mut self, gga: &GgaData) -> Option<GnssFix> {
        let height = gga.altitude.map(f64::from).filter(|alt| alt.is_finite());
        let geoid = gga.geoid_separation.map(f64::from).filter(|alt| alt.is_finite());
        let flat = height.is_none();
        let quality = gga.fix_type.map_or(FixQuality::None, quality);
        if quality > FixQuality::None && !flat {
            self.alt_m = height.map(|height| height + geoid.unwrap_or(0.0));
        }
        let placed = (quality > FixQuality::None)
            .then(|| Geodetic::new(gga.latitude?, gga.longitude?, self.alt_m?).ok());
        let place = placed.flatten();
        let time = gga.fix_time.map(of_day);
        let fix = GnssFix {
            utc_s: time.and_then(|time| self.utc(time)),
            place,
            flat,
            quality: place.map_or(FixQuality::None, |_| quality),
            sigma_m: time.and_then(|time| at(self.gst, time)),
            velocity_mps: time.and_then(|time| at(self.velocity, time)),
            satellites: gga.fix_satellites,
            hdop: gga.hdop.map(f64::from).and_then(sane),
        };
        self.gga = time.map(|time| (time, fix));
        Some(fix)
    }

    fn gst(&mut self, gst: &GstData) -> Option<GnssFix> {
        let time = of_day(gst.time?);
        let [east, north, up] = [gst.long_sd, gst.lat_sd, gst.alt_sd].map(|sd| sd.map(f64::from));
        let sigma = sane_sigma(east?, north?, up?)?;
        self.gst = Some((time, sigma));
        let fix = self.fix_at(time).filter(|fix| fix.sigma_m != Some(sigma))?;
        self.repeat(GnssFix { sigma_m: Some(sigma), ..fix })
    }

    /// UNIX time of a time of the day, on the day that brings it next to the last date.
    fn utc(&self, time: f64) -> Option<f64> {
        let (midnight, dated) = self.date?;
        let days = ((dated - time) / DAY_S).round();
        Some(midnight + time + days * DAY_S)
    }
}

/// Returns the value of another sentence at a time of the day, unless it is too old then.
fn at(companion: Option<(f64, Vector3<f64>)>, time: f64) -> Option<Vector3<f64>> {
    let (of, value) = companion?;
    let age = (time - of).rem_euclid(DAY_S);
    (age <= COMPANION_AGE_S).then_some(value)
}

/// Returns true if it is a sentence by its checksum, whatever its content.
fn is_whole(text: &str) -> bool {
    let Some((body, sum_digits)) = text.strip_prefix('$').and_then(|rest| rest.split_once('*'))
    else {
        return false;
    };
    let sum = body.bytes().fold(0, |sum, byte| sum ^ byte);
    sum_digits.get(..2).and_then(|digits| u8::from_str_radix(digits, 16).ok()) == Some(sum)
}

/// An RMC without its magnetic variation: it is not needed, and the crate refuses one that has no
/// direction.
fn without_variation(data: &str) -> String {
    let keep = |(at, field)| if matches!(at, 9 | 10) { "" } else { field };
    data.split(',').enumerate().map(keep).collect::<Vec<_>>().join(",")
}

/// Seconds since midnight.
fn of_day(time: NaiveTime) -> f64 {
    f64::from(time.num_seconds_from_midnight()) + f64::from(time.nanosecond()) * 1e-9
}

fn quality(fix: FixType) -> FixQuality {
    match fix {
        FixType::Invalid => FixQuality::None,
        FixType::Gps | FixType::Pps => FixQuality::Autonomous,
        FixType::DGps => FixQuality::Differential,
        FixType::Rtk => FixQuality::RtkFixed,
        FixType::FloatRtk => FixQuality::RtkFloat,
        FixType::Estimated | FixType::Manual | FixType::Simulation => FixQuality::Estimated,
    }
}
