use std::{cell::RefCell, collections::VecDeque, rc::Rc};

use super::{DroneLink, FusionLink, LinkError, Order, Report};

/// Messages under way between the two sides.
#[derive(Debug, Default)]
struct Wires {
    reports: VecDeque<(usize, Report)>,
    orders: Vec<VecDeque<Order>>,
}

/// Most messages that are kept for a side that does not take them; the oldest are lost.
const MOST: usize = 10_000;

/// A network within one program: a link for each drone, and the one of the side that fuses. It
/// loses nothing; [`Impaired`](super::Impaired) does.
#[must_use]
pub fn memory_network(drones: usize) -> (Vec<MemoryDrone>, MemoryFusion) {
    let orders = vec![VecDeque::new(); drones];
    let wires = Rc::new(RefCell::new(Wires { reports: VecDeque::new(), orders }));
    let of = |drone| MemoryDrone { drone, wires: Rc::clone(&wires) };
    ((0..drones).map(of).collect(), MemoryFusion { wires })
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

fn push<T>(queue: &mut VecDeque<T>, message: T) {
    if queue.len() == MOST {
        queue.pop_front();
    }
    queue.push_back(message);
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
