//! Somebody who carries a receiver, and goes where a plotter or a telephone shows the next
//! waypoint.

use std::io;

use foxhunt_core::{Vehicle, Waypoint, parameter::FieldError};
use foxhunt_wire::{
    ByteStream,
    geodesy::{Geodetic, LocalFrame},
};
use nalgebra::Vector3;

use crate::{Emulator, SimError, SimVehicle, World};

/// The longest sentence that is read, in bytes.
const LONGEST: usize = 82;

/// A drone of a simulated world as somebody on the ground: it goes to each waypoint (WPL of NMEA
/// 0183) that comes over its stream, at its own height.
#[derive(Debug)]
pub struct EmulatedCarrier<S> {
    stream: S,
    vehicle: SimVehicle,
    frame: LocalFrame,
    up_m: f64,
    line: Vec<u8>,
}

impl<S: ByteStream> EmulatedCarrier<S> {
    /// Somebody with the receiver of one of the world's drones, whose zero is at `origin`.
    ///
    /// # Errors
    ///
    /// [`SimError::Drone`] if there is no such drone; [`SimError::Field`] for an invalid origin.
    pub fn new(world: &World, drone: usize, origin: Geodetic, stream: S) -> Result<Self, SimError> {
        let up_m = world.pose(drone)?.position.z;
        let vehicle = world.vehicle(drone)?;
        let refused = |_| FieldError::new("origin", origin.lat_deg, "a place on Earth");
        let frame = LocalFrame::new(origin).map_err(refused)?;
        Ok(Self { stream, vehicle, frame, up_m, line: Vec::new() })
    }

    fn go_to(&mut self, line: &[u8]) -> io::Result<()> {
        let Some((lat_deg, lon_deg)) = waypoint(line) else { return Ok(()) };
        let Ok(place) = Geodetic::new(lat_deg, lon_deg, self.frame.origin().alt_m) else {
            return Ok(());
        };
        let there = self.frame.to_local(&place).xy();
        let position = Vector3::new(there.x, there.y, self.up_m);
        self.vehicle.go_to(&Waypoint { position }).map_err(io::Error::other)
    }
}

impl<S: ByteStream> Emulator for EmulatedCarrier<S> {
    fn serve(&mut self) -> io::Result<()> {
        let mut piece = [0; 256];
        loop {
            let count = self.stream.receive(&mut piece)?;
            if count == 0 {
                return Ok(());
            }
            for &byte in piece.get(..count).unwrap_or_default() {
                match byte {
                    b'\r' | b'\n' => {
                        let line = std::mem::take(&mut self.line);
                        self.go_to(&line)?;
                    }
                    _ if self.line.len() < LONGEST => self.line.push(byte),
                    _ => {}
                }
            }
        }
    }
}

/// Latitude and longitude in degrees of a WPL whose checksum is right.
fn waypoint(line: &[u8]) -> Option<(f64, f64)> {
    let text = str::from_utf8(line).ok()?;
    let (body, sum) = text.strip_prefix('$')?.split_once('*')?;
    let right = body.bytes().fold(0, |sum, byte| sum ^ byte);
    if u8::from_str_radix(sum, 16) != Ok(right) {
        return None;
    }
    let mut fields = body.split(',');
    fields.next().filter(|address| address.ends_with("WPL"))?;
    let mut degrees = |positive: &str| {
        let number: f64 = fields.next()?.parse().ok()?;
        let whole = (number / 100.0).trunc();
        let deg = whole + (number - whole * 100.0) / 60.0;
        Some(if fields.next()? == positive { deg } else { -deg })
    };
    Some((degrees("N")?, degrees("E")?))
}

#[cfg(test)]
mod tests {
    use foxhunt_wire::memory_pair;

    use super::*;
    use crate::{BeaconConfig, DroneConfig, WorldConfig};

    #[test]
    fn it_walks_to_each_waypoint_and_nowhere_else() {
        let config = WorldConfig {
            beacons: vec![BeaconConfig::default()],
            drones: vec![DroneConfig { up_m: 1.5, ..DroneConfig::default() }],
            ..WorldConfig::default()
        };
        let world = World::new(&config, 1).expect("a world");
        let origin = Geodetic { lat_deg: 50.0, lon_deg: 14.0, alt_m: 0.0 };
        let (near, mut far) = memory_pair();
        let mut carrier = EmulatedCarrier::new(&world, 0, origin, near).expect("somebody");
        let mut after = |bytes: &[u8]| {
            far.send(bytes).expect("memory");
            for _ in 0..600 {
                carrier.serve().expect("memory");
                world.advance(0.1).expect("time passes");
            }
            world.pose(0).expect("a drone").position
        };
        // 40 m to the North, 30 to the West.
        let there = after(b"noise\r\n$FXWPL,5000.0216,N,01359.9749,E,NEXT*48\r\n");
        assert!((there - Vector3::new(-30.0, 40.0, 1.5)).norm() < 0.3, "{there}");
        let stays = after(b"$FXWPL,5000.0000,N,01400.0000,E,NEXT*00\r\n$GPGGA,1,2*00\r\n");
        assert!((stays - there).norm() < 0.3, "{stays}");
    }
}
