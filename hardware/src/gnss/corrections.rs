//! Corrections for a receiver: frames of RTCM 3 of an NTRIP caster, an endpoint or a file.

use std::{
    env, fmt,
    fs::{self, File},
    io::{self, Read, Seek, SeekFrom},
    path::{Path, PathBuf},
};

use foxhunt_core::parameter::{FieldError, positive};
use foxhunt_wire::{
    ByteStream, Endpoint, FixQuality,
    geoid::geoid_height_m,
    ntrip::{Answer, Chunks, Request, Version, answer},
    rtcm::{Frames, message_number},
};
use serde::{Deserialize, Serialize};

use super::{DAY_S, GnssFix, GnssKind, angle_field, sentence};
use crate::Finding;

/// The most that is read at once, in pieces of 512 bytes.
const PIECES: usize = 64;

/// Pause in seconds after a caster's refusal: casters ban clients that ask again and again.
const REFUSED_S: f64 = 30.0;

/// Least time between two requests to a caster, in seconds.
const REQUEST_S: f64 = 5.0;

/// Silence of a caster in seconds after which its stream is requested again.
const SILENT_S: f64 = 20.0;

/// Age in seconds of a fix that is still sent to a caster: virtual stations move by kilometres.
const NEAR_S: f64 = 60.0;

/// The most message types that are named.
const NAMED: usize = 12;

/// Greatest age of corrections unless configured, in seconds.
const STALE_S: f64 = 10.0;

/// Origin of the corrections of a receiver.
///
/// With a mountpoint the endpoint is an NTRIP caster; without one it sends RTCM 3 as it is. The
/// password stands in an environment variable or in a file of its own.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct CorrectionsConfig {
    /// Endpoint of a caster (`tcp:HOST:2101`), or of a device that sends RTCM 3.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub endpoint: Option<Endpoint>,
    /// File to which another program appends RTCM 3; its present content is skipped.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub file: Option<PathBuf>,
    /// Name of the caster's stream.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mountpoint: Option<String>,
    /// Version of NTRIP, 1 or 2; 2 if absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ntrip: Option<u8>,
    /// User at the caster.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub user: Option<String>,
    /// Environment variable with the password.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub password_env: Option<String>,
    /// File with the password in its first line.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub password_file: Option<PathBuf>,
    /// Interval in seconds at which the receiver's place is sent to the caster, for virtual
    /// stations; never sent if absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gga_s: Option<f64>,
    /// Age in seconds above which corrections count as lost; 10 if absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stale_s: Option<f64>,
}

/// Error of a configuration of corrections.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CorrectionsConfigError {
    /// No source is given, or two.
    #[error("corrections come from either endpoint or file; {0} given")]
    Source(&'static str),
    /// A setting has no effect.
    #[error("{field} has no effect {reason}")]
    Unused {
        /// The setting.
        field: &'static str,
        /// Reason why it has none.
        reason: &'static str,
    },
    /// A setting is missing.
    #[error("{field} is missing: {reason}")]
    Missing {
        /// The setting.
        field: &'static str,
        /// Reason why it is needed.
        reason: &'static str,
    },
    /// A text is not allowed.
    #[error("{field} is {text:?}; it must be {allowed}")]
    Text {
        /// The setting.
        field: &'static str,
        /// Refused value of the setting.
        text: String,
        /// Allowed texts.
        allowed: &'static str,
    },
    /// A number is out of range.
    #[error(transparent)]
    Number(#[from] FieldError),
    /// The receiver gets its corrections otherwise.
    #[error(
        "gpsd passes nothing on to its receiver: give gpsd the caster itself \
         (gpsd ntrip://USER:PASSWORD@HOST:2101/MOUNTPOINT), or use kind = \"nmea\" or \"ublox\""
    )]
    Gpsd,
    /// The environment has no password.
    #[error("password_env: the environment has no variable {name:?} in Unicode")]
    Environment {
        /// Name of the variable.
        name: String,
    },
    /// A file cannot be read.
    #[error("{field}: {}: {source}", path.display())]
    File {
        /// The setting.
        field: &'static str,
        /// The file.
        path: PathBuf,
        /// Error of the system.
        source: io::Error,
    },
}

impl CorrectionsConfig {
    /// Takes relative paths from a folder.
    #[must_use]
    pub fn in_folder(self, folder: &Path) -> Self {
        let there = |path: Option<PathBuf>| path.map(|path| folder.join(path));
        Self { file: there(self.file), password_file: there(self.password_file), ..self }
    }

    /// Refuses settings that are out of range, missing or without effect for a kind of receiver.
    ///
    /// # Errors
    ///
    /// [`CorrectionsConfigError`] names the setting.
    pub fn check(&self, kind: GnssKind) -> Result<(), CorrectionsConfigError> {
        use CorrectionsConfigError::{Missing, Source, Text, Unused};
        if kind == GnssKind::Gpsd {
            return Err(CorrectionsConfigError::Gpsd);
        }
        match (&self.endpoint, &self.file) {
            (None, None) => return Err(Source("neither is")),
            (Some(_), Some(_)) => return Err(Source("both are")),
            _ => {}
        }
        positive("stale_s", self.stale_s.unwrap_or(STALE_S)).map_err(FieldError::from)?;
        positive("gga_s", self.gga_s.unwrap_or(1.0)).map_err(FieldError::from)?;
        let Some(mountpoint) = &self.mountpoint else {
            let of_casters = [
                ("ntrip", self.ntrip.is_some()),
                ("user", self.user.is_some()),
                ("password_env", self.password_env.is_some()),
                ("password_file", self.password_file.is_some()),
                ("gga_s", self.gga_s.is_some()),
            ];
            let unused = of_casters.into_iter().find(|(_, is_given)| *is_given);
            let reason = "without a mountpoint: it belongs to an NTRIP caster";
            return unused.map_or(Ok(()), |(field, _)| Err(Unused { field, reason }));
        };
        if self.file.is_some() {
            let reason = "with a file: it belongs to an NTRIP caster";
            return Err(Unused { field: "mountpoint", reason });
        }
        if let Some(endpoint) = self.endpoint.as_ref().filter(|_| self.host().is_none()) {
            let text = endpoint.to_string();
            let allowed = "tcp:HOST:PORT where there is a mountpoint";
            return Err(Text { field: "endpoint", text, allowed });
        }
        let is_plain = |text: &str| !text.is_empty() && text.bytes().all(|b| b.is_ascii_graphic());
        if !is_plain(mountpoint) || mountpoint.starts_with('/') {
            let allowed = "the name in the caster's source table, without a slash before it";
            return Err(Text { field: "mountpoint", text: mountpoint.clone(), allowed });
        }
        if let Some(version) = self.ntrip.filter(|version| !(1..=2).contains(version)) {
            return Err(FieldError::new("ntrip", f64::from(version), "1 or 2").into());
        }
        match (&self.user, &self.password_env, &self.password_file) {
            (Some(user), ..) if user.contains(|c: char| c == ':' || c.is_control()) => {
                let allowed = "a name without a colon and without line ends";
                return Err(Text { field: "user", text: user.clone(), allowed });
            }
            (_, Some(_), Some(_)) => {
                return Err(Unused { field: "password_file", reason: "beside password_env" });
            }
            (Some(_), None, None) => {
                let reason = "name an environment variable with it, or a file in password_file";
                return Err(Missing { field: "password_env", reason });
            }
            (None, Some(_), _) => {
                return Err(Unused { field: "password_env", reason: "without a user" });
            }
            (None, _, Some(_)) => {
                return Err(Unused { field: "password_file", reason: "without a user" });
            }
            _ => {}
        }
        Ok(())
    }

    /// Host and port of the caster.
    fn host(&self) -> Option<&str> {
        match &self.endpoint {
            Some(Endpoint::Tcp { address }) => Some(address),
            _ => None,
        }
    }

    /// User and password, the latter from the environment or its file.
    fn credentials(&self) -> Result<Option<(String, String)>, CorrectionsConfigError> {
        let Some(user) = &self.user else { return Ok(None) };
        let text = match (&self.password_env, &self.password_file) {
            (Some(name), _) => env::var(name)
                .map_err(|_| CorrectionsConfigError::Environment { name: name.clone() })?,
            (None, Some(path)) => fs::read_to_string(path).map_err(|source| {
                CorrectionsConfigError::File { field: "password_file", path: path.clone(), source }
            })?,
            (None, None) => String::new(),
        };
        let password = text.lines().next().unwrap_or_default();
        Ok(Some((user.clone(), password.to_owned())))
    }
}

/// Text of where corrections come from: it has no user and no password.
impl fmt::Display for CorrectionsConfig {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match (&self.endpoint, &self.file, &self.mountpoint) {
            (Some(endpoint), _, Some(mountpoint)) => write!(f, "{mountpoint} at {endpoint}"),
            (Some(endpoint), ..) => write!(f, "{endpoint}"),
            (None, Some(file), _) => write!(f, "{}", file.display()),
            (None, None, _) => write!(f, "nowhere"),
        }
    }
}

/// Loss of corrections: for how long, and why.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error(
    "no corrections from {origin} for {age_s:.1} s, {frames} frames before{}",
    reason.as_ref().map_or(String::new(), |reason| format!(": {reason}"))
)]
pub struct CorrectionsLost {
    /// Origin of the corrections.
    pub origin: String,
    /// Time since the last frame, or since the start, in seconds.
    pub age_s: f64,
    /// Number of frames until then.
    pub frames: u64,
    /// Reason, with its remedy, where one is known.
    pub reason: Option<String>,
}

/// Corrections on their way to a receiver ([`GnssReceiver::with_corrections`]).
///
/// Frames with a wrong CRC are not forwarded. After a refusal a caster is asked again in 30 s,
/// after 20 s of silence at once.
///
/// [`GnssReceiver::with_corrections`]: super::GnssReceiver::with_corrections
pub struct Corrections {
    config: CorrectionsConfig,
    credentials: Option<(String, String)>,
    stream: Box<dyn ByteStream>,
    state: State,
    /// The connection that was requested at.
    connections: u32,
    frames: Frames,
    /// Numbers of the messages that have come.
    numbers: Vec<u16>,
    began_at: Option<f64>,
    /// Time of the last whole frame.
    frame_at: Option<f64>,
    /// Time of the last bytes, or of the request.
    heard_at: f64,
    requested_at: Option<f64>,
    gga_at: Option<f64>,
    /// Time before which the stream is left alone.
    resumes_at: f64,
    /// Failure since the last whole frame.
    failure: Option<String>,
    /// True once the present loss was reported.
    is_reported: bool,
}

/// State of a connection.
#[derive(Debug)]
enum State {
    Idle,
    /// The caster's answer until now.
    Requested(Vec<u8>),
    /// Frames come, in chunks of HTTP or as they are.
    Streaming(Option<Chunks>),
}

/// Failure of a connection.
enum Failure {
    Stream(io::Error),
    /// The caster refuses; the text has the remedy.
    Refused(String),
    Silent,
}

impl From<io::Error> for Failure {
    fn from(error: io::Error) -> Self {
        Self::Stream(error)
    }
}

/// The password is left out.
impl fmt::Debug for Corrections {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Corrections")
            .field("origin", &self.config.to_string())
            .field("state", &self.state)
            .field("frames", &self.frames.whole())
            .field("failure", &self.failure)
            .finish_non_exhaustive()
    }
}

impl Corrections {
    /// Corrections of a configuration's endpoint, which is open, for a kind of receiver.
    ///
    /// # Errors
    ///
    /// [`CorrectionsConfigError`] names the setting that is out of range, or the password's source
    /// that cannot be read.
    pub fn new(
        config: CorrectionsConfig,
        kind: GnssKind,
        stream: Box<dyn ByteStream>,
    ) -> Result<Self, CorrectionsConfigError> {
        config.check(kind)?;
        let credentials = config.credentials()?;
        Ok(Self {
            config,
            credentials,
            connections: stream.connections(),
            stream,
            state: State::Idle,
            frames: Frames::default(),
            numbers: Vec::new(),
            began_at: None,
            frame_at: None,
            heard_at: 0.0,
            requested_at: None,
            gga_at: None,
            resumes_at: f64::NEG_INFINITY,
            failure: None,
            is_reported: false,
        })
    }

    /// Corrections that another program appends to the configuration's file.
    ///
    /// # Errors
    ///
    /// [`CorrectionsConfigError`] names the setting that is out of range, or the file.
    pub fn follow(
        config: CorrectionsConfig,
        kind: GnssKind,
    ) -> Result<Self, CorrectionsConfigError> {
        config.check(kind)?;
        let path = config.file.clone().ok_or(CorrectionsConfigError::Missing {
            field: "file",
            reason: "there is nothing to follow",
        })?;
        match Followed::open(&path) {
            Ok(file) => Self::new(config, kind, Box::new(file)),
            Err(source) => Err(CorrectionsConfigError::File { field: "file", path, source }),
        }
    }

    /// Number of whole frames until now.
    #[must_use]
    pub fn frames(&self) -> u64 {
        self.frames.whole()
    }

    /// Number of damaged frames until now, which were not forwarded.
    #[must_use]
    pub fn damaged(&self) -> u64 {
        self.frames.damaged()
    }

    /// Takes what has come and hands each whole frame to `forward`. `fix` is the receiver's last
    /// place with its age in seconds.
    ///
    /// # Errors
    ///
    /// The first error of `forward`. Its own stream's failures are kept as a
    /// [`loss`](Self::loss).
    pub(super) fn poll(
        &mut self,
        now: f64,
        fix: Option<(&GnssFix, f64)>,
        forward: &mut dyn FnMut(&[u8]) -> io::Result<()>,
    ) -> io::Result<()> {
        self.began_at.get_or_insert(now);
        if now < self.resumes_at {
            return Ok(());
        }
        let mut forwarded = Ok(());
        let served = self.serve(now, fix, &mut |frame| {
            if forwarded.is_ok() {
                forwarded = forward(frame);
            }
        });
        if let Err(failure) = served {
            self.fail(now, failure);
        }
        forwarded
    }

    fn serve(
        &mut self,
        now: f64,
        fix: Option<(&GnssFix, f64)>,
        emit: &mut dyn FnMut(&[u8]),
    ) -> Result<(), Failure> {
        if self.stream.connections() != self.connections {
            self.connections = self.stream.connections();
            self.begin_again();
        }
        if matches!(self.state, State::Idle) {
            if self.requested_at.is_some_and(|at| now - at < REQUEST_S) {
                return Ok(());
            }
            self.request(now)?;
        }
        let is_caster = self.config.mountpoint.is_some();
        if is_caster && now - self.heard_at >= SILENT_S {
            return Err(Failure::Silent);
        }
        let mut piece = [0; 512];
        for _ in 0..PIECES {
            let count = self.stream.receive(&mut piece)?;
            if count == 0 {
                break;
            }
            self.heard_at = now;
            self.take(now, piece.get(..count).unwrap_or(&piece), emit)?;
        }
        if let (State::Streaming(_), Some(gga_s), Some((fix, age_s))) =
            (&self.state, self.config.gga_s, fix)
            && age_s <= NEAR_S
            && self.gga_at.is_none_or(|at| now - at >= gga_s)
            && let Some(gga) = gga(fix)
        {
            self.stream.send(gga.as_bytes())?;
            self.gga_at = Some(now);
        }
        Ok(())
    }

    fn begin_again(&mut self) {
        self.state = State::Idle;
        self.frames.reset();
        self.gga_at = None;
    }

    /// Requests the stream, where its other end is a caster.
    fn request(&mut self, now: f64) -> Result<(), Failure> {
        let Some(mountpoint) = &self.config.mountpoint else {
            self.state = State::Streaming(None);
            return Ok(());
        };
        let credentials = self.credentials.as_ref();
        let request = Request {
            version: if self.config.ntrip == Some(1) { Version::One } else { Version::Two },
            host: self.config.host().unwrap_or_default(),
            mountpoint,
            credentials: credentials.map(|(user, password)| (user.as_str(), password.as_str())),
        };
        self.stream.send(request.text().as_bytes())?;
        // Sending may have opened the stream.
        self.connections = self.stream.connections();
        self.requested_at = Some(now);
        self.heard_at = now;
        self.state = State::Requested(Vec::new());
        Ok(())
    }

    /// Takes bytes of the stream.
    fn take(&mut self, now: f64, bytes: &[u8], emit: &mut dyn FnMut(&[u8])) -> Result<(), Failure> {
        let Self { frames, numbers, frame_at, failure, .. } = self;
        let mut whole = |frame: &[u8]| {
            *frame_at = Some(now);
            *failure = None;
            if let Some(number) = message_number(frame)
                && !numbers.contains(&number)
                && numbers.len() < NAMED
            {
                numbers.push(number);
                numbers.sort_unstable();
            }
            emit(frame);
        };
        match &mut self.state {
            State::Idle => Ok(()),
            State::Streaming(None) => {
                frames.take(bytes, &mut whole);
                Ok(())
            }
            State::Streaming(Some(chunks)) => chunks
                .take(bytes, &mut |content| frames.take(content, &mut whole))
                .map_err(|error| Failure::Refused(error.to_string())),
            State::Requested(head) => {
                head.extend(bytes);
                let Some((answer, length)) = answer(head) else { return Ok(()) };
                let Answer::Stream { chunked } = answer else {
                    return Err(Failure::Refused(self.refusal(&answer)));
                };
                let rest = head.get(length..).unwrap_or_default().to_vec();
                self.state = State::Streaming(chunked.then(Chunks::default));
                self.take(now, &rest, emit)
            }
        }
    }

    /// Refusal of a caster in words.
    fn refusal(&self, answer: &Answer) -> String {
        match answer {
            Answer::Unauthorised if self.credentials.is_none() => {
                "the caster wants a user and a password: set user, and password_env or \
                 password_file"
                    .into()
            }
            Answer::Unauthorised => "the caster refuses the user or the password: check user, and \
                                     the text in password_env or password_file"
                .into(),
            Answer::SourceTable | Answer::NotFound => {
                "the caster has no such mountpoint: take a name from its source table".into()
            }
            Answer::Other(line) => format!(
                "the answer {line:?} is not a stream of NTRIP: check host and port, or set ntrip \
                 = 1"
            ),
            Answer::Stream { .. } => String::new(),
        }
    }

    fn fail(&mut self, now: f64, failure: Failure) {
        self.begin_again();
        let text = match failure {
            Failure::Stream(error) => error.to_string(),
            Failure::Refused(text) => {
                self.resumes_at = now + REFUSED_S;
                self.stream.renew();
                text
            }
            Failure::Silent => {
                self.stream.renew();
                let hint = match self.config.gga_s {
                    None => "; a virtual station needs gga_s",
                    Some(_) => "",
                };
                format!("the caster sends nothing for {SILENT_S} s{hint}")
            }
        };
        // A link that is lost after a refusal hides its reason.
        if self.failure.is_none() || self.resumes_at > now {
            self.failure = Some(text);
        }
    }

    /// Loss of the corrections: the last frame is older than allowed, or none has come in that
    /// time.
    #[must_use]
    pub fn loss(&self, now: f64) -> Option<CorrectionsLost> {
        let age_s = now - self.frame_at.or(self.began_at)?;
        (age_s > self.config.stale_s.unwrap_or(STALE_S)).then(|| self.lost(age_s))
    }

    fn lost(&self, age_s: f64) -> CorrectionsLost {
        CorrectionsLost {
            origin: self.config.to_string(),
            age_s,
            frames: self.frames.whole(),
            reason: self.failure.clone(),
        }
    }

    /// Returns each loss once, when it begins.
    pub(super) fn take_loss(&mut self, now: f64) -> Option<CorrectionsLost> {
        let loss = self.loss(now);
        let was_reported = std::mem::replace(&mut self.is_reported, loss.is_some());
        loss.filter(|_| !was_reported)
    }

    /// True once a frame has come, or a caster has refused.
    pub(super) fn is_settled(&self) -> bool {
        self.frame_at.is_some() || self.resumes_at > f64::NEG_INFINITY
    }

    /// Finding about the corrections.
    pub(super) fn finding(&self, now: f64) -> Finding {
        let subject = "corrections";
        let age_s = self.frame_at.or(self.began_at).map_or(0.0, |at| now - at);
        let is_young = age_s <= self.config.stale_s.unwrap_or(STALE_S);
        if self.frame_at.is_none() || !is_young {
            let remedy = match self.failure {
                Some(_) => "mend the reason that is given here",
                None => {
                    "check the network, and that the station is on the air; a virtual station \
                     needs gga_s"
                }
            };
            return Finding::bad(subject, self.lost(age_s), remedy);
        }
        let numbers: Vec<String> = self.numbers.iter().map(u16::to_string).collect();
        let frames = self.frames.whole();
        let damaged = self.frames.damaged();
        let text = format!(
            "{}, {frames} frames ({}), {damaged} damaged, the last {age_s:.1} s old",
            self.config,
            numbers.join(", ")
        );
        if damaged > frames / 10 {
            let remedy = "check the cable or the rate of the link they come by";
            return Finding::bad(subject, text, remedy);
        }
        Finding::good(subject, text)
    }
}

/// GGA of a fix, as a caster takes it.
fn gga(fix: &GnssFix) -> Option<String> {
    let place = fix.place?;
    let quality = match fix.quality {
        FixQuality::None => return None,
        FixQuality::Autonomous => 1,
        FixQuality::Differential => 2,
        FixQuality::RtkFixed => 4,
        FixQuality::RtkFloat => 5,
        FixQuality::Estimated => 6,
    };
    let lat = angle_field(place.lat_deg, 2, ['N', 'S']);
    let lon_deg = if place.lon_deg > 180.0 { place.lon_deg - 360.0 } else { place.lon_deg };
    let lon = angle_field(lon_deg, 3, ['E', 'W']);
    let time = fix.utc_s.unwrap_or(0.0).rem_euclid(DAY_S).floor();
    let hours = (time / 3600.0).floor();
    let minutes = ((time - hours * 3600.0) / 60.0).floor();
    let seconds = time - hours * 3600.0 - minutes * 60.0;
    let satellites = fix.satellites.unwrap_or(10).min(99);
    let hdop = fix.hdop.unwrap_or(1.0);
    let geoid_m = geoid_height_m(&place);
    let above_sea_m = place.alt_m - geoid_m;
    Some(sentence(&format!(
        "GPGGA,{hours:02.0}{minutes:02.0}{seconds:02.0}.00,{lat},{lon},{quality},{satellites:02},\
         {hdop:.1},{above_sea_m:.1},M,{geoid_m:.1},M,,"
    )))
}

/// A file that another program appends to.
struct Followed {
    file: File,
    read: u64,
}

impl Followed {
    /// Opens a file at its end.
    fn open(path: &Path) -> io::Result<Self> {
        if !fs::metadata(path)?.is_file() {
            return Err(io::Error::new(io::ErrorKind::InvalidInput, "it is not a regular file"));
        }
        let mut file = File::open(path)?;
        let read = file.seek(SeekFrom::End(0))?;
        Ok(Self { file, read })
    }
}

impl ByteStream for Followed {
    fn receive(&mut self, into: &mut [u8]) -> io::Result<usize> {
        // It was emptied by its writer.
        if self.file.metadata()?.len() < self.read {
            self.read = self.file.seek(SeekFrom::Start(0))?;
        }
        let count = self.file.read(into)?;
        self.read = self.read.saturating_add(u64::try_from(count).unwrap_or(0));
        Ok(count)
    }

    fn send(&mut self, _bytes: &[u8]) -> io::Result<()> {
        Ok(())
    }
}
