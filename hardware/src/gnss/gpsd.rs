use chrono::DateTime;
use foxhunt_wire::{FixQuality, geodesy::compass_deg_to_radians};
use nalgebra::Vector3;
use serde::Deserialize;

use super::{
    GnssDecoder, GnssFix, HeightOrigin, Heights, Line, axis_of, over_ground, sane, sane_sigma,
    seconds,
};

/// The longest report that is read, in bytes; a sky of 150 satellites has 15 000.
const LONGEST: usize = 32_768;

/// Longest time by which a GST may precede its fix, in seconds.
const GST_AGE_S: f64 = 2.0;

/// Reads the JSON reports of gpsd (`gpsd_json(5)`): TPV, GST for σ, SKY for satellites and
/// dilution, and ATT for the heading.
///
/// A height above the sea alone is made one above the ellipsoid by EGM2008. Without a height the
/// fix is flat ([`HeightOrigin`](super::HeightOrigin)).
///
/// Without a GST of the same time or up to 2 s before, σ is `epx`, `epy` and `epv`. These come with
/// "certainty unknown", are often no more than dilutions times a constant, and are taken for one σ.
#[derive(Clone, Debug)]
pub struct GpsdDecoder {
    line: Line,
    reports: Reports,
}

/// Values of the reports until now.
#[derive(Clone, Copy, Debug, Default)]
struct Reports {
    satellites: Option<u32>,
    hdop: Option<f64>,
    heights: Heights,
    /// Heading since it was taken last.
    heading: Option<f64>,
    /// True once a position without a height came, and none with one.
    no_height: bool,
    /// Time and σ of the last GST.
    gst: Option<(f64, Vector3<f64>)>,
    messages: u64,
    refused: u64,
}

#[derive(Deserialize)]
#[serde(tag = "class")]
enum Report {
    #[serde(rename = "TPV")]
    Tpv(Tpv),
    #[serde(rename = "SKY")]
    Sky(Sky),
    #[serde(rename = "GST")]
    Gst(Gst),
    #[serde(rename = "ATT")]
    Att(Att),
    #[serde(other)]
    Other,
}

#[derive(Deserialize)]
struct Tpv {
    #[serde(default)]
    mode: u8,
    status: Option<u8>,
    time: Option<String>,
    lat: Option<f64>,
    lon: Option<f64>,
    #[serde(rename = "altHAE")]
    alt_hae: Option<f64>,
    #[serde(rename = "altMSL")]
    alt_msl: Option<f64>,
    /// Height above the sea, as old versions call it.
    alt: Option<f64>,
    #[serde(rename = "geoidSep")]
    geoid_separation: Option<f64>,
    epx: Option<f64>,
    epy: Option<f64>,
    epv: Option<f64>,
    eph: Option<f64>,
    /// Over ground, in metres per second.
    speed: Option<f64>,
    /// Course over ground, in degrees clockwise from true North.
    track: Option<f64>,
    /// In metres per second.
    climb: Option<f64>,
}

/// Standard deviations in metres.
#[derive(Deserialize)]
struct Gst {
    time: Option<String>,
    lat: Option<f64>,
    lon: Option<f64>,
    alt: Option<f64>,
}

#[derive(Deserialize)]
struct Att {
    /// In degrees clockwise from true North.
    heading: Option<f64>,
}

#[derive(Deserialize)]
struct Sky {
    hdop: Option<f64>,
    #[serde(rename = "uSat")]
    used: Option<u32>,
    #[serde(default)]
    satellites: Vec<Satellite>,
}

#[derive(Deserialize)]
struct Satellite {
    #[serde(default)]
    used: bool,
}

impl Default for GpsdDecoder {
    fn default() -> Self {
        Self::new()
    }
}

impl GpsdDecoder {
    /// A decoder without any bytes so far.
    #[must_use]
    pub fn new() -> Self {
        Self { line: Line::new(LONGEST, None), reports: Reports::default() }
    }
}

impl GnssDecoder for GpsdDecoder {
    fn name(&self) -> &'static str {
        "gpsd"
    }

    fn set_up(&self) -> Vec<u8> {
        b"?WATCH={\"enable\":true,\"json\":true};\n".to_vec()
    }

    fn decode(&mut self, bytes: &[u8], emit: &mut dyn FnMut(GnssFix)) {
        let Self { line, reports } = self;
        for &byte in bytes {
            if let Some(fix) = line.push(byte, |text| reports.report(text)).flatten() {
                emit(fix);
            }
        }
    }

    fn reset(&mut self) {
        self.line.clear();
        let Reports { messages, refused, .. } = self.reports;
        self.reports = Reports { messages, refused, ..Reports::default() };
    }

    fn messages(&self) -> u64 {
        self.reports.messages
    }

    fn refused(&self) -> u64 {
        self.reports.refused
    }

    fn take_heading(&mut self) -> Option<f64> {
        self.reports.heading.take()
    }

    fn missing(&self) -> Option<String> {
        self.reports
            .no_height
            .then(|| "gpsd has no height: its receiver sends neither GGA nor a 3D fix".to_owned())
    }
}

impl Reports {
    fn report(&mut self, text: &str) -> Option<GnssFix> {
        let Ok(report) = serde_json::from_str(text) else {
            self.refused += 1;
            return None;
        };
        self.messages += 1;
        match report {
            Report::Tpv(tpv) => Some(self.fix(&tpv)),
            Report::Sky(sky) => {
                let counted = sky.satellites.iter().filter(|satellite| satellite.used).count();
                // A part of the sky has no satellites: those known stay.
                let counted = u32::try_from(counted).ok().filter(|_| !sky.satellites.is_empty());
                self.satellites = sky.used.or(counted).or(self.satellites);
                self.hdop = sky.hdop.and_then(sane).or(self.hdop);
                None
            }
            Report::Gst(gst) => {
                let sigma = |gst: &Gst| sane_sigma(gst.lon?, gst.lat?, gst.alt?);
                self.gst = utc(gst.time.as_deref()).zip(sigma(&gst));
                None
            }
            Report::Att(att) => {
                let heading = att.heading.filter(|deg| deg.is_finite());
                self.heading = heading.map(compass_deg_to_radians).or(self.heading);
                None
            }
            Report::Other => None,
        }
    }

    fn fix(&mut self, tpv: &Tpv) -> GnssFix {
        let utc_s = utc(tpv.time.as_deref());
        let of_gst = self.gst.zip(utc_s).and_then(|((of, sigma), now)| {
            (-1e-3..=GST_AGE_S).contains(&(now - of)).then_some(sigma)
        });
        let above_sea = tpv.alt_msl.or(tpv.alt);
        let has_height = tpv.mode >= 3;
        let spot = tpv.lat.zip(tpv.lon).filter(|_| tpv.mode >= 2);
        let placed = spot.and_then(|(lat_deg, lon_deg)| match (tpv.alt_hae, above_sea) {
            (Some(alt_m), _) if has_height => self.heights.place(lat_deg, lon_deg, Some(alt_m)),
            (None, Some(above_sea)) if has_height => {
                self.heights.above_sea(lat_deg, lon_deg, Some((above_sea, tpv.geoid_separation)))
            }
            _ => self.heights.place(lat_deg, lon_deg, None),
        });
        let place = placed.map(|(place, _)| place);
        let height = placed.map(|(_, height)| height).unwrap_or_default();
        let flat = height.is_flat();
        if place.is_some() {
            self.no_height = height == HeightOrigin::SeaLevel;
        }
        let horizontal = tpv.eph.map(axis_of);
        let east = tpv.epx.or(horizontal);
        let north = tpv.epy.or(horizontal);
        let up = tpv.epv.or(if flat { east } else { None });
        GnssFix {
            utc_s,
            place,
            height,
            quality: place.map_or(FixQuality::None, |_| quality(tpv.status)),
            sigma_m: of_gst.or_else(|| sane_sigma(east?, north?, up?)),
            velocity_mps: tpv
                .speed
                .zip(tpv.track)
                .and_then(|(speed, track)| over_ground(speed, track, tpv.climb.unwrap_or(0.0))),
            satellites: self.satellites,
            hdop: self.hdop,
        }
    }
}

/// UNIX time of an ISO 8601 text, in seconds.
fn utc(text: Option<&str>) -> Option<f64> {
    let time = DateTime::parse_from_rfc3339(text?).ok()?;
    Some(seconds(time.timestamp_millis()))
}

/// Returns the quality of a status, in gpsd 3.20 and later; a position without one rests on the
/// satellites alone.
fn quality(status: Option<u8>) -> FixQuality {
    match status {
        Some(2) => FixQuality::Differential,
        Some(3) => FixQuality::RtkFixed,
        Some(4) => FixQuality::RtkFloat,
        // Dead reckoning, with and without satellites, and simulated.
        Some(5 | 6 | 8) => FixQuality::Estimated,
        _ => FixQuality::Autonomous,
    }
}
