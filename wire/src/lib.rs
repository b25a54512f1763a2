//! The edge of foxhunt: conversions between its own units and values and those that others use.
//!
//! [`geodesy`] turns WGS84 and compass degrees into East-North-Up metres and radians, and the
//! feature `declination` knows where compasses point to, and `geoid` the height of the sea;
//! `terrain` reads tiles of elevation models. [`packed`] makes numbers short enough for a page.
//! The codecs turn the bytes of devices into values and back, and do no I/O; [`ByteStream`] carries
//! bytes, and never blocks. The drivers of `foxhunt-hardware` and the emulated devices of `foxhunt-sim` are made of the same codecs; what
//! keeps both honest are vectors and programs of others.

#[cfg(feature = "ardrone")]
pub mod ardrone;
#[cfg(feature = "declination")]
pub mod declination;
#[cfg(feature = "firmata")]
pub mod firmata;
mod fix_quality;
pub mod geodesy;
#[cfg(feature = "geoid")]
pub mod geoid;
#[cfg(feature = "mavlink")]
pub mod mavlink;
#[cfg(feature = "motion-capture")]
pub mod motion_capture;
pub mod nmea;
#[cfg(feature = "corrections")]
pub mod ntrip;
pub mod packed;
#[cfg(feature = "receivers")]
pub mod receivers;
#[cfg(feature = "corrections")]
pub mod rtcm;
#[cfg(feature = "stream")]
mod stream;
#[cfg(feature = "terrain")]
pub mod terrain;
#[cfg(feature = "xbee")]
pub mod xbee;

pub use fix_quality::FixQuality;
#[cfg(feature = "stream")]
pub use stream::{
    ByteStream, Endpoint, EndpointError, MemoryStream, PtyStream, SerialStream, SharedPort,
    SharedStream, TcpServerStream, TcpStream, UdpStream, memory_pair,
};
