//! Drivers that implement the device traits of `foxhunt_core`, one feature each.
//!
//! A driver is made of a codec of `foxhunt_wire`, any [`ByteStream`](foxhunt_wire::ByteStream) and
//! a clock. None of them blocks, prints or starts a thread that it does not end. The same drivers
//! run over memory, pseudo-terminals and cables.
//!
//! A person with a GNSS receiver, here one in memory that sends a single sentence, is a vehicle:
//!
//! ```
//! # #[cfg(feature = "gnss")]
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! use foxhunt_core::Vehicle;
//! use foxhunt_hardware::{CarriedConfig, CarriedVehicle, GnssConfig, GnssReceiver, SystemClock};
//! use foxhunt_wire::{ByteStream, geodesy::{Geodetic, LocalFrame}, memory_pair};
//!
//! let (port, mut device) = memory_pair();
//! let gnss = GnssReceiver::new(GnssConfig::default(), port, SystemClock::start())?;
//! let frame = LocalFrame::new(Geodetic { lat_deg: 50.0, lon_deg: 14.0, alt_m: 300.0 })?;
//! // An antenna without a direction needs no compass.
//! let mut walker = CarriedVehicle::new(CarriedConfig::default(), gnss, frame).omnidirectional();
//!
//! device.send(b"$GPGGA,120000.00,5000.0100,N,01400.0000,E,4,17,0.7,255.0,M,45.0,M,,*69\r\n")?;
//! let place = walker.pose()?.position;
//! assert!((place.y - 18.5).abs() < 0.1, "a hundredth of a minute to the North: {place}");
//! assert!(walker.position_sigma().is_some_and(|sigma| sigma.x < 0.1), "by an RTK fix");
//! # Ok(())
//! # }
//! # #[cfg(not(feature = "gnss"))]
//! # fn main() {}
//! ```

mod aircraft;
#[cfg(feature = "ardrone")]
mod ardrone;
mod clock;
pub mod cot;
mod finding;
#[cfg(feature = "gnss")]
mod gnss;
mod host;
pub mod link;
#[cfg(feature = "mavlink")]
mod mavlink;
#[cfg(feature = "ardrone")]
mod motion_capture;
#[cfg(feature = "mqtt")]
mod mqtt_sender;
#[cfg(any(feature = "cot", feature = "mqtt"))]
mod outbox;
#[cfg(feature = "receivers")]
mod receivers;
mod reconnecting;
#[cfg(feature = "firmata")]
mod stepper;
#[cfg(feature = "xbee")]
mod xbee;

pub use aircraft::{Aircraft, AircraftState, Hands, ReportedHeight, Shared};
#[cfg(feature = "ardrone")]
pub use ardrone::{ArDrone, ArDroneConfig, ArDroneError};
pub use clock::SystemClock;
pub use finding::{Finding, OwnFence, Watch};
#[cfg(feature = "gnss")]
pub use foxhunt_wire::FixQuality;
#[cfg(feature = "gnss")]
pub use gnss::{
    CarriedConfig, CarriedError, CarriedVehicle, Corrections, CorrectionsConfig,
    CorrectionsConfigError, CorrectionsLost, FixedConfig, GnssConfig, GnssDecoder, GnssError,
    GnssFix, GnssFloors, GnssKind, GnssPosition, GnssReceiver, GpsdDecoder, HeightOrigin, Mark,
    NmeaDecoder, Placed, PlacedError, Positioning, UbloxDecoder,
};
#[cfg(feature = "mavlink")]
pub use mavlink::{
    FlightLimits, MavlinkConfig, MavlinkError, MavlinkOrigin, MavlinkSigning, MavlinkVehicle,
    PositionRequirements, RadioStatus,
};
#[cfg(feature = "ardrone")]
pub use motion_capture::{MotionCapture, MotionCaptureConfig, PosesLost};
#[cfg(feature = "mqtt")]
pub use mqtt_sender::MqttSender;
#[cfg(feature = "receivers")]
pub use receivers::{
    KrakenConfig, KrakenSource, KrakenSourceError, PulseConfig, RtlTcpConfig, RtlTcpRadio,
    RtlTcpRadioError, RtlTcpSamples, RtlTcpTuning, SampleLosses, SikError, SikFeed, SikRadio,
};
#[cfg(feature = "soapy")]
pub use receivers::{SoapyError, SoapySamples, SoapyTuning, soapy_devices};
pub use reconnecting::Reconnecting;
#[cfg(feature = "firmata")]
pub use stepper::{
    Approach, BeyondCable, CoilFailure, FirmataConfig, FirmataStepper, FirmataStepperError, Homing,
    LostPosition, MissingStepper,
};
#[cfg(feature = "xbee")]
pub use xbee::{XbeeConfig, XbeeCounts, XbeeError, XbeeIdentity, XbeeQuestion, XbeeRadio};
