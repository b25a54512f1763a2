use approx::assert_abs_diff_eq;
use std::{io::Read, path::Path};

use foxhunt_core::{Bearing, BearingModes, Estimate, Level};
use foxhunt_hunt::locate::{Located, Region, Rival};
use foxhunt_wire::geodesy::{Geodetic, LocalFrame};
use nalgebra::{Matrix2, Vector2, Vector3};
#[cfg(feature = "mcap")]
use nalgebra::{Quaternion, UnitQuaternion};
use quick_xml::{Reader, events::Event};
use serde_json::Value;

use super::*;
use crate::overview::{Believed, Received, SearchOverview};

const ORIGIN: Geodetic = Geodetic { lat_deg: 50.0, lon_deg: 14.0, alt_m: 200.0 };
const HOSTILE: &str = "fox <&> \"one\" \u{1}";

/// Two places of one receiver with bearings, one fix with a region and a rival.
fn overview() -> Overview {
    let mut overview = Overview {
        title: "meadow".to_owned(),
        epoch_unix_s: Some(1_616_345_508.0),
        frame: LocalFrame::new(ORIGIN).ok(),
        ..Overview::default()
    };
    let receiver = overview.receiver("drone 1");
    for (time, place, angle) in [(1.0, [0.0, 0.0, 4.0], 0.0), (2.0, [30.0, 40.0, 4.0], 1.0)] {
        overview.add(Received {
            time,
            receiver,
            search: Some(0),
            place: Vector3::from(place),
            level: Some(Level { rss_dbm: -60.0, sigma_db: 2.0 }),
            bearing: Some(Bearing { angle, sigma: 0.1, confidence: 0.9 }),
            modes: BearingModes::default(),
            remark: None,
            used: true,
            struck: false,
            id: None,
            nis: None,
            turn: None,
        });
    }
    let covariance = Matrix2::new(4.0, 0.0, 0.0, 1.0);
    let mut located = Located::at(Estimate { mean: Vector2::new(100.0, 50.0), covariance });
    located.observations = 2;
    located.rivals = vec![Rival { place: Vector2::new(-100.0, 50.0), relative_density: 0.5 }];
    let corners = [[90.0, 40.0], [110.0, 40.0], [110.0, 60.0], [90.0, 40.0]];
    located.regions_95 = vec![Region {
        probability: 0.95,
        area_m2: 200.0,
        outline: corners.map(Vector2::from).to_vec(),
        holes: Vec::new(),
    }];
    let truth = Some(Vector2::new(101.0, 50.0));
    let located = SearchOverview::located(HOSTILE.to_owned(), &located, truth, 2.0);
    let smoothed = [1.0, 2.0].map(|time| Believed { time, ..located.beliefs[0].clone() });
    overview.searches.push(SearchOverview { smoothed: smoothed.to_vec(), ..located });
    overview
}

fn text(format: Format) -> String {
    String::from_utf8(export(&overview(), format).expect("it has an origin and a time"))
        .expect("UTF-8")
}

/// Counts an element's beginnings in a text that has to be well-formed.
fn elements(text: &str, name: &str) -> usize {
    let mut reader = Reader::from_str(text);
    let mut found = 0;
    loop {
        match reader.read_event().expect("well-formed") {
            Event::Eof => return found,
            Event::Start(start) | Event::Empty(start)
                if start.name().as_ref() == name.as_bytes() =>
            {
                found += 1;
            }
            _ => {}
        }
    }
}

/// The fix on Earth, converted by the frame itself.
fn fix() -> Geodetic {
    LocalFrame::new(ORIGIN).expect("a place").to_geodetic(&Vector3::new(100.0, 50.0, 0.0))
}

#[test]
fn geojson_has_every_feature_where_it_is() {
    let json: Value = serde_json::from_str(&text(Format::GeoJson)).expect("JSON");
    assert_eq!(json["type"], "FeatureCollection");
    let features = json["features"].as_array().expect("a list");
    let of = |kind: &str| features.iter().filter(|f| f["properties"]["kind"] == kind).count();
    let kinds = ["path", "bearing", "fix", "ellipse-95", "region-95", "rival", "truth"];
    assert_eq!(kinds.map(of), [1, 2, 1, 1, 1, 1, 1]);
    assert_eq!([of("smoothed-track"), of("track")], [1, 0]);
    let found = features.iter().find(|f| f["properties"]["kind"] == "fix").expect("a fix");
    let [lon, lat] = [0, 1].map(|i| found["geometry"]["coordinates"][i].as_f64().expect("degrees"));
    // A hundred-millionth of a degree is a millimetre.
    assert_abs_diff_eq!(lon, fix().lon_deg, epsilon = 1e-8);
    assert_abs_diff_eq!(lat, fix().lat_deg, epsilon = 1e-8);
    assert_eq!(found["properties"]["name"], HOSTILE);
    assert_eq!(found["properties"]["time"], "2021-03-21T16:51:50Z");
    assert_eq!(found["properties"]["error_m"], 1.0);
    // The longer axis lies East-West.
    assert_eq!(found["properties"]["along_deg_compass"], 90.0);
    let ellipse = features.iter().find(|f| f["properties"]["kind"] == "ellipse-95").expect("one");
    let ring = ellipse["geometry"]["coordinates"][0].as_array().expect("a ring");
    assert_eq!(ring.first(), ring.last(), "closed");
    let bearing = features.iter().find(|f| f["properties"]["kind"] == "bearing").expect("one");
    assert_eq!(bearing["properties"]["bearing_deg_compass"], 90.0, "East");
    let [from, to] = [0, 1].map(|i| &bearing["geometry"]["coordinates"][i]);
    assert!(to[0].as_f64() > from[0].as_f64(), "{from} to {to}");
}

#[test]
fn kml_gpx_and_cot_are_well_formed_and_whole() {
    let kml = text(Format::Kml);
    assert_eq!(elements(&kml, "Placemark"), 9);
    assert_eq!((elements(&kml, "Polygon"), elements(&kml, "LineString")), (2, 4));
    assert!(kml.contains("fox &lt;&amp;&gt;") && !kml.contains('\u{1}'));
    let gpx = text(Format::Gpx);
    // Fix, rival, truth; path, smoothed track, ellipse, region and the bearings.
    assert_eq!((elements(&gpx, "wpt"), elements(&gpx, "trk")), (3, 5));
    assert_eq!(elements(&gpx, "trkseg"), 6);
    let before = gpx.rfind("<wpt").expect("waypoints") < gpx.find("<trk").expect("tracks");
    assert!(before, "the order of the schema");
    let cot = text(Format::Cot);
    assert_eq!(cot.lines().count(), 10, "the receiver, and each feature");
    for line in cot.lines() {
        assert_eq!((elements(line, "event"), elements(line, "point")), (1, 1), "{line}");
    }
    let found = cot.lines().find(|line| line.contains(r#"type="a-u-G""#)).expect("the fix");
    assert!(found.contains(r#"time="2021-03-21T16:51:50Z""#), "{found}");
    // √χ²₂ at 95 % is 2.4477, the larger σ 2 m.
    assert!(found.contains(r#"ce="4.9""#), "{found}");
}

#[test]
fn a_table_has_metres_with_or_without_an_origin() {
    let with = text(Format::Csv);
    let rows: Vec<_> = with.lines().collect();
    let each = "header, receptions, estimate, smoothed, rival, truth";
    assert_eq!(rows.len(), 1 + 2 + 1 + 2 + 1 + 1, "{each}");
    assert!(rows[4].starts_with("smoothed,") && rows[4].ends_with(",1.000"), "{}", rows[4]);
    assert!(rows[1].starts_with("reception,drone 1,1.000,2021-03-21T16:51:49Z,50.00000000,"));
    let without = Overview { frame: None, epoch_unix_s: None, ..overview() };
    let table = export(&without, Format::Csv).expect("metres");
    let table = String::from_utf8(table).expect("UTF-8");
    assert!(table.contains("reception,drone 1,1.000,,,,0.000,0.000,4.000,-60.00"), "{table}");
}

/// The numbers of a message at a place behind its header, where CDR has them.
#[cfg(feature = "mcap")]
fn doubles<const N: usize>(message: &[u8], at: usize) -> [f64; N] {
    std::array::from_fn(|number| {
        let begin = 4 + at + 8 * number;
        let bytes = message[begin..begin + 8].try_into().expect("eight bytes");
        f64::from_le_bytes(bytes)
    })
}

#[cfg(feature = "mcap")]
#[test]
fn mcap_is_read_back() {
    let bytes = export(&overview(), Format::Mcap).expect("it has an origin");
    let messages = ::mcap::MessageStream::new(&bytes).expect("MCAP");
    let messages: Vec<_> = messages.map(|message| message.expect("whole")).collect();
    let of = |topic: &str| {
        messages.iter().filter(|message| message.channel.topic == topic).collect::<Vec<_>>()
    };
    // Bags of ROS 2 have messages in CDR alone, and names of topics that ROS allows.
    assert!(messages.iter().all(|message| {
        let legal = |c: char| c.is_ascii_alphanumeric() || "_/".contains(c);
        let schema = message.channel.schema.as_ref().expect("a schema");
        message.channel.message_encoding == "cdr"
            && schema.encoding == "ros2msg"
            && !schema.data.is_empty()
            && message.channel.topic.chars().all(legal)
    }));
    assert_eq!(of("/foxhunt/map").len(), 1);
    let poses = of("/foxhunt/drone_0/pose");
    assert_eq!(poses.len(), 2);
    assert_eq!(poses[1].channel.metadata["name"], "drone 1");
    // Stamp, and the text "map" with its length.
    let pose: [f64; 7] = doubles(&poses[1].data, 16);
    let expected = [30.0, 40.0, 4.0, 0.0, 0.0, 0.0, 1.0];
    assert_eq!(pose.map(f64::to_bits), expected.map(f64::to_bits));
    assert_eq!(poses[1].data[4..8], 1_616_345_510_u32.to_le_bytes());
    assert_eq!(of("/foxhunt/drone_0/path").len(), 2);

    let fixes = of("/foxhunt/beacon_0/fix");
    assert_eq!(fixes[0].channel.metadata["name"], HOSTILE);
    // Stamp, the text "beacon_0" with its length, status and service.
    let [lat, lon, _, east_variance] = doubles(&fixes[0].data, 24);
    // The difference is the rounding of doubles.
    assert_abs_diff_eq!(lat, fix().lat_deg, epsilon = 1e-12);
    assert_abs_diff_eq!(lon, fix().lon_deg, epsilon = 1e-12);
    assert_eq!(east_variance.to_bits(), 4.0_f64.to_bits());
    let estimates = of("/foxhunt/beacon_0/estimate");
    let [variance, _, _, _, _, _, _, north_variance] = doubles(&estimates[0].data, 72);
    assert_eq!([variance, north_variance].map(f64::to_bits), [4.0_f64, 1.0].map(f64::to_bits));
}

#[cfg(feature = "mcap")]
#[test]
fn frames_of_an_mcap_lead_from_the_antenna_to_the_earth() {
    let overview = overview();
    let bytes = export(&overview, Format::Mcap).expect("it has an origin");
    let messages = ::mcap::MessageStream::new(&bytes).expect("MCAP");
    let mut frames = Vec::new();
    for message in messages.map(|message| message.expect("whole")) {
        if !message.channel.topic.starts_with("/tf") {
            continue;
        }
        let text = |at: usize| {
            let length = usize::from(message.data[4 + at]);
            let text = &message.data[8 + at..7 + at + length];
            (String::from_utf8(text.to_vec()).expect("UTF-8"), at + 4 + length)
        };
        // One transform, its stamp, its parent, its child, its place, its turn.
        assert_eq!(message.data[4], 1);
        let (parent, end) = text(12);
        let (child, end) = text(end.next_multiple_of(4));
        let [x, y, z, i, j, k, w] = doubles(&message.data, end.next_multiple_of(8));
        let turn = UnitQuaternion::new_unchecked(Quaternion::new(w, i, j, k));
        assert_abs_diff_eq!(turn.norm(), 1.0, epsilon = 1e-12);
        frames.push((message.channel.topic.clone(), parent, child, Vector3::new(x, y, z), turn));
    }
    let last = |child: &str| frames.iter().rfind(|frame| frame.2 == child).expect("a frame");
    let (topic, parent, _, centre, turn) = last("map");
    assert_eq!((topic.as_str(), parent.as_str()), ("/tf_static", "earth"));
    let local = Vector3::new(1200.0, -700.0, 30.0);
    let on_earth = overview.frame.expect("an origin").to_geodetic(&local).to_ecef();
    assert!((centre + turn * local - on_earth).norm() < 1e-6);
    let (topic, parent, _, place, _) = last("drone_0");
    assert_eq!((topic.as_str(), parent.as_str()), ("/tf", "map"));
    assert_eq!(*place, Vector3::new(30.0, 40.0, 4.0));
    let (_, parent, _, place, turn) = last("drone_0/antenna");
    assert_eq!((parent.as_str(), *place), ("drone_0", Vector3::zeros()));
    // x points along the bearing, 1 rad from East.
    let along = turn * Vector3::x();
    assert!((along - Vector3::new(1.0_f64.cos(), 1.0_f64.sin(), 0.0)).norm() < 1e-12);
    assert_eq!(last("beacon_0").3, Vector3::new(100.0, 50.0, 0.0));
}

#[test]
fn what_is_missing_is_named() {
    let nowhere = Overview { frame: None, ..overview() };
    for format in [Format::GeoJson, Format::Kml, Format::Gpx, Format::Cot, Format::Mcap] {
        let error = export(&nowhere, format).expect_err("degrees of nowhere").to_string();
        assert!(error.contains("--origin"), "{format:?}: {error}");
    }
    let never = Overview { epoch_unix_s: None, ..overview() };
    let error = export(&never, Format::Cot).expect_err("times of nothing").to_string();
    assert!(error.contains("--start-utc"), "{error}");
    assert_eq!(Format::of_file(Path::new("a/b.GeoJSON")).expect("known"), Format::GeoJson);
    let error = Format::of_file(Path::new("hunt.shp")).expect_err("unknown").to_string();
    assert!(error.contains("\"shp\"") && error.contains(".kml"), "{error}");
}

/// The attribute of the first element that has it.
fn attribute<'a>(xml: &'a str, name: &str) -> &'a str {
    let begin = format!(" {name}=\"");
    let (_, rest) = xml.split_once(&begin).expect("the attribute");
    rest.split_once('"').expect("its end").0
}

fn feed(events: &[CotEvent]) -> Vec<(&str, &str)> {
    let mut found = Vec::new();
    for CotEvent { uid, xml, .. } in events {
        let xml = std::str::from_utf8(xml).expect("UTF-8");
        found.push((uid.as_str(), attribute(xml, "type")));
    }
    found
}

#[test]
fn a_fix_moves_and_does_not_multiply() {
    let mut overview = overview();
    overview.searches[0].name = "fox".to_owned();
    let walker = CotPlatform { name: "walker".to_owned(), on_the_ground: true };
    let mut feed_of = CotFeed::new(vec![walker], false);
    // Two seconds into the hunt.
    let now = 1_616_345_510.0;
    let before = feed_of.events(&overview, now, false).expect("it has an origin");
    assert_eq!(
        feed(&before),
        [
            ("foxhunt.meadow.receiver.walker", "a-f-G-U-C"),
            ("foxhunt.meadow.rival.fox.1", "b-m-p-s-m"),
            ("foxhunt.meadow.ellipse-95.fox", "u-d-f"),
            ("foxhunt.meadow.fix.fox", "a-u-G"),
            ("foxhunt.meadow.bearing.walker.fox.1", "u-rb-a"),
            ("foxhunt.meadow.bearing.walker.fox.2", "u-rb-a"),
        ]
    );
    let again = feed_of.events(&overview, now + 0.5, false).expect("it has an origin");
    assert_eq!(again, before, "nothing to send again");
    let mut moved = overview.searches[0].beliefs[0].clone();
    moved.estimate.mean.x += 30.0;
    moved.time = 3.0;
    overview.searches[0].beliefs.push(moved);
    feed_of.place(0, 3.0, Vector3::new(1.0, 2.0, 0.0));
    let after = feed_of.events(&overview, now + 1.0, false).expect("it has an origin");
    assert_eq!(feed(&after), feed(&before));
    let changed: Vec<_> = (after.iter().zip(&before))
        .filter(|(after, before)| after != before)
        .map(|(after, _)| after.uid.as_str())
        .collect();
    assert_eq!(
        changed,
        [
            "foxhunt.meadow.receiver.walker",
            "foxhunt.meadow.ellipse-95.fox",
            "foxhunt.meadow.fix.fox"
        ]
    );
    let fix = std::str::from_utf8(&after[3].xml).expect("UTF-8");
    assert_eq!(attribute(fix, "start"), "2021-03-21T16:51:51Z");
    assert_eq!(attribute(fix, "how"), "m-f");
    assert_abs_diff_eq!(after[3].stale_unix_s, now, epsilon = 302.0);
    let ended = feed_of.events(&overview, now + 1.0, true).expect("it has an origin");
    assert!(ended[3].stale_unix_s > now + 86_000.0, "a fix is of use after the hunt");
}

#[test]
fn the_ellipse_fits_into_a_datagram() {
    let mut feed_of = CotFeed::new(Vec::new(), true);
    let events = feed_of.events(&overview(), 1_616_345_510.0, false).expect("it has an origin");
    let ellipse = events.iter().find(|event| event.uid.contains("ellipse")).expect("an ellipse");
    assert!(ellipse.xml.len() < 1472, "{}", ellipse.xml.len());
    let xml = std::str::from_utf8(&ellipse.xml).expect("UTF-8");
    assert_eq!((elements(xml, "link"), attribute(xml, "how")), (25, "m-s"));
    let first = attribute(xml, "point");
    assert!(xml.rfind(&format!(r#"<link point="{first}""#)) > xml.find("<link"), "closed: {xml}");
}

#[test]
fn bearings_take_turns_and_what_is_old_goes() {
    let mut overview = overview();
    for time in 3..20 {
        let one = Received { time: f64::from(time), ..overview.received[1].clone() };
        overview.add(one);
    }
    // A prior is no fix.
    overview.searches[0].beliefs.iter_mut().for_each(|believed| believed.steps = 0);
    let mut feed_of = CotFeed::new(Vec::new(), false);
    let events = feed_of.events(&overview, 1_616_345_530.0, false).expect("it has an origin");
    let kinds = events.iter().map(|event| event.uid.split('.').nth(2).expect("a kind"));
    assert_eq!(kinds.clone().filter(|kind| *kind == "bearing").count(), 8);
    assert_eq!(kinds.filter(|kind| *kind != "bearing").collect::<Vec<_>>(), ["receiver"]);
    let later = feed_of.events(&overview, 1_616_345_530.0 + 601.0, false).expect("an origin");
    assert_eq!(later, [], "receivers and bearings are stale");
}

#[test]
fn things_of_one_name_have_two_uids() {
    let mut overview = overview();
    overview.searches[0].name = "fox".to_owned();
    overview.searches.push(overview.searches[0].clone());
    let twin = CotPlatform { name: "twin".to_owned(), on_the_ground: false };
    let mut feed_of = CotFeed::new(vec![twin.clone(), twin], false);
    feed_of.place(1, 2.0, Vector3::zeros());
    let events = feed_of.events(&overview, 1_616_345_510.0, false).expect("it has an origin");
    let mut uids: Vec<_> = events.iter().map(|event| event.uid.as_str()).collect();
    for uid in ["receiver.twin", "receiver.twin.2", "fix.fox", "fix.fox.2", "rival.fox.2.1"] {
        assert!(uids.contains(&format!("foxhunt.meadow.{uid}").as_str()), "{uid}: {uids:?}");
    }
    uids.sort_unstable();
    assert!(uids.windows(2).all(|pair| pair[0] != pair[1]), "{uids:?}");
}

#[test]
fn a_lost_drone_stays_where_it_was_heard() {
    let mut feed_of = CotFeed::new(Vec::new(), false);
    // The hunt has it elsewhere, and later.
    feed_of.place(0, 1.5, Vector3::zeros());
    let events = feed_of.events(&overview(), 1_616_345_510.0, false).expect("it has an origin");
    let xml = std::str::from_utf8(&events[0].xml).expect("UTF-8");
    let place = [attribute(xml, "lat"), attribute(xml, "lon")].map(|deg| deg.parse::<f64>());
    let off = |deg: f64, origin: f64| (deg - origin).abs() < 1e-9;
    let [Ok(lat), Ok(lon)] = place else { panic!("{xml}") };
    assert!(off(lat, ORIGIN.lat_deg) && off(lon, ORIGIN.lon_deg), "{xml}");
    assert!(events[0].stale_unix_s < 1_616_345_508.0 + 1.6 + 120.0, "{}", events[0].stale_unix_s);
}

#[test]
fn a_geotiff_has_each_cell_where_it_is() {
    use tiff::{
        decoder::{Decoder, DecodingResult},
        tags::Tag,
    };
    let bytes = export(&overview(), Format::GeoTiff).expect("it has an origin");
    let mut decoder = Decoder::new(std::io::Cursor::new(bytes)).expect("a TIFF");
    let (width, height) = decoder.dimensions().expect("a picture");
    let scale = decoder.get_tag_f64_vec(Tag::ModelPixelScaleTag).expect("the size of cells");
    let [west, north] = {
        let tie = decoder.get_tag_f64_vec(Tag::ModelTiepointTag).expect("a place");
        [tie[3], tie[4]]
    };
    let keys = decoder.get_tag_u16_vec(Tag::GeoKeyDirectoryTag).expect("keys");
    assert_eq!(keys.len(), 4 * (usize::from(keys[3]) + 1));
    assert!(keys[4..].chunks(4).map(|key| key[0]).is_sorted(), "{keys:?}");
    let DecodingResult::F32(values) = decoder.read_image().expect("values") else {
        panic!("numbers of 32 bits")
    };
    assert_eq!(values.len(), 2 * width as usize * height as usize);
    let mut mean = Vector2::zeros();
    let mut held = 0.0;
    for (index, cell) in (0_u32..).zip(values.chunks(2)) {
        let column = f64::from(index % width);
        let row = f64::from(index / width);
        let [east, north] = [west + (column + 0.5) * scale[0], north - (row + 0.5) * scale[1]];
        mean += Vector2::new(east, north) * f64::from(cell[0]);
        held += if cell[1] <= 0.5 { f64::from(cell[0]) } else { 0.0 };
    }
    assert_abs_diff_eq!(mean, Vector2::new(100.0, 50.0), epsilon = 1e-3);
    assert_abs_diff_eq!(held, 0.5, epsilon = 0.01);
    assert!(!decoder.more_images(), "one search");
}

/// Checks the sums of the parts of a PNG.
fn parts(png: &[u8]) -> Vec<(&[u8], &[u8])> {
    let mut rest = png.strip_prefix(b"\x89PNG\r\n\x1a\n").expect("a PNG");
    let mut parts = Vec::new();
    while let Some((head, after)) = rest.split_at_checked(8) {
        let (length, kind) = head.split_at(4);
        let length = u32::from_be_bytes(length.try_into().expect("four bytes")) as usize;
        let (data, after) = after.split_at(length);
        let (sum, after) = after.split_at(4);
        let mut own = flate2::Crc::new();
        own.update(kind);
        own.update(data);
        assert_eq!(own.sum().to_be_bytes(), sum);
        parts.push((kind, data));
        rest = after;
    }
    parts
}

#[test]
fn a_picture_is_a_png_and_an_overlay_holds_one() {
    let png = export(&overview(), Format::Png).expect("a belief");
    let parts = parts(&png);
    let kinds: Vec<_> = parts.iter().map(|(kind, _)| *kind).collect();
    assert_eq!(kinds, [b"IHDR", b"IDAT", b"IEND"]);
    // 14 by 7 σ: twice as wide as high.
    assert_eq!(parts[0].1[..8], [0, 0, 3, 232, 0, 0, 1, 244]);
    let mut rows = Vec::new();
    flate2::read::ZlibDecoder::new(parts[1].1).read_to_end(&mut rows).expect("compressed rows");
    assert_eq!(rows.len(), 500 * (1 + 4 * 1000));
    assert!(rows.chunks(1 + 4 * 1000).all(|row| row[0] == 0), "no row is filtered");
    let kmz = export(&overview(), Format::Kmz).expect("it has an origin");
    let holds = |part: &[u8]| kmz.windows(part.len()).any(|bytes| bytes == part);
    assert!(kmz.starts_with(b"PK\x03\x04") && holds(b"<href>belief.png</href>"));
    assert!(holds(b"\x89PNG") && holds(b"doc.kml"));
    let nothing = Overview { frame: LocalFrame::new(ORIGIN).ok(), ..Overview::default() };
    for format in [Format::Png, Format::Kmz, Format::GeoTiff] {
        let error = export(&nothing, format).expect_err("nothing was found");
        assert!(matches!(error, ExportError::NoBelief), "{error}");
    }
}

#[cfg(feature = "sqlite")]
#[test]
fn tiles_are_painted_where_the_fix_is() {
    let bytes = export(&overview(), Format::MbTiles).expect("it has an origin");
    let file = std::env::temp_dir().join(format!("foxhunt-tiles-{}.mbtiles", std::process::id()));
    std::fs::write(&file, bytes).expect("a file");
    let database = rusqlite::Connection::open(&file).expect("SQLite");
    let zooms = "SELECT min(zoom_level), max(zoom_level) FROM tiles";
    let (least, most): (u8, u8) =
        database.query_row(zooms, [], |row| Ok((row.get(0)?, row.get(1)?))).expect("tiles");
    assert_eq!(most - least, 6);
    let [x, y] = crate::page::mercator(&fix());
    for zoom in least..=most {
        let side = f64::from(zoom).exp2();
        let column = (x * side).floor();
        let row = side - 1.0 - (y * side).floor();
        let tile = "SELECT tile_data FROM tiles
             WHERE zoom_level = ?1 AND tile_column = ?2 AND tile_row = ?3";
        let at = rusqlite::params![zoom, column, row];
        let png: Vec<u8> = database.query_row(tile, at, |row| row.get(0)).expect("it is there");
        assert_eq!(parts(&png).len(), 3);
    }
    drop(database);
    std::fs::remove_file(&file).expect("it was ours");
}

/// The JSON of a topic.
fn of_topic(messages: &[MqttMessage], topic: &str) -> Value {
    let found = messages.iter().find(|message| message.topic == topic);
    let found = found.unwrap_or_else(|| panic!("{topic} is not in {messages:?}"));
    serde_json::from_slice(&found.payload).expect("JSON")
}

#[test]
fn mqtt_has_a_tracker_and_a_place_for_each_beacon_and_receiver() {
    let mut overview = overview();
    overview.searches[0].name = "fox 1".to_owned();
    let walker = CotPlatform { name: "Jäger/1".to_owned(), on_the_ground: true };
    let mut feed = MqttFeed::new(vec![walker], true);
    let messages = feed.messages(&overview).expect("it has an origin");
    assert_eq!(messages.len(), 4, "{messages:?}");
    let id = "foxhunt__meadow__beacon__fox_1";
    let config = of_topic(&messages, &format!("homeassistant/device_tracker/{id}/config"));
    assert_eq!(config["name"], "fox 1");
    assert_eq!(config["unique_id"], id);
    assert_eq!(config["source_type"], "gps");
    assert_eq!(config["json_attributes_topic"], "foxhunt/meadow/beacon/fox_1");
    assert_eq!(config["device"]["identifiers"][0], "foxhunt__meadow");
    assert!(config.get("availability_topic").is_none(), "a fix holds after the hunt");
    let place = of_topic(&messages, "foxhunt/meadow/beacon/fox_1");
    let frame = LocalFrame::new(ORIGIN).expect("an origin");
    let fix = frame.to_geodetic(&Vector3::new(100.0, 50.0, 0.0));
    let degrees = |name: &str| place[name].as_f64().expect("a number");
    assert_abs_diff_eq!(degrees("latitude"), fix.lat_deg, epsilon = 1e-8);
    assert_abs_diff_eq!(degrees("longitude"), fix.lon_deg, epsilon = 1e-8);
    // Two standard deviations are 2.4477 of 2 m.
    assert_abs_diff_eq!(degrees("gps_accuracy"), 4.8955, epsilon = 1e-3);
    assert_abs_diff_eq!(degrees("semi_minor_95_m"), 2.4477, epsilon = 1e-3);
    assert_abs_diff_eq!(degrees("along_deg_compass"), 90.0, epsilon = 1e-9);
    assert_eq!(place["beacon"], "fox 1");
    assert_eq!(place["simulated"], true);
    assert_eq!(place["receptions"], 2);
    assert!(place["outcome"].is_null());
    assert_eq!(place["rivals"].as_array().map(Vec::len), Some(1));
    let last = &place["last_reception"];
    assert_eq!(last["receiver"], "Jäger/1");
    assert_eq!(last["rss_dbm"], -60.0);
    assert_eq!(last["used"], true);
    let compass = last["bearing_deg_compass"].as_f64().expect("a bearing");
    assert_abs_diff_eq!(compass, 90.0 - 1.0_f64.to_degrees(), epsilon = 1e-3);

    let receiver = &messages[0].topic;
    let safe = receiver.strip_prefix("homeassistant/device_tracker/foxhunt__meadow__receiver__");
    let safe = safe.and_then(|rest| rest.strip_suffix("/config")).expect("its topic");
    assert!(safe.starts_with("Jaeger_1_"), "{safe}");
    let config = of_topic(&messages, receiver);
    assert_eq!(config["availability_topic"], availability_topic("meadow"));
    assert_eq!(config["icon"], "mdi:walk");
    let topic = format!("foxhunt/meadow/receiver/{safe}");
    let before = of_topic(&messages, &topic);
    assert!(before.get("gps_accuracy").is_none(), "its error is not known");
    assert_eq!(feed.messages(&overview).expect("an origin"), messages, "nothing has changed");

    feed.place(0, 3.0, Vector3::new(0.0, 100.0, 4.0));
    let after = feed.messages(&overview).expect("an origin");
    let moved = of_topic(&after, &topic)["latitude"].as_f64() > before["latitude"].as_f64();
    assert!(moved, "{after:?}");
    assert_eq!(after[2..], messages[2..], "the beacon stays");
}

#[test]
fn mqtt_sends_no_prior_and_no_receiver_of_recordings() {
    let mut overview = overview();
    let messages = MqttFeed::of_recordings().messages(&overview).expect("it has an origin");
    assert_eq!(messages.len(), 2, "{messages:?}");
    let topics: Vec<_> = messages.iter().map(|message| message.topic.as_str()).collect();
    for topic in topics {
        assert!(!topic.contains(['+', '#', ' ', '<', '\u{1}']), "{topic:?}");
    }
    overview.searches[0].beliefs[0].steps = 0;
    assert_eq!(MqttFeed::of_recordings().messages(&overview).expect("it has an origin"), []);
    overview.searches[0].beliefs[0].steps = 2;
    overview.searches[0].beliefs[0].ellipse_95 = None;
    assert_eq!(MqttFeed::of_recordings().messages(&overview).expect("it has an origin"), []);
    overview.frame = None;
    let error = MqttFeed::of_recordings().messages(&overview).expect_err("it is nowhere");
    assert!(matches!(error, ExportError::NoOrigin), "{error}");
}
