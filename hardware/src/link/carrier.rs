use std::{cell::RefCell, collections::VecDeque, rc::Rc};

use super::LinkError;

/// A carrier of messages between a drone and the one that fuses as bytes, for [`CarriedDrone`] and
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

/// Most messages that are kept for an end that does not take them; the oldest are lost.
const MOST: usize = 10_000;

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
