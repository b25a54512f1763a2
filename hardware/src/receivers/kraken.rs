//! Bearings of a KrakenSDR from the page that it serves, and its check.

use std::{f64::consts::TAU, io};

use foxhunt_core::{
    BeaconId, Clock, PatternSource, Pose, Sample, Sweep, Vehicle, angle, parameter::FieldError,
};
use foxhunt_wire::{
    ByteStream,
    receivers::{HttpError, HttpResponse, KrakenDoa, KrakenError},
};
use nalgebra::Vector3;

use super::{KrakenConfig, KrakenSourceError};
use crate::Finding;

/// Number of positions of a pseudo-spectrum.
const POSITIONS: u16 = 360;

/// Pauses after which waiting ends, whatever the clock shows.
const PAUSES: u32 = 1_000_000;

/// A `KrakenSDR` as a source of turns that take no turning: its pseudo-spectrum is the pattern, one
/// sample for each of 360 directions. Their mean in dB is the power that it measured, as the mean
/// over a turn of an antenna is the level of the place: how deep the spectrum is says nothing of
/// the power.
///
/// The page is fetched again and again over connections that `open` makes. What stands in it when a
/// turn begins was measured before; a beacon's first new line is its turn. A line that is torn is
/// left out. Pose and time are those at which the line was read.
#[derive(Debug)]
pub struct KrakenSource<S, O, V, C> {
    config: KrakenConfig,
    open: O,
    vehicle: V,
    clock: C,
    page: Option<Page<S>>,
    requested_at: f64,
    begun_at: f64,
    beacons: Vec<Turn>,
    /// Number of these that were lent.
    lent: usize,
    /// A sweep is lent from here on.
    complete: bool,
    last_pose: Pose,
}

/// Present turn of one beacon.
#[derive(Clone, Debug)]
struct Turn {
    beacon: BeaconId,
    frequency_hz: f64,
    /// The line that stood there before.
    before_ms: Option<u64>,
    time: f64,
    receiver: Option<Pose>,
    sigma: Option<Vector3<f64>>,
    samples: Vec<Sample>,
}

impl<S, O, V, C> KrakenSource<S, O, V, C>
where
    S: ByteStream,
    O: FnMut() -> io::Result<S>,
    V: Vehicle,
    C: Clock,
{
    /// A source whose page is fetched over what `open` connects to.
    ///
    /// # Errors
    ///
    /// [`FieldError`] names what is wrong in `config`.
    pub fn new(config: KrakenConfig, open: O, vehicle: V, clock: C) -> Result<Self, FieldError> {
        config.check()?;
        Ok(Self {
            config,
            open,
            vehicle,
            clock,
            page: None,
            requested_at: f64::NEG_INFINITY,
            begun_at: 0.0,
            beacons: Vec::new(),
            lent: 0,
            complete: false,
            last_pose: Pose::default(),
        })
    }

    /// Fetches the page; its text, once.
    fn fetch(&mut self, now: f64) -> Result<Option<String>, KrakenSourceError<V::Error>> {
        if self.page.is_none() {
            if now < self.requested_at + self.config.spacing_s {
                return Ok(None);
            }
            self.requested_at = now;
            let stream = (self.open)().map_err(KrakenSourceError::Stream)?;
            let page = Page::request(stream, &self.config.host, &self.config.path, now);
            self.page = Some(page.map_err(KrakenSourceError::Stream)?);
        }
        let Some(page) = &mut self.page else { return Ok(None) };
        let late = now > page.requested_at + self.config.page_timeout_s;
        match page.poll() {
            Ok(None) if late => {
                self.page = None;
                Err(KrakenSourceError::Timeout { seconds: self.config.page_timeout_s })
            }
            Ok(None) => Ok(None),
            Ok(Some(body)) => {
                self.page = None;
                Ok(Some(String::from_utf8_lossy(&body).into_owned()))
            }
            Err(error) => {
                self.page = None;
                Err(match error {
                    PageError::Stream(error) => KrakenSourceError::Stream(error),
                    PageError::Http(error) => KrakenSourceError::Http(error),
                })
            }
        }
    }

    /// Takes a line for the beacon whose channel it is.
    fn take(&mut self, line: &KrakenDoa, now: f64) -> Result<(), KrakenSourceError<V::Error>> {
        let tolerance = self.config.tolerance_hz;
        let theirs = |turn: &&mut Turn| {
            turn.receiver.is_none() && (turn.frequency_hz - line.frequency_hz).abs() <= tolerance
        };
        let Some(turn) = self.beacons.iter_mut().find(theirs) else { return Ok(()) };
        let before = *turn.before_ms.get_or_insert(line.unix_ms);
        if line.unix_ms <= before || line.confidence < self.config.least_confidence {
            return Ok(());
        }
        let receiver = self.vehicle.pose().map_err(KrakenSourceError::Vehicle)?;
        if !receiver.is_finite() {
            return Ok(());
        }
        let mean = line.spectrum_db.iter().sum::<f64>() / f64::from(POSITIONS);
        let level = line.power_db + self.config.calibration_db - mean;
        let front = receiver.heading + self.config.mount_offset_rad;
        let sample = |(position, value): (u16, &f64)| {
            let aside = TAU * f64::from(position) / f64::from(POSITIONS);
            let boresight = angle::wrap(front + aside);
            Sample { time: now, receiver, boresight, position, rss_dbm: level + value }
        };
        turn.samples = (0..POSITIONS).zip(&line.spectrum_db).map(sample).collect();
        (turn.time, turn.receiver) = (now, Some(receiver));
        turn.sigma = self.vehicle.position_sigma();
        self.last_pose = receiver;
        Ok(())
    }
}

impl<S, O, V, C> PatternSource for KrakenSource<S, O, V, C>
where
    S: ByteStream,
    O: FnMut() -> io::Result<S>,
    V: Vehicle,
    C: Clock,
{
    type Error = KrakenSourceError<V::Error>;

    fn begin(&mut self, beacons: &[BeaconId]) -> Result<(), Self::Error> {
        let frequencies = &self.config.frequencies_hz;
        let turn = |beacon: &BeaconId| {
            let missing =
                KrakenSourceError::Beacon { beacon: beacon.0, beacons: frequencies.len() };
            let frequency_hz = *frequencies.get(usize::from(beacon.0)).ok_or(missing)?;
            Ok(Turn {
                beacon: *beacon,
                frequency_hz,
                before_ms: None,
                time: 0.0,
                receiver: None,
                sigma: None,
                samples: Vec::new(),
            })
        };
        self.beacons = beacons.iter().map(turn).collect::<Result<_, Self::Error>>()?;
        (self.lent, self.complete, self.begun_at) = (0, false, self.clock.now());
        // A page that is on its way was measured before.
        self.page = None;
        Ok(())
    }

    fn poll(&mut self) -> Result<Option<Sweep<'_>>, Self::Error> {
        if self.lent >= self.beacons.len() {
            return Ok(None);
        }
        let now = self.clock.now();
        if !self.complete {
            let late = now >= self.begun_at + self.config.turn_timeout_s;
            let fetched = self.fetch(now);
            if let Ok(Some(text)) = &fetched {
                for line in KrakenDoa::page(text).into_iter().flatten() {
                    self.take(&line, now)?;
                }
            }
            self.complete = late || self.beacons.iter().all(|turn| turn.receiver.is_some());
            if !self.complete {
                return fetched.map(|_| None);
            }
            // Where nothing was received only the vehicle knows.
            if self.beacons.iter().any(|turn| turn.receiver.is_none())
                && let Ok(pose) = self.vehicle.pose()
                && pose.is_finite()
            {
                self.last_pose = pose;
            }
        }
        let Some(turn) = self.beacons.get(self.lent) else { return Ok(None) };
        self.lent += 1;
        Ok(Some(Sweep {
            beacon: turn.beacon,
            time: if turn.receiver.is_some() { turn.time } else { now },
            receiver: turn.receiver.unwrap_or(self.last_pose),
            positions: POSITIONS,
            samples: &turn.samples,
            receiver_sigma_m: turn.sigma,
            ..Sweep::default()
        }))
    }
}

/// One page, which is fetched over a connection of its own.
#[derive(Debug)]
struct Page<S> {
    stream: S,
    response: HttpResponse,
    /// Time of the request.
    requested_at: f64,
}

/// Error of a page that does not come.
enum PageError {
    Stream(io::Error),
    Http(HttpError),
}

impl<S: ByteStream> Page<S> {
    /// Asks for it.
    fn request(mut stream: S, host: &str, path: &str, now: f64) -> io::Result<Self> {
        stream.send(&HttpResponse::request(host, path))?;
        Ok(Self { stream, response: HttpResponse::default(), requested_at: now })
    }

    /// The page, once it is complete.
    fn poll(&mut self) -> Result<Option<Vec<u8>>, PageError> {
        let mut chunk = [0; 4096];
        loop {
            match self.stream.receive(&mut chunk) {
                Ok(0) => return Ok(None),
                Ok(count) => {
                    let came = chunk.get(..count).unwrap_or_default();
                    if let Some(body) = self.response.push(came).map_err(PageError::Http)? {
                        return Ok(Some(body));
                    }
                }
                Err(error) if error.kind() == io::ErrorKind::UnexpectedEof => {
                    let response = std::mem::take(&mut self.response);
                    return response.end().map(Some).map_err(PageError::Http);
                }
                Err(error) => return Err(PageError::Stream(error)),
            }
        }
    }
}

impl<S, O, V, C> KrakenSource<S, O, V, C>
where
    S: ByteStream,
    O: FnMut() -> io::Result<S>,
    V: Vehicle,
    C: Clock,
{
    /// Reads the page once: from where each beacon is received now. `pause` is called while it
    /// waits, and has to let a little time pass.
    pub fn examine(&mut self, pause: &mut dyn FnMut()) -> Vec<Finding> {
        let remedy = "check that it runs, its address, and that its data output is \"Kraken App\"";
        for _ in 0..PAUSES {
            match self.fetch(self.clock.now()) {
                Ok(Some(text)) => return looked(&self.config, &KrakenDoa::page(&text)),
                Ok(None) => pause(),
                Err(error) => return vec![Finding::bad("KrakenSDR", error, remedy)],
            }
        }
        let seconds = self.config.page_timeout_s;
        let late = KrakenSourceError::<V::Error>::Timeout { seconds };
        vec![Finding::bad("KrakenSDR", late, remedy)]
    }
}

/// The beacons of a page.
fn looked(config: &KrakenConfig, lines: &[Result<KrakenDoa, KrakenError>]) -> Vec<Finding> {
    let look = |(index, hz): (usize, &f64)| {
        let subject = format!("beacon {index} ({:.3} MHz)", hz / 1e6);
        let theirs = |line: &&KrakenDoa| (line.frequency_hz - hz).abs() <= config.tolerance_hz;
        match lines.iter().flatten().find(theirs) {
            None => {
                let remedy =
                    "set one of its VFOs to this frequency, and its squelch below the beacon";
                Finding::bad(&subject, "there is no channel at this frequency", remedy)
            }
            Some(line) => {
                let degrees = line.direction().to_degrees();
                let level = line.power_db + config.calibration_db;
                let confidence = line.confidence;
                let text = format!(
                    "from {degrees:.0} degrees counter-clockwise of the front, {level:.1} dBm, \
                     confidence {confidence}"
                );
                if confidence < config.least_confidence {
                    let remedy = "go closer, or lower least_confidence";
                    Finding::bad(&subject, text, remedy)
                } else {
                    Finding::good(&subject, text)
                }
            }
        }
    };
    config.frequencies_hz.iter().enumerate().map(look).collect()
}
