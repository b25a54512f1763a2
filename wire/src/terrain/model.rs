//! Heights of the ground about a place, and reasons for their absence.

use std::{
    fs,
    path::{Path, PathBuf},
};

use foxhunt_core::Terrain;
use nalgebra::{Vector2, Vector3};

use super::tile::{Area, TerrainError, Tile, read_geotiff, read_hgt};
use crate::geodesy::LocalFrame;

/// Maximum distance from the origin to which tiles are read, in metres.
const MOST_M: f64 = 50_000.0;

/// The heights of the ground about the origin of a frame, by an elevation model.
///
/// Between the samples heights are bilinear. They are above whatever the model counts from, the
/// geoid as a rule, which is no matter where differences alone are used.
#[derive(Clone, Debug)]
pub struct ElevationModel {
    frame: LocalFrame,
    reach_m: f64,
    tiles: Vec<Tile>,
    step_m: f64,
}

impl ElevationModel {
    /// Reads the tiles in a folder within the square that goes `reach_m` metres from the frame's
    /// origin to each side. Files with other endings than `.hgt`, `.tif` and `.tiff` are left
    /// alone; of tiles that overlap the first by name counts.
    ///
    /// # Errors
    ///
    /// [`TerrainError`] where the folder or a tile cannot be read, a tile is missing, or a height
    /// within the square is void.
    pub fn read(folder: &Path, frame: LocalFrame, reach_m: f64) -> Result<Self, TerrainError> {
        if !(reach_m > 0.0 && reach_m <= MOST_M) {
            return Err(TerrainError::Reach { reach_m });
        }
        let area = area(&frame, reach_m)?;
        let mut tiles = Vec::new();
        for path in files(folder)? {
            let ending = path.extension().unwrap_or_default().to_ascii_lowercase();
            let tile = match ending.to_str() {
                Some("hgt") => read_hgt(&path, &area)?,
                Some("tif" | "tiff") => read_geotiff(&path, &area)?,
                _ => None,
            };
            tiles.extend(tile);
        }
        let step = |tile: &Tile| {
            let (lat, lon) = tile.steps();
            let here = frame.origin();
            let metres_per_degree = 111_000.0;
            metres_per_degree * lat.min(lon * libm::cos(here.lat_deg.to_radians()))
        };
        // A tenth of a metre at the least, whatever a tile claims.
        let step_m = tiles.iter().map(step).fold(reach_m, f64::min).max(0.1);
        let model = Self { frame, reach_m, tiles, step_m };
        model.check(folder)?;
        Ok(model)
    }

    /// The height of the ground at a place East and North of the origin, in metres; `None` beyond
    /// the reach.
    #[must_use]
    pub fn height(&self, place: &Vector2<f64>) -> Option<f64> {
        (place.amax() <= self.reach_m).then_some(())?;
        let (lat, lon) = self.degrees(place);
        self.at(lat, lon)
    }

    /// The distance between two samples, in metres, where they are nearest to each other.
    #[must_use]
    pub fn step_m(&self) -> f64 {
        self.step_m
    }

    /// Height of the highest sample within the reach, or beside it, above the lowest, in metres.
    #[must_use]
    pub fn relief_m(&self) -> f64 {
        let heights = || self.tiles.iter().flat_map(Tile::heights);
        heights().fold(f64::NEG_INFINITY, f64::max) - heights().fold(f64::INFINITY, f64::min)
    }

    fn at(&self, lat: f64, lon: f64) -> Option<f64> {
        let height = |beyond| self.tiles.iter().find_map(|tile| tile.height(lat, lon, beyond));
        height(false).or_else(|| height(true))
    }

    fn degrees(&self, place: &Vector2<f64>) -> (f64, f64) {
        let place = self.frame.to_geodetic(&Vector3::new(place.x, place.y, 0.0));
        (place.lat_deg, place.lon_deg)
    }

    /// Refuses an area that is not covered, or has a void.
    fn check(&self, folder: &Path) -> Result<(), TerrainError> {
        for tile in &self.tiles {
            if let Some((lat_deg, lon_deg)) = tile.void() {
                return Err(TerrainError::Void { path: tile.path.clone(), lat_deg, lon_deg });
            }
        }
        // Tiles have no holes, so that what is missing is as large as a tile.
        let steps = (self.reach_m / self.step_m).ceil().min(200.0);
        #[expect(clippy::cast_possible_truncation, reason = "200 at most")]
        let steps = steps as i32;
        let along = |step: i32| self.reach_m * f64::from(step) / f64::from(steps.max(1));
        for (row, column) in (-steps..=steps).flat_map(|r| (-steps..=steps).map(move |c| (r, c))) {
            let (lat_deg, lon_deg) = self.degrees(&Vector2::new(along(column), along(row)));
            if self.at(lat_deg, lon_deg).is_none() {
                let tile = name(lat_deg, lon_deg);
                let folder = folder.to_owned();
                return Err(TerrainError::Missing { folder, tile, lat_deg, lon_deg });
            }
        }
        Ok(())
    }
}

impl Terrain for ElevationModel {
    fn height(&self, place: &Vector2<f64>) -> Option<f64> {
        Self::height(self, place)
    }

    fn step_m(&self) -> f64 {
        Self::step_m(self)
    }
}

/// Bounds of a square about the origin in degrees, with the bulge of its sides.
fn area(frame: &LocalFrame, reach_m: f64) -> Result<Area, TerrainError> {
    let origin = frame.origin();
    let corner = |east, north| frame.to_geodetic(&Vector3::new(east, north, 0.0));
    let offsets = [-reach_m, 0.0, reach_m];
    let places = offsets.into_iter().flat_map(|e| offsets.map(|n| corner(e, n)));
    let mut area = Area {
        south: f64::INFINITY,
        north: f64::NEG_INFINITY,
        west: f64::INFINITY,
        east: f64::NEG_INFINITY,
    };
    for place in places {
        area.south = area.south.min(place.lat_deg);
        area.north = area.north.max(place.lat_deg);
        area.west = area.west.min(place.lon_deg);
        area.east = area.east.max(place.lon_deg);
    }
    // 50 km are less than 10° of longitude up to 87° of latitude.
    if origin.lat_deg.abs() > 87.0 || area.east - area.west > 180.0 {
        return Err(TerrainError::Edge { lat_deg: origin.lat_deg, lon_deg: origin.lon_deg });
    }
    Ok(area)
}

/// The files of a folder in the order of their names.
fn files(folder: &Path) -> Result<Vec<PathBuf>, TerrainError> {
    let failed = |source| TerrainError::Read { path: folder.to_owned(), source };
    let entries = fs::read_dir(folder).map_err(failed)?;
    let paths = entries.map(|entry| entry.map(|entry| entry.path()));
    let mut paths = paths.collect::<Result<Vec<_>, _>>().map_err(failed)?;
    paths.sort();
    Ok(paths)
}

/// The square degree of a place, as SRTM's tiles are named.
fn name(lat_deg: f64, lon_deg: f64) -> String {
    let south = lat_deg.floor();
    let west = lon_deg.floor();
    let letter = |value: f64, positive, negative| if value < 0.0 { negative } else { positive };
    let lat = letter(south, 'N', 'S');
    let lon = letter(west, 'E', 'W');
    format!("{lat}{:02}{lon}{:03}", south.abs(), west.abs())
}

#[cfg(test)]
mod tests {
    use approx::{abs_diff_eq, assert_abs_diff_eq};
    use std::f64::consts::PI;

    use tiff::{
        encoder::{TiffEncoder, colortype::Gray32Float},
        tags::Tag,
    };

    use super::*;
    use crate::geodesy::Geodetic;

    /// A folder that is gone at the end.
    struct Folder(PathBuf);

    impl Folder {
        fn new(name: &str) -> Self {
            let folder = format!("foxhunt-terrain-{name}-{}", std::process::id());
            let folder = std::env::temp_dir().join(folder);
            fs::create_dir_all(&folder).expect("a folder for this test");
            Self(folder)
        }

        fn write(&self, name: &str, bytes: &[u8]) -> PathBuf {
            let path = self.0.join(name);
            fs::write(&path, bytes).expect("it is ours");
            path
        }
    }

    impl Drop for Folder {
        fn drop(&mut self) {
            let _ = fs::remove_dir_all(&self.0);
        }
    }

    fn frame(lat_deg: f64, lon_deg: f64) -> LocalFrame {
        LocalFrame::new(Geodetic::new(lat_deg, lon_deg, 0.0).expect("on Earth")).expect("on Earth")
    }

    /// Whole metres, so that HGT holds them.
    fn height(row: usize, column: usize) -> i16 {
        i16::try_from((row * 7 + column * column) % 901).expect("below 901")
    }

    fn hgt(side: usize, height: impl Fn(usize, usize) -> i16) -> Vec<u8> {
        let places = (0..side).flat_map(|row| (0..side).map(move |column| (row, column)));
        places.flat_map(|(row, column)| height(row, column).to_be_bytes()).collect()
    }

    fn geotiff(side: u32, tie: [f64; 2], step: f64, points: bool, heights: &[f32]) -> Vec<u8> {
        let mut bytes = std::io::Cursor::new(Vec::new());
        let mut encoder = TiffEncoder::new(&mut bytes).expect("memory");
        let mut image = encoder.new_image::<Gray32Float>(side, side).expect("memory");
        let raster = if points { 2 } else { 1 };
        let keys: [u16; 12] = [1, 1, 0, 2, 1024, 0, 1, 2, 1025, 0, 1, raster];
        let tags = image.encoder();
        let tie = [0.0, 0.0, 0.0, tie[1], tie[0], 0.0];
        tags.write_tag(Tag::ModelPixelScaleTag, &[step, step, 0.0][..]).expect("memory");
        tags.write_tag(Tag::ModelTiepointTag, &tie[..]).expect("memory");
        tags.write_tag(Tag::GeoKeyDirectoryTag, &keys[..]).expect("memory");
        tags.write_tag(Tag::GdalNodata, "-9999").expect("memory");
        image.write_data(heights).expect("memory");
        bytes.into_inner()
    }

    /// Row and column of a place in a tile of `side` samples to the degree.
    fn index(frame: &LocalFrame, place: &Vector2<f64>, side: usize) -> (f64, f64) {
        let place = frame.to_geodetic(&Vector3::new(place.x, place.y, 0.0));
        let steps = f64::from(u32::try_from(side - 1).expect("some thousand"));
        ((place.lat_deg.ceil() - place.lat_deg) * steps, place.lon_deg.rem_euclid(1.0) * steps)
    }

    #[test]
    fn hgt_is_bilinear_between_its_samples() {
        let folder = Folder::new("hgt");
        let frame = frame(-33.4, -70.3);
        // 30 m to a row, and a plane beside it: exact everywhere.
        folder.write("S34W071.hgt", &hgt(1201, |row, _| i16::try_from(row).expect("1200")));
        let model = ElevationModel::read(&folder.0, frame, 800.0).expect("a tile");
        for k in 0..40 {
            let angle = f64::from(k) * 0.1 * PI;
            let place = Vector2::new(angle.cos(), angle.sin()) * 20.0 * f64::from(k);
            let (row, _) = index(&frame, &place, 1201);
            let height = model.height(&place).expect("within the reach");
            assert_abs_diff_eq!(height, row, epsilon = 1e-3);
        }
        assert_eq!(model.height(&Vector2::new(801.0, 0.0)), None);
        assert_eq!(model.height(&Vector2::new(f64::NAN, 0.0)), None);
        assert_abs_diff_eq!(
            model.step_m(),
            111_000.0 / 1200.0 * f64::to_radians(33.4).cos(),
            epsilon = 1e-6
        );
        // A sample by itself, whose row and column are not mixed up.
        folder.write("S34W071.hgt", &hgt(1201, height));
        let model = ElevationModel::read(&folder.0, frame, 800.0).expect("a tile");
        let sample = Geodetic::new(-33.0 - 481.0 / 1200.0, -71.0 + 839.0 / 1200.0, 0.0);
        let place = frame.to_local(&sample.expect("on Earth")).xy();
        let found = model.height(&place).expect("within the reach");
        assert_abs_diff_eq!(found, f64::from(height(481, 839)), epsilon = 0.05);
    }

    #[test]
    fn geotiff_has_the_heights_of_hgt() {
        let folder = Folder::new("tiff");
        let frame = frame(50.5, 14.5);
        let other = Folder::new("same");
        let side = 61;
        folder.write("n50e014.HGT", &hgt(side, height));
        let places = (0..side).flat_map(|row| (0..side).map(move |column| (row, column)));
        let heights: Vec<f32> = places.map(|(r, c)| f32::from(height(r, c))).collect();
        let hgt = ElevationModel::read(&folder.0, frame, 20_000.0).expect("a tile");
        let step = 1.0 / 60.0;
        for points in [true, false] {
            // Cells have their tie point at the corner, half a step out.
            let out = if points { 0.0 } else { 0.5 * step };
            let tie = [51.0 + out, 14.0 - out];
            other.write("dem.tif", &geotiff(61, tie, step, points, &heights));
            let tiff = ElevationModel::read(&other.0, frame, 20_000.0).expect("a tile");
            for k in 0..400 {
                let place = Vector2::new(f64::from(k) * 47.0 - 9000.0, f64::from(k) * -31.0);
                let one = hgt.height(&place);
                let two = tiff.height(&place);
                let difference = one.expect("within") - two.expect("within");
                assert!(abs_diff_eq!(difference, 0.0, epsilon = 1e-3), "{points}: {one:?} {two:?}");
            }
        }
    }

    #[test]
    fn tiles_meet_at_their_borders() {
        let folder = Folder::new("border");
        let frame = frame(50.0, 14.0);
        for (name, level) in [("N49E013", 10), ("N49E014", 20), ("N50E013", 30), ("N50E014", 40)] {
            folder.write(&format!("{name}.hgt"), &hgt(101, |_, _| level));
        }
        let model = ElevationModel::read(&folder.0, frame, 3000.0).expect("four tiles");
        for (place, level) in [([-9.0, -9.0], 10.0), ([9.0, -9.0], 20.0), ([-9.0, 9.0], 30.0)] {
            assert_eq!(model.height(&place.into()), Some(level));
        }
        assert_abs_diff_eq!(model.relief_m(), 30.0, epsilon = 1e-9);
        fs::remove_file(folder.0.join("N49E013.hgt")).expect("it is there");
        let error = ElevationModel::read(&folder.0, frame, 3000.0).expect_err("one is missing");
        let text = error.to_string();
        assert!(text.contains("N49E013.hgt") && text.contains("foxhunt-terrain-border"), "{text}");
    }

    #[test]
    fn what_is_no_height_is_named() {
        let folder = Folder::new("wrong");
        let frame = frame(50.5, 14.5);
        let refused = |reach| {
            let error = ElevationModel::read(&folder.0, frame, reach);
            error.expect_err("nonsense").to_string()
        };
        assert!(refused(1000.0).contains("N50E014.hgt"));
        assert!(refused(-1.0).contains("-1") && refused(f64::NAN).contains("NaN"));
        folder.write("readme.txt", b"no tile");
        folder.write("N50E014.hgt", &hgt(1201, |row, _| if row == 600 { -32_768 } else { 7 }));
        assert!(refused(1000.0).contains("is void") && refused(1000.0).contains("50.50000°"));
        let path = folder.write("N50E014.hgt", &[0; 1000]);
        assert!(refused(1000.0).contains("N50E014.hgt: 1000 bytes"));
        fs::remove_file(path).expect("it is there");
        let path = folder.write("hill.hgt", &hgt(11, |_, _| 0));
        assert!(refused(1000.0).contains("hill.hgt: its name"));
        fs::remove_file(path).expect("it is there");
        folder.write("dem.tif", b"II*\0nonsense");
        assert!(refused(1000.0).contains("dem.tif"));
        let level = vec![5.0; 121];
        let mut void = level.clone();
        void[60] = -9999.0;
        folder.write("dem.tif", &geotiff(11, [51.0, 14.0], 0.1, true, &void));
        assert!(refused(1000.0).contains("dem.tif: the height at 50.50000°, 14.50000° is void"));
        folder.write("dem.tif", &geotiff(11, [51.0, 14.0], 0.1, true, &level));
        assert!(ElevationModel::read(&folder.0, frame, 1000.0).is_ok());
        let elsewhere = ElevationModel::read(Path::new("/nowhere/tiles"), frame, 1000.0);
        assert!(elsewhere.expect_err("no folder").to_string().contains("/nowhere/tiles"));
    }
}
