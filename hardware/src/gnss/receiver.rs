use std::{fmt, io};

use foxhunt_core::{Clock, parameter::FieldError};
use foxhunt_wire::ByteStream;
use nalgebra::Vector3;

use super::{GnssConfig, GnssDecoder, GnssError, GnssFix, GnssPosition, Positioning};

/// The most that is read at once, in pieces of 512 bytes: a stream that never runs dry must not
/// hold up the program.
const PIECES: usize = 128;

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
    /// Time at which a fix came last, or the receiver was set up.
    received_at: Option<f64>,
    connections: u32,
    bytes: u64,
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
            received_at: None,
            connections,
            bytes: 0,
        })
    }

    /// Takes what has come, and sets the receiver up where it is new or has fallen silent.
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
        }
        Ok(())
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
    pub(super) fn now(&self) -> f64 {
        self.clock.now()
    }

    /// The last place, if it is not too old.
    fn placed(&self) -> Result<GnssPosition, GnssError> {
        let satellites = self.last.and_then(|fix| fix.satellites);
        let none = GnssError::NoFix { satellites };
        let Some((fix, at)) = self.placed else { return Err(none) };
        let (Some(place), Some(sigma)) = (fix.place, self.config.sigma(&fix)) else {
            return Err(none);
        };
        let age_s = self.clock.now() - at;
        let limit_s = self.config.stale_s;
        if age_s > limit_s {
            return Err(GnssError::Stale { age_s, limit_s });
        }
        let moved = Vector3::repeat(self.config.speed_mps * age_s);
        let sigma_m = sigma.zip_map(&moved, f64::hypot);
        let velocity_mps = fix.velocity_mps;
        Ok(GnssPosition { place, sigma_m, velocity_mps, quality: fix.quality, age_s })
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
}
