//! The world for Gazebo agrees with the hunt and the vehicles beside it.

use std::{
    fs,
    path::{Path, PathBuf},
};

use foxhunt::{document, fly::EmulatedFieldConfig, scenario::Scenario};
use quick_xml::{Reader, events::Event};

use crate::support::{folder, foxhunt};

/// An element of an XML document: its name, its `name` attribute, its text, its children.
#[derive(Debug, Default)]
struct Element {
    tag: String,
    name: String,
    text: String,
    children: Vec<Self>,
}

impl Element {
    /// Reads a whole document; it has one root.
    fn parse(text: &str) -> Self {
        let mut reader = Reader::from_str(text);
        let mut open = vec![Self::default()];
        loop {
            match reader.read_event().expect("XML") {
                Event::Start(start) => open.push(Self::named(&start)),
                Event::Empty(start) => {
                    open.last_mut().expect("a parent").children.push(Self::named(&start));
                }
                Event::End(_) => {
                    let closed = open.pop().expect("an open element");
                    open.last_mut().expect("a parent").children.push(closed);
                }
                Event::Text(text) => {
                    let text = text.decode().expect("UTF-8");
                    open.last_mut().expect("a parent").text.push_str(text.trim());
                }
                Event::Eof => break,
                _ => {}
            }
        }
        assert_eq!(open.len(), 1, "every element is closed");
        let mut roots = open.remove(0).children;
        assert_eq!(roots.len(), 1, "one root");
        roots.remove(0)
    }

    fn named(start: &quick_xml::events::BytesStart<'_>) -> Self {
        let text = |bytes: &[u8]| String::from_utf8(bytes.to_vec()).expect("UTF-8");
        let name = start.try_get_attribute("name").expect("attributes");
        Self {
            tag: text(start.name().as_ref()),
            name: name.map_or_else(String::new, |name| text(&name.value)),
            ..Self::default()
        }
    }

    fn child(&self, tag: &str) -> &Self {
        let mut found = self.children.iter().filter(|child| child.tag == tag);
        let child = found.next().unwrap_or_else(|| panic!("no <{tag}> in <{}>", self.tag));
        assert!(found.next().is_none(), "two <{tag}> in <{}>", self.tag);
        child
    }

    fn number(&self, tag: &str) -> f64 {
        let text = &self.child(tag).text;
        text.parse().unwrap_or_else(|_| panic!("<{tag}> {text} is not a number"))
    }

    /// x, y, z, roll, pitch and yaw.
    fn pose(&self) -> [f64; 6] {
        let numbers: Vec<f64> = self
            .child("pose")
            .text
            .split_whitespace()
            .map(|number| number.parse().expect("a number"))
            .collect();
        numbers.try_into().expect("six numbers")
    }
}

fn example(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../examples/gazebo").join(name)
}

fn read(name: &str) -> String {
    fs::read_to_string(example(name)).expect("the file is in the repository")
}

#[test]
fn the_world_stands_where_the_hunt_and_its_vehicles_are() {
    let sdf = Element::parse(&read("foxhunt.sdf"));
    let world = sdf.child("world");
    let hunt = Scenario::parse(&read("hunt.toml"), "hunt.toml").expect("a scenario");
    let field: EmulatedFieldConfig =
        document::from_toml(&read("vehicles.toml")).expect("settings of a field");

    let earth = world.child("spherical_coordinates");
    // x is East and y is North, as in a hunt.
    assert_eq!(earth.child("surface_model").text, "EARTH_WGS84");
    assert_eq!(earth.child("world_frame_orientation").text, "ENU");
    let numbers = ["latitude_deg", "longitude_deg", "heading_deg"].map(|tag| earth.number(tag));
    let site = [field.site.lat_deg, field.site.lon_deg, 0.0];
    assert_eq!(numbers.map(f64::to_bits), site.map(f64::to_bits));
    // The emulated devices keep the time of the wall.
    assert_eq!(world.child("physics").number("real_time_factor").to_bits(), 1.0_f64.to_bits());

    let beacons: Vec<(&str, [f64; 3])> = world
        .children
        .iter()
        .filter(|model| model.tag == "model" && model.name != "ground")
        .map(|model| (model.name.as_str(), [model.pose()[0], model.pose()[1], model.pose()[2]]))
        .collect();
    let hunted: Vec<(&str, [f64; 3])> = hunt
        .world
        .beacons
        .iter()
        .map(|beacon| (beacon.name.as_str(), [beacon.east_m, beacon.north_m, beacon.up_m]))
        .collect();
    assert_eq!(beacons, hunted);

    let drones: Vec<(String, [f64; 2])> = world
        .children
        .iter()
        .filter(|include| include.tag == "include")
        .map(|drone| (drone.child("name").text.clone(), [drone.pose()[0], drone.pose()[1]]))
        .collect();
    let flown: Vec<(String, [f64; 2])> = hunt
        .world
        .drones
        .iter()
        .enumerate()
        .map(|(index, drone)| (format!("drone_{}", index + 1), [drone.east_m, drone.north_m]))
        .collect();
    assert_eq!(drones, flown);
    assert_eq!(field.vehicles.len(), flown.len(), "each drone is flown by Gazebo's vehicle");
}

#[test]
fn the_hunt_of_the_world_finds_its_beacon_in_simulation() {
    let out = folder("gazebo");
    let hunt = example("hunt.toml");
    let args = ["--json", "hunt", &hunt.display().to_string(), "--out", &out.display().to_string()];
    let result = foxhunt(args).json();
    let error_m = result["beacons"][0]["error_m"].as_f64().expect("the truth is known");
    // 3 m is 8 % of the way from the drone's start to the beacon.
    assert!(error_m < 3.0, "{error_m} m");
}
