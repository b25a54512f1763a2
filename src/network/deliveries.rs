use std::collections::VecDeque;

use foxhunt_hardware::link::{Delivery, Taken};

/// What a drone has to deliver and does not know to be taken in.
#[derive(Debug, Default)]
pub(super) struct Deliveries {
    /// The oldest first, each with when it is said next.
    kept: VecDeque<(f64, Delivery)>,
    given_up: u64,
}

impl Deliveries {
    /// Takes one in; past `most` the oldest is given up.
    pub(super) fn put(&mut self, time: f64, delivery: Delivery, most: usize) {
        if self.kept.len() >= most {
            self.kept.pop_front();
            self.given_up += 1;
        }
        self.kept.push_back((time, delivery));
    }

    /// Forgets what was taken in.
    pub(super) fn taken(&mut self, taken: &[Taken]) {
        self.kept.retain(|(_, delivery)| !taken.contains(&delivery.name()));
    }

    /// What is to be said now, and after `repeat_s` again.
    pub(super) fn due(
        &mut self,
        time: f64,
        repeat_s: f64,
    ) -> impl Iterator<Item = &Delivery> + use<'_> {
        self.kept.iter_mut().filter_map(move |(next, delivery)| {
            (*next <= time).then(|| {
                *next = time + repeat_s;
                &*delivery
            })
        })
    }

    /// How many were given up because nobody took them in.
    pub(super) fn given_up(&self) -> u64 {
        self.given_up
    }
}
