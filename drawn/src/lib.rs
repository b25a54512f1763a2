//! Recordings as people make them, drawn from seeds, each with its truth.
//!
//! A [`Class`] is a way of receiving with something about it that may go wrong: a drive of 40 km, a
//! receiver that clips, a house. [`Class::draw`] makes the files of one recording, in the formats
//! that `locate` and `judge` read, and the flags of the command that reads them. What propagates
//! and receives here is written apart and imports nothing from the packages of the estimators,
//! their models or the simulated world (`tests/layering.rs` sees to that): a mistake of theirs is
//! none of the judge's. One class in four cuts and thins real recordings, whose places are known.

#![expect(unreachable_pub, reason = "what draws share is no library but for the names below")]

mod bearings;
mod bound;
mod cut;
mod geodesy;
mod levels;
mod mishaps;
mod moving;
mod radio;
mod random;
mod ranges;
mod scene;

pub use bound::{Bound, median_error};
pub use scene::{Class, DrawnFile, DrawnRecording};

/// Returns every class, in the order of tables.
#[must_use]
pub fn classes() -> Vec<Class> {
    [
        &levels::CLASSES[..],
        &mishaps::CLASSES,
        &bearings::CLASSES,
        &ranges::CLASSES,
        &moving::CLASSES,
        &cut::CLASSES,
        &[levels::LARGE],
    ]
    .concat()
}

#[cfg(test)]
mod tests {
    use std::{collections::BTreeSet, path::Path};

    use super::*;
    use crate::scene::{LARGE_NAME, OPEN};

    #[test]
    fn the_same_seed_gives_the_same_recording_and_another_one_another() {
        let all = classes();
        let names: BTreeSet<&str> = all.iter().map(|class| class.name).collect();
        assert_eq!(names.len(), all.len(), "names are unique");
        assert!(OPEN.iter().chain([&LARGE_NAME]).all(|name| names.contains(name)));
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
