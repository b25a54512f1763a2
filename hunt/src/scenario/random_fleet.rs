use std::f64::consts::TAU;

use foxhunt_formation::{
    Airspace, AirspaceConfig, EnduranceConfig, FollowConfig, KeepOut, StopRules, Void,
};
use foxhunt_sensors::StepperConfig;
use foxhunt_sim::{
    BeaconConfig, ChannelConfig, DroneConfig, Interval, KinematicConfig, VehicleConfig, WorldConfig,
};
use nalgebra::Vector2;
use rand::{RngExt, SeedableRng, rngs::Xoshiro256PlusPlus};

use super::{Scenario, SimulationConfig};
use crate::{
    config::{
        ExtractorConfig, LobeConfig, ModelConfig, PlaceConfig, PlannerConfig, ShapeConfig,
        SourceConfig,
    },
    hunt::HuntConfig,
    registry::Registry,
};

/// Prefix of the names of random scenarios; the seed that they are drawn with follows.
const PREFIX: &str = "fleet-";

/// Constant by which the generator of scenarios differs from the generators of their worlds.
const SCENARIOS: u64 = 0xf1ee_7000_0000_0000;

/// Drones begin so far apart beyond their separation and twice their tolerance, in metres.
const ROOM_M: f64 = 1.0;

/// Failures begin before this second: most hunts are over after some minutes.
const HORIZON_S: f64 = 200.0;

/// The planners that are drawn, in the order of their list: whatever else a registry holds, a seed
/// means one scenario.
const PLANNERS: [&str; 11] = [
    "pritzl2018",
    "pritzl2018-emulated",
    "waypoints",
    "lawn-mower",
    "orbit",
    "arcs",
    "surge-cast",
    "information",
    "steepest-descent",
    "bayesian-optimisation",
    "hold",
];

/// The planner that takes longest to decide; drawn seldom.
const SLOW: &str = "bayesian-optimisation";

/// The seed in the name of a random scenario.
pub(super) fn seed_in(name: &str) -> Option<u64> {
    let digits = name.strip_prefix(PREFIX)?;
    digits.chars().all(|c| c.is_ascii_digit()).then(|| digits.parse().ok()).flatten()
}

/// A hunt in which everything is drawn at random that may go wrong: one to eight drones, among them
/// some that get stuck, are lost, receive nothing or answer late, for a while or for good; a beacon
/// that is switched on late, a prior, a fence, zones and a void to keep out of, a separation,
/// batteries, rules to stop; a planner and its shape.
/// `fleet-` and the seed is its name, by which [`Scenario::find`] has it, too.
///
/// Turns are short and coarse (16 positions, one sample at each): who flies where is what matters.
#[must_use]
pub fn random_fleet(seed: u64) -> Scenario {
    let mut draw = Draw(Xoshiro256PlusPlus::seed_from_u64(seed ^ SCENARIOS));
    let count = draw.whole(1, 8);
    let separation_m = draw.between(1.0, 4.0);
    let tolerance_m = draw.between(0.2, 0.6);
    let places = draw.starts(count, separation_m + 2.0 * tolerance_m + ROOM_M);
    let airspace = draw.airspace(&places, tolerance_m + ROOM_M);
    let vehicle = KinematicConfig {
        speed_mps: draw.between(2.0, 6.0),
        climb_mps: draw.between(0.7, 2.0),
        reports_velocity: false,
    };
    let failing = draw.between(0.0, 0.8);
    let up_m = draw.between(3.0, 5.0);
    let drones = places.iter().map(|place| {
        let drone =
            DroneConfig { east_m: place.x, north_m: place.y, up_m, ..DroneConfig::default() };
        draw.failures(drone, failing)
    });
    let drones = drones.collect();
    let beacons = (0..draw.whole(1, 2)).map(|index| BeaconConfig {
        name: format!("beacon {}", index + 1),
        east_m: draw.between(-50.0, 50.0),
        north_m: draw.between(-50.0, 50.0),
        ..BeaconConfig::default()
    });
    let mut beacons: Vec<BeaconConfig> = beacons.collect();
    let centre = draw.chance(0.5).then(|| {
        let shift = draw.between(-20.0, 20.0);
        [beacons[0].east_m + shift, beacons[0].north_m - shift]
    });
    // One that is switched on later is the last one.
    if beacons.len() > 1
        && draw.chance(0.3)
        && let Some(last) = beacons.last_mut()
    {
        last.appears_after_s = Some(draw.between(5.0, HORIZON_S));
    }
    let void = draw
        .chance(0.25)
        .then(|| Void { radius_m: draw.between(2.0, 5.0), probability: draw.between(0.05, 0.3) });
    let endurance = draw.chance(0.6).then(|| EnduranceConfig {
        endurance_s: draw.between(150.0, 900.0),
        reserve_s: draw.between(20.0, 60.0),
        speed_mps: vehicle.speed_mps,
        climb_mps: vehicle.climb_mps,
    });
    let channel = ChannelConfig {
        loss_probability: if draw.chance(0.3) { draw.between(0.0, 0.6) } else { 0.0 },
        ..ChannelConfig::default()
    };
    let hunt = HuntConfig {
        prior_sigma_m: draw.between(15.0, 60.0),
        prior_centre_m: centre,
        arrival_tolerance_m: tolerance_m,
        move_timeout_s: draw.between(20.0, 120.0),
        turn_timeout_s: draw.between(8.0, 20.0),
        shared_turns: draw.chance(0.5),
        separation_m,
        stopping_m: 1.0,
        airspace,
        void,
        endurance,
        return_home: draw.chance(0.5),
        stop: draw.stop(),
        ..HuntConfig::default()
    };
    let mut scenario = Scenario {
        name: format!("{PREFIX}{seed}"),
        description: "a random fleet with random failures".to_owned(),
        estimator: "ekf".to_owned(),
        world: WorldConfig {
            beacons,
            drones,
            channel,
            vehicle: VehicleConfig::Kinematic(vehicle),
            ..WorldConfig::default()
        },
        model: ModelConfig {
            reference_dbm: -29.06,
            exponent: 2.765,
            target_up_m: 0.0,
            antenna: None,
            reference_m: None,
            pulses: None,
            terrain: None,
        },
        extractor: ExtractorConfig::FirstHarmonic(LobeConfig::default()),
        bearings: None,
        planner: PlannerConfig::Hold { turns: 1 },
        source: SourceConfig::Stepper(stepper()),
        sources: Vec::new(),
        turns: None,
        hunt,
        simulation: SimulationConfig { tick_s: 0.1, limit_s: 7200.0 },
    };
    scenario.planner = draw.planner(&scenario);
    scenario
}

/// 16 positions, a sample at each, in some 5 s.
fn stepper() -> StepperConfig {
    StepperConfig::pritzl2018()
        .with_positions(16)
        .and_then(|config| config.with_samples_per_position(1))
        .expect("both are positive")
}

/// Draws what a hunt is made of.
struct Draw(Xoshiro256PlusPlus);

impl Draw {
    fn between(&mut self, least: f64, most: f64) -> f64 {
        self.0.random_range(least..most)
    }

    fn whole(&mut self, least: u32, most: u32) -> u32 {
        self.0.random_range(least..=most)
    }

    fn chance(&mut self, probability: f64) -> bool {
        self.0.random::<f64>() < probability
    }

    /// Places about the origin that are at least `apart` metres from each other.
    fn starts(&mut self, count: u32, apart: f64) -> Vec<Vector2<f64>> {
        let mut places: Vec<Vector2<f64>> = Vec::new();
        let mut reach = apart;
        while places.len() < count as usize {
            let place = Vector2::new(self.between(-reach, reach), self.between(-reach, reach));
            if places.iter().all(|other| (place - other).norm() >= apart) {
                places.push(place);
            }
            // Wider each time: it ends.
            reach *= 1.1;
        }
        places
    }

    /// A fence, convex or not, that holds the places by a margin, and zones to keep out of that do
    /// not.
    fn airspace(&mut self, places: &[Vector2<f64>], margin: f64) -> AirspaceConfig {
        let reach = places.iter().map(|place| place.norm()).fold(0.0, f64::max) + margin;
        // Even a chord between two neighbouring corners leaves the places inside.
        let corners = self.whole(6, 11);
        let least = (reach + 1.0) / libm::cos(TAU / 2.0 / f64::from(corners));
        let fence_m = if self.chance(0.75) {
            let most = least + self.between(5.0, 80.0);
            (0..corners)
                .map(|corner| {
                    let angle = TAU * f64::from(corner) / f64::from(corners);
                    let radius = self.between(least, most);
                    [radius * libm::cos(angle), radius * libm::sin(angle)]
                })
                .collect()
        } else {
            Vec::new()
        };
        let keep_out = (0..self.whole(0, 3))
            .filter_map(|_| {
                let centre = Vector2::new(self.between(-60.0, 60.0), self.between(-60.0, 60.0));
                let radius = self.between(2.0, 12.0);
                let square = self.chance(0.5);
                let clear = |place: &Vector2<f64>| (place - centre).norm() > radius + margin + 2.0;
                places.iter().all(clear).then(|| keep_out(centre, radius, square))
            })
            .collect();
        let altitude_m = self.chance(0.5).then(|| [2.0, self.between(6.0, 40.0)]);
        let mut config = AirspaceConfig { fence_m, keep_out, altitude_m };
        // Zones may leave nothing, or cut the start off; then there are none.
        let usable = Airspace::new(&config).and_then(|airspace| airspace.with_margin(margin));
        if usable.is_err() {
            config.keep_out.clear();
        }
        config
    }

    fn interval(&mut self) -> Interval {
        let from_s = self.between(0.0, HORIZON_S);
        let to_s = self.chance(0.6).then(|| from_s + self.between(1.0, 120.0));
        Interval { from_s, to_s }
    }

    /// The drone, each kind of failure happening to it with this probability divided by their
    /// number.
    fn failures(&mut self, drone: DroneConfig, probability: f64) -> DroneConfig {
        let mut of = |often: f64| -> Vec<Interval> {
            let some = self.chance(probability * often);
            (0..u32::from(some) * self.whole(1, 3)).map(|_| self.interval()).collect()
        };
        let silent = of(0.25);
        let stuck = of(0.25);
        let lost = of(0.25);
        let late_s = if self.chance(0.25 * probability) { self.between(0.5, 15.0) } else { 0.0 };
        DroneConfig { silent, stuck, lost, late_s, ..drone }
    }

    fn stop(&mut self) -> StopRules {
        StopRules {
            ellipse_95_m: self.chance(0.3).then(|| self.between(2.0, 8.0)),
            least_gain_nats_per_s: self.chance(0.2).then(|| self.between(0.001, 0.02)),
            settled_m: self.chance(0.2).then(|| self.between(0.5, 3.0)),
            time_s: self.chance(0.3).then(|| self.between(60.0, 1500.0)),
            path_m: self.chance(0.2).then(|| self.between(50.0, 3000.0)),
            positions: Some(self.whole(5, 40)),
            ..StopRules::default()
        }
    }

    /// Any named planner, the slow one seldom; or a shape of any kind that follows the estimate or
    /// flies from place to place.
    fn planner(&mut self, scenario: &Scenario) -> PlannerConfig {
        if self.chance(0.5) {
            let mut names = PLANNERS.to_vec();
            names.retain(|name| *name != SLOW || self.chance(0.1));
            let name = names[self.0.random_range(0..names.len())];
            // What the library was built without has no settings but its name.
            return Registry::builtin().planner(name).map_or_else(
                |_| PlannerConfig::Registered { name: name.to_owned() },
                |planner| planner.config(&scenario.field()),
            );
        }
        let shape = self.chance(0.8).then(|| self.shape());
        if self.chance(0.3) {
            return self.waypoints(shape);
        }
        let follow = FollowConfig {
            circumradius_m: self.circumradius(shape.as_ref()),
            rotation_rad: self.between(0.0, TAU),
            search_altitude_m: self.between(2.0, 10.0),
            ..FollowConfig::default()
        };
        PlannerConfig::FollowEstimate { follow, shape }
    }

    fn waypoints(&mut self, shape: Option<ShapeConfig>) -> PlannerConfig {
        let place = |draw: &mut Self| {
            PlaceConfig::Plane([draw.between(-50.0, 50.0), draw.between(-50.0, 50.0)])
        };
        PlannerConfig::Waypoints {
            places_m: (0..self.whole(2, 8)).map(|_| place(self)).collect(),
            circumradius_m: self.circumradius(shape.as_ref()),
            shape,
            rotation_deg: self.between(0.0, 360.0),
            up_m: Some(self.between(2.0, 10.0)),
            turns_at_each: 1,
            rounds: 1,
        }
    }

    /// A polygon's circumradius; beside another shape, the one of files that give none.
    fn circumradius(&mut self, shape: Option<&ShapeConfig>) -> f64 {
        let drawn = self.between(2.0, 15.0);
        if shape.is_none() { drawn } else { FollowConfig::default().circumradius_m }
    }

    /// Any kind of shape; what is scaled is one of the others.
    fn shape(&mut self) -> ShapeConfig {
        match self.whole(0, 3) {
            0 => {
                let scale = self.between(0.5, 2.0);
                let shape = Box::new(self.plain_shape());
                ShapeConfig::Scaled { scale, shape }
            }
            _ => self.plain_shape(),
        }
    }

    fn plain_shape(&mut self) -> ShapeConfig {
        match self.whole(0, 2) {
            0 => ShapeConfig::Polygon { circumradius_m: self.between(2.0, 15.0) },
            1 => ShapeConfig::Line { spacing_m: self.between(2.0, 12.0) },
            _ => {
                let place =
                    |draw: &mut Self| [draw.between(-15.0, 15.0), draw.between(-15.0, 15.0)];
                let offsets_m = (0..self.whole(2, 5)).map(|_| place(self)).collect();
                ShapeConfig::Offsets { offsets_m }
            }
        }
    }
}

fn keep_out(centre: Vector2<f64>, radius_m: f64, square: bool) -> KeepOut {
    let [east, north] = [centre.x, centre.y];
    if !square {
        return KeepOut::Disc { centre_m: [east, north], radius_m };
    }
    // Its corners lie on the circle.
    let half = radius_m * std::f64::consts::FRAC_1_SQRT_2;
    let corners_m = vec![
        [east - half, north - half],
        [east + half, north - half],
        [east + half, north + half],
        [east - half, north + half],
    ];
    KeepOut::Polygon { corners_m }
}
