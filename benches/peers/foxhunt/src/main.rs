//! foxhunt, the same by hand, and the problems that all peers read: `peer-foxhunt write FOLDER`.

use std::{env, fmt::Write as _, fs, hint::black_box, path::Path};

use common::{Beacon, Bearing, Bearings, Call, Cloud, Kalman, Measured};
use foxhunt_core::{Estimate, Estimator, Observation};
use foxhunt_filters::Resampling;

#[path = "../../../../benches/beacon/mod.rs"]
mod beacon;
#[path = "../../../../benches/bearings/mod.rs"]
mod bearings;

/// Writes the problems.
fn write(folder: &Path) {
    let mut text = format!(
        "{} {} {} {} {} {} {}\n",
        beacon::prior().covariance[(0, 0)],
        beacon::DRIFT,
        beacon::REFERENCE_DBM,
        beacon::EXPONENT,
        beacon::SIGMAS[0],
        beacon::SIGMAS[1],
        beacon::ALPHA
    );
    for observation in beacon::sweep() {
        let place = observation.receiver().position;
        let z = observation.value();
        let _ = writeln!(text, "{} {} {} {} {}", place.x, place.y, place.z, z.x, z.y);
    }
    fs::write(folder.join("beacon"), text).expect("the folder can be written to");

    let mut text = String::new();
    for number in bearings::PRIOR.iter().chain(&bearings::SPREAD) {
        let _ = write!(text, "{number} ");
    }
    let _ = writeln!(
        text,
        "{} {} {} {}",
        bearings::NOISE,
        bearings::BIAS,
        bearings::SIGMA,
        bearings::SHARE
    );
    for observation in bearings::observations() {
        let place = observation.receiver().position;
        let z = observation.value();
        let _ = writeln!(text, "{} {} {}", place.x, place.y, z.x);
    }
    fs::write(folder.join("bearings"), text).expect("the folder can be written to");
}

fn belief(estimate: &Estimate<2>) -> ([f64; 2], [f64; 4]) {
    let p = estimate.covariance;
    (estimate.mean.into(), [p.m11, p.m12, p.m21, p.m22])
}

/// Observations in their order, again and again.
struct Sequence<const M: usize> {
    observations: Vec<Observation<M>>,
    next: usize,
}

impl<const M: usize> Sequence<M> {
    fn new(observations: Vec<Observation<M>>) -> Self {
        Self { observations, next: 0 }
    }
    fn next(&mut self) -> &Observation<M> {
        let observation = &self.observations[self.next];
        self.next = (self.next + 1) % self.observations.len();
        observation
    }
}

struct Filter<E> {
    filter: E,
    sweep: Sequence<2>,
}

impl<E: Estimator<2, 2>> Kalman for Filter<E> {
    fn step(&mut self, _: &Beacon, _: &Measured) {
        self.filter.predict(1.0).expect("a proper step");
        let _ = black_box(self.filter.update(self.sweep.next()).expect("possible"));
    }
    fn belief(&self) -> ([f64; 2], [f64; 4]) {
        belief(&self.filter.estimate())
    }
}

type HandStep = fn(&Estimate<2>, &Observation<2>) -> Option<Estimate<2>>;

struct Hand {
    belief: Estimate<2>,
    step: HandStep,
    sweep: Sequence<2>,
}

impl Kalman for Hand {
    fn step(&mut self, _: &Beacon, _: &Measured) {
        self.belief = (self.step)(&self.belief, self.sweep.next()).expect("positive definite");
    }
    fn belief(&self) -> ([f64; 2], [f64; 4]) {
        belief(&self.belief)
    }
}

struct Particles {
    step: bearings::Step,
    sequence: Sequence<1>,
}

impl Cloud for Particles {
    fn step(&mut self, _: &Bearings, _: &Bearing) -> [f64; 4] {
        let believed = (self.step)(self.sequence.next());
        black_box(believed.covariance);
        believed.mean.into()
    }
}

fn main() {
    if let [_, verb, folder] = env::args().collect::<Vec<_>>().as_slice()
        && verb == "write"
    {
        return write(Path::new(folder));
    }
    let call = Call::read();
    let sweep = || Sequence::new(beacon::sweep());
    let hand = |step: HandStep| {
        call.kalman(|_| Hand { belief: beacon::prior(), step, sweep: sweep() });
    };
    let cloud = |what: &str, scheme| {
        call.cloud(|_, particles, seed| Particles {
            step: bearings::of(what, scheme, particles, seed),
            sequence: Sequence::new(bearings::observations()),
        });
    };
    match call.problem.as_str() {
        "ukf" => call.kalman(|_| Filter { filter: beacon::ukf(), sweep: sweep() }),
        "ekf" => call.kalman(|_| Filter { filter: beacon::ekf(), sweep: sweep() }),
        "hand-ukf" => hand(beacon::hand_ukf),
        "hand-ekf" => hand(beacon::hand_ekf),
        "multinomial" => cloud("columns", Resampling::Multinomial),
        "systematic" => cloud("columns", Resampling::Systematic),
        "states-multinomial" => cloud("states", Resampling::Multinomial),
        "states-systematic" => cloud("states", Resampling::Systematic),
        "hand-multinomial" => cloud("loop", Resampling::Multinomial),
        "hand-systematic" => cloud("loop", Resampling::Systematic),
        _ => call.refuse(),
    }
}
