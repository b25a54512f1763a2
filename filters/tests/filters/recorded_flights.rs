//! Recorded flights, read where they lie.

use std::path::{Path, PathBuf};

use foxhunt_core::Pose;
use nalgebra::Vector2;

/// One flight in metres about its first reading.
pub(super) struct Flight {
    pub(super) readings: Vec<(Pose, f64)>,
    pub(super) truth: Vector2<f64>,
}

/// A CSV's rows under the named columns; an empty field is NaN.
fn columns<const N: usize>(path: &Path, names: [&str; N]) -> Vec<[f64; N]> {
    let text = std::fs::read_to_string(path).expect("readable");
    let mut lines = text.lines();
    let header: Vec<&str> = lines.next().expect("a header").split(',').collect();
    let at = names.map(|name| header.iter().position(|h| *h == name).expect("the column"));
    let number = |field: &str| field.parse().unwrap_or(f64::NAN);
    lines
        .map(|line| line.split(',').collect::<Vec<_>>())
        .map(|f| at.map(|i| number(f[i])))
        .collect()
}

/// Metres of East and North per radian on the WGS84 ellipsoid, enough for a few hundred metres.
fn metres_per_radian(latitude: f64) -> Vector2<f64> {
    let a = 6_378_137.0;
    let e2 = 6.694_379_990_14e-3;
    let w = 1.0 - e2 * latitude.sin().powi(2);
    Vector2::new(a / w.sqrt() * latitude.cos(), a * (1.0 - e2) / w.powf(1.5))
}

impl Flight {
    /// Without the seconds below 15 m, or without lock.
    fn read(data: &Path, experiment: u16, location: usize) -> Self {
        let truth = columns(&data.join("truth.csv"), ["lat_deg", "lon_deg"])[location - 1];
        let path = data.join(format!("afar_exp{experiment}_loc{location}_1hz.csv"));
        let names = ["lat_deg", "lon_deg", "alt_agl_m", "power_db", "quality_db"];
        let rows: Vec<_> = columns(&path, names)
            .into_iter()
            .filter(|[lat, _, up, power, quality]| {
                *up >= 15.0 && *quality >= 60.0 && power.is_finite() && lat.is_finite()
            })
            .collect();
        let [lat0, lon0, ..] = rows[0];
        let scale = metres_per_radian(lat0.to_radians());
        let east_north = |lat: f64, lon: f64| {
            Vector2::new((lon - lon0).to_radians() * scale.x, (lat - lat0).to_radians() * scale.y)
        };
        let reading = |&[lat, lon, up, power, _]: &[f64; 5]| {
            let place = east_north(lat, lon);
            (Pose::at(place.x, place.y, up), power)
        };
        let readings = rows.iter().map(reading).collect();
        Self { readings, truth: east_north(truth[0], truth[1]) }
    }
}

/// The flights, two by three places, or where the data were missed.
pub(super) fn flights() -> Result<Vec<Flight>, PathBuf> {
    let data = PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared/data/aerpaw_afar"));
    if !data.exists() {
        return Err(data);
    }
    let pairs = [288, 300].into_iter().flat_map(|e| (1..=3).map(move |l| (e, l)));
    Ok(pairs.map(|(e, l)| Flight::read(&data, e, l)).collect())
}
