//! Beliefs as tiles of Web Mercator in SQLite (MBTiles 1.3).

use foxhunt_wire::geodesy::{Geodetic, LocalFrame};
use rusqlite::{Connection, params};

use super::{ExportError, kml::bounds, paint::Paint};
use crate::{
    overview::Overview,
    page::{degrees, mercator},
};

/// Pixels of a side of a tile.
const SIDE: u32 = 256;

/// Circumference of the Earth in Web Mercator, in metres.
const EQUATOR_M: f64 = std::f64::consts::TAU * 6_378_137.0;

/// Number of coarser levels, for a view from farther off.
const COARSER: u8 = 6;

/// The finest level of all.
const FINEST: f64 = 22.0;

/// Number of tiles of the finest level.
const MOST_FINE: u64 = 256;

const TABLES: &str = "CREATE TABLE metadata (name TEXT, value TEXT);
    CREATE TABLE tiles (zoom_level INTEGER, tile_column INTEGER, tile_row INTEGER, tile_data BLOB);
    CREATE UNIQUE INDEX tile_index ON tiles (zoom_level, tile_column, tile_row);";

pub(super) fn write(overview: &Overview, frame: &LocalFrame) -> Result<Vec<u8>, ExportError> {
    let paint = Paint::of(overview).ok_or(ExportError::NoBelief)?;
    let (low, high) = paint.corners();
    let (south, west, north, east) = bounds(frame, low, high);
    let at = |lat_deg, lon_deg| Geodetic { lat_deg, lon_deg, alt_m: frame.origin().alt_m };
    let corners = [mercator(&at(north, west)), mercator(&at(south, east))];
    let metres = EQUATOR_M * libm::cos(frame.origin().lat_deg.to_radians());
    // Half a cell to a pixel at least.
    let level = libm::log2(2.0 * metres / (f64::from(SIDE) * paint.cell_m())).ceil();
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped")]
    let mut finest = level.clamp(0.0, FINEST) as u8;
    while finest > 0 && Cover::of(corners, finest).count() > MOST_FINE {
        finest -= 1;
    }
    let coarsest = finest.saturating_sub(COARSER);
    let mut connection = Connection::open_in_memory().map_err(ExportError::write)?;
    connection.execute_batch(TABLES).map_err(ExportError::write)?;
    let metadata = [
        ("name", format!("foxhunt: {}", overview.title)),
        ("type", "overlay".to_owned()),
        ("format", "png".to_owned()),
        ("description", "Regions that hold the transmitter with 50, 80 and 95 %".to_owned()),
        ("bounds", format!("{west:.7},{south:.7},{east:.7},{north:.7}")),
        ("minzoom", coarsest.to_string()),
        ("maxzoom", finest.to_string()),
    ];
    for (name, value) in metadata {
        let row = params![name, value];
        let insert = "INSERT INTO metadata VALUES (?1, ?2)";
        let _ = connection.execute(insert, row).map_err(ExportError::write)?;
    }
    for zoom in coarsest..=finest {
        let Cover { columns, rows } = Cover::of(corners, zoom);
        for (column, row) in columns.flat_map(|column| rows.clone().map(move |row| (column, row))) {
            let picture = paint.picture(SIDE, SIDE, |x, y| {
                let side = f64::from(zoom).exp2();
                let share =
                    |tile: u32, pixel: f64| (f64::from(tile) + pixel / f64::from(SIDE)) / side;
                let [lat_deg, lon_deg] = degrees([share(column, x), share(row, y)]);
                frame.to_local(&at(lat_deg, lon_deg)).xy()
            });
            if picture.is_empty() {
                continue;
            }
            let png = picture.png().map_err(ExportError::write)?;
            // Rows are counted from the South.
            let from_south = (1_u32 << zoom) - 1 - row;
            let tile = params![zoom, column, from_south, png];
            let insert = "INSERT INTO tiles VALUES (?1, ?2, ?3, ?4)";
            let _ = connection.execute(insert, tile).map_err(ExportError::write)?;
        }
    }
    let whole = connection.serialize("main").map_err(ExportError::write)?;
    Ok(whole.to_vec())
}

/// Columns and rows of the tiles of a level over an area.
struct Cover {
    columns: std::ops::RangeInclusive<u32>,
    rows: std::ops::RangeInclusive<u32>,
}

impl Cover {
    fn of([first, last]: [[f64; 2]; 2], zoom: u8) -> Self {
        let side = f64::from(zoom).exp2();
        let [[west, north], [east, south]] = [first, last].map(|corner| {
            corner.map(|share| {
                #[expect(
                    clippy::cast_possible_truncation,
                    clippy::cast_sign_loss,
                    reason = "clamped"
                )]
                let tile = (share * side).floor().clamp(0.0, side - 1.0) as u32;
                tile
            })
        });
        Self { columns: west..=east, rows: north..=south }
    }

    fn count(&self) -> u64 {
        let length =
            |range: &std::ops::RangeInclusive<u32>| u64::from(range.end() - range.start()) + 1;
        length(&self.columns) * length(&self.rows)
    }
}
