use std::{collections::VecDeque, fmt};

use foxhunt_core::{
    Clock,
    parameter::{FieldError, not_negative, probability},
};

use super::{DroneLink, FusionLink, LinkError, Order, Report, View};

/// Faults of a link.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Impairment {
    /// Probability that a message is lost.
    pub loss: f64,
    /// Probability that one that is not lost comes twice.
    pub doubled: f64,
    /// Greatest delay in seconds; delays are uniform below it, so that messages overtake each
    /// other.
    pub late_s: f64,
}

/// A link that loses, doubles and delays what is sent over it, for rehearsals and tests. What comes
/// in is left alone: impair the other end for that.
pub struct Impaired<L, C, D, M> {
    link: L,
    clock: C,
    draw: D,
    impairment: Impairment,
    /// Messages under way, each with the time at which it arrives.
    under_way: VecDeque<(f64, M)>,
}

impl<L: fmt::Debug, C, D, M> fmt::Debug for Impaired<L, C, D, M> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Impaired")
            .field("link", &self.link)
            .field("impairment", &self.impairment)
            .field("under_way", &self.under_way.len())
            .finish_non_exhaustive()
    }
}

impl<L, C: Clock, D: FnMut() -> f64, M: Clone> Impaired<L, C, D, M> {
    /// Impairs `link`; `draw` gives independent numbers that are uniform in [0, 1).
    ///
    /// # Errors
    ///
    /// [`FieldError`] names the field that is out of its range.
    pub fn new(link: L, impairment: Impairment, clock: C, draw: D) -> Result<Self, FieldError> {
        let Impairment { loss, doubled, late_s } = impairment;
        probability("loss", loss)?;
        probability("doubled", doubled)?;
        not_negative("late_s", late_s)?;
        Ok(Self { link, clock, draw, impairment, under_way: VecDeque::new() })
    }

    fn put(&mut self, message: M) {
        let Impairment { loss, doubled, late_s } = self.impairment;
        if (self.draw)() < loss {
            return;
        }
        let copies = if (self.draw)() < doubled { 2 } else { 1 };
        for _ in 0..copies {
            let due = self.clock.now() + late_s * (self.draw)();
            self.under_way.push_back((due, message.clone()));
        }
    }

    /// Takes a message that has come to its end, the one sent first before the others.
    fn due(&mut self) -> Option<M> {
        let now = self.clock.now();
        let first = self.under_way.iter().position(|(due, _)| *due <= now)?;
        self.under_way.remove(first).map(|(_, message)| message)
    }
}

impl<L: DroneLink, C: Clock, D: FnMut() -> f64> Impaired<L, C, D, Report> {
    fn pass(&mut self) -> Result<(), LinkError> {
        while let Some(report) = self.due() {
            self.link.send(&report)?;
        }
        Ok(())
    }
}

impl<L: DroneLink, C: Clock, D: FnMut() -> f64> DroneLink for Impaired<L, C, D, Report> {
    fn send(&mut self, report: &Report) -> Result<(), LinkError> {
        self.put(report.clone());
        self.pass()
    }

    fn receive(&mut self) -> Result<Option<Order>, LinkError> {
        self.pass()?;
        self.link.receive()
    }
}

impl<L: FusionLink, C: Clock, D: FnMut() -> f64> Impaired<L, C, D, (usize, Order)> {
    fn pass(&mut self) -> Result<(), LinkError> {
        while let Some((drone, order)) = self.due() {
            self.link.send(drone, &order)?;
        }
        Ok(())
    }
}

impl<L: FusionLink, C: Clock, D: FnMut() -> f64> FusionLink for Impaired<L, C, D, (usize, Order)> {
    fn send(&mut self, drone: usize, order: &Order) -> Result<(), LinkError> {
        self.put((drone, order.clone()));
        self.pass()
    }

    fn receive(&mut self) -> Result<Option<(usize, Report)>, LinkError> {
        self.pass()?;
        self.link.receive()
    }

    fn show(&mut self, view: &View) -> Result<(), LinkError> {
        self.link.show(view)
    }
}
