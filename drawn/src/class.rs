use std::{io, path::Path};

use super::{
    bearings, cut, kraken, levels, mishaps, moving,
    random::Random,
    ranges,
    recording::{DrawnFile, DrawnRecording},
    scene::Scene,
};

/// A kind of recordings.
#[derive(Clone, Copy, Debug)]
pub struct Class {
    /// Its name, as `--class` takes it.
    pub name: &'static str,
    /// Summary of its draws, in a line.
    pub about: &'static str,
    source: Source,
}

/// Origin of the recordings of a class.
#[derive(Clone, Copy, Debug)]
enum Source {
    /// Drawn rows.
    Rows(fn(&mut Random) -> Scene),
    /// Drawn files in a format of their own.
    Files(fn(&mut Random) -> DrawnRecording),
    /// Real recordings in a folder.
    Cut(fn(&mut Random, &Path) -> io::Result<DrawnRecording>),
}

/// Name of the class whose recordings are so large that it runs on request alone.
const LARGE: &str = "large";

/// Names of the classes whose recordings leave the place open.
const OPEN: [&str; 4] = ["hover", "jitter", "never-there", "bearings-place"];

impl Class {
    /// Returns true if the class cuts real recordings and needs their folder.
    #[must_use]
    pub fn is_cut(&self) -> bool {
        matches!(self.source, Source::Cut(_))
    }

    /// Returns true if each recording takes many seconds.
    #[must_use]
    pub fn is_large(&self) -> bool {
        self.name == LARGE
    }

    /// Returns true if the recordings leave the place open, so that a refusal is right.
    #[must_use]
    pub fn is_open(&self) -> bool {
        OPEN.contains(&self.name)
    }

    /// Draws the recording of a seed. The same seed gives the same one, whatever else is drawn;
    /// `data` is the folder of real recordings.
    ///
    /// # Errors
    ///
    /// [`io::Error`] that names the file, where a real recording cannot be read or no folder is
    /// given.
    pub fn draw(&self, seed: u64, data: Option<&Path>) -> io::Result<DrawnRecording> {
        let mut random = Random::new(self.name, seed);
        match self.source {
            Source::Rows(draw) => Ok(recording(self.name, draw(&mut random))),
            Source::Files(draw) => Ok(draw(&mut random)),
            Source::Cut(draw) => match data {
                Some(data) => draw(&mut random, data),
                None => Err(io::Error::new(
                    io::ErrorKind::NotFound,
                    format!("{}: no folder of real recordings is given", self.name),
                )),
            },
        }
    }
}

/// Writes a scene.
fn recording(name: &str, scene: Scene) -> DrawnRecording {
    let recorded = DrawnFile { name: format!("{name}.csv"), text: scene.text() };
    DrawnRecording {
        header: scene.preamble.len() + 1,
        files: [recorded].into_iter().chain(scene.beside).collect(),
        flags: scene.flags,
        bound: scene.bound,
        is_empty: scene.is_empty,
    }
}

/// Returns every class, in the order of tables.
#[must_use]
pub fn classes() -> Vec<Class> {
    let rows = |name, about, draw| Class { name, about, source: Source::Rows(draw) };
    let files = |name, about, draw| Class { name, about, source: Source::Files(draw) };
    let cut = |name, about, draw| Class { name, about, source: Source::Cut(draw) };
    vec![
        rows("lanes", "a field in lanes, shadowed", levels::lanes),
        rows("lanes-white", "a field in lanes, independent errors", levels::white),
        rows("lanes-long", "kilometres of lanes, independent errors", levels::long),
        rows("lanes-beside", "the transmitter beside the lanes", levels::beside),
        rows("lanes-far", "the transmitter 3 to 10 sides away", levels::far),
        rows("drive", "5 to 100 km on streets, whole dB, weak rows missing", levels::drive),
        rows("home", "a walk that ends at the transmitter, GNSS of 4 m", levels::home),
        rows("round", "a loop round the transmitter or past it", levels::round),
        rows("line", "one straight line", levels::line),
        rows("hover", "one place", levels::hover),
        rows("jitter", "one place, GNSS of 2 to 10 m", levels::jitter),
        rows("heights", "5 to 120 m above dipoles", levels::heights),
        rows("network", "5 to 50 receivers with gains of their own", levels::network),
        rows("few-nodes", "3 or 4 receivers", levels::few_nodes),
        rows("house", "nodes in a house of 1 to 3 storeys", levels::house),
        rows("reflected", "low flights with a ground reflection", levels::reflected),
        rows("exponents", "exponents of 1.2 to 8.5, σ that grows", levels::exponents),
        rows("floor", "30 to 80 % of rows at a stated floor", levels::floor),
        rows("floor-hidden", "a floor that nothing states", levels::hidden_floor),
        rows("ceiling", "5 to 40 % of rows at a ceiling", levels::ceiling),
        rows("coarse", "steps of 1 to 6 dB", levels::coarse),
        rows("attenuator", "an attenuator switched in", levels::attenuator),
        rows("unsigned", "levels without their minus", mishaps::unsigned),
        rows("comma", "semicolons and decimal commas", mishaps::comma),
        rows("app", "an app's export with jumps, half with a preamble", mishaps::app),
        rows("jumps", "places that jump in 2 to 6 rows", mishaps::jumps),
        rows("no-fix", "0° N 0° E in 1 to 5 rows", mishaps::no_fix),
        rows("late", "levels 5 to 120 s off their places", mishaps::late),
        rows("clock-back", "a clock that steps back", mishaps::steps_back),
        rows("duplicates", "rows twice or swapped", mishaps::duplicates),
        rows("outliers", "one level in eight is any", mishaps::outliers),
        rows("another", "a second transmitter", mishaps::another),
        rows("moving", "a transmitter that moves", mishaps::moving),
        rows("switched-off", "a transmitter that is switched off", mishaps::switched_off),
        rows("never-there", "noise alone", mishaps::silent),
        rows("bearings", "3 to 12 bearings", bearings::good),
        rows("bearings-back", "1 or 2 of 5 to 10 point back", bearings::back),
        rows("bearings-diverge", "two that point back", bearings::diverging),
        rows("bearings-outlier", "one of 8 to 12 is wrong", bearings::outlier),
        rows("bearings-common", "errors in common at each place", bearings::common),
        rows("bearings-array", "errors by direction of arrival", bearings::deviation),
        rows("bearings-sigma", "σ stated 0.3 to 3 times", bearings::misstated),
        rows("bearings-modes", "a third are reflections", bearings::two_modes),
        rows("bearings-far", "the transmitter 3 to 10 baselines away", bearings::far),
        rows("bearings-place", "all from one place", bearings::one_place),
        rows("bearings-north", "200 km at 52 to 66° N", bearings::north),
        rows("groups", "15 to 30 animals, σ not stated", bearings::groups),
        rows("groups-back", "two of them with back-bearings", bearings::groups_back),
        rows("turns", "turns of an antenna, with an echo", bearings::turns),
        files("kraken", "KrakenSDR: no fix, or a clock that steps back", kraken::drive),
        rows("ranges", "4 to 10 ranges", ranges::good),
        rows("ranges-offset", "an offset and a scale in common", ranges::offset),
        rows("ranges-corner", "a third go round a corner", ranges::cornered),
        rows("ranges-line", "stations in a line", ranges::in_line),
        rows("differences", "4 to 8 differences", ranges::good_differences),
        rows("differences-two", "two differences", ranges::two_differences),
        rows("differences-corner", "a quarter go round a corner", ranges::cornered_differences),
        rows("track-network", "a tag among 4 to 8 towers, levels", moving::network),
        rows("track-towers", "a tag among 2 to 4 towers, bearings too", moving::towers),
        rows("track-one", "a tag and one tower", moving::one_tower),
        cut("afar", "AERPAW rover, a part", cut::rover_part),
        cut("afar-thin", "AERPAW rover, 5 to 50 % of rows", cut::rover_thinned),
        cut("afar-outside", "AERPAW rover beside the flight", cut::rover_outside),
        cut("afar-ceiling", "AERPAW rover, clipped", cut::rover_ceiling),
        cut("afar-weak", "AERPAW rover, weak rows missing", cut::rover_deaf),
        cut("afar-coarse", "AERPAW rover, steps of 2 to 6 dB", cut::rover_coarse),
        cut("afar-late", "AERPAW rover, 5 to 60 rows late", cut::rover_late),
        cut("afar-outliers", "AERPAW rover, one level in eight is any", cut::rover_outliers),
        cut("afar-jumps", "AERPAW rover, places that jump", cut::rover_jumps),
        cut("tower", "AERPAW tower, a part", cut::tower_part),
        cut("tower-thin", "AERPAW tower, 5 to 50 % of rows", cut::tower_thinned),
        cut("tower-high", "AERPAW tower from 70 and 100 m", cut::tower_high),
        cut("tower-ceiling", "AERPAW tower, clipped", cut::tower_ceiling),
        cut("otter", "an otter's bearings of a day", cut::otter),
        cut("otter-few", "two or three of them", cut::otter_few),
        cut("otter-back", "one of them points back", cut::otter_back),
        cut("otter-outlier", "one of them is wrong", cut::otter_outlier),
        cut("otter-groups", "5 to 20 otters, σ not stated", cut::otter_groups),
        cut("yagis", "a walking tag and a station of Yagis", cut::yagis),
        cut("collars", "flights over VHF collars", cut::collars),
        cut("collars-floor", "flights over VHF collars, with a floor", cut::collars_floor),
        rows(LARGE, "100,000 to 2,000,000 rows", levels::large),
    ]
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    #[test]
    fn the_same_seed_gives_the_same_recording_and_another_one_another() {
        let all = classes();
        let names: BTreeSet<&str> = all.iter().map(|class| class.name).collect();
        assert_eq!(names.len(), all.len(), "names are unique");
        assert!(OPEN.iter().chain([&LARGE]).all(|name| names.contains(name)));
        for class in all.iter().filter(|class| !class.is_cut() && !class.is_large()) {
            let draw = |seed| class.draw(seed, None).expect("it needs no file");
            assert_eq!(draw(7), draw(7), "{}", class.name);
            assert_ne!(draw(7).text(), draw(8).text(), "{}", class.name);
            assert!(draw(9).text().lines().count() > 2, "{}", class.name);
        }
    }

    #[test]
    fn one_class_in_four_cuts_real_recordings_and_needs_them() {
        let all = classes();
        let cut: Vec<&Class> = all.iter().filter(|class| class.is_cut()).collect();
        assert!(4 * cut.len() >= all.len(), "{} of {}", cut.len(), all.len());
        for class in cut {
            let error = class.draw(1, None).expect_err("there is no folder");
            assert!(error.to_string().contains(class.name), "{error}");
            let error = class.draw(1, Some(Path::new("no-such-folder"))).expect_err("nor this");
            assert!(error.to_string().contains("no-such-folder"), "{error}");
        }
    }
}
