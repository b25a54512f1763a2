//! An NTRIP caster with a station of the field.

use std::{io, ops::Range};

use foxhunt_core::{
    Clock,
    parameter::{FieldError, in_range},
};
use foxhunt_wire::{
    ByteStream,
    geodesy::Geodetic,
    nmea::Sentence,
    ntrip::basic,
    rtcm::{self, Frames},
};

use super::whole;
use crate::{Emulator, Interval, SimClock, SimError, World};

/// The longest request that is read, in lines.
const LONGEST_REQUEST: usize = 64;

/// The longest line that is read, in bytes.
const LONGEST_LINE: usize = 512;

/// Number of the station.
const STATION: u16 = 2003;

/// Numbers of the messages that make corrections.
const CORRECTIONS: Range<u16> = 1001..1300;

/// An emulated caster.
///
/// By default a station at 50.1° N 14.5° E 250 m behind the mountpoint `FOX`, once a second, for
/// anybody, never silent.
#[derive(Clone, Debug, PartialEq)]
pub struct EmulatedCasterConfig {
    /// Name of the only stream.
    pub mountpoint: String,
    /// User and password; anybody may have the stream if absent.
    pub credentials: Option<(String, String)>,
    /// Place of the station.
    pub station: Geodetic,
    /// Rate of the messages, per second.
    pub rate_hz: f64,
    /// Times when the station sends nothing.
    pub outages: Vec<Interval>,
}

impl Default for EmulatedCasterConfig {
    fn default() -> Self {
        Self {
            mountpoint: "FOX".into(),
            credentials: None,
            station: Geodetic { lat_deg: 50.1, lon_deg: 14.5, alt_m: 250.0 },
            rate_hz: 1.0,
            outages: Vec::new(),
        }
    }
}

impl EmulatedCasterConfig {
    fn check(&self) -> Result<(), FieldError> {
        in_range("rate_hz", self.rate_hz, 0.1..=20.0, "from 0.1 to 20")?;
        for (i, outage) in self.outages.iter().enumerate() {
            outage.check().map_err(|error| error.within(format_args!("outages[{i}]")))?;
        }
        Ok(())
    }
}

/// An NTRIP caster, versions 1 and 2, of one client at a time.
///
/// The frames are proper RTCM 3 of a station: 1005 (its place) and 1230 (no biases). There are no
/// observations in them: an emulated receiver takes any frame for a correction.
#[derive(Debug)]
pub struct EmulatedCaster<S> {
    stream: S,
    clock: SimClock,
    config: EmulatedCasterConfig,
    line: Vec<u8>,
    /// Lines of the request until now.
    request: Vec<String>,
    connections: u32,
    /// True in chunks of HTTP, false as it is; `None` without a client.
    client: Option<bool>,
    /// Number of the epoch that was sent last.
    sent: Option<f64>,
    /// Place that the client sent last: degrees North and East.
    rover: Option<(f64, f64)>,
}

impl<S: ByteStream> EmulatedCaster<S> {
    /// A caster by the world's time.
    ///
    /// # Errors
    ///
    /// [`SimError::Field`] names what is out of range.
    pub fn new(world: &World, config: EmulatedCasterConfig, stream: S) -> Result<Self, SimError> {
        config.check().map_err(|error| error.within("caster"))?;
        Ok(Self {
            stream,
            clock: world.clock(),
            config,
            line: Vec::new(),
            request: Vec::new(),
            connections: 0,
            client: None,
            sent: None,
            rover: None,
        })
    }

    /// Latitude and longitude in degrees that the client sent last, in a GGA.
    #[must_use]
    pub fn rover(&self) -> Option<(f64, f64)> {
        self.rover
    }

    fn listen(&mut self) -> io::Result<()> {
        let mut piece = [0; 512];
        loop {
            let count = self.stream.receive(&mut piece)?;
            if self.stream.connections() != self.connections {
                self.connections = self.stream.connections();
                self.client = None;
                self.request.clear();
                self.line.clear();
            }
            if count == 0 {
                return Ok(());
            }
            for &byte in piece.get(..count).unwrap_or(&piece) {
                if byte != b'\n' {
                    if self.line.len() < LONGEST_LINE {
                        self.line.push(byte);
                    }
                    continue;
                }
                let line = std::mem::take(&mut self.line);
                self.take(String::from_utf8_lossy(&line).trim_end())?;
            }
        }
    }

    /// Takes a line of a request, or a sentence of the client.
    fn take(&mut self, line: &str) -> io::Result<()> {
        let gga = line.strip_prefix("Ntrip-GGA:").map_or(line, str::trim);
        if let Ok(sentence) = Sentence::parse(gga)
            && sentence.kind() == "GGA"
        {
            self.rover = sentence.spot(1).ok().flatten().or(self.rover);
        }
        if line.starts_with("GET ") {
            self.client = None;
            self.request.clear();
        } else if self.request.is_empty() || self.request.len() >= LONGEST_REQUEST {
            return Ok(());
        }
        if !line.is_empty() {
            self.request.push(line.to_owned());
            return Ok(());
        }
        let request = std::mem::take(&mut self.request);
        let answer = self.answer(&request);
        self.emit(answer.as_bytes())
    }

    /// Answers a request, and takes its client in.
    fn answer(&mut self, request: &[String]) -> String {
        let field = |name: &str| {
            request.iter().skip(1).find_map(|line| {
                let (own, value) = line.split_once(':')?;
                own.eq_ignore_ascii_case(name).then(|| value.trim())
            })
        };
        let is_http = field("Ntrip-Version").is_some_and(|version| version.ends_with("2.0"));
        let path = request.first().and_then(|line| line.split(' ').nth(1)).unwrap_or_default();
        let config = &self.config;
        let mountpoint = &config.mountpoint;
        if path.trim_start_matches('/') != *mountpoint {
            if path.len() > 1 && is_http {
                return "HTTP/1.1 404 Not Found\r\nContent-Length: 0\r\nConnection: close\r\n\r\n"
                    .into();
            }
            let Geodetic { lat_deg, lon_deg, .. } = config.station;
            let authentication = if config.credentials.is_some() { 'B' } else { 'N' };
            let table = format!(
                "STR;{mountpoint};emulated;RTCM 3.2;1005(1),1230(1);2;GPS;NONE;CZE;{lat_deg:.2};\
                 {lon_deg:.2};1;0;foxhunt;none;{authentication};N;1000;\r\nENDSOURCETABLE\r\n"
            );
            let head = match is_http {
                true => {
                    "HTTP/1.1 200 OK\r\nNtrip-Version: Ntrip/2.0\r\nContent-Type: \
                         gnss/sourcetable\r\n"
                }
                false => "SOURCETABLE 200 OK\r\nContent-Type: text/plain\r\n",
            };
            return format!("{head}Content-Length: {}\r\n\r\n{table}", table.len());
        }
        let key = config.credentials.as_ref().map(|(user, password)| basic(user, password));
        let given = field("Authorization").and_then(|text| text.strip_prefix("Basic "));
        if key.is_some() && key.as_deref() != given {
            return format!(
                "HTTP/1.1 401 Unauthorized\r\nWWW-Authenticate: Basic realm=\"/{mountpoint}\"\r\n\
                 Content-Length: 0\r\nConnection: close\r\n\r\n"
            );
        }
        self.client = Some(is_http);
        match is_http {
            true => "HTTP/1.1 200 OK\r\nNtrip-Version: Ntrip/2.0\r\nContent-Type: \
                     gnss/data\r\nTransfer-Encoding: chunked\r\nConnection: close\r\n\r\n"
                .into(),
            false => "ICY 200 OK\r\n\r\n".into(),
        }
    }

    /// Sends bytes; without a client they are dropped.
    fn emit(&mut self, bytes: &[u8]) -> io::Result<()> {
        match self.stream.send(bytes) {
            Err(error) if error.kind() == io::ErrorKind::NotConnected => Ok(()),
            other => other,
        }
    }
}

impl<S: ByteStream> Emulator for EmulatedCaster<S> {
    fn serve(&mut self) -> io::Result<()> {
        self.listen()?;
        let now = self.clock.now();
        let number = (now * self.config.rate_hz + 1e-6).floor();
        let Some(chunked) = self.client else { return Ok(()) };
        let is_out = self.config.outages.iter().any(|outage| outage.contains(now));
        if is_out || self.sent.is_some_and(|sent| number <= sent) {
            return Ok(());
        }
        self.sent = Some(number);
        let mut frames = Vec::new();
        for message in [station_message(&self.config.station), biases_message()] {
            frames.extend(rtcm::frame(&message).unwrap_or_default());
        }
        if chunked {
            let length = format!("{:x}\r\n", frames.len());
            frames.splice(..0, length.into_bytes());
            frames.extend(b"\r\n");
        }
        self.emit(&frames)
    }
}

/// Corrections that a receiver has got.
#[derive(Clone, Debug, Default)]
pub(super) struct Corrected {
    frames: Frames,
    at: Option<f64>,
}

impl Corrected {
    /// Takes bytes that came at a time.
    pub(super) fn take(&mut self, bytes: &[u8], now: f64) {
        let Self { frames, at } = self;
        frames.take(bytes, &mut |frame| {
            if rtcm::message_number(frame).is_some_and(|number| CORRECTIONS.contains(&number)) {
                *at = Some(now);
            }
        });
    }

    /// True if the last one is no older than that.
    pub(super) fn is_within(&self, age_s: f64, now: f64) -> bool {
        self.at.is_some_and(|at| now - at <= age_s)
    }
}

/// Bits of a message, the highest first.
#[derive(Default)]
struct Bits {
    bytes: Vec<u8>,
    count: usize,
}

impl Bits {
    fn push(&mut self, value: i64, bits: u32) {
        for at in (0..bits).rev() {
            if self.count.is_multiple_of(8) {
                self.bytes.push(0);
            }
            if let Some(last) = self.bytes.last_mut()
                && value >> at & 1 == 1
            {
                *last |= 0x80 >> (self.count % 8);
            }
            self.count += 1;
        }
    }
}

/// Message 1005: the place of the station's antenna, in tenths of millimetres from the Earth's
/// middle.
fn station_message(place: &Geodetic) -> Vec<u8> {
    let [x, y, z] = <[f64; 3]>::from(place.to_ecef()).map(|metres| whole(metres * 1e4));
    let mut bits = Bits::default();
    bits.push(1005, 12);
    bits.push(STATION.into(), 12);
    // The year of the frame; GPS, GLONASS and Galileo; a real station.
    bits.push(0, 6);
    bits.push(0b1110, 4);
    bits.push(x, 38);
    // One oscillator, a reserved bit.
    bits.push(0b10, 2);
    bits.push(y, 38);
    bits.push(0, 2);
    bits.push(z, 38);
    bits.bytes
}

/// Message 1230: no biases of GLONASS.
fn biases_message() -> Vec<u8> {
    let mut bits = Bits::default();
    bits.push(1230, 12);
    bits.push(STATION.into(), 12);
    bits.push(0, 8);
    bits.bytes
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The example of RTCM 10403: station 2003 at (1114104.5999, −4850729.7108, 3975521.4643) m.
    #[test]
    fn the_station_is_the_example_of_the_standard_at_its_place() {
        let place = Geodetic::from_ecef(1_114_104.599_9, -4_850_729.710_8, 3_975_521.464_3);
        let message = station_message(&place.expect("on the ground"));
        // The standard's own receiver and oscillator differ, four and two bits.
        let own = [
            0x3e, 0xd7, 0xd3, 0x03, 0x82, 0x98, 0x0e, 0xde, 0xef, 0xb4, 0xb4, 0xbd, 0x62, 0xac,
            0x09, 0x41, 0x98, 0x6f, 0x33,
        ];
        assert_eq!(message, own, "{message:02x?}");
        assert_eq!(biases_message(), [0x4c, 0xe7, 0xd3, 0]);
    }

    #[test]
    fn bits_are_those_of_the_standard() {
        let mut bits = Bits::default();
        for (value, count) in [(1005, 12), (2003, 12), (0, 6), (0, 1), (0, 1), (0, 1), (0, 1)] {
            bits.push(value, count);
        }
        for (value, then) in [(11_141_045_999, 2), (-48_507_297_108, 2), (39_755_214_643, 0)] {
            bits.push(value, 38);
            bits.push(0, then);
        }
        assert_eq!(bits.bytes.len(), 19);
        // The standard's own bytes have the bits of the receiver and the oscillator besides.
        let z = [0x09, 0x41, 0x98, 0x6f, 0x33];
        assert_eq!(bits.bytes[14..], z, "{:x?}", bits.bytes);
    }
}
