use std::collections::VecDeque;

use super::{Command, Event};

/// What a hunt has to say and has not been asked for yet.
#[derive(Debug, Default)]
pub(super) struct Outbox {
    pub(super) commands: VecDeque<Command>,
    pub(super) events: VecDeque<Event>,
    /// What failed since the last change of phase, so that one fault makes one event.
    failures: Vec<(Option<usize>, String)>,
}

impl Outbox {
    pub(super) fn order(&mut self, command: Command) {
        self.commands.push_back(command);
    }

    pub(super) fn tell(&mut self, event: Event) {
        if matches!(event, Event::PhaseChanged { .. }) {
            self.failures.clear();
        }
        self.events.push_back(event);
    }

    pub(super) fn failed(&mut self, time: f64, drone: Option<usize>, reason: String) {
        if !self.failures.iter().any(|known| known.0 == drone && known.1 == reason) {
            self.failures.push((drone, reason.clone()));
            self.tell(Event::DeviceFailed { time, drone, reason });
        }
    }
}
