use std::mem::discriminant;

use foxhunt_formation::{
    AltitudeRule, ArcsConfig, CoverageConfig, DetectionConfig, FollowConfig, InformationConfig,
    OrbitConfig, SettlingRule, SteepestDescentConfig, SurgeCastConfig,
};
use nalgebra::Vector2;

use super::{Field, PlannerEntry, Recipe};
use crate::{
    config::{PlannerConfig, ShapeConfig},
    hunt::HuntConfig,
};

impl PlannerEntry {
    /// Returns its configuration for a field, as it stands in a file. If the field's own planner is
    /// of this kind, it is the field's own, but for `pritzl2018` and `pritzl2018-emulated`: these
    /// are always the reference's.
    #[must_use]
    pub fn config(&self, field: &Field) -> PlannerConfig {
        let Recipe::Settings(settings) = &self.recipe else {
            return PlannerConfig::Registered { name: self.name.clone().into_owned() };
        };
        let named = settings(field);
        let fixed = self.name.starts_with(REFERENCE);
        if discriminant(&named) == discriminant(&field.planner) && !fixed {
            field.planner.clone()
        } else {
            named
        }
    }
}

/// Prefix of the names of the reference's planners.
const REFERENCE: &str = "pritzl2018";

/// Number of turns in which `hold` listens.
const TURNS: u32 = 10;

/// Number of drones that `pritzl2018-emulated` emulates, the reference's.
const VIRTUAL_DRONES: u16 = 3;

/// Number of places per side of the area that is swept where the scenario has no path of its own,
/// as in the reference's sweep (Pritzl 2018, §7.4).
const PLACES_A_SIDE: f64 = 4.0;

/// Number of places per side of the area that `detection` searches.
const SEARCHED_A_SIDE: f64 = 16.0;

/// Half the width of a box that holds a Gaussian of two equal, independent coordinates with 95 %,
/// in standard deviations: the quantile of (1 + √0.95) / 2.
const BOX_95: f64 = 2.236_476_644_557_789_5;

/// Every planner that has a name.
pub(super) fn builtin() -> Vec<PlannerEntry> {
    let named = |name: &'static str,
                 about: &'static str,
                 source: &'static str,
                 config: fn(&Field) -> PlannerConfig| PlannerEntry {
        name: name.into(),
        about: about.into(),
        source: source.into(),
        recipe: Recipe::Settings(config),
    };
    vec![
        named(
            "pritzl2018",
            "a polygon, with three drones a triangle, that follows the estimate until it has \
             settled",
            "Pritzl 2018, §5.2",
            |_| pritzl2018(),
        ),
        named(
            "pritzl2018-emulated",
            "the same, where there are fewer than three drones flown for three, one place after \
             the other",
            "Pritzl 2018, §7.2",
            |_| PlannerConfig::Emulated {
                virtual_drones: VIRTUAL_DRONES,
                planner: Box::new(pritzl2018()),
            },
        ),
        named(
            "waypoints",
            "the scenario's own path, or else the lawn-mower's",
            "Pritzl 2018, §7.3 and §7.4",
            waypoints,
        ),
        named(
            "lawn-mower",
            "a sweep in rows, back and forth, of the area where the beacon is believed to be",
            "Pritzl 2018, §7.4; Choset & Pignon 1998",
            lawn_mower,
        ),
        named(
            "detection",
            "where a beacon that was missed would be received soonest, then as information",
            "Koopman 1980; Stone 1975",
            detection,
        ),
        named(
            "orbit",
            "a circle about the estimate, drones spread evenly, and one round once it has settled",
            "Pritzl 2018, §5.2, in steps about one centre",
            orbit,
        ),
        named(
            "arcs",
            "a spiral towards the estimate, so that bearings differ on the way in, then a circle",
            "Pritzl 2018, ch. 8, a logarithmic spiral",
            arcs,
        ),
        named(
            "surge-cast",
            "along the bearings while the level rises, across them when it falls, then a circle",
            "Kennedy & Marsh 1974; Balkovsky & Shraiman 2002",
            surge_cast,
        ),
        named(
            "information",
            "where the ellipse of what is believed is expected to become small soonest",
            "Chaloner & Verdinelli 1995; Kolchinsky & Tracey 2017",
            |field| PlannerConfig::Information { information: information(field) },
        ),
        named(
            "steepest-descent",
            "each drone down the gradient of the posterior bound, one turn ahead",
            "Uciński 2004; Martínez & Bullo 2006",
            steepest_descent,
        ),
        #[cfg(feature = "maps")]
        named(
            "bayesian-optimisation",
            "to where the level is expected to improve most, by a Gaussian process of levels",
            "Močkus 1975; Jones, Schonlau & Welch 1998",
            |_| PlannerConfig::BayesianOptimisation(Default::default()),
        ),
        named("hold", "everyone stays and listens", "Isaacs et al. 2014, §V", |_| {
            PlannerConfig::Hold { turns: TURNS }
        }),
    ]
}

fn pritzl2018() -> PlannerConfig {
    PlannerConfig::FollowEstimate { follow: FollowConfig::pritzl2018(), shape: None }
}

fn steepest_descent(field: &Field) -> PlannerConfig {
    let exponent = field.exponent;
    PlannerConfig::SteepestDescent(SteepestDescentConfig { exponent, ..Default::default() })
}

/// With the exponent that the estimator takes, the vehicles' speed, the time that the slowest turn
/// takes and what is believed before the first reception.
///
/// A turn is not taken for shorter than the planner's own 45 s: with the simulated stepper's 11 s,
/// it stops more often on the way, and its 95 % ellipse is below 3 m later (from the far start
/// after 365 s and not 313 s, medians of 200 hunts).
fn information(field: &Field) -> InformationConfig {
    let default = InformationConfig::default();
    // What the traffic keeps between two goals: the separation, and twice its tolerance, which is
    // twice what a drone may be from its goal.
    let kept_m = field.hunt.separation_m + 4.0 * field.hunt.arrival_tolerance_m;
    InformationConfig {
        exponent: field.exponent,
        speed_mps: field.speed_mps.unwrap_or(default.speed_mps),
        climb_mps: field.climb_mps.unwrap_or(default.climb_mps),
        turn_s: field.turn_s.map_or(default.turn_s, |turn_s| turn_s.max(default.turn_s)),
        separation_m: default.separation_m.max(kept_m),
        prior_sigma_m: field.hunt.prior_sigma_m,
        prior_centre_m: field.hunt.prior_centre_m,
        ..default
    }
}

/// A path of the scenario's own is of another kind than the lawn-mower's that stands in for it.
fn waypoints(field: &Field) -> PlannerConfig {
    match &field.planner {
        own @ (PlannerConfig::Waypoints { .. } | PlannerConfig::LawnMower { .. }) => own.clone(),
        _ => lawn_mower(field),
    }
}

/// Returns the corners of the fence, or else of a box that holds the beacon with 95 %, and the side
/// of a square as large.
fn searched_area(field: &Field) -> (Vec<[f64; 2]>, f64) {
    let fence = &field.hunt.airspace.fence_m;
    if !fence.is_empty() {
        return (fence.clone(), area_m2(fence).sqrt());
    }
    let half = BOX_95 * field.hunt.prior_sigma_m;
    let centre = prior_centre(field);
    let corner = |east: f64, north: f64| [centre.x + east * half, centre.y + north * half];
    let square = [corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)];
    (square.to_vec(), 2.0 * half)
}

/// Returns a search of the area, and the information planner for what was received.
fn detection(field: &Field) -> PlannerConfig {
    let information = information(field);
    let (corners_m, side_m) = searched_area(field);
    let detection = DetectionConfig {
        spacing_m: side_m / SEARCHED_A_SIDE,
        exponent: field.exponent,
        up_m: altitude(field).most_m,
        speed_mps: information.speed_mps,
        turn_s: information.turn_s,
        separation_m: information.separation_m,
        ..DetectionConfig::default()
    };
    // It begins after the first reception.
    let information = InformationConfig { prior_sigma_m: 0.0, prior_centre_m: None, ..information };
    let then = Box::new(PlannerConfig::Information { information });
    PlannerConfig::Detection { corners_m, detection, then }
}

/// Returns a lawn mower over the area.
fn lawn_mower(field: &Field) -> PlannerConfig {
    let (corners_m, side_m) = searched_area(field);
    let spacing = side_m / PLACES_A_SIDE;
    let inside = !field.hunt.airspace.fence_m.is_empty();
    let circumradius_m = FollowConfig::pritzl2018().circumradius_m.min(0.25 * spacing);
    // Each place is the middle of its share of the box; inside a fence, the drones are.
    let margin_m = if inside { circumradius_m } else { 0.5 * spacing };
    PlannerConfig::LawnMower {
        corners_m,
        coverage: CoverageConfig {
            row_spacing_m: spacing,
            along_spacing_m: spacing,
            margin_m,
            direction_rad: None,
        },
        shape: Some(ShapeConfig::Polygon { circumradius_m }),
        up_m: altitude(field).most_m,
        rounds: 1,
    }
}

/// The area of a simple polygon in square metres (the shoelace formula).
fn area_m2(corners: &[[f64; 2]]) -> f64 {
    let next = corners.iter().cycle().skip(1);
    let doubled = corners.iter().zip(next).map(|([e, n], [to_e, to_n])| e * to_n - to_e * n);
    0.5 * doubled.sum::<f64>().abs()
}

fn orbit(field: &Field) -> PlannerConfig {
    let config = OrbitConfig::default();
    PlannerConfig::Orbit(OrbitConfig {
        radius_m: in_area(config.radius_m, field),
        altitude: altitude(field),
        settling: settling(field),
        ..config
    })
}

fn arcs(field: &Field) -> PlannerConfig {
    let config = ArcsConfig::default();
    PlannerConfig::Arcs(ArcsConfig {
        spacing_m: in_area(config.spacing_m, field),
        standoff_m: in_area(config.standoff_m, field),
        altitude: altitude(field),
        settling: settling(field),
        ..config
    })
}

fn surge_cast(field: &Field) -> PlannerConfig {
    let config = SurgeCastConfig::default();
    // Its legs are for a prior as wide as the hunt's default.
    let wider = field.hunt.prior_sigma_m / HuntConfig::default().prior_sigma_m;
    PlannerConfig::SurgeCast(SurgeCastConfig {
        surge_m: config.surge_m * wider,
        cast_m: config.cast_m * wider,
        circumradius_m: in_area(config.circumradius_m, field),
        standoff_m: in_area(config.standoff_m, field),
        altitude: altitude(field),
        settling: settling(field),
        ..config
    })
}

/// A length, or the prior's σ where that is shorter: a room is not circled from outside.
fn in_area(length_m: f64, field: &Field) -> f64 {
    length_m.min(field.hunt.prior_sigma_m)
}

/// In a room, an estimate settles within less.
fn settling(field: &Field) -> SettlingRule {
    let rule = SettlingRule::default();
    SettlingRule { settled_m: rule.settled_m.min(0.1 * field.hunt.prior_sigma_m), ..rule }
}

/// Drones that begin in the air go no higher than the highest of them, and nobody leaves the
/// altitudes that the hunt permits.
fn altitude(field: &Field) -> AltitudeRule {
    let mut rule = AltitudeRule::default();
    let highest = field.drones_m.iter().map(|drone| drone.z).fold(0.0, f64::max);
    if highest > 0.0 {
        (rule.least_m, rule.most_m) = (rule.least_m.min(highest), highest);
    }
    if let Some([low, high]) = field.hunt.airspace.altitude_m {
        let within = |up: f64| up.min(high).max(low);
        (rule.least_m, rule.most_m) = (within(rule.least_m), within(rule.most_m));
    }
    rule
}

/// The centre of the hunt's prior of a beacon, before any reception.
fn prior_centre(field: &Field) -> Vector2<f64> {
    let count = u32::try_from(field.drones_m.len()).unwrap_or(u32::MAX).max(1);
    let sum: Vector2<f64> = field.drones_m.iter().map(|drone| drone.xy()).sum();
    field.hunt.prior_centre_m.map_or(sum / f64::from(count), Vector2::from)
}
