//! Every kind of picture is drawn as it was when a person last looked at it.

use std::{collections::BTreeMap, fmt::Write as _, fs, path::Path};

use flate2::Crc;
use foxhunt_archive::struck::Struck;
use foxhunt_core::{MeasuredList, Pose, Sample, Sweep};
use foxhunt_hunt::{log::Log, registry::Registry};
use foxhunt_sensors::{Antenna, PatternTable};
use foxhunt_show::{
    overview::{KnownAntenna, Overview, Turn},
    picture::{
        Distribution, NamedSearch, Ratios, antenna_svg, axes_over_steps, clouds_svg,
        distributions_svg, error_over_steps, graph_svg, hunt_svg, nees_over_steps, ratios_svg,
        turn_svg,
    },
};

/// The checksums of the pictures that were looked at: name, CRC-32, bytes.
const LOOKED_AT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/data/pictures.txt");

/// A turn with an unanswered question, an echo and whole decibels.
fn turn() -> Turn {
    let patch = PatternTable::reference_patch();
    let sample = |position: u16| {
        let boresight = f64::from(position) * std::f64::consts::TAU / 32.0;
        let direct = patch.gain_dbi(0.8 - boresight, 0.0);
        let rss_dbm = (-61.0 + direct + 3.0 * (2.0 * boresight).sin()).round();
        let time = f64::from(position);
        let receiver = Pose::default();
        Sample { time, receiver, boresight, position, rss_dbm }
    };
    let samples: Vec<Sample> = (0..32).filter(|i| *i != 11).map(sample).collect();
    let sweep = Sweep { samples: &samples, positions: 32, ..Sweep::default() };
    let known = KnownAntenna { antenna: &patch, elevation: 0.0 };
    Turn::new(&Sweep { measured: MeasuredList::default(), ..sweep }, Some(known), Some(0.8))
}

/// All pictures by their names.
fn pictures() -> BTreeMap<String, String> {
    let mut pictures = BTreeMap::new();
    let mut keep = |name: String, svg: Result<String, _>| {
        let svg: Result<String, foxhunt_show::picture::PictureError> = svg;
        pictures.insert(name, svg.expect("it can be drawn"));
    };
    for name in ["default", "particle", "ukf-pritzl2018"] {
        let path = format!(
            "{}/../archive/tests/data/logs/version-5-{name}.jsonl",
            env!("CARGO_MANIFEST_DIR")
        );
        let log = Log::read(Path::new(&path)).expect("a committed log");
        keep(format!("{name}: hunt"), hunt_svg(&log.header, &log.events));
        let registry = Registry::builtin();
        let (overview, _) =
            Overview::of_log(&log, &registry, None, &Struck::default(), Vec::new(), None)
                .expect("it replays");
        let searches: Vec<NamedSearch<'_>> = (overview.searches.iter())
            .map(|search| NamedSearch { name: search.name.clone(), search })
            .collect();
        keep(format!("{name}: error"), graph_svg(&error_over_steps("error", &searches)));
        keep(format!("{name}: axes"), graph_svg(&axes_over_steps("axes", &searches)));
        keep(format!("{name}: NEES"), graph_svg(&nees_over_steps("NEES", &searches)));
        for NamedSearch { name: beacon, search } in &searches {
            keep(format!("{name}: cloud of {beacon}"), clouds_svg("cloud", search));
        }
    }
    let patch = PatternTable::reference_patch();
    keep("antenna".to_owned(), antenna_svg("reference-patch", &patch));
    keep("turn".to_owned(), turn_svg("a turn", &turn(), Some(0.8)));
    let contender = |name: &str, factor: f64| Distribution {
        name: name.to_owned(),
        errors_m: (1..40).map(|i| factor * f64::from(i) / 7.0).collect(),
        nees: (1..40).map(|i| factor * f64::from(i) / 5.0).collect(),
    };
    let contenders = [contender("ekf", 1.0), contender("ukf", 1.7)];
    keep("distributions".to_owned(), distributions_svg("two filters", &contenders));
    let ratios = Ratios {
        name: "ukf".to_owned(),
        ratios: vec![Some((0.8, [0.7, 0.9])), None, Some((1.3, [1.1, 1.6]))],
    };
    let figures = ["error", "time", "NEES"];
    keep("ratios".to_owned(), ratios_svg("beside the ekf", &figures, &[ratios]));
    pictures
}

/// Fails with the path of each picture that has changed. Whoever has looked at them all replaces
/// the list by the file that the message names.
#[test]
fn pictures_are_those_that_were_looked_at() {
    let looked_at = fs::read_to_string(LOOKED_AT).unwrap_or_default();
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("pictures");
    fs::create_dir_all(&folder).expect("a folder for what changed");
    let mut list = String::new();
    let mut changed = Vec::new();
    for (name, svg) in pictures() {
        let mut crc = Crc::new();
        crc.update(svg.as_bytes());
        let line = format!("{name}: {:08x}, {} bytes\n", crc.sum(), svg.len());
        if !looked_at.contains(&line) {
            let path = folder.join(format!("{}.svg", name.replace([' ', ':'], "-")));
            fs::write(&path, svg).expect("a file for what changed");
            changed.push(path.display().to_string());
        }
        let _ = write!(list, "{line}");
    }
    let renewed = folder.join("pictures.txt");
    fs::write(&renewed, &list).expect("a file for the list");
    assert!(
        changed.is_empty() && list == looked_at,
        "other pictures than before; look at {}, then replace {LOOKED_AT} by {}",
        changed.join(", "),
        renewed.display()
    );
}
