use std::fs;

use crate::support::{folder, foxhunt, has};

#[test]
fn an_antenna_tells_its_figures() {
    let read = foxhunt(["antenna", "reference-patch", "--json"]).json();
    has(
        &read,
        &[
            "antenna",
            "gain_dbi",
            "main_lobe_azimuth_deg",
            "main_lobe_elevation_deg",
            "azimuth_beamwidth_deg",
            "elevation_beamwidth_deg",
            "front_to_back_db",
            "directivity_dbi",
            "electrical_tilt_deg",
            "header",
        ],
    );
    assert!((read["azimuth_beamwidth_deg"].as_f64().expect("a number") - 70.1).abs() < 0.1);
    assert!((read["front_to_back_db"].as_f64().expect("a number") - 17.0).abs() < 0.1);
    assert!(read["elevation_beamwidth_deg"].is_null(), "the same at every elevation");
    let table = foxhunt(["antenna", "dipole"]);
    assert!(table.stdout.contains("78.1") && table.stdout.contains("2.15"), "{table:?}");
}

#[test]
fn an_antenna_is_written_and_read_again() {
    let folder = folder("antenna");
    let path = |name: &str| folder.join(name).display().to_string();
    let (msi, pln, csv, svg) = (path("a.msi"), path("b.pln"), path("c.csv"), path("a.svg"));
    let first = foxhunt(["antenna", "yagi", "--write", &msi, "--out", &svg, "--json"]).json();
    let again = foxhunt(["antenna", &msi, "--write", &pln, "--json"]).json();
    for field in ["gain_dbi", "azimuth_beamwidth_deg", "elevation_beamwidth_deg"] {
        let [a, b] = [&first, &again].map(|r| r[field].as_f64().expect("a number"));
        assert!((a - b).abs() < 0.1, "{field}: {a} and {b}");
    }
    assert_eq!(again["header"]["NAME"], "yagi");
    assert_eq!(fs::read(&msi).expect("written"), fs::read(&pln).expect("written"));
    assert_eq!(foxhunt(["antenna", &msi, "--write", &csv]).code, 0);
    let flat = foxhunt(["antenna", &csv, "--json"]).json();
    let [a, b] = [&first, &flat].map(|r| r["azimuth_beamwidth_deg"].as_f64().expect("a number"));
    assert!((a - b).abs() < 0.1, "{a} and {b}");
    let picture = fs::read_to_string(&svg).expect("written");
    assert!(picture.starts_with("<svg") && picture.contains("yagi"), "{picture}");
}

#[test]
fn what_is_no_antenna_is_wrong_input() {
    foxhunt(["antenna", "horn"]).failed(2, &["horn", "reference-patch"]);
    foxhunt(["antenna", "no-such.msi"]).failed(2, &["no-such.msi"]);
    foxhunt(["antenna", "dipole", "--write", "dipole.txt"]).failed(2, &["dipole.txt", ".msi"]);
    let folder = folder("broken-antenna");
    let broken = folder.join("broken.msi").display().to_string();
    fs::write(&broken, "NAME x\nGAIN 3\n").expect("a file");
    foxhunt(["antenna", &broken]).failed(2, &["broken.msi", "line 2", "unit"]);
}
