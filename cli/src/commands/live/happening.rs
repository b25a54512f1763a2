#[cfg(feature = "live")]
use foxhunt::{
    export::{ExportError, Format, export},
    overview::Overview,
};
use foxhunt::{hunt::Event, nalgebra::Vector3, overview::KeptTurn};
#[cfg(feature = "live")]
use tokio::sync::oneshot;

/// A turn, a place or an event of a hunt, or a question about it.
pub enum Happening {
    Turn(Box<KeptTurn>),
    Event(Box<Event>),
    /// Time of the hunt, and the places of the receivers.
    #[cfg_attr(not(feature = "hardware"), expect(dead_code, reason = "nothing flies"))]
    Places(f64, Vec<Vector3<f64>>),
    #[cfg(feature = "live")]
    Asked(Asked),
    Over,
}

/// The hunt as a program wants it, and the way back.
#[cfg(feature = "live")]
pub struct Asked {
    pub format: Format,
    pub answer: oneshot::Sender<Result<Vec<u8>, ExportError>>,
}

#[cfg(feature = "live")]
impl Asked {
    /// Answers with the hunt as it is now.
    pub fn answer(self, overview: &Overview) {
        if self.answer.is_closed() {
            return;
        }
        // Somebody who has gone needs no answer.
        let _ = self.answer.send(export(overview, self.format));
    }
}
