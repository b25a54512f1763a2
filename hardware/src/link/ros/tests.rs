//! Both ends in one program, over topics in memory.

use std::{
    any::Any,
    collections::VecDeque,
    sync::{Arc, Mutex, MutexGuard},
};

use foxhunt_core::Pose;
use serde::{Deserialize, Serialize};

use super::{
    Kept, Publish, Publisher, RosHeader, Subscribe, Subscriber, Text, Topics, convert, drone_topic,
    ends::{DroneEnd, FusionEnd},
};
use crate::link::{
    DroneLink, FusionLink, LinkError, Order, Refusal, Report, Status, TeamKey, UnixTime,
};

/// A header that holds every time.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
struct Stamp(i64, u32);

impl RosHeader for Stamp {
    fn at(moment: UnixTime) -> Result<Self, LinkError> {
        Ok(Self(moment.sec, moment.nanosec))
    }

    fn moment(&self) -> UnixTime {
        UnixTime { sec: self.0, nanosec: self.1 }
    }
}

type Queue = Arc<Mutex<VecDeque<Box<dyn Any + Send>>>>;

/// A network in memory; a clone is another node of it.
#[derive(Clone, Default)]
struct Network(Arc<Mutex<Vec<(String, Queue)>>>);

/// A topic that is published on.
struct Out(Network, String);

/// A topic that is subscribed to.
struct In(Queue);

fn locked<T>(of: &Mutex<T>) -> MutexGuard<'_, T> {
    of.lock().expect("nobody panicked")
}

impl<M: Clone + Send + 'static> Topics<M> for Network {
    fn publisher(&mut self, topic: &str, _: Kept) -> Result<Publisher<M>, LinkError> {
        Ok(Box::new(Out(self.clone(), topic.to_owned())))
    }

    fn late_publisher(&mut self, topic: &str) -> Result<Publisher<M>, LinkError> {
        self.publisher(topic, Kept::Last)
    }

    fn subscriber(&mut self, topic: &str, _: usize) -> Result<Subscriber<M>, LinkError> {
        let queue = Queue::default();
        locked(&self.0).push((topic.to_owned(), Arc::clone(&queue)));
        Ok(Box::new(In(queue)))
    }
}

impl<M: Clone + Send + 'static> Publish<M> for Out {
    fn publish(&mut self, message: M) -> Result<(), LinkError> {
        for (topic, queue) in locked(&self.0.0).iter() {
            if *topic == self.1 {
                locked(queue).push_back(Box::new(message.clone()));
            }
        }
        Ok(())
    }
}

impl<M: 'static> Subscribe<M> for In {
    fn take(&mut self) -> Result<Option<M>, LinkError> {
        let message = locked(&self.0).pop_front();
        Ok(message.map(|message| *message.downcast().expect("one type on each topic")))
    }
}

type Drone = DroneEnd<Stamp, Network>;
type Fusion = FusionEnd<Stamp, Network>;

fn key() -> TeamKey {
    TeamKey::generate().expect("randomness")
}

fn order(number: u64) -> Order {
    Order { number, ..Order::default() }
}

fn status(order: u64) -> Report {
    Report::Status(Status { order, ..Status::default() })
}

/// All that has come to an end, refusals included.
fn all<T>(mut receive: impl FnMut() -> Result<Option<T>, LinkError>) -> Vec<Result<T, LinkError>> {
    std::iter::from_fn(|| receive().transpose()).collect()
}

/// Lets both ends know each other's session.
fn meet(drones: &mut [Drone], fusion: &mut Fusion) {
    for _ in 0..2 {
        for (number, drone) in drones.iter_mut().enumerate() {
            drone.send(&status(0)).expect("sent");
            fusion.send(number, &order(0)).expect("sent");
        }
        let _ = all(|| fusion.receive());
        for drone in drones.iter_mut() {
            let _ = all(|| drone.receive());
        }
    }
}

fn drones(network: &Network, key: Option<&TeamKey>) -> Vec<Drone> {
    let end = |drone| Drone::new(network.clone(), drone, key.cloned()).expect("joined");
    (0..2).map(end).collect()
}

#[test]
fn orders_and_reports_come_with_a_key_and_without() {
    for key in [None, Some(key())] {
        let network = Network::default();
        let mut fusion = Fusion::new(network.clone(), 2, key.clone()).expect("joined");
        let mut drones = drones(&network, key.as_ref());
        meet(&mut drones, &mut fusion);
        fusion.send(1, &order(7)).expect("sent");
        assert_eq!(all(|| drones[0].receive()), []);
        assert_eq!(all(|| drones[1].receive()), [Ok(order(7))]);
        let pose = Report::Pose { at: UnixTime::whole(3), pose: Pose::at(1.0, 2.0, 3.0) };
        for report in [pose, status(7)] {
            drones[1].send(&report).expect("sent");
            assert_eq!(all(|| fusion.receive()), [Ok((1, report))]);
        }
        let missing = fusion.send(2, &order(8));
        assert_eq!(missing, Err(LinkError::Drone { drone: 2, drones: 2 }));
    }
}

#[test]
fn with_a_key_nobody_else_gives_orders_or_reports() {
    let network = Network::default();
    let key_of_team = key();
    let mut drones = drones(&network, Some(&key_of_team));
    let mut fusion = Fusion::new(network.clone(), 2, Some(key_of_team)).expect("joined");
    let mut stranger: Subscriber<Text> =
        network.clone().subscriber(&drone_topic(0, "signed_order"), 1).expect("joined");
    meet(&mut drones, &mut fusion);
    fusion.send(0, &order(1)).expect("sent");
    assert_eq!(all(|| drones[0].receive()), [Ok(order(1))]);

    // What it has recorded, and garbage.
    let recorded: Vec<Text> = all(|| stranger.take()).into_iter().flatten().collect();
    assert!(!recorded.is_empty());
    for drone in 0..2 {
        let topic = drone_topic(drone, "signed_order");
        let mut speaker: Publisher<Text> =
            network.clone().publisher(&topic, Kept::Last).expect("joined");
        for text in &recorded {
            speaker.publish(text.clone()).expect("sent");
        }
        speaker.publish(Text { data: "land".to_owned() }).expect("sent");
    }
    let refused = |came: Vec<Result<Order, LinkError>>| -> Vec<Refusal> {
        let why = |refused| match refused {
            Err(LinkError::Refused { why, .. }) => why,
            other => panic!("it was taken: {other:?}"),
        };
        came.into_iter().map(why).collect()
    };
    assert_eq!(refused(all(|| drones[0].receive())), [Refusal::Garbage], "replays are harmless");
    let on_another = refused(all(|| drones[1].receive()));
    assert_eq!(on_another, [Refusal::WrongKey, Refusal::Garbage], "{recorded:?}");

    // Without the key, on the topics of nodes that have none.
    let mut unsigned = Fusion::new(network.clone(), 2, None).expect("joined");
    unsigned.send(0, &Order { land: true, ..order(9) }).expect("sent");
    assert_eq!(all(|| drones[0].receive()), []);
    // With another one.
    let mut other = Fusion::new(network.clone(), 2, Some(key())).expect("joined");
    other.send(0, &Order { land: true, ..order(9) }).expect("sent");
    assert_eq!(refused(all(|| drones[0].receive())), [Refusal::WrongKey]);
    let mut imposter = Drone::new(network, 1, Some(key())).expect("joined");
    imposter.send(&status(9)).expect("sent");
    let report = all(|| fusion.receive());
    let [Err(LinkError::Refused { why: Refusal::WrongKey, count: 1, .. })] = report[..] else {
        panic!("it was taken: {report:?}");
    };
}

#[test]
fn with_a_key_viewers_still_see_the_pose() {
    let network = Network::default();
    let mut viewer: Subscriber<super::PoseStamped<Stamp>> =
        network.clone().subscriber(&drone_topic(0, "pose"), 1).expect("joined");
    let mut drone = Drone::new(network, 0, Some(key())).expect("joined");
    let report = Report::Pose { at: UnixTime::whole(3), pose: Pose::at(1.0, 2.0, 3.0) };
    drone.send(&report).expect("sent");
    let received = viewer.take().expect("nothing fails").expect("it was sent");
    assert_eq!(convert::report_of_pose(&received), report);
}
