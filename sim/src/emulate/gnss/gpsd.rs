use foxhunt_wire::FixQuality;

use super::epoch::Epoch;

/// The greeting of gpsd.
pub(super) const VERSION: &str = "{\"class\":\"VERSION\",\"release\":\"3.25\",\"rev\":\"3.25\",\
                                  \"proto_major\":3,\"proto_minor\":15}\r\n";

const DEVICE: &str = "{\"class\":\"DEVICE\",\"path\":\"emulated\",\"driver\":\"emulated\",\
                      \"activated\":\"2026-01-01T00:00:00.000Z\"}";

/// The longest request that is read, in bytes: gpsd allows 80.
const LONGEST: usize = 256;

/// A client of gpsd.
#[derive(Clone, Debug, Default)]
pub(super) struct Client {
    request: Vec<u8>,
    /// True if it has requested reports.
    pub(super) watches: bool,
}

impl Client {
    /// Takes bytes of the client; what is answered to them.
    pub(super) fn take(&mut self, bytes: &[u8]) -> String {
        let mut answer = String::new();
        for &byte in bytes {
            match byte {
                b'?' => self.request = vec![byte],
                b';' | b'\n' if !self.request.is_empty() => {
                    let request = std::mem::take(&mut self.request);
                    answer += &self.answer(&String::from_utf8_lossy(&request));
                }
                _ if self.request.is_empty() || self.request.len() >= LONGEST => {}
                _ if byte.is_ascii_whitespace() => {}
                _ => self.request.push(byte),
            }
        }
        answer
    }

    fn answer(&mut self, request: &str) -> String {
        let devices = || format!("{{\"class\":\"DEVICES\",\"devices\":[{DEVICE}]}}\r\n");
        if request == "?VERSION" {
            return VERSION.into();
        }
        if request == "?DEVICES" {
            return devices();
        }
        if let Some(wanted) = request.strip_prefix("?WATCH") {
            if wanted.starts_with('=') {
                self.watches = !wanted.contains("\"enable\":false");
            }
            let watches = self.watches;
            let watch =
                format!("{{\"class\":\"WATCH\",\"enable\":{watches},\"json\":{watches}}}\r\n");
            return devices() + &watch;
        }
        "{\"class\":\"ERROR\",\"message\":\"Unrecognized request\"}\r\n".into()
    }
}

/// TPV and SKY.
pub(super) fn reports(epoch: &Epoch) -> String {
    // ISO 8601.
    let time = format!("{:?}Z", epoch.date_time());
    let satellites = epoch.satellites;
    let hdop = epoch.hdop;
    let (vdop, pdop) = epoch.vdop_pdop();
    let sky = format!(
        "{{\"class\":\"SKY\",\"device\":\"emulated\",\"time\":\"{time}\",\"hdop\":{hdop:.2},\
         \"vdop\":{vdop:.2},\"pdop\":{pdop:.2},\"uSat\":{satellites}}}\r\n"
    );
    let head = format!("{{\"class\":\"TPV\",\"device\":\"emulated\",\"time\":\"{time}\"");
    let status = match epoch.quality {
        FixQuality::None => return format!("{sky}{head},\"mode\":1}}\r\n"),
        FixQuality::Autonomous => 1,
        FixQuality::Differential => 2,
        FixQuality::RtkFixed => 3,
        FixQuality::RtkFloat => 4,
        FixQuality::Estimated => 5,
    };
    let place = epoch.place;
    let sigma = epoch.sigma_m;
    let (speed, course) = epoch.speed_course();
    format!(
        "{sky}{head},\"mode\":3,\"status\":{status},\"lat\":{:.9},\"lon\":{:.9},\
         \"altHAE\":{:.4},\"altMSL\":{:.4},\"geoidSep\":{:.3},\"epx\":{:.4},\"epy\":{:.4},\
         \"epv\":{:.4},\"eph\":{:.4},\"speed\":{speed:.3},\"track\":{course:.3}}}\r\n",
        place.lat_deg,
        place.lon_deg,
        place.alt_m,
        place.alt_m - epoch.geoid_m,
        epoch.geoid_m,
        sigma.x,
        sigma.y,
        sigma.z,
        sigma.x.hypot(sigma.y),
    )
}
