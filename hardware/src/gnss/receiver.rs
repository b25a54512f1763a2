//! A GNSS receiver behind any stream: its last fix, how uncertain that is by now, and its check.

use std::{fmt, io};

use foxhunt_core::{Clock, parameter::FieldError};
use foxhunt_wire::{ByteStream, FixQuality, geodesy::Geodetic};
use nalgebra::Vector3;

use super::{
    Corrections, CorrectionsLost, GnssConfig, GnssDecoder, GnssFix, GnssKind, HeightOrigin,
};
use crate::Finding;

/// The most that is read at once, in pieces of 512 bytes: a stream that never runs dry must not
/// hold up the program.
const PIECES: usize = 128;

/// Time that a receiver is given for a place, in seconds.
const PATIENCE_S: f64 = 10.0;

/// The most pauses, for a clock that stands still.
const PAUSES: u32 = 100_000;

/// Greatest age of a heading, in seconds: compasses send several a second.
const HEADING_AGE_S: f64 = 1.5;

/// A σ of East or North above this, in metres, is worth a word: bearings at 100 m move by 3°.
const POOR_M: f64 = 5.0;

/// A GNSS receiver behind any stream: its last fix, how old that is and how uncertain by now.
///
/// σ² is that of the fix ([`GnssConfig::sigma`]) and the square of
/// [`speed_mps`](GnssConfig::speed_mps) times its age; a fix that is older than
/// [`stale_s`](GnssConfig::stale_s) is an error. Its age counts from when it came.
pub struct GnssReceiver<S, C, D> {
    config: GnssConfig,
    decoder: D,
    stream: S,
    clock: C,
    /// The last fix that had a place, and when it came.
    placed: Option<(GnssFix, f64)>,
    /// The last fix, with a place or without.
    last: Option<GnssFix>,
    /// The last heading, and when it came.
    heading: Option<(f64, f64)>,
    /// Time at which a fix came last, or the receiver was set up.
    received_at: Option<f64>,
    connections: u32,
    bytes: u64,
    corrections: Option<Corrections>,
}

impl<S, C, D: GnssDecoder> fmt::Debug for GnssReceiver<S, C, D> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("GnssReceiver")
            .field("decoder", &self.decoder.name())
            .field("placed", &self.placed)
            .field("last", &self.last)
            .finish_non_exhaustive()
    }
}

impl<S: ByteStream, C: Clock> GnssReceiver<S, C, Box<dyn GnssDecoder>> {
    /// A receiver of the configured kind.
    ///
    /// # Errors
    ///
    /// [`FieldError`] names the field that is out of range.
    pub fn new(config: GnssConfig, stream: S, clock: C) -> Result<Self, FieldError> {
        Self::with_decoder(config, config.decoder(), stream, clock)
    }
}

impl<S: ByteStream, C: Clock, D: GnssDecoder> GnssReceiver<S, C, D> {
    /// A receiver that is read by `decoder`, whatever kind is configured.
    ///
    /// # Errors
    ///
    /// [`FieldError`] names the field that is out of range.
    pub fn with_decoder(
        config: GnssConfig,
        decoder: D,
        stream: S,
        clock: C,
    ) -> Result<Self, FieldError> {
        config.check()?;
        let connections = stream.connections();
        Ok(Self {
            config,
            decoder,
            stream,
            clock,
            placed: None,
            last: None,
            heading: None,
            received_at: None,
            connections,
            bytes: 0,
            corrections: None,
        })
    }

    /// Forwards corrections to the receiver. They are taken for its kind already.
    #[must_use]
    pub fn with_corrections(self, corrections: Corrections) -> Self {
        Self { corrections: Some(corrections), ..self }
    }

    /// Returns its corrections, if it has any.
    pub fn corrections(&self) -> Option<&Corrections> {
        self.corrections.as_ref()
    }

    /// Takes the bytes received, and sets the receiver up if it is new or has fallen silent.
    ///
    /// # Errors
    ///
    /// Any error of the stream; the call may be repeated.
    pub fn poll(&mut self) -> io::Result<()> {
        let now = self.clock.now();
        let connections = self.stream.connections();
        if connections != self.connections {
            self.connections = connections;
            self.decoder.reset();
            self.received_at = None;
        }
        if self.received_at.is_none_or(|at| now - at >= self.config.silent_s) {
            let set_up = self.decoder.set_up();
            if !set_up.is_empty() {
                self.stream.send(&set_up)?;
            }
            self.received_at = Some(now);
        }
        let mut piece = [0; 512];
        for _ in 0..PIECES {
            let count = self.stream.receive(&mut piece)?;
            if count == 0 {
                break;
            }
            self.bytes = self.bytes.saturating_add(u64::try_from(count).unwrap_or(u64::MAX));
            let Self { decoder, placed, last, received_at, .. } = self;
            decoder.decode(piece.get(..count).unwrap_or(&piece), &mut |fix| {
                *received_at = Some(now);
                *last = Some(fix);
                if fix.place.is_some() {
                    *placed = Some((fix, now));
                }
            });
            self.heading = self.decoder.take_heading().map(|at| (at, now)).or(self.heading);
        }
        let Self { corrections, stream, placed, .. } = self;
        let Some(corrections) = corrections else { return Ok(()) };
        let fix = placed.as_ref().map(|(fix, at)| (fix, now - at));
        corrections.poll(now, fix, &mut |frame| stream.send(frame))
    }

    /// Returns the configuration.
    pub fn config(&self) -> &GnssConfig {
        &self.config
    }

    /// Returns the decoder.
    pub fn decoder(&self) -> &D {
        &self.decoder
    }

    /// Returns the last fix, with a place or without.
    pub fn last(&self) -> Option<&GnssFix> {
        self.last.as_ref()
    }

    /// Returns the number of bytes that have come.
    pub fn bytes(&self) -> u64 {
        self.bytes
    }

    /// The receiver's clock.
    fn now(&self) -> f64 {
        self.clock.now()
    }

    /// The last place, if it is not too old.
    fn placed(&self) -> Result<GnssPosition, GnssError> {
        let satellites = self.last.and_then(|fix| fix.satellites);
        let none = || GnssError::NoFix { satellites, missing: self.decoder.missing() };
        let Some((fix, at)) = self.placed else { return Err(none()) };
        let (Some(place), Some(sigma)) = (fix.place, self.config.sigma(&fix)) else {
            return Err(none());
        };
        let age_s = self.clock.now() - at;
        let limit_s = self.config.stale_s;
        if age_s > limit_s {
            return Err(GnssError::Stale { age_s, limit_s });
        }
        let moved = Vector3::repeat(self.config.speed_mps * age_s);
        let sigma_m = sigma.zip_map(&moved, f64::hypot);
        let velocity_mps = fix.velocity_mps;
        let young = |(_, at): &(f64, f64)| self.clock.now() - at <= HEADING_AGE_S;
        let heading = self.heading.filter(young).map(|(heading, _)| heading);
        let height = fix.height;
        let quality = fix.quality;
        Ok(GnssPosition { place, height, sigma_m, velocity_mps, heading, quality, age_s })
    }
}

/// A stream that fails is an error only once the last fix is too old: until then that one still
/// gives where the antenna is, less and less surely.
impl<S: ByteStream, C: Clock, D: GnssDecoder> Positioning for GnssReceiver<S, C, D> {
    fn position(&mut self) -> Result<GnssPosition, GnssError> {
        let polled = self.poll();
        let placed = self.placed();
        match polled {
            Err(error) if placed.is_err() => Err(error.into()),
            _ => placed,
        }
    }

    fn clock_s(&self) -> Option<f64> {
        Some(self.clock.now())
    }

    fn failure(&mut self) -> Option<GnssError> {
        let now = self.clock.now();
        self.corrections.as_mut()?.take_loss(now).map(GnssError::Corrections)
    }
}

/// Present place of a receiver's antenna, with its uncertainty.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GnssPosition {
    /// Place at the last fix.
    pub place: Geodetic,
    /// Origin of the place's height.
    pub height: HeightOrigin,
    /// σ of East, North and Up in metres now, with what may have happened since.
    pub sigma_m: Vector3<f64>,
    /// Velocity to East, North and Up in metres per second at the last fix, where that is known.
    pub velocity_mps: Option<Vector3<f64>>,
    /// Direction of the vehicle's nose in radians counter-clockwise from East, by a compass or two
    /// antennas, if one came lately.
    pub heading: Option<f64>,
    /// Quality of the fix.
    pub quality: FixQuality,
    /// Age of the fix, in seconds.
    pub age_s: f64,
}

/// Something that knows where its antenna is.
///
/// A measured chain of places:
///
/// ```
/// use foxhunt_core::Vehicle;
/// use foxhunt_hardware::{
///     CarriedConfig, CarriedVehicle, FixQuality, GnssError, GnssPosition, HeightOrigin,
///     Positioning,
/// };
/// use foxhunt_wire::geodesy::{Geodetic, LocalFrame};
/// use nalgebra::Vector3;
///
/// struct Surveyor(Geodetic);
///
/// impl Positioning for Surveyor {
///     fn position(&mut self) -> Result<GnssPosition, GnssError> {
///         Ok(GnssPosition {
///             place: self.0,
///             height: HeightOrigin::Fix,
///             sigma_m: Vector3::repeat(0.02),
///             velocity_mps: None,
///             heading: Some(1.0),
///             quality: FixQuality::RtkFixed,
///             age_s: 0.0,
///         })
///     }
/// }
///
/// let place = Geodetic { lat_deg: 50.1, lon_deg: 14.5, alt_m: 400.0 };
/// let frame = LocalFrame::new(place)?;
/// let mut walker = CarriedVehicle::new(CarriedConfig::default(), Surveyor(place), frame);
/// assert!(walker.pose()?.position.xy().norm() < 1e-6);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub trait Positioning {
    /// Returns the antenna's present place. Never blocks; to be called several times a second,
    /// because this is when the receiver is listened to.
    ///
    /// # Errors
    ///
    /// That there is no fix, or none that is young enough.
    fn position(&mut self) -> Result<GnssPosition, GnssError>;

    /// Returns the time of the receiver's clock in seconds; `None` if it has none. A
    /// [`CarriedVehicle`](super::CarriedVehicle) repeats its goals by this clock.
    fn clock_s(&self) -> Option<f64> {
        None
    }

    /// Returns once why the places are poorer than they should be, such as a loss of corrections;
    /// `None` if no failure is new.
    fn failure(&mut self) -> Option<GnssError> {
        None
    }
}

macro_rules! forward {
    ($pointer:ty) => {
        impl<G: Positioning + ?Sized> Positioning for $pointer {
            fn position(&mut self) -> Result<GnssPosition, GnssError> {
                (**self).position()
            }
            fn clock_s(&self) -> Option<f64> {
                (**self).clock_s()
            }
            fn failure(&mut self) -> Option<GnssError> {
                (**self).failure()
            }
        }
    };
}

forward!(&mut G);

forward!(Box<G>);

/// Error of a GNSS receiver: why there is no place.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum GnssError {
    /// The stream failed, and the last fix is too old by now, if there ever was one.
    #[error("the GNSS receiver: {0}")]
    Stream(#[from] io::Error),
    /// It has had no fix until now.
    #[error(
        "the GNSS receiver has no fix yet{}{}",
        satellites.map_or(String::new(), |n| format!("; it uses {n} satellites")),
        missing.as_ref().map_or(String::new(), |missing| format!("; {missing}"))
    )]
    NoFix {
        /// Number of satellites in use; `None` if it is not reported.
        satellites: Option<u32>,
        /// Sentence about what the receiver does not send ([`GnssDecoder::missing`]).
        missing: Option<String>,
    },
    /// The last fix is too old.
    #[error("the last GNSS fix is {age_s:.1} s old; at most {limit_s} s are allowed")]
    Stale {
        /// Age of the last fix, in seconds.
        age_s: f64,
        /// Greatest age that is allowed, in seconds.
        limit_s: f64,
    },
    /// No fix has had a height until now, which a flying vehicle needs.
    #[error(
        "no fix of the GNSS receiver has had a height: wait for a fourth satellite, or turn \
         sentences with a height on, such as GGA"
    )]
    NoHeight,
    /// The corrections have stopped, and the receiver goes on without them.
    #[error("the GNSS receiver has {0}")]
    Corrections(CorrectionsLost),
}

impl<S: ByteStream, C: Clock, D: GnssDecoder> GnssReceiver<S, C, D> {
    /// Looks at the receiver for at most 10 s: its protocol, its fix, the position's σ and age,
    /// and what mends what is wrong. `pause` is called while it waits.
    pub fn examine(&mut self, pause: &mut dyn FnMut()) -> Vec<Finding> {
        let begun = self.now();
        let mut position = self.position();
        for _ in 0..PAUSES {
            let is_settled = self.corrections.as_ref().is_none_or(Corrections::is_settled);
            if (position.is_ok() && is_settled) || self.now() - begun >= PATIENCE_S {
                break;
            }
            pause();
            position = self.position();
        }
        let mut findings = Vec::new();
        if let Err(GnssError::Stream(error)) = &position {
            let remedy =
                "check the cable, the port's name and who may open it; for gpsd, that it runs";
            findings.push(Finding::bad("link", error, remedy));
        }
        findings.push(self.speech());
        if self.decoder().messages() > 0 {
            findings.push(self.fix());
        }
        if let Some(missing) = self.decoder().missing() {
            let remedy = "set the receiver up to send it, or go on without";
            findings.push(Finding::bad("sentences", missing, remedy));
        }
        findings.extend(self.corrections.as_ref().map(|own| own.finding(self.now())));
        if let Ok(position) = position {
            findings.push(noise(&position));
            findings.push(self.age(&position));
        }
        findings
    }

    fn speech(&self) -> Finding {
        let name = self.decoder().name();
        let messages = self.decoder().messages();
        let refused = self.decoder().refused();
        let subject = "receiver";
        if messages > 0 && refused > messages / 10 {
            let text = format!("{name}, {messages} messages, {refused} more were damaged");
            let remedy =
                "use a shorter cable or a lower rate, and let no other program read the port";
            return Finding::bad(subject, text, remedy);
        }
        if messages > 0 {
            return Finding::good(subject, format!("{name}, {messages} messages"));
        }
        if self.bytes() == 0 {
            let remedy = match self.config().kind {
                GnssKind::Gpsd => "start gpsd with the receiver's port, and let it listen (-N -n)",
                _ => "check power, that its TX is at our RX, and the port's name",
            };
            return Finding::bad(subject, "it sends nothing", remedy);
        }
        let text = format!("{} bytes came, and none of them are {name}", self.bytes());
        Finding::bad(subject, text, "check the baud rate (9600, 38400 or 115200) and the kind")
    }

    fn fix(&self) -> Finding {
        let subject = "fix";
        let Some(last) = self.last() else {
            let remedy = match self.config().kind {
                GnssKind::Nmea => "turn its GGA sentences on, or at least RMC",
                GnssKind::Ublox => "turn UBX output on at this port, or use kind = \"nmea\"",
                GnssKind::Gpsd => "check that gpsd has a receiver: `gpspipe -w`",
            };
            return Finding::bad(subject, "it reports no position", remedy);
        };
        let satellites = last.satellites.map_or(String::new(), |n| format!(", {n} satellites"));
        let hdop = last.hdop.map_or(String::new(), |hdop| format!(", HDOP {hdop:.1}"));
        let text = format!("{}{satellites}{hdop}", last.quality.name());
        match last.quality {
            FixQuality::None => {
                Finding::bad(subject, text, "give its antenna a free sky and some minutes")
            }
            FixQuality::Estimated => {
                Finding::bad(subject, text, "it guesses: give its antenna a free sky")
            }
            _ if last.height.is_flat() => {
                let remedy = "wait for a fourth satellite, or turn sentences with a height on";
                Finding::bad(subject, text + ", no height", remedy)
            }
            FixQuality::RtkFloat => {
                Finding::bad(subject, text, "wait for the RTK fix, or check its corrections")
            }
            _ => Finding::good(subject, text),
        }
    }

    fn age(&self, position: &GnssPosition) -> Finding {
        let text = format!("{:.1} s", position.age_s);
        if position.age_s > self.config().stale_s / 2.0 {
            let remedy = "set its rate to 5 Hz, or raise stale_s if it is slow";
            return Finding::bad("age", text, remedy);
        }
        Finding::good("age", text)
    }
}

fn noise(position: &GnssPosition) -> Finding {
    let sigma = position.sigma_m;
    let text = format!("σ East {:.2} m, North {:.2} m, Up {:.2} m", sigma.x, sigma.y, sigma.z);
    if sigma.x.max(sigma.y) > POOR_M {
        let remedy = "move its antenna away from walls and trees, and from USB 3 cables";
        return Finding::bad("position noise", text, remedy);
    }
    Finding::good("position noise", text)
}
