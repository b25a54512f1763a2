//! `locate --unknown-number`: several transmitters on one frequency, and silent searches.

use std::{fmt::Write as _, fs};

use rand::{RngExt, SeedableRng, rngs::Xoshiro256PlusPlus};

use crate::support::{folder, foxhunt, has};

/// Places of the transmitters, East and North in metres.
const PLACES: [(f64, f64); 3] = [(-80.0, 60.0), (120.0, -30.0), (10.0, -140.0)];

/// 60 bearings with σ of 4° from a walk around the first of the places, one in ten wrong. The
/// seeds are such that the number is right, as it is in 777 of 800 draws (`locate::unknown_number`
/// in foxhunt-hunt).
fn drawn(number: usize) -> String {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(20 + u64::try_from(number).expect("few"));
    let mut text = "time_s,east_m,north_m,bearing_deg_compass,bearing_sigma_deg\n".to_owned();
    for row in 0..60_u8 {
        let around = 6.0_f64.to_radians() * f64::from(row);
        let east = 300.0 * around.cos();
        let north = 250.0 * around.sin();
        let wrong = number == 0 || rng.random::<f64>() < 0.1;
        let compass_deg = if wrong {
            360.0 * rng.random::<f64>()
        } else {
            let (target_east, target_north) = PLACES[rng.random_range(0..number)];
            // Twelve uniform numbers have the variance 1.
            let error = (0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0;
            (target_east - east).atan2(target_north - north).to_degrees() + 4.0 * error
        };
        let compass_deg = compass_deg.rem_euclid(360.0);
        writeln!(text, "{row},{east:.1},{north:.1},{compass_deg:.2},4").expect("a string");
    }
    text
}

#[test]
fn none_one_two_and_three_transmitters_are_found() {
    let folder = folder("unknown-number");
    for number in 0..=3 {
        let file = folder.join(format!("{number}.csv"));
        fs::write(&file, drawn(number)).expect("the folder is there");
        let file = file.to_str().expect("UTF-8");
        let report = foxhunt(["locate", "--json", "--unknown-number", file]).json();
        has(&report, &["beacon", "numbers", "transmitters", "unassigned", "absence"]);
        let transmitters = report["transmitters"].as_array().expect("a list");
        assert_eq!(transmitters.len(), number, "{}", report["numbers"]);
        assert!(report["absence"].is_null());
        let mut rows = report["unassigned"].as_array().expect("a list").len();
        for of in transmitters {
            has(of, &["existence", "belonging", "estimate", "ellipse_95", "estimator"]);
            assert!(of["existence"].as_f64().is_some_and(|p| (0.5..=1.0).contains(&p)), "{of}");
            rows += of["belonging"].as_array().expect("a list").len();
        }
        assert_eq!(rows, 60, "each row belongs to one transmitter or to none");
        // Each place is found: 30 m is some four of its standard deviations.
        for (east, north) in &PLACES[..number] {
            let away = |of: &serde_json::Value| {
                let at = |axis: &str| of["estimate"][axis].as_f64().expect("a number");
                (at("east_m") - east).hypot(at("north_m") - north)
            };
            let nearest = transmitters.iter().map(away).fold(f64::INFINITY, f64::min);
            assert!(nearest < 30.0, "{number}: {nearest} m from ({east}, {north})");
        }
        let page = folder.join("page.html");
        let page = page.to_str().expect("UTF-8");
        let shown = foxhunt(["locate", "--unknown-number", file, "--report", page]);
        assert_eq!(shown.code, 0, "{shown:?}");
        assert!(shown.stdout.contains("Number of transmitters"), "{}", shown.stdout);
        let html = fs::read_to_string(page).expect("it was written");
        for number_of in 1..=number {
            assert!(shown.stdout.contains(&format!("Rows of transmitter {number_of}: ")));
            assert!(html.contains(&format!("transmitter {number_of}")), "{number_of}");
        }
        if number == 0 {
            assert!(shown.stdout.contains("No place is more probable"), "{}", shown.stdout);
        }
    }
}

#[test]
fn a_silent_search_states_what_it_would_have_found() {
    let mut text = "time_s,east_m,north_m,rss_dbm,floor_dbm\n".to_owned();
    for row in 0..12_u8 {
        writeln!(text, "{row},{},0,,-110", 60.0 * f64::from(row)).expect("a string");
    }
    let file = folder("silent-search").join("silent.csv");
    fs::write(&file, text).expect("the folder is there");
    let file = file.to_str().expect("UTF-8");
    let args = ["locate", "--unknown-number", file, "--margin-m", "150", "--exponent", "3"];
    let absence = foxhunt(args.iter().chain(&["--json"])).json()["absence"].clone();
    has(&absence, &["confidence", "prior", "weakest_dbm", "silences", "places", "side_m"]);
    assert!(absence["existence"].is_null(), "the power is not stated");
    assert_eq!(absence["silences"], 12);
    let weakest_dbm = absence["weakest_dbm"].as_f64().expect("a number");
    let shown = foxhunt(args).stdout;
    let sentence = format!(
        "None is here with 95 %, unless it is weaker than {weakest_dbm:.1} dBm at one metre."
    );
    assert!(shown.contains(&sentence), "{shown}");
    let page = folder("silent-page").join("page.html");
    let page = page.to_str().expect("UTF-8");
    assert_eq!(foxhunt(args.iter().chain(&["--report", page])).code, 0);
    let html = fs::read_to_string(page).expect("it was written");
    assert!(html.contains("nothing above the receiver's floor"), "the silences are shown");
    // A stated power: existence is 5 % at the very power of the statement.
    let power = weakest_dbm.to_string();
    let stated = args.iter().copied().chain(["--json", "--p0-dbm", &power]);
    let existence = foxhunt(stated).json()["absence"]["existence"].as_f64().expect("a number");
    assert!((existence - 0.05).abs() < 1e-3, "{existence}");
    // One place of all transmitters is not asked for, and levels are not sorted.
    foxhunt(["locate", "--unknown-number", file, "--truth", "50,14"]).failed(2, &["--truth"]);
}

#[test]
fn levels_alone_are_refused() {
    let text = "time_s,east_m,north_m,rss_dbm\n0,0,0,-60\n1,50,0,-65\n2,0,50,-70\n";
    let file = folder("unknown-levels").join("levels.csv");
    fs::write(&file, text).expect("the folder is there");
    let file = file.to_str().expect("UTF-8");
    foxhunt(["locate", "--unknown-number", file]).failed(2, &["needs bearings"]);
}
