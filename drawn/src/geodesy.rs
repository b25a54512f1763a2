//! Places on WGS84, written apart from `wire`.

/// Half of the equator's diameter in metres (WGS84).
const EQUATOR_M: f64 = 6_378_137.0;

/// Square of the ellipsoid's eccentricity (WGS84).
const ECCENTRICITY_2: f64 = 6.694_379_990_141e-3;

/// The place where the zero of local metres is, in degrees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Origin {
    pub lat_deg: f64,
    pub lon_deg: f64,
}

impl Origin {
    /// Converts East and North in metres to latitude and longitude in degrees, along the meridian
    /// and the parallel of the origin: exact to centimetres over a kilometre.
    pub fn degrees(self, [east_m, north_m]: [f64; 2]) -> [f64; 2] {
        let (sin, cos) = self.lat_deg.to_radians().sin_cos();
        let bulge = 1.0 - ECCENTRICITY_2 * sin * sin;
        let meridian_m = EQUATOR_M * (1.0 - ECCENTRICITY_2) / bulge.powf(1.5);
        let parallel_m = EQUATOR_M / bulge.sqrt() * cos;
        let lat_deg = self.lat_deg + (north_m / meridian_m).to_degrees();
        [lat_deg, self.lon_deg + (east_m / parallel_m).to_degrees()]
    }
}

/// Returns the direction from one place to another, in degrees clockwise from North at the first:
/// of the plane section, which differs from the geodesic's by less than 0.01° over 300 km.
pub fn azimuth_deg(from_deg: [f64; 2], to_deg: [f64; 2]) -> f64 {
    let from = centred(from_deg);
    let to = centred(to_deg);
    let way = [to[0] - from[0], to[1] - from[1], to[2] - from[2]];
    let (sin_lat, cos_lat) = from_deg[0].to_radians().sin_cos();
    let (sin_lon, cos_lon) = from_deg[1].to_radians().sin_cos();
    let east = -sin_lon * way[0] + cos_lon * way[1];
    let north = -sin_lat * (cos_lon * way[0] + sin_lon * way[1]) + cos_lat * way[2];
    east.atan2(north).to_degrees().rem_euclid(360.0)
}

/// Converts latitude and longitude to metres from the Earth's centre.
fn centred([lat_deg, lon_deg]: [f64; 2]) -> [f64; 3] {
    let (sin_lat, cos_lat) = lat_deg.to_radians().sin_cos();
    let (sin_lon, cos_lon) = lon_deg.to_radians().sin_cos();
    let normal_m = EQUATOR_M / (1.0 - ECCENTRICITY_2 * sin_lat * sin_lat).sqrt();
    let axis_m = normal_m * cos_lat;
    [axis_m * cos_lon, axis_m * sin_lon, normal_m * (1.0 - ECCENTRICITY_2) * sin_lat]
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_abs_diff_eq;

    #[test]
    fn azimuths_lead_along_meridians_and_off_parallels() {
        let north = azimuth_deg([60.0, 10.0], [61.0, 10.0]);
        assert_abs_diff_eq!(north.to_radians().sin(), 0.0, epsilon = 1e-9);
        assert_abs_diff_eq!(azimuth_deg([0.0, 10.0], [0.0, 9.0]), 270.0, epsilon = 1e-9);
        // At 60° N the great circle to a place 2° east begins 0.87° north of East.
        let off = 90.0 - azimuth_deg([60.0, 10.0], [60.0, 12.0]);
        assert_abs_diff_eq!(off, 0.866, epsilon = 0.01);
    }

    #[test]
    fn local_metres_are_degrees_of_the_ellipsoid() {
        let origin = Origin { lat_deg: 50.0, lon_deg: 14.0 };
        let [lat, lon] = origin.degrees([1000.0, -2000.0]);
        let [from, to] = [centred([50.0, 14.0]), centred([lat, lon])];
        let square: f64 = from.iter().zip(&to).map(|(a, b)| (a - b).powi(2)).sum();
        assert_abs_diff_eq!(square.sqrt(), 2236.07, epsilon = 0.6);
    }
}
