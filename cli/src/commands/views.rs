//! What commands leave to look at, besides tables.

use std::{cell::RefCell, fs, path::Path, rc::Rc};

use foxhunt::{
    config::ExtractorConfig,
    core::Sweep,
    hunt::Tap,
    overview::{KeptTurn, KnownAntenna, Overview},
    page::page,
    sensors::SharedAntenna,
};

use crate::error::CliError;

/// A tap that keeps all turns, and the turns.
pub(super) fn keep_turns() -> (Tap, Rc<RefCell<Vec<KeptTurn>>>) {
    let turns = Rc::new(RefCell::new(Vec::new()));
    let kept = Rc::clone(&turns);
    let keep = move |drone: usize, sweep: &Sweep<'_>| {
        kept.borrow_mut().push(KeptTurn { drone, sweep: sweep.into() });
    };
    (Rc::new(RefCell::new(keep)), turns)
}

/// The antenna that an extractor knows, if it does.
pub(super) struct Antennas(Option<(SharedAntenna, f64)>);

impl Antennas {
    pub(super) fn of(extractor: &ExtractorConfig) -> Self {
        let known = extractor.known_antenna();
        // One that cannot be built has stopped the command before.
        Self(known.and_then(|(antenna, elevation)| Some((antenna.build().ok()?, elevation))))
    }

    pub(super) fn known(&self) -> Option<KnownAntenna<'_>> {
        let (antenna, elevation) = self.0.as_ref()?;
        Some(KnownAntenna { antenna: antenna.as_ref(), elevation: *elevation })
    }
}

/// Writes the page that shows a hunt or recordings.
pub(super) fn write_page(path: &Path, overview: &Overview) -> Result<(), CliError> {
    let text = page(overview).map_err(CliError::failure)?;
    fs::write(path, text).map_err(|error| CliError::writing(path, error))
}
