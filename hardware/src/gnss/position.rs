use foxhunt_wire::{FixQuality, geodesy::Geodetic};
use nalgebra::Vector3;

use super::GnssError;

/// Where a receiver's antenna is now, and how uncertain that is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GnssPosition {
    /// Where it was at the last fix.
    pub place: Geodetic,
    /// σ of East, North and Up in metres now, with what may have happened since.
    pub sigma_m: Vector3<f64>,
    /// What the fix rests on.
    pub quality: FixQuality,
    /// How long ago the fix came, in seconds.
    pub age_s: f64,
}

/// Something that knows where its antenna is.
pub trait Positioning {
    /// Where the antenna is now. Never blocks; to be asked several times a second, because this is when
    /// the receiver is listened to.
    ///
    /// # Errors
    ///
    /// That there is no fix, or none that is young enough.
    fn position(&mut self) -> Result<GnssPosition, GnssError>;
}

macro_rules! forward {
    ($pointer:ty) => {
        impl<G: Positioning + ?Sized> Positioning for $pointer {
            fn position(&mut self) -> Result<GnssPosition, GnssError> {
                (**self).position()
            }
        }
    };
}

forward!(&mut G);
forward!(Box<G>);
