use std::{
    cell::Cell,
    sync::mpsc::{self, Receiver, RecvTimeoutError, Sender},
    thread,
    time::{Duration, Instant},
};

#[cfg(feature = "hardware")]
use foxhunt::{core::Station, hardware::link::MqttConfig};
use foxhunt::{
    hunt::Event,
    nalgebra::Vector3,
    overview::{KeptTurn, OverviewReader},
    replay::ReplayError,
};

#[cfg(feature = "live")]
use super::page::{Batch, PageNews, PageView};
use super::{LivePlan, Shown, happening::Happening};
#[cfg(feature = "cot")]
use crate::commands::cot::CotOutlet;
#[cfg(feature = "hardware")]
use crate::commands::mqtt::MqttOutlet;
use crate::{commands::views::Antennas, error::CliError, output::warn};

/// Maximum number of places for one belief: a long hunt is sent as a whole to late browsers.
const PLACES: u32 = 500;

/// Shortest time from one state of the hunt to the next for teams, and between two places of a
/// receiver.
const STATE: Duration = Duration::from_secs(1);

/// Longest wait for teams to have the last state of a hunt before the program ends.
#[cfg(feature = "hardware")]
const FAREWELL: Duration = Duration::from_secs(3);

/// A hunt that is shown while it goes on: to browsers, to programs that fetch it, and to teams.
pub struct LiveView {
    happenings: Sender<Happening>,
    #[cfg(feature = "live")]
    page: Option<PageView>,
    /// Number of turns that were shown.
    turns: Cell<usize>,
    /// Time of the last places.
    #[cfg(feature = "hardware")]
    placed: Cell<Option<Instant>>,
    /// Closed when the last state of the hunt has been sent.
    sent: Receiver<()>,
}

impl LiveView {
    /// Opens the addresses of the plan, and shows the hunt there from now on.
    pub fn start(plan: LivePlan, shown: &Shown<'_>) -> Result<Self, CliError> {
        #[cfg(feature = "cot")]
        refuse_nowhere("--cot", plan.cot.is_some(), shown)?;
        #[cfg(feature = "hardware")]
        refuse_nowhere("--mqtt", plan.mqtt.is_some(), shown)?;
        let header = shown.header.clone();
        let registry = shown.registry.clone();
        let estimator = shown.estimator.clone();
        let extractor = shown.extractor.clone();
        let (happenings, happened) = mpsc::channel();
        #[cfg(feature = "live")]
        let page = plan
            .page
            .as_ref()
            .map(|plan| PageView::start(plan, shown, happenings.clone()))
            .transpose()?;
        let outlets = Outlets {
            #[cfg(feature = "live")]
            page: page.as_ref().map(PageView::news),
            #[cfg(feature = "cot")]
            cot: plan
                .cot
                .map(|sender| CotOutlet::new(sender, shown.platforms.to_vec(), shown.is_simulated)),
            #[cfg(feature = "hardware")]
            mqtt: plan.mqtt.map(|config| broker(&config, shown)).transpose()?,
            due: None,
        };
        let (end, sent) = mpsc::channel();
        thread::spawn(move || {
            let antennas = Antennas::of(&extractor);
            let reader =
                OverviewReader::new(&header, &registry, Some(&estimator), antennas.known());
            let mut outlets = outlets;
            let followed = reader.and_then(|reader| {
                follow(reader.with_places(PLACES), &happened, &mut outlets, end)
            });
            if let Err(error) = followed {
                warn(&format!("the live view stops: {error}"));
            }
            #[cfg(feature = "live")]
            if let Some(page) = &outlets.page {
                page.over();
            }
        });
        Ok(Self {
            happenings,
            #[cfg(feature = "live")]
            page,
            turns: Cell::new(0),
            #[cfg(feature = "hardware")]
            placed: Cell::new(None),
            sent,
        })
    }

    /// Shows an event, and the turns that were kept since the one before.
    pub fn show(&self, event: &Event, turns: &[KeptTurn]) {
        let shown = self.turns.replace(turns.len());
        for turn in turns.get(shown..).unwrap_or_default() {
            self.send(Happening::Turn(Box::new(turn.clone())));
        }
        self.send(Happening::Event(Box::new(event.clone())));
    }

    /// Shows where the receivers are, once a second at most.
    #[cfg(feature = "hardware")]
    pub fn place(&self, time: f64, stations: impl FnOnce() -> Vec<Station>) {
        let now = Instant::now();
        let is_due = |last: Instant| now.duration_since(last) >= STATE;
        if self.placed.get().is_none_or(is_due) {
            self.placed.set(Some(now));
            let places = stations().iter().map(|station| station.pose.position).collect();
            self.send(Happening::Places(time, places));
        }
    }

    fn send(&self, happening: Happening) {
        // Where the view has stopped, it has been on standard error why.
        let _ = self.happenings.send(happening);
    }

    /// Returns true if a viewer with the token has broken the flight off since the last call.
    #[cfg(feature = "hardware")]
    pub fn is_broken_off(&self) -> bool {
        #[cfg(feature = "live")]
        return self.page.as_ref().is_some_and(PageView::is_broken_off);
        #[cfg(not(feature = "live"))]
        false
    }

    /// Sends the last state of a hunt that is over. Serves its page until `interrupted`; ends at
    /// once if that was requested, or without a page.
    #[cfg_attr(not(feature = "live"), expect(unused_variables, reason = "no page is served"))]
    pub fn stay(self, interrupted: impl Fn() -> bool) {
        self.send(Happening::Over);
        // It ends where the thread has ended.
        let _ = self.sent.recv();
        #[cfg(feature = "live")]
        if let Some(page) = self.page {
            page.stay(interrupted);
        }
    }
}

/// Refuses to send a hunt that has no place on Earth.
#[cfg(feature = "hardware")]
fn refuse_nowhere(flag: &str, is_given: bool, shown: &Shown<'_>) -> Result<(), CliError> {
    match is_given && shown.header.origin.is_none() {
        true => Err(CliError::input(format!("{flag}: {}", shown.nowhere))),
        false => Ok(()),
    }
}

/// Opens the broker for a hunt.
#[cfg(feature = "hardware")]
fn broker(config: &MqttConfig, shown: &Shown<'_>) -> Result<MqttOutlet, CliError> {
    let platforms = shown.platforms.to_vec();
    MqttOutlet::new(config, &shown.header.scenario, platforms, shown.is_simulated)
}

/// Receivers of a hunt that goes on.
struct Outlets {
    #[cfg(feature = "live")]
    page: Option<PageNews>,
    #[cfg(feature = "cot")]
    cot: Option<CotOutlet>,
    #[cfg(feature = "hardware")]
    mqtt: Option<MqttOutlet>,
    /// Time of the next state for teams; `None` before the first.
    due: Option<Instant>,
}

impl Outlets {
    fn has_teams(&self) -> bool {
        #[cfg(feature = "cot")]
        if self.cot.is_some() {
            return true;
        }
        #[cfg(feature = "hardware")]
        return self.mqtt.is_some();
        #[cfg(not(feature = "hardware"))]
        false
    }

    fn place(&mut self, reader: &OverviewReader<'_>, time: f64, places: &[Vector3<f64>]) {
        #[cfg(feature = "hardware")]
        for (receiver, place) in places.iter().enumerate() {
            // Where a drone that is not heard of was last is no place of now.
            let known = reader.overview().receivers.get(receiver);
            let health = known.and_then(|receiver| receiver.health.last());
            if health.is_some_and(|health| !health.linked) {
                continue;
            }
            #[cfg(feature = "cot")]
            if let Some(cot) = &mut self.cot {
                cot.place(receiver, time, *place);
            }
            if let Some(mqtt) = &mut self.mqtt {
                mqtt.place(receiver, time, *place);
            }
        }
        #[cfg(not(feature = "hardware"))]
        let _ = (reader, time, places);
    }

    /// Returns true if it is time for the next state.
    fn is_due(&self) -> bool {
        self.due.is_some_and(|due| Instant::now() >= due)
    }

    /// Sends the state of the hunt to teams, if it is time.
    fn publish(&mut self, reader: &OverviewReader<'_>, is_over: bool) {
        let now = Instant::now();
        if !is_over && self.due.is_some_and(|due| now < due) {
            return;
        }
        self.due = Some(now + STATE);
        #[cfg(feature = "cot")]
        if let Some(cot) = &mut self.cot {
            cot.publish(reader.overview(), is_over);
        }
        #[cfg(feature = "hardware")]
        if let Some(mqtt) = &mut self.mqtt {
            mqtt.publish(reader.overview());
        }
        #[cfg(not(feature = "hardware"))]
        let _ = reader;
    }

    /// Sends the last state of the hunt, and waits until it has arrived.
    fn finish(&mut self, reader: &OverviewReader<'_>) {
        self.publish(reader, true);
        #[cfg(feature = "cot")]
        if let Some(Err(error)) = self.cot.take().map(|cot| cot.finish(FAREWELL)) {
            warn(&error);
        }
        #[cfg(feature = "hardware")]
        if let Some(Err(error)) = self.mqtt.take().map(|mqtt| mqtt.finish(FAREWELL)) {
            warn(&error);
        }
    }
}

/// Passes everything on that happens, and answers questions, as long as anybody may ask.
fn follow(
    mut reader: OverviewReader<'_>,
    happened: &Receiver<Happening>,
    outlets: &mut Outlets,
    end: Sender<()>,
) -> Result<(), ReplayError> {
    // Dropped when the last state has been sent.
    let mut end = Some(end);
    loop {
        let first = match outlets.has_teams() {
            true => match happened.recv_timeout(STATE) {
                Err(RecvTimeoutError::Timeout) => None,
                other => Some(other.map_err(|_| ())),
            },
            false => Some(happened.recv().map_err(|_| ())),
        };
        let mut next = match first {
            Some(Err(())) => return Ok(()),
            Some(Ok(happening)) => Some(happening),
            None => None,
        };
        let mut is_over = false;
        #[cfg(feature = "live")]
        let mut news = outlets.page.as_ref().map(|_| Batch::default());
        while let Some(happening) = next {
            match happening {
                Happening::Turn(turn) => reader.turn(*turn),
                Happening::Event(event) => {
                    reader.event(&event)?;
                    #[cfg(feature = "live")]
                    if let Some(news) = &mut news {
                        news.add(&event);
                    }
                }
                Happening::Places(time, places) => outlets.place(&reader, time, &places),
                #[cfg(feature = "live")]
                Happening::Asked(asked) => {
                    asked.answer(reader.overview());
                    break;
                }
                Happening::Over => is_over = true,
            }
            // Neither questions nor a burst of events hold up what others are sent.
            if outlets.is_due() {
                break;
            }
            next = happened.try_recv().ok();
        }
        #[cfg(feature = "live")]
        if let (Some(page), Some(news)) = (&mut outlets.page, news) {
            page.add(reader.overview(), news);
            if is_over {
                page.over();
            }
        }
        match is_over {
            true => {
                outlets.finish(&reader);
                drop(end.take());
            }
            false => outlets.publish(&reader, false),
        }
    }
}
