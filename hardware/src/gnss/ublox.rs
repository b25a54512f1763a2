use chrono::NaiveDate;
use foxhunt_wire::{
    FixQuality,
    geodesy::{Geodetic, compass_deg_to_radians},
};
use nalgebra::Vector3;

use super::{
    DAY_S, GnssDecoder, GnssFix, Heights, Leader, axis_of, sane, sane_sigma, sane_velocity,
    seconds,
    ubx::{Frames, Message, Payload, frame},
};

/// Class and number of the messages that are read.
const NAV_POSLLH: (u8, u8) = (0x01, 0x02);
const NAV_STATUS: (u8, u8) = (0x01, 0x03);
const NAV_DOP: (u8, u8) = (0x01, 0x04);
const NAV_SOL: (u8, u8) = (0x01, 0x06);
const NAV_PVT: (u8, u8) = (0x01, 0x07);
const NAV_VELNED: (u8, u8) = (0x01, 0x12);
const NAV_HPPOSLLH: (u8, u8) = (0x01, 0x14);
const NAV_TIMEUTC: (u8, u8) = (0x01, 0x21);
const ACK_NAK: (u8, u8) = (0x05, 0x00);
const CFG_MSG: (u8, u8) = (0x06, 0x01);
const CFG_VALSET: (u8, u8) = (0x06, 0x8a);

/// Keys of CFG-MSGOUT for NAV-PVT on I²C, UART1, UART2 and USB (u-blox F9 interface description).
const PVT_KEYS: [u32; 4] = [0x2091_0006, 0x2091_0007, 0x2091_0008, 0x2091_0009];

/// Time in seconds for which a status, a velocity or a dilution counts.
const COMPANION_AGE_S: f64 = 2.0;

/// Horizontal accuracy in metres up to which a place without a status counts as a fix: the mask
/// by which these receivers themselves decide (CFG-NAV5, as it comes from the factory).
const FIX_WITHIN_M: f64 = 100.0;

/// Reads UBX of receivers by u-blox: NAV-PVT from generation 7 on, and NAV-HPPOSLLH, NAV-POSLLH and
/// NAV-SOL of older ones or if NAV-PVT is off. Other bytes, NMEA included, are passed over.
///
/// The place comes from the best of these messages that the receiver sends. A poorer one counts
/// from its second epoch on in which no better one came. NAV-SOL and NAV-STATUS have the quality of
/// the fix, NAV-VELNED the velocity, NAV-TIMEUTC the time, NAV-DOP the dilution. Without a status a
/// place counts as a fix by the satellites if its accuracy is within 100 m.
///
/// `hAcc` is √(σ_E² + σ_N²), as its users found against GST; East and North get equal shares.
/// NAV-SOL's accuracy is shared equally by all three axes. NAV-PVT's heading of the vehicle is that
/// of a receiver that fuses sensors.
#[derive(Clone, Debug, Default)]
pub struct UbloxDecoder {
    frames: Frames,
    solution: Solution,
    /// True if the receiver refused a CFG-MSG, and a CFG-VALSET: both turn NAV-PVT on.
    refused_pvt: [bool; 2],
    messages: u64,
}

/// The messages with a place, from the poorest to the best.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Origin {
    Sol,
    Posllh,
    Hpposllh,
    Pvt,
}

/// Quality of a fix, and the number of satellites if it is known.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Status {
    quality: FixQuality,
    flat: bool,
    satellites: Option<u32>,
}

/// Values of the messages until now. Times are seconds of the GPS week.
#[derive(Clone, Copy, Debug)]
struct Solution {
    leader: Leader<Origin>,
    heights: Heights,
    status: Option<(f64, Status)>,
    velocity: Option<(f64, Vector3<f64>)>,
    hdop: Option<(f64, f64)>,
    /// UNIX time of a time of the week.
    utc: Option<(f64, f64)>,
    /// The last fix, and the place and σ that it was made of.
    fix: Option<(f64, Report)>,
    /// The last fix as it was handed on.
    sent: Option<GnssFix>,
    heading: Option<f64>,
}

/// A place as a message reports it.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Report {
    place: Option<Geodetic>,
    sigma_m: Option<Vector3<f64>>,
}

impl Default for Solution {
    fn default() -> Self {
        Self {
            leader: Leader::new(WEEK_S),
            heights: Heights::default(),
            status: None,
            velocity: None,
            hdop: None,
            utc: None,
            fix: None,
            sent: None,
            heading: None,
        }
    }
}

const WEEK_S: f64 = 7.0 * DAY_S;

impl UbloxDecoder {
    /// A decoder without any bytes so far.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    fn message(&mut self, message: &Message) -> Option<GnssFix> {
        if message.id == ACK_NAK {
            let refused = message.payload.u8(0).zip(message.payload.u8(1));
            let [old, new] = &mut self.refused_pvt;
            *old |= refused == Some(CFG_MSG);
            *new |= refused == Some(CFG_VALSET);
        }
        self.solution.message(message)
    }
}

impl GnssDecoder for UbloxDecoder {
    fn name(&self) -> &'static str {
        "u-blox"
    }

    /// NAV-PVT at every epoch on the port that this comes in by, in both dialects: CFG-MSG, which
    /// generations up to 9 take, and CFG-VALSET to the RAM, which those from 9 on take. The other
    /// one is refused and does nothing. A receiver that has refused a CFG-MSG, and is silent, gets
    /// NAV-POSLLH, NAV-SOL, NAV-STATUS, NAV-VELNED and NAV-TIMEUTC turned on as well. The refusal
    /// does not name the message that was to be turned on.
    fn set_up(&self) -> Vec<u8> {
        let turn_on = |(class, number): (u8, u8)| frame(CFG_MSG, &[class, number, 1]);
        let mut valset = vec![0, 1, 0, 0];
        for key in PVT_KEYS {
            valset.extend(key.to_le_bytes());
            valset.push(1);
        }
        let mut bytes = [turn_on(NAV_PVT), frame(CFG_VALSET, &valset)].concat();
        if self.refused_pvt[0] {
            for old in [NAV_POSLLH, NAV_SOL, NAV_STATUS, NAV_VELNED, NAV_TIMEUTC] {
                bytes.extend(turn_on(old));
            }
        }
        bytes
    }

    fn decode(&mut self, bytes: &[u8], emit: &mut dyn FnMut(GnssFix)) {
        self.frames.push(bytes);
        while let Some(message) = self.frames.next() {
            self.messages += 1;
            if let Some(fix) = self.message(&message) {
                emit(fix);
            }
        }
    }

    fn reset(&mut self) {
        self.frames.clear();
        self.solution = Solution::default();
        self.refused_pvt = [false; 2];
    }

    fn messages(&self) -> u64 {
        self.messages
    }

    fn refused(&self) -> u64 {
        self.frames.refused()
    }

    fn take_heading(&mut self) -> Option<f64> {
        self.solution.heading.take()
    }

    fn missing(&self) -> Option<String> {
        let solution = &self.solution;
        let mut missing = Vec::new();
        match (solution.leader.leader(), solution.leader.waits()) {
            (None, None) if self.refused_pvt == [true; 2] => missing.push(
                "it knows no NAV-PVT, and sends no NAV-POSLLH or NAV-SOL: turn these on".to_owned(),
            ),
            (None, None) if self.messages > 0 => {
                missing.push("no message has a place: turn NAV-PVT or NAV-POSLLH on".to_owned());
            }
            (Some(origin), _) if origin < Origin::Pvt => {
                if solution.status.is_none() {
                    let on = "the quality of the fix is unknown: turn NAV-PVT or NAV-STATUS on";
                    missing.push(on.to_owned());
                }
                if solution.utc.is_none() {
                    missing.push("there is no time: turn NAV-PVT or NAV-TIMEUTC on".to_owned());
                }
            }
            _ => {}
        }
        (!missing.is_empty()).then(|| missing.join("; "))
    }
}

impl Solution {
    /// The fix that a message completes, if any; a message that is too short is passed over.
    fn message(&mut self, Message { id, payload }: &Message) -> Option<GnssFix> {
        let time_at = if *id == NAV_HPPOSLLH { 4 } else { 0 };
        let time = f64::from(payload.u32(time_at)?) / 1e3;
        match *id {
            NAV_PVT => self.pvt(time, payload),
            NAV_HPPOSLLH => {
                let fine = |at, fine_at| Some(payload.i32(at)? + payload.i8(fine_at)? * 1e-2);
                let valid = payload.u8(3)? & 1 == 0;
                let lat_lon = (fine(12, 25)? * 1e-7, fine(8, 24)? * 1e-7);
                let alt_m = payload.i32(16)? * 1e-3 + payload.i8(26)? * 1e-4;
                let accuracy = (payload.u32(28)?, payload.u32(32)?);
                let accuracy = (f64::from(accuracy.0) * 1e-4, f64::from(accuracy.1) * 1e-4);
                self.placed(Origin::Hpposllh, time, valid.then_some((lat_lon, alt_m)), accuracy)
            }
            NAV_POSLLH => {
                let lat_lon = (payload.i32(8)? * 1e-7, payload.i32(4)? * 1e-7);
                let alt_m = payload.i32(12)? * 1e-3;
                let accuracy = (payload.u32(20)?, payload.u32(24)?);
                let accuracy = (f64::from(accuracy.0) * 1e-3, f64::from(accuracy.1) * 1e-3);
                self.placed(Origin::Posllh, time, Some((lat_lon, alt_m)), accuracy)
            }
            NAV_SOL => self.sol(time, payload),
            NAV_STATUS => {
                let quality = quality(payload.u8(4)?, payload.u8(5)?, payload.u8(7)? & 0xc0);
                let flat = payload.u8(4)? == 2;
                let satellites = self.status_at(time).and_then(|status| status.satellites);
                self.status = Some((time, Status { quality, flat, satellites }));
                self.again(time)
            }
            NAV_VELNED => {
                let velocity =
                    Vector3::new(payload.i32(8)?, payload.i32(4)?, -payload.i32(12)?) * 1e-2;
                self.velocity = sane_velocity(velocity).map(|velocity| (time, velocity));
                self.again(time)
            }
            NAV_DOP => {
                self.hdop = sane(payload.u16(12)? * 1e-2).map(|hdop| (time, hdop));
                None
            }
            NAV_TIMEUTC => {
                let valid = payload.u8(19)? & 4 != 0;
                let utc = utc(payload, 12, payload.i32(8)?).filter(|_| valid);
                self.utc = utc.map(|utc| (time, utc));
                self.again(time)
            }
            _ => None,
        }
    }

    fn sol(&mut self, time: f64, sol: &Payload) -> Option<GnssFix> {
        let quality = quality(sol.u8(10)?, sol.u8(11)?, 0);
        let flat = sol.u8(10)? == 2;
        let satellites = sol.u8(47).map(u32::from);
        // Of the carrier NAV-STATUS alone knows.
        let known = self.status_at(time).filter(|status| status.quality > quality);
        let best = known.filter(|_| quality > FixQuality::None);
        let quality = best.map_or(quality, |status| status.quality);
        self.status = Some((time, Status { quality, flat, satellites }));
        let place =
            Geodetic::from_ecef(sol.i32(12)? * 1e-2, sol.i32(16)? * 1e-2, sol.i32(20)? * 1e-2);
        // Of the three axes together.
        let accuracy = f64::from(sol.u32(24)?) * 1e-2 / 3_f64.sqrt();
        let fix = self.placed(
            Origin::Sol,
            time,
            place.map(|place| ((place.lat_deg, place.lon_deg), place.alt_m)),
            (accuracy * 2_f64.sqrt(), accuracy),
        );
        fix.or_else(|| self.again(time))
    }

    /// Takes a place with its horizontal and vertical accuracy.
    fn placed(
        &mut self,
        origin: Origin,
        time: f64,
        spot: Option<((f64, f64), f64)>,
        (horizontal, vertical): (f64, f64),
    ) -> Option<GnssFix> {
        if !self.leader.leads(origin, Origin::Pvt, Some(time)) {
            return None;
        }
        let known = self.status.is_some() || horizontal <= FIX_WITHIN_M;
        let place = spot
            .filter(|_| known)
            .and_then(|((lat_deg, lon_deg), alt_m)| Geodetic::new(lat_deg, lon_deg, alt_m).ok());
        let axis = axis_of(horizontal);
        let report = Report { place, sigma_m: sane_sigma(axis, axis, vertical) };
        self.fix = Some((time, report));
        let fix = self.fix(time, report);
        self.sent = Some(fix);
        Some(fix)
    }

    /// The last fix once more, if it is of this time and another message has changed it.
    fn again(&mut self, time: f64) -> Option<GnssFix> {
        let (_, report) = self.fix.filter(|(of, _)| (of - time).abs() < 1e-6)?;
        let fix = self.fix(time, report);
        let changed = self.sent.replace(fix) != Some(fix);
        changed.then_some(fix)
    }

    fn fix(&mut self, time: f64, report: Report) -> GnssFix {
        let status = self.status_at(time);
        // Once a status has come, a place without a young one is not known to be valid.
        let unknown = if self.status.is_some() { FixQuality::None } else { FixQuality::Autonomous };
        let quality = status.map_or(unknown, |status| status.quality);
        let flat = status.is_some_and(|status| status.flat);
        let placed = report.place.filter(|_| quality > FixQuality::None).and_then(|place| {
            let alt_m = (!flat).then_some(place.alt_m);
            self.heights.place(place.lat_deg, place.lon_deg, alt_m)
        });
        let place = placed.map(|(place, _)| place);
        GnssFix {
            utc_s: self.utc.map(|(of, utc)| utc + since(of, time)),
            place,
            height: placed.map(|(_, height)| height).unwrap_or_default(),
            quality: place.map_or(FixQuality::None, |_| quality),
            sigma_m: report.sigma_m,
            velocity_mps: self.velocity.filter(|_| place.is_some()).and_then(young(time)),
            satellites: status.and_then(|status| status.satellites),
            hdop: self.hdop.and_then(young(time)),
        }
    }

    fn status_at(&self, time: f64) -> Option<Status> {
        self.status.and_then(young(time))
    }

    fn pvt(&mut self, time: f64, pvt: &Payload) -> Option<GnssFix> {
        let flags = pvt.u8(21)?;
        let valid = pvt.u16(78)?.rem_euclid(2.0) < 1.0;
        self.status = Some((
            time,
            Status {
                quality: quality(pvt.u8(20)?, flags, flags & 0xc0),
                flat: pvt.u8(20)? == 2,
                satellites: pvt.u8(23).map(u32::from),
            },
        ));
        let dated = pvt.u8(11)? & 0b11 == 0b11;
        self.utc = utc(pvt, 4, pvt.i32(16)?).filter(|_| dated).map(|utc| (time, utc));
        let velocity = Vector3::new(pvt.i32(52)?, pvt.i32(48)?, -pvt.i32(56)?) * 1e-3;
        self.velocity = sane_velocity(velocity).map(|velocity| (time, velocity));
        if flags & 0x20 != 0 {
            let heading = pvt.i32(84).map(|deg| compass_deg_to_radians(deg * 1e-5));
            self.heading = heading.or(self.heading);
        }
        let lat_lon = (pvt.i32(28)? * 1e-7, pvt.i32(24)? * 1e-7);
        let alt_m = pvt.i32(32)? * 1e-3;
        let accuracy = (f64::from(pvt.u32(40)?) * 1e-3, f64::from(pvt.u32(44)?) * 1e-3);
        self.placed(Origin::Pvt, time, valid.then_some((lat_lon, alt_m)), accuracy)
    }
}

/// Seconds from one time of the week to another, within half a week.
fn since(of: f64, time: f64) -> f64 {
    (time - of + WEEK_S / 2.0).rem_euclid(WEEK_S) - WEEK_S / 2.0
}

/// A value, unless it is too old at a time.
fn young<T>(time: f64) -> impl Fn((f64, T)) -> Option<T> {
    move |(of, value)| (since(of, time).abs() <= COMPANION_AGE_S).then_some(value)
}

/// UNIX time of year, month, day, hour, minute and second from `at` on, and nanoseconds.
fn utc(payload: &Payload, at: usize, nanoseconds: f64) -> Option<f64> {
    let part = |after: usize| payload.u8(at + after).map(u32::from);
    let year = u32::from(u16::from_le_bytes([payload.u8(at)?, payload.u8(at + 1)?]));
    let date = NaiveDate::from_ymd_opt(i32::try_from(year).ok()?, part(2)?, part(3)?)?;
    // A leap second is the 61st.
    let second = part(6)?;
    let time = date.and_hms_opt(part(4)?, part(5)?, 0)?.and_utc().timestamp_millis();
    (second <= 60).then(|| seconds(time) + f64::from(second) + nanoseconds * 1e-9)
}

/// Quality of a fix by its type, its flags of validity and corrections, and the carrier's flags.
fn quality(fix_type: u8, flags: u8, carrier: u8) -> FixQuality {
    if flags & 1 == 0 {
        return FixQuality::None;
    }
    match (fix_type, carrier) {
        (1, _) => FixQuality::Estimated,
        (2..=4, 0x80) => FixQuality::RtkFixed,
        (2..=4, 0x40) => FixQuality::RtkFloat,
        (2..=4, _) if flags & 2 != 0 => FixQuality::Differential,
        (2..=4, _) => FixQuality::Autonomous,
        _ => FixQuality::None,
    }
}
