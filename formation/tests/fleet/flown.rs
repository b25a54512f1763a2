//! Drones that fly as they are ordered.

use foxhunt_formation::{
    Airspace, AirspaceConfig, Formation, Order, OrderReason, Traffic, TrafficConfig, Travel,
};
use nalgebra::Vector3;

pub(crate) fn at(east: f64, north: f64) -> Vector3<f64> {
    Vector3::new(east, north, 4.0)
}

/// Drones that obey at 2 m/s, at once and exactly.
pub(crate) struct Flown {
    pub(crate) traffic: Traffic,
    pub(crate) places: Vec<Vector3<f64>>,
    goals: Vec<Vector3<f64>>,
    pub(crate) orders: Vec<Order>,
    /// The least that any two were apart.
    pub(crate) least: f64,
    pub(crate) seconds: f64,
}

impl Flown {
    /// Lines keep 3 m.
    pub(crate) fn new(airspace: &AirspaceConfig, places: &[Vector3<f64>]) -> Self {
        Self::with(airspace, TrafficConfig::default(), places)
    }

    pub(crate) fn with(
        airspace: &AirspaceConfig,
        config: TrafficConfig,
        places: &[Vector3<f64>],
    ) -> Self {
        Self::over(&Airspace::new(airspace).expect("an airspace"), config, places)
    }

    pub(crate) fn over(
        airspace: &Airspace,
        config: TrafficConfig,
        places: &[Vector3<f64>],
    ) -> Self {
        let traffic = Traffic::new(airspace, config, places).expect("the drones are apart");
        let (places, goals) = (places.to_vec(), places.to_vec());
        Self { traffic, places, goals, orders: vec![], least: f64::INFINITY, seconds: 0.0 }
    }

    /// One step of 50 ms; the drones named are stuck and silent.
    pub(crate) fn step(&mut self, stuck: &[usize]) {
        self.seconds += 0.05;
        for drone in (0..self.places.len()).filter(|drone| !stuck.contains(drone)) {
            let way = self.goals[drone] - self.places[drone];
            self.places[drone] += way.cap_magnitude(2.0 * 0.05);
            self.traffic.locate(drone, &self.places[drone]);
        }
        for order in self.traffic.step() {
            self.goals[order.drone] = order.to;
            self.orders.push(order);
        }
        for (index, one) in self.places.iter().enumerate() {
            for other in &self.places[..index] {
                self.least = self.least.min((one - other).xy().norm());
            }
        }
    }

    /// Until everyone is there or blocked.
    pub(crate) fn settle(&mut self) {
        for _ in 0..20_000 {
            self.step(&[]);
            let ends = |d| matches!(self.traffic.status(d), Travel::There | Travel::Blocked);
            if (0..self.places.len()).all(ends) {
                return;
            }
        }
        panic!("it does not end");
    }

    pub(crate) fn reasons(&self, drone: usize) -> Vec<OrderReason> {
        self.orders.iter().filter(|o| o.drone == drone).map(|o| o.reason).collect()
    }
}

pub(crate) fn formation(goals: &[Vector3<f64>]) -> Formation {
    Formation { drones: (0..goals.len()).collect(), goals: goals.to_vec(), moved: vec![] }
}
