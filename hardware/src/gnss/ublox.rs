use std::fmt;

use chrono::{DateTime, Utc};
use foxhunt_wire::{FixQuality, geodesy::Geodetic};
use nalgebra::Vector3;
use ublox::{
    FixedBuffer, GnssFixType, Parser, ParserBuilder, UbxPacket,
    cfg_msg::CfgMsgSinglePortBuilder,
    nav_pvt::{
        common::{NavPvtFlags, NavPvtValidFlags},
        proto27::{NavPvt, NavPvtRef},
    },
    packets::cfg_val::{CfgLayerSet, CfgValSetBuilder},
    proto27::{PacketRef, Proto27},
};

use super::{GnssDecoder, GnssFix, axis_of, sane_sigma, sane_velocity, seconds};

/// The longest message that is waited for, in bytes: a NAV-PVT has 100. A length that was garbled
/// keeps no more than this from being read.
const LONGEST: usize = 256;

/// Reads UBX-NAV-PVT of receivers by u-blox from generation 8 on, and turns it on; what else comes,
/// NMEA included, is passed over.
///
/// `hAcc` is √(σ_E² + σ_N²), as its users found against GST; East and North get equal shares.
pub struct UbloxDecoder {
    parser: Parser<FixedBuffer<LONGEST>, Proto27>,
    /// The height of the last fix that had one.
    alt_m: Option<f64>,
    messages: u64,
    refused: u64,
}

impl fmt::Debug for UbloxDecoder {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("UbloxDecoder")
            .field("messages", &self.messages)
            .field("refused", &self.refused)
            .finish_non_exhaustive()
    }
}

impl Default for UbloxDecoder {
    fn default() -> Self {
        Self::new()
    }
}

impl UbloxDecoder {
    /// A decoder without any bytes so far.
    #[must_use]
    pub fn new() -> Self {
        Self { parser: parser(), alt_m: None, messages: 0, refused: 0 }
    }
}

fn parser() -> Parser<FixedBuffer<LONGEST>, Proto27> {
    ParserBuilder::new().with_protocol::<Proto27>().with_fixed_buffer::<LONGEST>()
}

impl GnssDecoder for UbloxDecoder {
    fn name(&self) -> &'static str {
        "u-blox"
    }

    /// NAV-PVT at every epoch on the port that this comes in by, in both dialects: CFG-MSG, which
    /// generations up to 9 take, and CFG-VALSET to the RAM, which those from 9 on take. The other
    /// one is refused and does nothing.
    fn set_up(&self) -> Vec<u8> {
        use ublox::cfg_val::CfgVal::{
            MsgOutUbxNavPvtI2c, MsgOutUbxNavPvtUart1, MsgOutUbxNavPvtUart2, MsgOutUbxNavPvtUsb,
        };
        let old = CfgMsgSinglePortBuilder::set_rate_for::<NavPvt>(1).into_packet_bytes();
        // The crate writes the length at the beginning of what it extends.
        let mut new = Vec::new();
        CfgValSetBuilder {
            version: 0,
            layers: CfgLayerSet::RAM,
            reserved1: 0,
            cfg_data: &[
                MsgOutUbxNavPvtI2c(1),
                MsgOutUbxNavPvtUart1(1),
                MsgOutUbxNavPvtUart2(1),
                MsgOutUbxNavPvtUsb(1),
            ],
        }
        .extend_to(&mut new);
        [&old[..], &new].concat()
    }

    fn decode(&mut self, bytes: &[u8], emit: &mut dyn FnMut(GnssFix)) {
        let mut packets = self.parser.consume_ubx(bytes);
        while let Some(packet) = packets.next() {
            match packet {
                Ok(packet) => {
                    self.messages += 1;
                    if let UbxPacket::Proto27(PacketRef::NavPvt(pvt)) = packet {
                        emit(fix(&pvt, &mut self.alt_m));
                    }
                }
                Err(_) => self.refused += 1,
            }
        }
    }

    fn reset(&mut self) {
        (self.parser, self.alt_m) = (parser(), None);
    }

    fn messages(&self) -> u64 {
        self.messages
    }

    fn refused(&self) -> u64 {
        self.refused
    }
}

fn fix(pvt: &NavPvtRef<'_>, alt_m: &mut Option<f64>) -> GnssFix {
    let quality = quality(pvt);
    let flat = pvt.fix_type() == GnssFixType::Fix2D;
    let usable = quality > FixQuality::None && !pvt.flags3().invalid_llh();
    if usable && !flat {
        *alt_m = Some(pvt.height_above_ellipsoid());
    }
    let place = alt_m
        .filter(|_| usable)
        .and_then(|alt_m| Geodetic::new(pvt.latitude(), pvt.longitude(), alt_m).ok());
    let axis = axis_of(pvt.horizontal_accuracy());
    let dated = pvt.valid().contains(NavPvtValidFlags::VALID_DATE | NavPvtValidFlags::VALID_TIME);
    let utc = DateTime::<Utc>::try_from(pvt).ok().filter(|_| dated);
    GnssFix {
        utc_s: utc.map(|utc| seconds(utc.timestamp_millis())),
        place,
        flat,
        quality: place.map_or(FixQuality::None, |_| quality),
        sigma_m: sane_sigma(axis, axis, pvt.vertical_accuracy()),
        velocity_mps: place.and_then(|_| {
            sane_velocity(Vector3::new(pvt.vel_east(), pvt.vel_north(), -pvt.vel_down()))
        }),
        satellites: Some(u32::from(pvt.num_satellites())),
        hdop: None,
    }
}

fn quality(pvt: &NavPvtRef<'_>) -> FixQuality {
    let flags = pvt.flags();
    if !flags.contains(NavPvtFlags::GPS_FIX_OK) {
        return FixQuality::None;
    }
    match pvt.fix_type() {
        GnssFixType::DeadReckoningOnly => FixQuality::Estimated,
        GnssFixType::Fix2D | GnssFixType::Fix3D | GnssFixType::GPSPlusDeadReckoning => {
            if flags.contains(NavPvtFlags::CARR_SOLN_FIXED) {
                FixQuality::RtkFixed
            } else if flags.contains(NavPvtFlags::CARR_SOLN_FLOAT) {
                FixQuality::RtkFloat
            } else if flags.contains(NavPvtFlags::DIFF_SOLN) {
                FixQuality::Differential
            } else {
                FixQuality::Autonomous
            }
        }
        _ => FixQuality::None,
    }
}
