use foxhunt_wire::{FixQuality, geodesy::Geodetic};
use nalgebra::Vector3;

use super::GnssError;

/// Present place of a receiver's antenna, with its uncertainty.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GnssPosition {
    /// Place at the last fix.
    pub place: Geodetic,
    /// σ of East, North and Up in metres now, with what may have happened since.
    pub sigma_m: Vector3<f64>,
    /// Velocity to East, North and Up in metres per second at the last fix, where that is known.
    pub velocity_mps: Option<Vector3<f64>>,
    /// Quality of the fix.
    pub quality: FixQuality,
    /// Age of the fix, in seconds.
    pub age_s: f64,
}

/// Something that knows where its antenna is.
///
/// An antenna on a surveyed mark:
///
/// ```
/// use foxhunt_core::Vehicle;
/// use foxhunt_hardware::{FixQuality, GnssError, GnssPosition, Positioning, StillVehicle};
/// use foxhunt_wire::geodesy::{Geodetic, LocalFrame};
/// use nalgebra::Vector3;
///
/// struct Mark(Geodetic);
///
/// impl Positioning for Mark {
///     fn position(&mut self) -> Result<GnssPosition, GnssError> {
///         Ok(GnssPosition {
///             place: self.0,
///             sigma_m: Vector3::repeat(0.02),
///             velocity_mps: Some(Vector3::zeros()),
///             quality: FixQuality::RtkFixed,
///             age_s: 0.0,
///         })
///     }
/// }
///
/// let place = Geodetic { lat_deg: 50.1, lon_deg: 14.5, alt_m: 400.0 };
/// let mut station = StillVehicle::new(Mark(place), LocalFrame::new(place)?);
/// assert!(station.pose()?.position.norm() < 1e-6);
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
