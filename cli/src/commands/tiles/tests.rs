use std::{fs, path::PathBuf};

use super::*;

/// First bytes of a PNG; the rest does not matter here.
const PNG: &[u8] = b"\x89PNG\r\n\x1a\nrest";

/// A folder of a test's own.
fn fresh(name: &str) -> PathBuf {
    let folder = std::env::temp_dir().join(format!("foxhunt-tiles-{name}-{}", std::process::id()));
    let _ = fs::remove_dir_all(&folder);
    fs::create_dir_all(&folder).expect("a folder");
    folder
}

fn at(zoom: u8, column: u32, row: u32) -> TileAt {
    TileAt::new(zoom, column, row).expect("it is on the map")
}

fn refused(path: &Path) -> String {
    let CliError::Input(error) = Tiles::open(path).expect_err("it is no map") else {
        panic!("a wrong map is wrong input")
    };
    let source = error.source().map(ToString::to_string).unwrap_or_default();
    format!("{error}: {source}")
}

#[test]
fn a_folder_of_tiles() {
    let folder = fresh("folder");
    assert!(refused(&folder).contains("no tile"), "{}", refused(&folder));
    fs::create_dir_all(folder.join("13/4417")).expect("a folder");
    fs::write(folder.join("13/4417/2776.png"), PNG).expect("a tile");
    fs::write(folder.join("13/4417/2777.jpg"), b"\xff\xd8\xff\xe0").expect("a tile");
    fs::write(folder.join("13/4417/2778.png"), b"<html>not found").expect("no tile");
    // A level without tiles is none.
    fs::create_dir_all(folder.join("19")).expect("a folder");
    fs::write(folder.join("metadata.json"), r#"{"attribution":"© us","name":"x"}"#).expect("text");
    let tiles = Tiles::open(&folder).expect("a map");
    assert_eq!(tiles.about().zooms, [13, 13]);
    assert_eq!(tiles.about().attribution.as_deref(), Some("© us"));
    let png = tiles.tile(at(13, 4417, 2776)).expect("it is there");
    assert_eq!((png.bytes.as_slice(), png.content_type), (PNG, "image/png"));
    // The bytes count, not the name.
    assert_eq!(tiles.tile(at(13, 4417, 2777)).expect("there").content_type, "image/jpeg");
    assert_eq!(tiles.tile(at(13, 4417, 2778)), None);
    assert_eq!(tiles.tile(at(13, 0, 0)), None);
    fs::remove_dir_all(&folder).expect("it was ours");
}

#[test]
fn tiles_outside_the_map_are_none() {
    assert_eq!(TileAt::new(0, 0, 1), None);
    assert_eq!(TileAt::new(3, 8, 0), None);
    assert_eq!(TileAt::new(200, 0, 0), None);
    assert!(TileAt::new(3, 7, 7).is_some());
}

#[cfg(feature = "store")]
#[test]
fn mbtiles_count_rows_from_the_south() {
    let folder = fresh("mbtiles");
    let file = folder.join("map.mbtiles");
    let connection = rusqlite::Connection::open(&file).expect("a file");
    let tables = "CREATE TABLE metadata (name TEXT, value TEXT);
         CREATE TABLE tiles (zoom_level INTEGER, tile_column INTEGER, tile_row INTEGER,
         tile_data BLOB);
         INSERT INTO metadata VALUES ('attribution', 'us');";
    connection.execute_batch(tables).expect("tables");
    assert!(refused(&file).contains("no tile"), "{}", refused(&file));
    let insert = |bytes: &[u8]| {
        let tile = rusqlite::params![13, 4417, 8191 - 2776, bytes];
        connection.execute("INSERT INTO tiles VALUES (?1, ?2, ?3, ?4)", tile).expect("a tile");
    };
    insert(b"\x1f\x8bvector");
    assert!(refused(&file).contains("images are needed"), "{}", refused(&file));
    connection.execute("DELETE FROM tiles", []).expect("none left");
    insert(PNG);
    let tiles = Tiles::open(&file).expect("a map");
    assert_eq!(tiles.about(), &LiveTiles { zooms: [13; 2], attribution: Some("us".to_owned()) });
    assert_eq!(tiles.tile(at(13, 4417, 2776)).expect("it is there").bytes, PNG);
    assert_eq!(tiles.tile(at(13, 4417, 8191 - 2776)), None);
    // The header alone is not a database.
    fs::write(&file, b"SQLite format 3\0").expect("a file");
    assert!(refused(&file).contains("damaged"), "{}", refused(&file));
    fs::remove_dir_all(&folder).expect("it was ours");
}

/// An archive of one tile at 1/1/0, by the specification of PMTiles 3; nothing is compressed.
fn archive(tile_type: u8) -> Vec<u8> {
    let metadata = br#"{"attribution":"us"}"#;
    // One entry: the id 4 (1/1/0 is the last of the Hilbert curve from 1), one long, its length, at
    // the begin.
    let directory = [1, 4, 1, u8::try_from(PNG.len()).expect("short"), 1];
    let mut bytes = b"PMTiles\x03".to_vec();
    let mut offset = 127;
    let lengths = [directory.len(), metadata.len(), 0, PNG.len()];
    for length in lengths.map(|length| u64::try_from(length).expect("short")) {
        bytes.extend(u64::to_le_bytes(offset));
        bytes.extend(length.to_le_bytes());
        offset += length;
    }
    for _ in 0..3 {
        bytes.extend(1_u64.to_le_bytes());
    }
    // Clustered, uncompressed twice, the type, the zoom levels.
    bytes.extend([1, 1, 1, tile_type, 1, 1]);
    bytes.resize(127, 0);
    bytes.extend(directory);
    bytes.extend(metadata);
    bytes.extend(PNG);
    bytes
}

#[test]
fn pmtiles() {
    let folder = fresh("pmtiles");
    let file = folder.join("map.pmtiles");
    let whole = archive(2);
    fs::write(&file, &whole).expect("a file");
    let tiles = Tiles::open(&file).expect("a map");
    assert_eq!(tiles.about(), &LiveTiles { zooms: [1; 2], attribution: Some("us".to_owned()) });
    assert_eq!(tiles.tile(at(1, 1, 0)).expect("it is there").bytes, PNG);
    assert_eq!(tiles.tile(at(1, 0, 0)), None);
    fs::write(&file, &whole[..whole.len() - 3]).expect("a file");
    assert!(refused(&file).contains("cut short"), "{}", refused(&file));
    fs::write(&file, archive(1)).expect("a file");
    assert!(refused(&file).contains("images are needed"), "{}", refused(&file));
    let mut damaged = whole;
    damaged[127] = 0xff;
    fs::write(&file, damaged).expect("a file");
    assert!(refused(&file).contains("damaged"), "{}", refused(&file));
    fs::remove_dir_all(&folder).expect("it was ours");
}

#[test]
fn what_is_no_map_is_named() {
    let folder = fresh("none");
    let file = folder.join("map.png");
    fs::write(&file, PNG).expect("a file");
    for path in [file, folder.join("no/such")] {
        let error = refused(&path);
        assert!(error.contains(&path.display().to_string()), "{error}");
    }
    fs::remove_dir_all(&folder).expect("it was ours");
}
