use foxhunt_core::{
    Bearing, BearingModes, Estimate, HeightAboveGround, HeightSource, Level, Remark,
};
use foxhunt_hunt::{calibration::ConformalFactors, locate::Measurand};
use foxhunt_wire::geodesy::{Geodetic, LocalFrame};
use nalgebra::{Vector2, Vector3};
use serde_json::Value;

use super::*;
use crate::overview::{Believed, Health, Notice, Received, SearchOverview, Turn};
use foxhunt_archive::recorded::RowResidual;

/// The data of a page, as a browser reads them.
fn data_in(page: &str) -> Value {
    let (_, rest) = page.split_once(r#"<script type="application/json" id="data">"#).expect("data");
    let (data, _) = rest.split_once("</script>").expect("their end");
    serde_json::from_str(data).expect("JSON")
}

fn overview() -> Overview {
    let received = Received {
        time: 3.0,
        receiver: 0,
        search: Some(0),
        place: Vector3::new(1.234_56, -2.0, 4.0),
        level: Some(Level { rss_dbm: -60.0, sigma_db: 2.0 }),
        bearing: Some(Bearing { angle: 0.5, sigma: 0.1, confidence: 0.9 }),
        modes: BearingModes::default(),
        remark: None,
        used: true,
        struck: false,
        id: None,
        nis: Some((1.5, 2)),
        turn: Some(Turn { samples: vec![[0.0, -70.0], [1.0, -60.0]], ..Turn::default() }),
    };
    let estimate = Estimate::isotropic(Vector2::new(10.0, 20.0), 2.0);
    let believed = Believed {
        time: 3.0,
        steps: 1,
        estimate,
        ellipse_95: estimate.ellipse(0.95),
        error_m: None,
        cloud: vec![Vector2::new(9.0, 19.0), Vector2::new(11.0, 21.0)],
    };
    let mut overview = Overview { title: "field".to_owned(), ..Overview::default() };
    let _ = overview.receiver("drone 1");
    overview.receivers[0].health.push(Health {
        time: 2.0,
        battery: Some(0.456),
        linked: true,
        position_sigma_m: None,
        above_ground: None,
    });
    overview.receivers[0].health.push(Health {
        time: 3.0,
        battery: None,
        linked: true,
        position_sigma_m: None,
        above_ground: Some(HeightAboveGround { metres: 3.5, source: HeightSource::Rangefinder }),
    });
    overview.add(received);
    overview.searches.push(SearchOverview {
        name: "fox".to_owned(),
        beliefs: vec![believed],
        ..SearchOverview::default()
    });
    overview
}

#[test]
fn remarks_and_the_rows_that_fit_worst_are_in_the_page() {
    let row = |line: u64, p: Option<f64>| RowResidual {
        file: "a</script>.csv".to_owned(),
        line,
        receiver: Some(String::new()),
        kind: Measurand::Bearing,
        residual: 1.234_56,
        unit: "deg",
        p,
        left_out: line == 7,
    };
    let mut overview = overview();
    assert!(data_in(&page(&overview, None).expect("plain data"))["searches"][0]["rows"].is_null());
    let search = &mut overview.searches[0];
    search.rows = vec![row(2, Some(0.123_456)), row(3, None), row(7, Some(1.26e-7))];
    search.remarks = vec![Remark::new("outlier", "the bearing of a.csv, line 7")];
    search.conformal = Some(ConformalFactors {
        estimator: "a".to_owned(),
        fixes: 20,
        ellipse: 1.234_56,
        circle: 1.0,
    });
    overview.remarks = vec![Remark::new("rows-left-out", "two rows")];
    let data = data_in(&page(&overview, None).expect("plain data"));
    let search = &data["searches"][0];
    let lines: Vec<_> = (0..3).map(|index| search["rows"][index]["line"].clone()).collect();
    assert_eq!(lines, [7, 2, 3]);
    assert_eq!(search["conformal"], serde_json::json!([20, 1.2346]));
    assert_eq!(search["rows"][0]["p"], 1.3e-7);
    assert_eq!(search["rows"][0]["left_out"], true);
    assert_eq!(search["rows"][1]["p"], 0.12);
    assert_eq!(search["rows"][1]["residual"], 1.23);
    assert_eq!(search["rows"][1]["kind"], "bearing");
    assert_eq!(search["remarks"], serde_json::json!([["outlier", "the bearing of a.csv, line 7"]]));
    assert_eq!(data["remarks"], serde_json::json!([["rows-left-out", "two rows"]]));
}

#[test]
fn the_page_holds_what_is_in_the_overview() {
    let page = page(&overview(), None).expect("plain data");
    let data = data_in(&page);
    assert_eq!(data["received"][0]["place"], serde_json::json!([1.235, -2.0, 4.0]));
    assert_eq!(data["received"][0]["bearing"], serde_json::json!([0.5, 0.1, 0.9]));
    let health = serde_json::json!([
        [2.0, 0.46, true, null, null],
        [3.0, null, true, null, [3.5, "rangefinder"]]
    ]);
    assert_eq!(data["receivers"][0]["health"], health);
    assert_eq!(data["searches"][0]["beliefs"][0]["place"], serde_json::json!([10.0, 20.0]));
    // √χ²₂ at 95 % is 2.4477.
    assert_eq!(data["searches"][0]["beliefs"][0]["ellipse"][0], 4.895);
    assert_eq!(data["searches"][0]["beliefs"][0]["cloud"]["points"], "AAAA////");
    assert_eq!(data["received"][0]["turn"]["samples"]["points"], "AAAA////");
    assert_eq!(data["receivers"][0]["path"], serde_json::json!([[3.0, 1.235, -2.0, 4.0]]));
    // χ²₂ between 2.5 and 97.5 %: −2 ln 0.975 and −2 ln 0.025.
    assert_eq!(data["nis_95"][1], serde_json::json!([0.0506, 7.3778]));
}

#[test]
fn no_text_breaks_out_of_the_data() {
    let hostile = "</script><script>alert(1)</script><!-- \u{2028} \" \\ /* page.js */";
    let mut overview = overview();
    overview.title = hostile.to_owned();
    overview.notices.push(Notice { time: 0.0, text: hostile.to_owned(), important: true });
    overview.searches[0].name = hostile.to_owned();
    let page = page(&overview, None).expect("plain data");
    assert!(!page.contains("alert(1)</script>"));
    assert_eq!(page.matches("</script>").count(), 6, "the page's own");
    let data = data_in(&page);
    assert_eq!(data["title"], hostile);
    assert_eq!(data["notices"][0][1], hostile);
    assert_eq!(data["searches"][0]["name"], hostile);
}

#[test]
fn the_page_needs_no_network() {
    let page = page(&overview(), None).expect("plain data");
    assert!(!page.contains("/* page.css */") && !page.contains("/* uplot.js */"), "all is joined");
    assert!(page.contains("default-src 'none'"));
    for outside in ["src=\"http", "href=\"http", "@import", "url(", "fetch(", "XMLHttpRequest"] {
        assert!(!page.contains(outside), "{outside}");
    }
}

#[test]
fn a_page_brings_its_map_along() {
    let mut overview = overview();
    let origin = Geodetic::new(50.0755, 14.4378, 200.0).expect("a place");
    overview.frame = Some(LocalFrame::new(origin).expect("a place"));
    let owner = Some("© </script>us".to_owned());
    let ground = Ground::about(&overview, [10, 18], owner, |_, _, _| Some(b"png".to_vec()));
    let on_map = page_on(&overview, None, &ground.expect("tiles")).expect("plain data");
    assert_eq!(on_map.matches("</script>").count(), 6, "the page's own");
    let (_, rest) = on_map.split_once(r#"id="embedded">"#).expect("tiles");
    let (tiles, _) = rest.split_once("</script>").expect("their end");
    let tiles: Value = serde_json::from_str(tiles).expect("JSON");
    assert_eq!(tiles["attribution"], "© </script>us");
    let images = tiles["images"].as_object().expect("images");
    assert!(images.len() > 10 && images.values().all(|image| image == "cG5n"), "{images:?}");
    assert!(on_map.contains("drawTiles = () =>"), "the script that draws them");
    let without = page(&overview, None).expect("plain data");
    assert!(!without.contains("drawTiles = () =>"), "it has none");
}

#[test]
fn without_a_script_there_are_the_fixes_and_a_picture() {
    let page = page(&overview(), None).expect("plain data");
    let (_, rest) = page.split_once("<noscript>").expect("it is there");
    let (still, _) = rest.split_once("</noscript>").expect("its end");
    assert!(still.contains("<td>fox</td><td data-name=\"place\">10.0 m E, 20.0 m N</td>"));
    assert!(still.contains("<ellipse") && still.contains("<polyline"), "{still}");
}

#[test]
fn an_overview_of_nothing_is_a_page() {
    let data = data_in(&page(&Overview::default(), None).expect("plain data"));
    assert_eq!(data["span"], serde_json::json!([0.0, 0.0]));
}

#[test]
fn news_come_once() {
    let mut overview = overview();
    let mut mark = Mark::default();
    let mut more = |overview: &Overview| {
        let text = news(overview, &mut mark).expect("plain data");
        text.map(|text| serde_json::from_str::<Value>(&text).expect("JSON"))
    };
    let all = more(&overview).expect("everything is new");
    let page = data_in(&page(&overview, None).expect("plain data"));
    for part in ["received", "receivers", "searches", "notices", "span"] {
        assert_eq!(all[part], page[part], "{part}");
    }
    assert_eq!(more(&overview), None);
    let mut next = overview.received[0].clone();
    next.time = 4.0;
    overview.add(next);
    overview.notices.push(Notice { time: 4.0, text: "landed".to_owned(), important: true });
    let later = more(&overview).expect("a reception");
    let count = |part: &str| later[part].as_array().map(Vec::len);
    assert_eq!(
        (count("received"), count("notices"), count("receivers")),
        (Some(1), Some(1), Some(1))
    );
    assert_eq!(later["received"][0]["time"], 4.0);
    assert_eq!(later["receivers"][0]["path"].as_array().map(Vec::len), Some(1));
    assert_eq!(later["searches"][0]["beliefs"], serde_json::json!([]));
}

#[test]
fn a_hostile_log_stays_in_its_place() {
    let text = concat!(
        r#"{"foxhunt_log":6,"scenario":"/* data */</script>","seed":1,"estimator_name":"mine","#,
        r#""model":{"reference_dbm":-29.06,"exponent":2.765},"beacons":[]}"#,
    );
    let header = serde_json::from_str(text).expect("a header");
    let registry = foxhunt_hunt::registry::Registry::builtin();
    let log = PageLog::new(&header, registry.estimator("ukf").ok(), &[]);
    let page = page(&overview(), Some(&log)).expect("plain data");
    assert_eq!(page.matches("</script>").count(), 6, "the page's own");
    assert_eq!(data_in(&page)["title"], "field");
    assert!(page.contains(r#""scenario":"/* data */\u003c/script>""#), "the log is in it");
    // Without a log the page is small.
    let without = super::page(&overview(), None).expect("plain data");
    assert!(without.len() + REPLAYER.len() < page.len());
}
