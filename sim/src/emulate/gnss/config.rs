use foxhunt_core::parameter::{FieldError, ParameterError, in_range, positive};
use foxhunt_wire::{
    FixQuality,
    geodesy::{Geodetic, LocalFrame},
};
use nalgebra::Vector3;

use crate::{Interval, SimError};

/// The protocol of an emulated receiver.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum EmulatedGnssKind {
    /// GGA, RMC, GST and GSA.
    #[default]
    Nmea,
    /// NMEA, as it comes from the factory, and UBX-NAV-PVT once that is requested.
    Ublox,
    /// gpsd, to a client that watches.
    Gpsd,
}

/// An emulated receiver.
///
/// By default an autonomous NMEA receiver at 5 Hz, at 50.1° N 14.5° E 250 m, σ 1.5 m on the
/// ground and 3 m in height, that forgets its errors within a minute; 14 satellites, HDOP 0.8;
/// never without a fix; time 0 of the world is 2026-01-01.
#[derive(Clone, Debug, PartialEq)]
pub struct EmulatedGnssConfig {
    /// Its protocol.
    pub kind: EmulatedGnssKind,
    /// The place of the world's zero.
    pub origin: Geodetic,
    /// The rate of its reports, per second.
    pub rate_hz: f64,
    /// The reported quality of its fix.
    pub quality: FixQuality,
    /// σ of East, North and Up in metres, which it also reports. UBX has one number for East and
    /// North.
    pub sigma_m: Vector3<f64>,
    /// The time in which the correlation of its errors falls to 1/e, in seconds.
    pub correlation_s: f64,
    /// The number of satellites that it uses.
    pub satellites: u8,
    /// The horizontal dilution of precision that it reports.
    pub hdop: f64,
    /// Height of the geoid above the ellipsoid, in metres.
    pub geoid_m: f64,
    /// Times when it has no fix, and reports so.
    pub outages: Vec<Interval>,
    /// UNIX time of the world's time 0, in seconds.
    pub utc_start_s: f64,
}

impl Default for EmulatedGnssConfig {
    fn default() -> Self {
        Self {
            kind: EmulatedGnssKind::default(),
            origin: Geodetic { lat_deg: 50.1, lon_deg: 14.5, alt_m: 250.0 },
            rate_hz: 5.0,
            quality: FixQuality::Autonomous,
            sigma_m: Vector3::new(1.5, 1.5, 3.0),
            correlation_s: 60.0,
            satellites: 14,
            hdop: 0.8,
            geoid_m: 45.0,
            outages: Vec::new(),
            utc_start_s: 1_767_225_600.0,
        }
    }
}

impl EmulatedGnssConfig {
    /// Sets the quality, and the σ that it has in the open, East, North and Up: 3, 3, 6 m
    /// estimated; 1.5, 1.5, 3 m autonomous; 0.9, 0.9, 1.8 m differential; 0.2, 0.2, 0.4 m float;
    /// 1.2, 1.2, 2 cm fixed.
    #[must_use]
    pub fn with_quality(self, quality: FixQuality) -> Self {
        let sigma_m = match quality {
            FixQuality::None => self.sigma_m,
            FixQuality::Estimated => Vector3::new(3.0, 3.0, 6.0),
            FixQuality::Autonomous => Vector3::new(1.5, 1.5, 3.0),
            FixQuality::Differential => Vector3::new(0.9, 0.9, 1.8),
            FixQuality::RtkFloat => Vector3::new(0.2, 0.2, 0.4),
            FixQuality::RtkFixed => Vector3::new(0.012, 0.012, 0.02),
        };
        Self { quality, sigma_m, ..self }
    }

    /// The world's frame on Earth.
    pub(super) fn checked(&self) -> Result<LocalFrame, SimError> {
        self.check().map_err(|error| error.within("gnss"))?;
        Ok(LocalFrame::new(self.origin).expect("its numbers were checked"))
    }

    fn check(&self) -> Result<(), FieldError> {
        in_range("rate_hz", self.rate_hz, 0.1..=25.0, "from 0.1 to 25")?;
        positive("sigma_m of East", self.sigma_m.x)?;
        positive("sigma_m of North", self.sigma_m.y)?;
        positive("sigma_m of Up", self.sigma_m.z)?;
        positive("correlation_s", self.correlation_s)?;
        in_range("hdop", self.hdop, 0.1..=99.0, "from 0.1 to 99")?;
        in_range("geoid_m", self.geoid_m, -120.0..=120.0, "within ±120")?;
        // Up to the year 2100; RMC has two digits for it.
        let dates = 946_684_800.0..=4_102_444_800.0;
        in_range("utc_start_s", self.utc_start_s, dates, "a date of this century")?;
        for (i, outage) in self.outages.iter().enumerate() {
            let within = |error: ParameterError| error.within(format_args!("outages[{i}]"));
            outage.check().map_err(within)?;
        }
        let Geodetic { lat_deg, lon_deg, alt_m } = self.origin;
        in_range("origin.lat_deg", lat_deg, -90.0..=90.0, "within ±90")?;
        in_range("origin.lon_deg", lon_deg, -180.0..=360.0, "within -180 to 360")?;
        in_range("origin.alt_m", alt_m, -500.0..=20_000.0, "from -500 to 20000")?;
        Ok(())
    }
}
