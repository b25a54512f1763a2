use std::collections::VecDeque;

use foxhunt_hardware::link::{Delivery, Taken};

/// The deliveries of a drone that are not known to be logged.
#[derive(Debug, Default)]
pub(super) struct Deliveries {
    /// The oldest first, each with when it is sent next.
    kept: VecDeque<(f64, Delivery)>,
    given_up: u64,
}

impl Deliveries {
    /// Adds one; past `most` the oldest is given up.
    pub(super) fn put(&mut self, time: f64, delivery: Delivery, most: usize) {
        if self.kept.len() >= most {
            self.kept.pop_front();
            self.given_up += 1;
        }
        self.kept.push_back((time, delivery));
    }

    /// Forgets those that are logged.
    pub(super) fn forget(&mut self, taken: &[Taken]) {
        self.kept.retain(|(_, delivery)| !taken.contains(&delivery.name()));
    }

    /// Returns the deliveries that are to be sent now, and again after `repeat_s`.
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

    /// Returns the number of deliveries that were given up because they were not logged for too
    /// long.
    pub(super) fn given_up(&self) -> u64 {
        self.given_up
    }
}
