use std::sync::{
    Arc, Mutex, PoisonError,
    atomic::{AtomicBool, Ordering},
    mpsc::Sender,
};

use foxhunt::export::{ExportError, Format};
use tokio::sync::{oneshot, watch};

use super::happening::{Asked, Happening};
use crate::commands::tiles::Tiles;

/// Page and news of a hunt, shared by the hunt, the thread that reads it and the server.
pub(super) struct Shared {
    pub(super) page: String,
    pub(super) token: Option<String>,
    pub(super) orders: bool,
    pub(super) tiles: Option<Arc<Tiles>>,
    /// Name of the run that the numbers of the news belong to; another hunt has another name.
    pub(super) run: String,
    /// All news since the beginning, in order. Each browser has its place in it, so that the hunt
    /// waits for no browser and late ones get everything.
    news: Mutex<Vec<Arc<str>>>,
    /// Number of news, and if they are complete.
    pub(super) progress: watch::Sender<Progress>,
    /// True if a viewer with the token has broken the flight off.
    broken_off: AtomicBool,
    /// Sender of questions to the hunt's thread.
    questions: Option<Sender<Happening>>,
}

/// Progress of a hunt.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Progress {
    pub(super) news: usize,
    pub(super) over: bool,
}

impl Shared {
    /// Begins without news.
    pub(super) fn new(
        page: String,
        token: Option<String>,
        orders: bool,
        tiles: Option<Arc<Tiles>>,
        run: String,
    ) -> Self {
        Self {
            page,
            token,
            orders,
            tiles,
            run,
            news: Mutex::new(Vec::new()),
            progress: watch::Sender::new(Progress::default()),
            broken_off: AtomicBool::new(false),
            questions: None,
        }
    }

    /// Sends questions of programs to the hunt's thread.
    pub(super) fn with_questions(self, questions: Sender<Happening>) -> Self {
        Self { questions: Some(questions), ..self }
    }

    /// Returns the hunt as it is now, in a format; `None` if it is not shown any more.
    pub(super) async fn ask(&self, format: Format) -> Option<Result<Vec<u8>, ExportError>> {
        let (answer, answered) = oneshot::channel();
        let asked = Happening::Asked(Asked { format, answer });
        self.questions.as_ref()?.send(asked).ok()?;
        answered.await.ok()
    }

    /// The news of a number, from 0.
    pub(super) fn news(&self, number: usize) -> Option<Arc<str>> {
        let news = self.news.lock().unwrap_or_else(PoisonError::into_inner);
        news.get(number).cloned()
    }

    /// Adds news for every browser.
    pub(super) fn add(&self, text: String) {
        let mut news = self.news.lock().unwrap_or_else(PoisonError::into_inner);
        news.push(text.into());
        let count = news.len();
        drop(news);
        self.progress.send_modify(|progress| progress.news = count);
    }

    pub(super) fn break_off(&self) {
        self.broken_off.store(true, Ordering::Relaxed);
    }

    /// Returns true if the flight was broken off since the last call.
    #[cfg(feature = "hardware")]
    pub(super) fn take_break_off(&self) -> bool {
        self.broken_off.swap(false, Ordering::Relaxed)
    }
}
