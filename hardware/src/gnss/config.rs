use foxhunt_core::parameter::{FieldError, finite, not_negative, positive};
use foxhunt_wire::{FixQuality, geoid::GEOID_SIGMA_M};
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::{GnssDecoder, GnssFix, GpsdDecoder, HeightOrigin, NmeaDecoder, UbloxDecoder};

/// The protocol of a receiver.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum GnssKind {
    /// NMEA 0183: nearly every receiver.
    #[default]
    Nmea,
    /// UBX: receivers by u-blox, which also send accuracies.
    Ublox,
    /// The JSON of gpsd, usually at port 2947.
    Gpsd,
}

/// Settings of a GNSS receiver. Its endpoint is given apart.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct GnssConfig {
    /// Protocol of the receiver.
    pub kind: GnssKind,
    /// Distance of its antenna in front of the vehicle's middle, in metres.
    pub antenna_forward_m: f64,
    /// Distance of its antenna to the left of the vehicle's middle, in metres.
    pub antenna_left_m: f64,
    /// Height of its antenna above the vehicle's middle, in metres.
    pub antenna_up_m: f64,
    /// The most that the vehicle moves while fixes stay away, in metres per second: σ² grows by the
    /// square of this times the age of the fix.
    pub speed_mps: f64,
    /// Greatest age of a fix, in seconds.
    pub stale_s: f64,
    /// After how much silence the receiver is set up again, in seconds.
    pub silent_s: f64,
    /// σ is never taken for less than this.
    pub floors: GnssFloors,
    /// Ratio of the floor of Up to the horizontal one.
    pub up_factor: f64,
    /// Factor that gives σ where a receiver does not report it: the floor times this times the
    /// horizontal dilution of precision.
    #[serde(alias = "untold_factor")]
    pub unreported_factor: f64,
    /// σ of Up in metres where a fix has the height of an earlier one.
    pub flat_up_sigma_m: f64,
    /// σ of Up in metres where no fix has had a height, and sea level is assumed.
    pub unknown_up_sigma_m: f64,
}

/// The least σ of East and of North in metres, by what a fix rests on.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct GnssFloors {
    /// Dead reckoning.
    pub estimated_m: f64,
    /// The satellites alone.
    pub autonomous_m: f64,
    /// SBAS or DGNSS.
    pub differential_m: f64,
    /// The carrier's ambiguities open.
    pub rtk_float_m: f64,
    /// The carrier's ambiguities resolved.
    pub rtk_fixed_m: f64,
}

impl Default for GnssFloors {
    /// 10 m estimated, 1.3 m autonomous, 0.85 m differential, 0.2 m float, 0.01 m fixed. In the
    /// open a two-band receiver has circular errors probable of 1.5 m, 1.0 m with SBAS and 0.01 m
    /// with RTK (u-blox ZED-F9P data sheet), and σ = CEP / 1.177. Float and estimated are cautious
    /// guesses.
    fn default() -> Self {
        Self {
            estimated_m: 10.0,
            autonomous_m: 1.3,
            differential_m: 0.85,
            rtk_float_m: 0.2,
            rtk_fixed_m: 0.01,
        }
    }
}

impl GnssFloors {
    /// Returns the floor of a quality; `None` without a position.
    #[must_use]
    pub fn of(&self, quality: FixQuality) -> Option<f64> {
        match quality {
            FixQuality::None => None,
            FixQuality::Estimated => Some(self.estimated_m),
            FixQuality::Autonomous => Some(self.autonomous_m),
            FixQuality::Differential => Some(self.differential_m),
            FixQuality::RtkFloat => Some(self.rtk_float_m),
            FixQuality::RtkFixed => Some(self.rtk_fixed_m),
        }
    }
}

impl Default for GnssConfig {
    /// NMEA, the antenna in the vehicle's middle, 2 m/s, fixes of at most 5 s, set up again after 3
    /// s of silence, the default floors, twice that for Up, twice the floor times HDOP where σ is
    /// not reported, 50 m for an earlier height, 500 m for one that is unknown.
    fn default() -> Self {
        Self {
            kind: GnssKind::Nmea,
            antenna_forward_m: 0.0,
            antenna_left_m: 0.0,
            antenna_up_m: 0.0,
            speed_mps: 2.0,
            stale_s: 5.0,
            silent_s: 3.0,
            floors: GnssFloors::default(),
            up_factor: 2.0,
            unreported_factor: 2.0,
            flat_up_sigma_m: 50.0,
            unknown_up_sigma_m: 500.0,
        }
    }
}

/// Dilution of precision that is assumed if none is reported.
const UNREPORTED_HDOP: f64 = 2.0;

impl GnssConfig {
    /// Returns a decoder for the receiver's protocol.
    #[must_use]
    pub fn decoder(&self) -> Box<dyn GnssDecoder> {
        match self.kind {
            GnssKind::Nmea => Box::new(NmeaDecoder::new()),
            GnssKind::Ublox => Box::new(UbloxDecoder::new()),
            GnssKind::Gpsd => Box::new(GpsdDecoder::new()),
        }
    }

    /// Returns the antenna's place from the vehicle's middle: forward, left and up in metres.
    #[must_use]
    pub fn antenna(&self) -> Vector3<f64> {
        Vector3::new(self.antenna_forward_m, self.antenna_left_m, self.antenna_up_m)
    }

    /// σ of East, North and Up in metres of a fix when it comes: what the receiver reports, but
    /// not less than the floor; `None` where there is no place.
    #[must_use]
    pub fn sigma(&self, fix: &GnssFix) -> Option<Vector3<f64>> {
        fix.place?;
        let floor = self.floors.of(fix.quality)?;
        let floors = Vector3::new(floor, floor, floor * self.up_factor);
        let unreported = || floors * self.unreported_factor * fix.hdop.unwrap_or(UNREPORTED_HDOP);
        let mut sigma = fix.sigma_m.unwrap_or_else(unreported).sup(&floors);
        match fix.height {
            HeightOrigin::Fix => {}
            HeightOrigin::Geoid => sigma.z = sigma.z.hypot(GEOID_SIGMA_M),
            HeightOrigin::Earlier => sigma.z = sigma.z.max(self.flat_up_sigma_m),
            HeightOrigin::SeaLevel => sigma.z = sigma.z.max(self.unknown_up_sigma_m),
        }
        Some(sigma)
    }

    /// Refuses what cannot be.
    ///
    /// # Errors
    ///
    /// [`FieldError`] names the field and its value.
    pub fn check(&self) -> Result<(), FieldError> {
        let floors = &self.floors;
        for (field, value) in [
            ("antenna_forward_m", self.antenna_forward_m),
            ("antenna_left_m", self.antenna_left_m),
            ("antenna_up_m", self.antenna_up_m),
        ] {
            finite(field, value)?;
        }
        not_negative("speed_mps", self.speed_mps)?;
        for (field, value) in [
            ("stale_s", self.stale_s),
            ("silent_s", self.silent_s),
            ("floors.estimated_m", floors.estimated_m),
            ("floors.autonomous_m", floors.autonomous_m),
            ("floors.differential_m", floors.differential_m),
            ("floors.rtk_float_m", floors.rtk_float_m),
            ("floors.rtk_fixed_m", floors.rtk_fixed_m),
            ("up_factor", self.up_factor),
            ("unreported_factor", self.unreported_factor),
            ("flat_up_sigma_m", self.flat_up_sigma_m),
            ("unknown_up_sigma_m", self.unknown_up_sigma_m),
        ] {
            positive(field, value)?;
        }
        Ok(())
    }
}
