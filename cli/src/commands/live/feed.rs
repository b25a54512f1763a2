use std::{
    cell::Cell,
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
    overview::{KeptTurn, OverviewReader},
    page::{Live, Mark, PageLog, live_page, news, page_line},
    replay::ReplayError,
};

use super::{LivePlan, Shown, server, shared::Shared};
use crate::{commands::views::Antennas, error::CliError, output::warn};

/// Maximum number of places for one belief: a long hunt is sent as a whole to late browsers.
const PLACES: u32 = 500;

/// Time for browsers to take the last news before the program ends.
const FAREWELL: Duration = Duration::from_secs(2);

/// A turn or an event of a hunt.
enum Happening {
    Turn(Box<KeptTurn>),
    Event(Box<Event>),
}

/// A hunt that is shown while it goes on.
pub(in crate::commands) struct LiveView {
    /// Sender of turns and events; `None` once the hunt is over.
    happenings: Option<Sender<Happening>>,
    shared: Arc<Shared>,
    until_done: bool,
    address: String,
    /// Number of turns that were shown.
    turns: Cell<usize>,
    /// Closed when the server ends.
    ended: Receiver<()>,
}

impl LiveView {
    /// Opens the address and serves the page from now on.
    pub(in crate::commands) fn start(plan: &LivePlan, shown: &Shown<'_>) -> Result<Self, CliError> {
        let LivePlan { address, token, until_done, tiles } = plan;
        if tiles.is_some() && shown.header.origin.is_none() {
            return Err(CliError::input(
                "--tiles: the hunt is in local metres; --origin LAT,LON places it on Earth",
            ));
        }
        let refused = |error: std::io::Error| {
            CliError::input(format!("--live={address}: cannot be served there: {error}"))
        };
        let listener = TcpListener::bind(address).map_err(refused)?;
        listener.set_nonblocking(true).map_err(refused)?;
        let address = listener.local_addr().map_err(refused)?;
        let orders = shown.orders && token.is_some();
        let header = shown.header.clone();
        let registry = shown.registry.clone();
        let estimator = shown.estimator.clone();
        let extractor = shown.extractor.clone();
        let beginning = OverviewReader::new(&header, &registry, Some(&estimator), None)
            .map_err(CliError::failure)?;
        let log = PageLog::live(&header, None);
        let about = tiles.as_ref().map(|tiles| tiles.about().clone());
        let page = live_page(beginning.overview(), &log, Live { orders, tiles: about });
        let page = page.map_err(CliError::failure)?;
        let shared = Arc::new(Shared::new(page, token.clone(), orders, tiles.clone(), run_name()));
        let (happenings, happened) = mpsc::channel();
        let kept = Arc::clone(&shared);
        thread::spawn(move || {
            let antennas = Antennas::of(&extractor);
            let reader =
                OverviewReader::new(&header, &registry, Some(&estimator), antennas.known());
            let read =
                reader.and_then(|reader| follow(reader.with_places(PLACES), &happened, &kept));
            if let Err(error) = read {
                warn(&format!("the live view stops: {error}"));
            }
            kept.progress.send_modify(|progress| progress.over = true);
        });
        let (end, ended) = mpsc::channel();
        server::start(listener, Arc::clone(&shared), *until_done, end)?;
        announce(&shared, address);
        let address = format!("http://{address}/");
        Ok(Self {
            happenings: Some(happenings),
            shared,
            until_done: *until_done,
            address,
            turns: Cell::new(0),
            ended,
        })
    }

    /// Shows an event, and the turns that were kept since the one before.
    pub(in crate::commands) fn show(&self, event: &Event, turns: &[KeptTurn]) {
        let shown = self.turns.replace(turns.len());
        for turn in turns.get(shown..).unwrap_or_default() {
            self.send(Happening::Turn(Box::new(turn.clone())));
        }
        self.send(Happening::Event(Box::new(event.clone())));
    }

    fn send(&self, happening: Happening) {
        if let Some(happenings) = &self.happenings {
            // Where the view has stopped, it has been on standard error why.
            let _ = happenings.send(happening);
        }
    }

    /// Returns true if a viewer with the token has broken the flight off since the last call.
    pub(in crate::commands) fn is_broken_off(&self) -> bool {
        self.shared.take_break_off()
    }

    /// Serves the page of a hunt that is over until `interrupted`, or ends at once if that was
    /// requested.
    pub(in crate::commands) fn stay(mut self, interrupted: impl Fn() -> bool) {
        self.happenings = None;
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

/// Adds the news for browsers, as long as anything happens.
fn follow(
    mut reader: OverviewReader<'_>,
    happened: &Receiver<Happening>,
    shared: &Shared,
) -> Result<(), ReplayError> {
    let mut mark = Mark::default();
    while let Ok(first) = happened.recv() {
        let mut lines = Vec::new();
        let mut sent = Vec::new();
        let mut next = Some(first);
        while let Some(happening) = next {
            match happening {
                Happening::Turn(turn) => reader.turn(*turn),
                Happening::Event(event) => {
                    reader.event(&event)?;
                    lines.extend(page_line(&event));
                    if let Event::Sent { drone, to, .. } = *event {
                        sent.push((drone, to.x, to.y));
                    }
                }
            }
            next = happened.try_recv().ok();
        }
        // JSON has a text for every overview; a page that misses one has the next.
        if let Ok(Some(news)) = news(reader.overview(), &mut mark) {
            let lines = serde_json::to_string(&lines).unwrap_or_default();
            let sent = serde_json::to_string(&sent).unwrap_or_default();
            shared.add(format!("{{\"news\":{news},\"log\":{lines},\"sent\":{sent}}}"));
        }
    }
    Ok(())
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
