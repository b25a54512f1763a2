use super::GnssFix;

/// Makes fixes of the bytes of a receiver, however they are cut, and finds its way back after bytes
/// that mean nothing. It holds a bounded number of bytes.
///
/// A decoder of lines with latitude, longitude and height:
///
/// ```
/// use foxhunt_hardware::{FixQuality, GnssDecoder, GnssFix};
/// use foxhunt_wire::geodesy::Geodetic;
///
/// #[derive(Default)]
/// struct Lines {
///     line: Vec<u8>,
///     messages: u64,
///     refused: u64,
/// }
///
/// fn place(line: &[u8]) -> Option<Geodetic> {
///     let text = str::from_utf8(line).ok()?;
///     let mut numbers = text.split_whitespace().map_while(|number| number.parse().ok());
///     Geodetic::new(numbers.next()?, numbers.next()?, numbers.next()?).ok()
/// }
///
/// impl GnssDecoder for Lines {
///     fn name(&self) -> &'static str {
///         "lines"
///     }
///
///     fn set_up(&self) -> Vec<u8> {
///         Vec::new()
///     }
///
///     fn decode(&mut self, bytes: &[u8], emit: &mut dyn FnMut(GnssFix)) {
///         for &byte in bytes {
///             if byte == b'\n' {
///                 let place = place(&self.line);
///                 self.line.clear();
///                 self.messages += u64::from(place.is_some());
///                 self.refused += u64::from(place.is_none());
///                 if place.is_some() {
///                     emit(GnssFix { place, quality: FixQuality::Autonomous, ..GnssFix::default() });
///                 }
///             } else if self.line.len() < 100 {
///                 self.line.push(byte);
///             }
///         }
///     }
///
///     fn reset(&mut self) {
///         self.line.clear();
///     }
///
///     fn messages(&self) -> u64 {
///         self.messages
///     }
///
///     fn refused(&self) -> u64 {
///         self.refused
///     }
/// }
///
/// let mut fixes = Vec::new();
/// let mut decoder = Lines::default();
/// decoder.decode(b"50.1 14.5 400\n50.1 14.", &mut |fix| fixes.push(fix));
/// assert_eq!((fixes.len(), decoder.messages(), decoder.refused()), (1, 1, 0));
/// ```
pub trait GnssDecoder {
    /// Returns the name of its protocol, such as `NMEA`.
    fn name(&self) -> &'static str;

    /// Returns the bytes to send to the receiver so that it sends fixes; empty if it does so by
    /// itself.
    fn set_up(&self) -> Vec<u8>;

    /// Takes bytes; hands on each fix that they complete. A fix may be repeated when
    /// its σ comes later.
    fn decode(&mut self, bytes: &[u8], emit: &mut dyn FnMut(GnssFix));

    /// Forgets what was begun and what came of the receiver: it may be another one now.
    fn reset(&mut self);

    /// Returns the number of whole messages until now, including those without a fix.
    fn messages(&self) -> u64;

    /// Returns the number of messages that were refused until now: a wrong checksum, or malformed.
    fn refused(&self) -> u64;
}

impl<D: GnssDecoder + ?Sized> GnssDecoder for Box<D> {
    fn name(&self) -> &'static str {
        (**self).name()
    }
    fn set_up(&self) -> Vec<u8> {
        (**self).set_up()
    }
    fn decode(&mut self, bytes: &[u8], emit: &mut dyn FnMut(GnssFix)) {
        (**self).decode(bytes, emit);
    }
    fn reset(&mut self) {
        (**self).reset();
    }
    fn messages(&self) -> u64 {
        (**self).messages()
    }
    fn refused(&self) -> u64 {
        (**self).refused()
    }
}
