//! Carriers of messages, links in memory, and links that lose, delay and double.

use std::{cell::RefCell, collections::VecDeque, fmt, rc::Rc};

use foxhunt_core::{
    Clock,
    parameter::{FieldError, not_negative, probability},
};

use super::{DroneLink, FusionLink, LinkError, Order, Report, View};

/// Most messages that are kept for an end that does not take them; the oldest are lost.
const MOST: usize = 10_000;

/// Messages under way between the two sides.
#[derive(Debug, Default)]
struct Wires {
    reports: VecDeque<(usize, Report)>,
    orders: Vec<VecDeque<Order>>,
}

/// A drone's end of a [`memory_network`]; a clone shares its queues.
#[derive(Clone, Debug)]
pub struct MemoryDrone {
    drone: usize,
    wires: Rc<RefCell<Wires>>,
}

/// The fusing end of a [`memory_network`]; a clone shares its queues.
#[derive(Clone, Debug)]
pub struct MemoryFusion {
    wires: Rc<RefCell<Wires>>,
}

impl DroneLink for MemoryDrone {
    fn send(&mut self, report: &Report) -> Result<(), LinkError> {
        push(&mut self.wires.borrow_mut().reports, (self.drone, report.clone()));
        Ok(())
    }

    fn receive(&mut self) -> Result<Option<Order>, LinkError> {
        Ok(self.wires.borrow_mut().orders.get_mut(self.drone).and_then(VecDeque::pop_front))
    }
}

impl FusionLink for MemoryFusion {
    fn send(&mut self, drone: usize, order: &Order) -> Result<(), LinkError> {
        let mut wires = self.wires.borrow_mut();
        let drones = wires.orders.len();
        let queue = wires.orders.get_mut(drone).ok_or(LinkError::Drone { drone, drones })?;
        push(queue, order.clone());
        Ok(())
    }

    fn receive(&mut self) -> Result<Option<(usize, Report)>, LinkError> {
        Ok(self.wires.borrow_mut().reports.pop_front())
    }
}

/// A carrier of messages between a drone and the fusing node as bytes, for [`CarriedDrone`] and
/// [`CarriedFusion`]. Nothing waits; whatever is sent may be lost, late, doubled or a stranger's.
///
/// A carrier that records what comes over another one:
///
/// ```
/// use foxhunt_hardware::link::{Carrier, LinkError, memory_carriers};
///
/// struct Recorder<C> {
///     carrier: C,
///     came: Vec<(usize, Vec<u8>)>,
/// }
///
/// impl<C: Carrier> Carrier for Recorder<C> {
///     fn send(&mut self, drone: usize, payload: Vec<u8>) -> Result<(), LinkError> {
///         self.carrier.send(drone, payload)
///     }
///
///     fn receive(&mut self) -> Result<Option<(usize, Vec<u8>)>, LinkError> {
///         let received = self.carrier.receive()?;
///         self.came.extend(received.clone());
///         Ok(received)
///     }
/// }
///
/// let (mut drones, fusion) = memory_carriers(2);
/// let mut recorder = Recorder { carrier: fusion, came: Vec::new() };
/// drones[1].send(1, b"a report".to_vec())?;
/// assert_eq!(recorder.receive()?, Some((1, b"a report".to_vec())));
/// assert_eq!(recorder.came.len(), 1);
/// # Ok::<(), LinkError>(())
/// ```
///
/// [`CarriedDrone`]: super::CarriedDrone
/// [`CarriedFusion`]: super::CarriedFusion
pub trait Carrier {
    /// Sends bytes to the other end of a drone's channel, counted from 0.
    ///
    /// # Errors
    ///
    /// Any error of the carrier; the call may be repeated.
    fn send(&mut self, drone: usize, payload: Vec<u8>) -> Result<(), LinkError>;

    /// Returns the next bytes that have come, and the drone whose channel they came on, if any
    /// have.
    ///
    /// # Errors
    ///
    /// Any error of the carrier; the call may be repeated.
    fn receive(&mut self) -> Result<Option<(usize, Vec<u8>)>, LinkError>;

    /// Shows text on a topic to whoever looks on, also to those who come later; to nobody, unless
    /// overridden.
    ///
    /// # Errors
    ///
    /// Any error of the carrier.
    fn show(&mut self, topic: &str, text: String) -> Result<(), LinkError> {
        let _ = (topic, text);
        Ok(())
    }
}

impl<C: Carrier + ?Sized> Carrier for Box<C> {
    fn send(&mut self, drone: usize, payload: Vec<u8>) -> Result<(), LinkError> {
        (**self).send(drone, payload)
    }

    fn receive(&mut self) -> Result<Option<(usize, Vec<u8>)>, LinkError> {
        (**self).receive()
    }

    fn show(&mut self, topic: &str, text: String) -> Result<(), LinkError> {
        (**self).show(topic, text)
    }
}

type Queue = Rc<RefCell<VecDeque<(usize, Vec<u8>)>>>;

/// One end of [`memory_carriers`]; a clone shares its inbox.
#[derive(Clone, Debug)]
pub struct MemoryCarrier {
    /// Messages to this end.
    inbox: Queue,
    /// Inboxes of the other ends, each with its drone; a single one takes the messages of all
    /// drones.
    others: Rc<Vec<Queue>>,
}

impl Carrier for MemoryCarrier {
    fn send(&mut self, drone: usize, payload: Vec<u8>) -> Result<(), LinkError> {
        let drones = self.others.len();
        let other = if drones == 1 { self.others.first() } else { self.others.get(drone) };
        let mut queue = other.ok_or(LinkError::Drone { drone, drones })?.borrow_mut();
        if queue.len() == MOST {
            queue.pop_front();
        }
        queue.push_back((drone, payload));
        Ok(())
    }

    fn receive(&mut self) -> Result<Option<(usize, Vec<u8>)>, LinkError> {
        Ok(self.inbox.borrow_mut().pop_front())
    }
}

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

/// A network within one program: a link for each drone, and the one of the side that fuses. It
/// loses nothing; [`Impaired`](super::Impaired) does.
#[must_use]
pub fn memory_network(drones: usize) -> (Vec<MemoryDrone>, MemoryFusion) {
    let orders = vec![VecDeque::new(); drones];
    let wires = Rc::new(RefCell::new(Wires { reports: VecDeque::new(), orders }));
    let of = |drone| MemoryDrone { drone, wires: Rc::clone(&wires) };
    ((0..drones).map(of).collect(), MemoryFusion { wires })
}

fn push<T>(queue: &mut VecDeque<T>, message: T) {
    if queue.len() == MOST {
        queue.pop_front();
    }
    queue.push_back(message);
}

/// Carriers within one program: one for each drone, and that of the side that fuses.
#[must_use]
pub fn memory_carriers(drones: usize) -> (Vec<MemoryCarrier>, MemoryCarrier) {
    let inboxes: Vec<Queue> = std::iter::repeat_with(Queue::default).take(drones).collect();
    let fusion = Queue::default();
    let to_fusion = Rc::new(vec![Rc::clone(&fusion)]);
    let of =
        |inbox: &Queue| MemoryCarrier { inbox: Rc::clone(inbox), others: Rc::clone(&to_fusion) };
    let ends = inboxes.iter().map(of).collect();
    (ends, MemoryCarrier { inbox: fusion, others: Rc::new(inboxes) })
}
