use std::{
    net::TcpListener,
    sync::{
        Arc,
        mpsc::{self, Receiver, Sender},
    },
    thread,
    time::{Duration, SystemTime, UNIX_EPOCH},
};

use foxhunt::{
    hunt::Event,
    overview::{Overview, OverviewReader},
    page::{Live, Mark, PageLog, live_page, news, page_line},
};

use super::{
    PagePlan, Shown,
    happening::Happening,
    server::{self, Shared},
};
use crate::{commands::tiles::NO_PLACE, error::CliError, output::warn};

/// Time for browsers to take the last news before the program ends.
const FAREWELL: Duration = Duration::from_secs(2);

/// The page of a hunt, as the hunt's thread has it.
pub struct PageView {
    shared: Arc<Shared>,
    until_done: bool,
    address: String,
    /// Closed when the server ends.
    ended: Receiver<()>,
}

impl PageView {
    /// Opens the address and serves the page from now on; `happenings` takes the questions of
    /// programs that fetch the hunt.
    pub fn start(
        plan: &PagePlan,
        shown: &Shown<'_>,
        happenings: Sender<Happening>,
    ) -> Result<Self, CliError> {
        let PagePlan { address, token, until_done, tiles } = plan;
        if tiles.is_some() && shown.header.origin.is_none() {
            return Err(CliError::input(NO_PLACE));
        }
        let refused = |error: std::io::Error| {
            CliError::input(format!("--live={address}: cannot be served there: {error}"))
        };
        let listener = TcpListener::bind(address).map_err(refused)?;
        listener.set_nonblocking(true).map_err(refused)?;
        let address = listener.local_addr().map_err(refused)?;
        let orders = shown.orders && token.is_some();
        let beginning =
            OverviewReader::new(shown.header, shown.registry, Some(shown.estimator), None)
                .map_err(CliError::failure)?;
        let log = PageLog::live(shown.header, None);
        let about = tiles.as_ref().map(|tiles| tiles.about().clone());
        let page = live_page(beginning.overview(), &log, Live { orders, tiles: about });
        let page = page.map_err(CliError::failure)?;
        let shared = Shared::new(page, token.clone(), orders, tiles.clone(), run_name());
        let shared = Arc::new(shared.with_questions(happenings));
        let (end, ended) = mpsc::channel();
        server::start(listener, Arc::clone(&shared), *until_done, end)?;
        announce(&shared, address);
        let address = format!("http://{address}/");
        Ok(Self { shared, until_done: *until_done, address, ended })
    }

    /// Returns the side that takes the news.
    pub fn news(&self) -> PageNews {
        PageNews { shared: Arc::clone(&self.shared), mark: Mark::default() }
    }

    /// Returns true if a viewer with the token has broken the flight off since the last call.
    #[cfg(feature = "hardware")]
    pub fn is_broken_off(&self) -> bool {
        self.shared.take_break_off()
    }

    /// Serves the page of a hunt that is over until `interrupted`, or ends at once if that was
    /// requested.
    pub fn stay(self, interrupted: impl Fn() -> bool) {
        if self.until_done {
            // All browsers have the last news then, or are too slow.
            let _ = self.ended.recv_timeout(FAREWELL);
            return;
        }
        warn(&format!("the hunt is over; {} stays until Ctrl-C", self.address));
        while !interrupted() {
            thread::sleep(Duration::from_millis(100));
        }
    }
}

/// The side of the page that takes the news.
pub struct PageNews {
    shared: Arc<Shared>,
    mark: Mark,
}

/// Lines and orders of events that came at once.
#[derive(Default)]
pub struct Batch {
    lines: Vec<String>,
    sent: Vec<(usize, f64, f64)>,
    has_events: bool,
}

impl Batch {
    pub fn add(&mut self, event: &Event) {
        self.has_events = true;
        self.lines.extend(page_line(event));
        if let Event::Sent { drone, to, .. } = *event {
            self.sent.push((drone, to.x, to.y));
        }
    }
}

impl PageNews {
    /// Adds the news for browsers, if anything has happened.
    pub fn add(&mut self, overview: &Overview, batch: Batch) {
        if !batch.has_events {
            return;
        }
        // JSON has a text for every overview; a page that misses one has the next.
        if let Ok(Some(news)) = news(overview, &mut self.mark) {
            let lines = serde_json::to_string(&batch.lines).unwrap_or_default();
            let sent = serde_json::to_string(&batch.sent).unwrap_or_default();
            self.shared.add(format!("{{\"news\":{news},\"log\":{lines},\"sent\":{sent}}}"));
        }
    }

    /// Tells browsers that no more news will come.
    pub fn over(&self) {
        self.shared.progress.send_modify(|progress| progress.over = true);
    }
}

/// Returns a name that no other run of the program has.
fn run_name() -> String {
    let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    format!("{:x}", now.as_nanos())
}

/// Prints the address of the page, and what others see of it.
fn announce(shared: &Shared, address: std::net::SocketAddr) {
    let query = if shared.token.is_some() { "?token=…" } else { "" };
    warn(&format!("live view: http://{address}/{query}"));
    if !address.ip().is_loopback() {
        let orders = if shared.orders { ", and can break the flight off" } else { "" };
        warn(&format!(
            "others can reach this address: who has the token sees where the drones and beacons \
             are, every reception and estimate{orders}; nothing is encrypted on its way"
        ));
    }
}
