use super::GnssFix;

/// Makes fixes of the bytes of a receiver, however they are cut, and finds its way back after bytes
/// that mean nothing. It holds a bounded number of bytes.
pub trait GnssDecoder {
    /// What it reads, such as `NMEA`.
    fn name(&self) -> &'static str;

    /// What the receiver is to be sent so that it tells its fixes; empty where it does so by itself.
    fn set_up(&self) -> Vec<u8>;

    /// Takes bytes; hands on each fix that they complete. A fix may be told once more when
    /// its σ comes later.
    fn decode(&mut self, bytes: &[u8], told: &mut dyn FnMut(GnssFix));

    /// Forgets what was begun and what the receiver said: it may be another one now.
    fn reset(&mut self);

    /// How many whole messages came until now, those included that are no fixes.
    fn messages(&self) -> u64;

    /// How many messages were refused until now: a wrong checksum, or not what they should be.
    fn refused(&self) -> u64;
}

impl<D: GnssDecoder + ?Sized> GnssDecoder for Box<D> {
    fn name(&self) -> &'static str {
        (**self).name()
    }
    fn set_up(&self) -> Vec<u8> {
        (**self).set_up()
    }
    fn decode(&mut self, bytes: &[u8], told: &mut dyn FnMut(GnssFix)) {
        (**self).decode(bytes, told);
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
