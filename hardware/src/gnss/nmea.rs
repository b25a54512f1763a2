use chrono::{NaiveDate, NaiveTime};
use foxhunt_wire::{
    FixQuality,
    declination::declination_deg,
    geodesy::compass_deg_to_radians,
    nmea::{Malformed, Sentence},
};
use nalgebra::Vector3;

use super::{
    DAY_S, GnssDecoder, GnssFix, Heights, Leader, Line, over_ground, sane, sane_sigma, seconds,
};

/// The longest sentence that is read, in bytes. The standard has 82; some receivers send more.
const LONGEST: usize = 102;

/// Longest time by which a GST, a velocity or a height may precede its fix, in seconds: the last
/// one, at 1 Hz.
const COMPANION_AGE_S: f64 = 2.0;

/// Speed in knots below which a receiver that reports no course stands.
const STANDS_KNOTS: f64 = 0.1;

/// Metres per second in a knot.
const KNOT_MPS: f64 = 1852.0 / 3600.0;

/// Reads NMEA 0183 of any talker. A sentence without the right checksum is dropped.
///
/// The place comes from the best of these sentences that the receiver sends: GGA, GNS, RMC, GLL.
/// A poorer one counts from its second epoch on in which no better one came. RMC, GLL and some GGA
/// have no height: the fix is then flat ([`HeightOrigin`](super::HeightOrigin)). A height above
/// the sea without the geoid's separation is made one above the ellipsoid by EGM2008. A GGA
/// without a quality, or a GLL without a status, is an estimated place where no other sentence has
/// a status.
///
/// GST has σ, GSA the dilution, RMC and ZDA the date, RMC and VTG the velocity. These count for a
/// fix of the same moment or up to 2 s later; when they come after the fix of their moment, the fix
/// is repeated. RMC and VTG have no climb: Up is taken to be 0. A course is missing while the
/// receiver stands: below 0.1 knots the velocity is 0 then, and unknown above.
///
/// HDT and THS are headings, unless the THS is simulated or not valid. HDG and HDM are headings of
/// a magnetic compass, which are turned by the sentence's own variation, that of the RMC, or the
/// World Magnetic Model.
#[derive(Clone, Debug)]
pub struct NmeaDecoder {
    line: Line,
    sentences: Sentences,
}

/// The sentences with a place, from the poorest to the best.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Origin {
    /// A GGA without a quality, or a GLL without a status.
    Unsure,
    Gll,
    Rmc,
    Gns,
    Gga,
}

impl Origin {
    fn name(self) -> &'static str {
        match self {
            Self::Unsure => "sentence without a status",
            Self::Gll => "GLL",
            Self::Rmc => "RMC",
            Self::Gns => "GNS",
            Self::Gga => "GGA",
        }
    }
}

/// Height above the sea, and the geoid's above the ellipsoid if it is known.
type SeaHeight = (f64, Option<f64>);

/// A place as a sentence reports it.
#[derive(Clone, Copy, Debug)]
struct Report {
    origin: Origin,
    /// Time of the day.
    time: Option<f64>,
    /// Latitude and longitude in degrees.
    spot: Option<(f64, f64)>,
    quality: FixQuality,
    /// Height above the sea, and the geoid's above the ellipsoid.
    height: Option<SeaHeight>,
    satellites: Option<u32>,
    hdop: Option<f64>,
}

/// Motion as an RMC or a VTG reports it.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Motion {
    /// The sentence has no speed, so that the velocity of another one counts.
    Missing,
    /// The sentence is not valid, or a receiver that moves has no course.
    Unknown,
    Known(Vector3<f64>),
}

impl Motion {
    fn of(speed_knots: Option<f64>, course_deg_compass: Option<f64>, is_valid: bool) -> Self {
        let velocity = match (speed_knots, course_deg_compass) {
            _ if !is_valid => None,
            (None, _) => return Self::Missing,
            (Some(knots), Some(course)) => over_ground(knots * KNOT_MPS, course, 0.0),
            (Some(knots), None) => (knots.abs() < STANDS_KNOTS).then(Vector3::zeros),
        };
        velocity.map_or(Self::Unknown, Self::Known)
    }
}

/// Values of the sentences until now.
#[derive(Clone, Copy, Debug)]
struct Sentences {
    /// Beginning of the day of the last date, in seconds of UNIX time, and the time of that day.
    date: Option<(f64, f64)>,
    /// Time of the day and σ of the last GST.
    gst: Option<(f64, Vector3<f64>)>,
    /// Time of the day, if it is known, and velocity of the last RMC or VTG.
    velocity: Option<(Option<f64>, Vector3<f64>)>,
    /// Time of the day and height of the last GGA whose quality is missing.
    height: Option<(Option<f64>, SeaHeight)>,
    /// Time of the day, if it is known, and the last fix.
    fix: Option<(Option<f64>, GnssFix)>,
    heights: Heights,
    /// Dilution of the last GSA.
    hdop: Option<f64>,
    leader: Leader<Origin>,
    /// True once a sentence reported whether its place is valid.
    has_status: bool,
    /// Magnetic variation of the last RMC, in degrees East.
    variation_deg: Option<f64>,
    /// Heading since it was taken last.
    heading: Option<f64>,
    /// Number of headings of a compass since its variation was known last.
    compass_only: u64,
    /// Number of sentences without a checksum.
    unchecked: u64,
    messages: u64,
    refused: u64,
}

impl Sentences {
    fn new() -> Self {
        Self {
            date: None,
            gst: None,
            velocity: None,
            height: None,
            fix: None,
            heights: Heights::default(),
            hdop: None,
            leader: Leader::new(DAY_S),
            has_status: false,
            variation_deg: None,
            heading: None,
            compass_only: 0,
            unchecked: 0,
            messages: 0,
            refused: 0,
        }
    }
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
        Self { line: Line::new(LONGEST, Some(b'$')), sentences: Sentences::new() }
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
        self.sentences = Sentences { messages, refused, ..Sentences::new() };
    }

    fn messages(&self) -> u64 {
        self.sentences.messages
    }

    fn refused(&self) -> u64 {
        self.sentences.refused
    }

    fn take_heading(&mut self) -> Option<f64> {
        self.sentences.heading.take()
    }

    fn missing(&self) -> Option<String> {
        self.sentences.missing()
    }
}

impl Sentences {
    fn sentence(&mut self, text: &str) -> Option<GnssFix> {
        let read = Sentence::parse(text).and_then(|sentence| self.read(&sentence));
        match read {
            Ok(fix) => {
                self.messages += 1;
                fix
            }
            Err(malformed) => {
                self.refused += 1;
                self.unchecked += u64::from(malformed == Malformed::Unchecked);
                None
            }
        }
    }

    /// The fix that a sentence completes, if any.
    fn read(&mut self, sentence: &Sentence<'_>) -> Result<Option<GnssFix>, Malformed> {
        match sentence.kind() {
            "GGA" => self.gga(sentence),
            "GNS" => self.gns(sentence),
            "RMC" => self.rmc(sentence),
            "GLL" => self.gll(sentence),
            "GST" => self.gst(sentence),
            "VTG" => self.vtg(sentence),
            "GSA" => {
                self.hdop = sentence.number(15)?.and_then(sane).or(self.hdop);
                Ok(None)
            }
            "ZDA" => {
                let time = sentence.time(0)?;
                let numbers = (sentence.number(1)?, sentence.number(2)?, sentence.number(3)?);
                if let (Some(time), (Some(day), Some(month), Some(year))) = (time, numbers) {
                    self.dated(date(day, month, year)?, time);
                }
                Ok(None)
            }
            // A THS that is simulated or not valid has a number all the same.
            "THS" if !matches!(sentence.text(1), None | Some("A" | "E" | "M")) => Ok(None),
            "HDT" | "THS" => {
                self.heading = sentence.number(0)?.map(compass_deg_to_radians).or(self.heading);
                Ok(None)
            }
            "HDG" => {
                let own = sentence.signed(3, "E", "W")?;
                let deviation = sentence.signed(1, "E", "W")?.unwrap_or(0.0);
                self.compass(sentence.number(0)?.map(|deg| deg + deviation), own);
                Ok(None)
            }
            "HDM" => {
                self.compass(sentence.number(0)?, None);
                Ok(None)
            }
            _ => Ok(None),
        }
    }

    /// Takes the heading of a magnetic compass.
    fn compass(&mut self, magnetic_deg: Option<f64>, own_variation_deg: Option<f64>) {
        let Some(magnetic_deg) = magnetic_deg else { return };
        let by_model = || {
            let (_, fix) = self.fix?;
            declination_deg(&fix.place?, fix.utc_s?).ok()
        };
        match own_variation_deg.or(self.variation_deg).or_else(by_model) {
            Some(east) => {
                self.heading = Some(compass_deg_to_radians(magnetic_deg + east));
                self.compass_only = 0;
            }
            None => self.compass_only += 1,
        }
    }

    fn gga(&mut self, gga: &Sentence<'_>) -> Result<Option<GnssFix>, Malformed> {
        let time = gga.time(0)?;
        let spot = gga.spot(1)?;
        let geoid = gga.number(10)?;
        let height = gga.number(8)?.map(|height| (height, geoid));
        let (origin, quality) = match gga.text(5) {
            Some(text) => {
                self.has_status = true;
                (Origin::Gga, gga_quality(text)?)
            }
            // Another sentence reports whether this place is valid.
            None if self.has_status => {
                self.height = height.map(|height| (time, height));
                return Ok(None);
            }
            None => (Origin::Unsure, FixQuality::Estimated),
        };
        let satellites = gga.count(6)?;
        let hdop = gga.number(7)?.and_then(sane);
        Ok(self.place(Report { origin, time, spot, quality, height, satellites, hdop }))
    }

    fn gns(&mut self, gns: &Sentence<'_>) -> Result<Option<GnssFix>, Malformed> {
        let time = gns.time(0)?;
        let spot = gns.spot(1)?;
        let modes = gns.text(5).unwrap_or_default();
        let quality = modes.chars().map(mode_quality).max().unwrap_or_default();
        self.has_status = true;
        let geoid = gns.number(9)?;
        let height = gns.number(8)?.map(|height| (height, geoid));
        let satellites = gns.count(6)?;
        let hdop = gns.number(7)?.and_then(sane);
        let origin = Origin::Gns;
        Ok(self.place(Report { origin, time, spot, quality, height, satellites, hdop }))
    }

    fn rmc(&mut self, rmc: &Sentence<'_>) -> Result<Option<GnssFix>, Malformed> {
        let time = rmc.time(0)?;
        if let (Some(time), Some(text)) = (time, rmc.text(8)) {
            self.dated(short_date(text)?, time);
        }
        self.variation_deg = rmc.signed(9, "E", "W").ok().flatten().or(self.variation_deg);
        let spot = rmc.spot(2)?;
        let mode = rmc.text(11).and_then(|mode| mode.chars().next());
        let quality = match (rmc.text(1), mode) {
            (Some("A"), None) => FixQuality::Autonomous,
            (Some("A"), Some(mode)) => mode_quality(mode),
            (Some("D"), _) => FixQuality::Differential,
            (Some("V") | None, _) => FixQuality::None,
            (Some(_), _) => return Err(Malformed::Field),
        };
        self.has_status = true;
        let motion = Motion::of(rmc.number(6)?, rmc.number(7)?, quality > FixQuality::None);
        self.moves(motion, time);
        let report = Report { spot, quality, ..Report::without_height(Origin::Rmc, time) };
        if let Some(fix) = self.place(report) {
            return Ok(Some(fix));
        }
        Ok(time.and_then(|time| self.moved(motion, Some(time))))
    }

    fn gll(&mut self, gll: &Sentence<'_>) -> Result<Option<GnssFix>, Malformed> {
        let spot = gll.spot(0)?;
        let time = gll.time(4)?;
        let mode = gll.text(6).and_then(|mode| mode.chars().next());
        let quality = match (gll.text(5), mode) {
            (Some("A"), None) => FixQuality::Autonomous,
            (Some("A"), Some(mode)) => mode_quality(mode),
            (Some("V"), _) => FixQuality::None,
            (Some(_), _) => return Err(Malformed::Field),
            // So sends a receiver of before NMEA 2.0.
            (None, _) if self.has_status => return Ok(None),
            (None, _) => FixQuality::Estimated,
        };
        self.has_status |= gll.text(5).is_some();
        let origin = if gll.text(5).is_some() { Origin::Gll } else { Origin::Unsure };
        let report = Report { spot, quality, ..Report::without_height(origin, time) };
        Ok(self.place(report))
    }

    fn gst(&mut self, gst: &Sentence<'_>) -> Result<Option<GnssFix>, Malformed> {
        let time = gst.time(0)?;
        let numbers = (gst.number(6)?, gst.number(5)?, gst.number(7)?);
        let (Some(time), (Some(east), Some(north), Some(up))) = (time, numbers) else {
            return Ok(None);
        };
        let Some(sigma) = sane_sigma(east, north, up) else { return Ok(None) };
        self.gst = Some((time, sigma));
        let fix = self.fix_at(Some(time)).filter(|fix| fix.sigma_m != Some(sigma));
        Ok(fix.and_then(|fix| self.repeat(GnssFix { sigma_m: Some(sigma), ..fix })))
    }

    /// Course and speed, whose time is that of the last fix.
    fn vtg(&mut self, vtg: &Sentence<'_>) -> Result<Option<GnssFix>, Malformed> {
        let motion = Motion::of(vtg.number(4)?, vtg.number(0)?, vtg.text(8) != Some("N"));
        let Some((time, _)) = self.fix else { return Ok(None) };
        self.moves(motion, time);
        Ok(self.moved(motion, time))
    }

    fn dated(&mut self, date: NaiveDate, time: f64) {
        let midnight = date.and_time(NaiveTime::MIN).and_utc().timestamp_millis();
        self.date = Some((seconds(midnight), time));
    }

    /// Takes the motion of a time.
    fn moves(&mut self, motion: Motion, time: Option<f64>) {
        match motion {
            Motion::Missing => {}
            Motion::Unknown => self.velocity = None,
            Motion::Known(velocity) => self.velocity = Some((time, velocity)),
        }
    }

    /// The fix of a time, with another velocity that came after it.
    fn moved(&mut self, motion: Motion, time: Option<f64>) -> Option<GnssFix> {
        let velocity_mps = match motion {
            Motion::Missing => return None,
            Motion::Unknown => None,
            Motion::Known(velocity) => Some(velocity),
        };
        let fix = self.fix_at(time).filter(|fix| fix.velocity_mps != velocity_mps)?;
        self.repeat(GnssFix { velocity_mps, ..fix })
    }

    /// The fix of a time of the day, if it is the last one.
    fn fix_at(&self, time: Option<f64>) -> Option<GnssFix> {
        let (of, fix) = self.fix?;
        let same = match (of, time) {
            (Some(of), Some(time)) => (of - time).abs() < 1e-3,
            (None, None) => true,
            _ => false,
        };
        (same && fix.place.is_some()).then_some(fix)
    }

    /// The last fix with what came after it.
    fn repeat(&mut self, fix: GnssFix) -> Option<GnssFix> {
        let (_, last) = self.fix.as_mut()?;
        *last = fix;
        Some(fix)
    }

    fn place(&mut self, report: Report) -> Option<GnssFix> {
        let Report { origin, time, .. } = report;
        if !self.leader.leads(origin, Origin::Gga, time) {
            return None;
        }
        let beside = self.height.filter(|(of, _)| *of == time).map(|(_, height)| height);
        let spot = report.spot.filter(|_| report.quality > FixQuality::None);
        let placed = spot.and_then(|(lat_deg, lon_deg)| {
            self.heights.above_sea(lat_deg, lon_deg, report.height.or(beside))
        });
        let place = placed.map(|(place, _)| place);
        let velocity = match time {
            Some(time) => self.velocity.and_then(|(of, velocity)| at(Some((of?, velocity)), time)),
            // Once, as its age is unknown.
            None => self.velocity.take().map(|(_, velocity)| velocity),
        };
        let fix = GnssFix {
            utc_s: time.and_then(|time| self.utc(time)),
            place,
            height: placed.map(|(_, height)| height).unwrap_or_default(),
            quality: place.map_or(FixQuality::None, |_| report.quality),
            sigma_m: time.and_then(|time| at(self.gst, time)),
            velocity_mps: velocity.filter(|_| place.is_some()),
            satellites: report.satellites,
            hdop: report.hdop.or(self.hdop),
        };
        self.fix = Some((time, fix));
        Some(fix)
    }

    /// UNIX time of a time of the day, on the day that brings it next to the last date.
    fn utc(&self, time: f64) -> Option<f64> {
        let (midnight, dated) = self.date?;
        let days = ((dated - time) / DAY_S).round();
        Some(midnight + time + days * DAY_S)
    }

    fn missing(&self) -> Option<String> {
        let mut missing = Vec::new();
        if self.unchecked > 0 {
            missing.push(format!("{} sentences have no checksum and are not read", self.unchecked));
        }
        let leads = self.leader.leader();
        match (leads, self.leader.waits()) {
            (None, None) if self.messages > 0 => {
                missing.push("no sentence has a place: turn GGA, GNS, RMC or GLL on".to_owned());
            }
            (None, Some(origin)) => {
                missing.push(format!("one {} came, and its next one is waited for", origin.name()));
            }
            (Some(origin @ (Origin::Rmc | Origin::Gll)), _) => {
                let name = origin.name();
                missing.push(format!("the place comes from {name}, without a height: turn GGA on"));
            }
            _ => {}
        }
        if leads.is_some() && !self.has_status {
            missing.push("no sentence reports whether the place is valid".to_owned());
        }
        if leads.is_some() && self.date.is_none() {
            missing.push("there is no date: turn RMC or ZDA on".to_owned());
        }
        if self.compass_only > 0 {
            missing.push("the compass's variation is unknown until date and place are".to_owned());
        }
        (!missing.is_empty()).then(|| missing.join("; "))
    }
}

impl Report {
    fn without_height(origin: Origin, time: Option<f64>) -> Self {
        let quality = FixQuality::None;
        Self { origin, time, spot: None, quality, height: None, satellites: None, hdop: None }
    }
}

/// Returns the value of another sentence at a time of the day, unless it is too old then.
fn at(companion: Option<(f64, Vector3<f64>)>, time: f64) -> Option<Vector3<f64>> {
    let (of, value) = companion?;
    let age = (time - of).rem_euclid(DAY_S);
    (age <= COMPANION_AGE_S).then_some(value)
}

/// Quality by the number in a GGA.
fn gga_quality(text: &str) -> Result<FixQuality, Malformed> {
    Ok(match text {
        "0" => FixQuality::None,
        // Satellites, with the military's code too; 9 is of NovAtel, with the almanac alone.
        "1" | "3" => FixQuality::Autonomous,
        "2" => FixQuality::Differential,
        "4" => FixQuality::RtkFixed,
        "5" => FixQuality::RtkFloat,
        "6" | "7" | "8" | "9" => FixQuality::Estimated,
        _ => return Err(Malformed::Field),
    })
}

/// Quality by the letter of NMEA 2.3 and later.
fn mode_quality(mode: char) -> FixQuality {
    match mode {
        'A' | 'P' => FixQuality::Autonomous,
        'D' => FixQuality::Differential,
        'R' => FixQuality::RtkFixed,
        'F' => FixQuality::RtkFloat,
        'E' | 'M' | 'S' => FixQuality::Estimated,
        _ => FixQuality::None,
    }
}

/// The date of an RMC: day, month and two digits of the year. NMEA 0183 is of 1983.
fn short_date(text: &str) -> Result<NaiveDate, Malformed> {
    let is_proper = text.len() == 6 && text.bytes().all(|byte| byte.is_ascii_digit());
    let digits = text.parse::<u32>().ok().filter(|_| is_proper).ok_or(Malformed::Field)?;
    let year = digits % 100;
    let century = if year >= 83 { 1900 } else { 2000 };
    let [day, month, year] = [digits / 10_000, digits / 100 % 100, century + year].map(f64::from);
    date(day, month, year)
}

#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "it saturates, and such dates are refused"
)]
fn date(day: f64, month: f64, year: f64) -> Result<NaiveDate, Malformed> {
    NaiveDate::from_ymd_opt(year as i32, month as u32, day as u32).ok_or(Malformed::Field)
}
