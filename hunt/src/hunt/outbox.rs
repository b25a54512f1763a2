use std::collections::VecDeque;

use super::{Command, Event};

/// Commands and events of a hunt that have not been polled yet.
#[derive(Debug, Default)]
pub(super) struct Outbox {
    commands: VecDeque<Command>,
    events: VecDeque<Event>,
    /// Failures since the last change of phase, without their numbers, so that one fault makes one
    /// event however old it gets.
    failures: Vec<(Option<usize>, String)>,
}

impl Outbox {
    pub(super) fn order(&mut self, command: Command) {
        self.commands.push_back(command);
    }

    pub(super) fn emit(&mut self, event: Event) {
        if matches!(event, Event::PhaseChanged { .. }) {
            self.failures.clear();
        }
        self.events.push_back(event);
    }

    pub(super) fn failed(&mut self, time: f64, drone: Option<usize>, reason: String) {
        let fault = (drone, without_numbers(&reason));
        if !self.failures.contains(&fault) {
            self.failures.push(fault);
            self.emit(Event::DeviceFailed { time, drone, reason });
        }
    }

    pub(super) fn is_empty(&self) -> bool {
        self.commands.is_empty() && self.events.is_empty()
    }

    pub(super) fn next_command(&mut self) -> Option<Command> {
        self.commands.pop_front()
    }

    pub(super) fn next_event(&mut self) -> Option<Event> {
        self.events.pop_front()
    }
}

fn without_numbers(text: &str) -> String {
    text.chars().filter(|letter| !letter.is_ascii_digit()).collect()
}
