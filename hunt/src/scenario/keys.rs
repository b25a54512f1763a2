//! Keys of a scenario's file: the one table behind `foxhunt list keys` and the documents.

/// Key of a table of a scenario's file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Key {
    /// Name of the key in the file.
    pub name: &'static str,
    /// Unit of its value; empty for names, tables and counts.
    pub unit: &'static str,
    /// Value where the key is absent, or `needed`.
    pub default: &'static str,
    /// Description of the value.
    pub meaning: &'static str,
}

/// Table of a scenario's file with its keys.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct KeyTable {
    /// Path of the table in the file; behind a space the kind that has the keys.
    pub table: &'static str,
    /// Description of the table.
    pub about: &'static str,
    /// Keys of the table, in the order of the documents.
    pub keys: &'static [Key],
}

const fn key(
    name: &'static str,
    unit: &'static str,
    default: &'static str,
    meaning: &'static str,
) -> Key {
    Key { name, unit, default, meaning }
}

/// Returns the tables of a scenario's file whose keys are listed.
#[must_use]
pub fn scenario_keys() -> &'static [KeyTable] {
    &TABLES
}

const TABLES: [KeyTable; 27] = [
    KeyTable {
        table: "world.beacons",
        about: "a beacon of the simulated world",
        keys: &[
            key("name", "", "needed", "its name"),
            key("east_m", "m", "needed", "its East"),
            key("north_m", "m", "needed", "its North"),
            key("up_m", "m", "0, on the ground", "its height"),
            key("course", "", "still", "its motion"),
            key("scatter_m", "m", "0", "σ about its place, drawn for every seed"),
            key(
                "appears_after_s",
                "s",
                "there from the beginning",
                "the time before which it does not answer",
            ),
            key("pulses", "", "answers requests", "the pulses that it sends by itself"),
            key(
                "frequency_mhz",
                "MHz",
                "the channel's, and 50 kHz more for each beacon before it",
                "its frequency, for receivers that are tuned to it",
            ),
            key("dipole", "", "none", "its magnetic field"),
            key("others", "", "none", "further transmitters on its frequency"),
        ],
    },
    KeyTable {
        table: "world.beacons.others",
        about: "a further transmitter on a beacon's frequency, which sends when the beacon does",
        keys: &[
            key("east_m", "m", "needed", "its East"),
            key("north_m", "m", "needed", "its North"),
            key("up_m", "m", "0, on the ground", "its height"),
            key("scatter_m", "m", "0", "σ about its place, drawn for every seed"),
            key("presence", "", "1", "the probability that it is there, drawn for every seed"),
        ],
    },
    KeyTable {
        table: "world.beacons.pulses",
        about: "the pulses of a beacon that sends by itself",
        keys: &[
            key("pulse_s", "s", "needed", "the duration of a pulse"),
            key("interval_s", "s", "needed", "the time from one pulse to the next"),
            key("jitter_s", "s", "0", "the greatest distance of a pulse from its raster"),
            key("phase_s", "s", "0", "the time at which the first pulse begins"),
        ],
    },
    KeyTable {
        table: "world.beacons.dipole",
        about: "the coil of a beacon with a magnetic field",
        keys: &[
            key("moment_ma_m2", "mA m²", "needed", "its strength"),
            key("azimuth_deg_ccw_from_east", "degrees", "0", "its azimuth"),
            key("elevation_deg", "degrees", "0", "its elevation above the horizon"),
        ],
    },
    KeyTable {
        table: "world.drones",
        about: "a drone of the simulated world",
        keys: &[
            key("east_m", "m", "needed", "its East at the beginning"),
            key("north_m", "m", "needed", "its North at the beginning"),
            key("up_m", "m", "0", "its height at the beginning"),
            key(
                "heading_deg_ccw_from_east",
                "degrees",
                "0, to the East",
                "the direction of its nose",
            ),
            key(
                "silent_after_s",
                "s",
                "never",
                "the time from which on its radio receives nothing",
            ),
            key("silent", "s", "none", "further times in which its radio receives nothing"),
            key("stuck", "s", "none", "times in which it hovers where it is"),
            key("lost", "s", "none", "times in which nobody has a link to it"),
            key("late_s", "s", "0", "the delay of its sweeps"),
            key("level_offset_db", "dB", "0", "what its receiver reads all levels too high"),
            key(
                "compass_offset_deg",
                "degrees",
                "0",
                "what its compass, and all of its bearings, read too far clockwise",
            ),
        ],
    },
    KeyTable {
        table: "world.channel",
        about: "the radio channel",
        keys: &[
            key(
                "path_loss",
                "",
                "−29.06 dBm, exponent 2.765 (Pritzl 2018, §7.1)",
                "the law of propagation",
            ),
            key("antenna", "", "`\"reference-patch\"`", "the antenna under every drone"),
            key(
                "frequency_mhz",
                "MHz",
                "2440",
                "the frequency of reflections and of the laws that need a wavelength",
            ),
            key("shadowing", "", "none", "fading that belongs to places"),
            key("reflectors", "", "none", "places that reflect"),
            key("scattering", "", "none", "waves that the surroundings scatter"),
            key("dead_zones", "", "none", "circles without reception"),
            key(
                "pattern_sigma_db",
                "dB",
                "4",
                "σ of the offset that all samples of a pattern share",
            ),
            key("sample_sigma_db", "dB", "2", "σ of each sample's own noise"),
            key(
                "bearing_sigma_deg",
                "degrees",
                "30",
                "σ of the angle by which a whole pattern is turned",
            ),
            key(
                "patterns_stay",
                "",
                "`false`",
                "`true`: a pattern's offset and angle belong to the place",
            ),
            key("noise_dbm", "dBm", "none", "the receiver's noise"),
            key("whole_db", "", "`false`", "`true`: readings are rounded to whole dB"),
            key("floor_dbm", "dBm", "none", "the level below which an answer is not received"),
            key("loss_probability", "", "0", "the share of answers that are lost at any power"),
        ],
    },
    KeyTable {
        table: "world.channel.scattering",
        about: "waves that the surroundings scatter, drawn for each pattern",
        keys: &[
            key("k_db", "dB", "needed", "power of the direct wave over all scattered ones, median"),
            key("k_sigma_db", "dB", "0", "σ of that over patterns"),
            key("waves", "", "6", "the number of scattered waves"),
            key("elevation_sigma_deg", "degrees", "0", "σ of the waves' elevations"),
        ],
    },
    KeyTable {
        table: "world.terrain",
        about: "terrain that hides beacons",
        keys: &[
            key(
                "hills",
                "m",
                "none",
                "the hills of a plain, each with `east_m`, `north_m`, `height_m` and `radius_m`",
            ),
            key("folder", "", "none", "the folder of tiles, in the place of `hills`"),
            key("lat_deg", "degrees", "none", "the latitude of the origin; `folder` needs it"),
            key("lon_deg", "degrees", "none", "the longitude of the origin; `folder` needs it"),
            key(
                "reach_m",
                "m",
                "with `folder`, 1000",
                "the distance from the origin to which tiles are read",
            ),
            key("frequency_mhz", "MHz", "the channel's", "the frequency of the loss"),
        ],
    },
    KeyTable {
        table: "world.vehicle",
        about: "the flight of every drone",
        keys: &[
            key("kind", "", "`\"kinematic\"`", "`\"kinematic\"` or `\"quadrotor\"`"),
            key("speed_mps", "m/s", "2", "the greatest speed over ground"),
            key("climb_mps", "m/s", "1", "the greatest speed up and down"),
            key("reports_velocity", "", "`false`", "`true`: poses have a velocity"),
        ],
    },
    KeyTable {
        table: "world.vehicle quadrotor",
        about: "the flight of a quadrotor",
        keys: &[
            key("acceleration_mps2", "m/s²", "1", "the greatest acceleration over ground"),
            key("tilt_limit_deg", "degrees", "20", "the greatest tilt"),
            key("thrust_limit", "weights", "2", "the greatest thrust"),
            key("yaw_limit_rad_s2", "rad/s²", "40", "the greatest yaw acceleration"),
            key("drag_per_s", "1/s", "0.2", "the drag over the mass"),
            key("rate_hz", "Hz", "400", "the rate of the integration steps"),
            key(
                "piloting",
                "",
                "`\"forces\"`",
                "`\"forces\"` commands thrust and torques, `\"velocities\"` climb and yaw rates",
            ),
            key(
                "dynamics",
                "",
                "`\"isaacs2014\"`",
                "`\"isaacs2014\"` moves the simplified body, `\"rigid-body\"` the full one",
            ),
            key(
                "inertia_kg_m2",
                "kg m²",
                "of `rigid-body`, `[0.0022, 0.003, 0.0048]`",
                "the moments of inertia about the forward, left and up axes",
            ),
            key("gains", "", "the autopilot's", "a table of the control gains"),
            key("wind", "", "still air, gusts of 2 s", "a table of the wind and its gusts"),
        ],
    },
    KeyTable {
        table: "world.vehicle.wind",
        about: "the wind about a quadrotor",
        keys: &[
            key("east_mps", "m/s", "0", "the mean wind to the East"),
            key("north_mps", "m/s", "0", "the mean wind to the North"),
            key("gust_sigma_mps", "m/s", "0", "σ of the gusts on each axis"),
            key("gust_time_s", "s", "2", "the time over which gusts are alike"),
        ],
    },
    KeyTable {
        table: "world.stepper",
        about: "the motor and radio of every drone",
        keys: &[
            key("rotator_speed_rad_s", "rad/s", "2", "the speed of the motor"),
            key("radio_latency_s", "s", "0.01", "the time from a question to its answer"),
        ],
    },
    KeyTable {
        table: "source stepper",
        about: "an antenna on a motor (Pritzl 2018, §4.1)",
        keys: &[
            key("positions", "", "128", "the positions of a turn"),
            key("samples_per_position", "", "6", "the answers at each position"),
            key("position_timeout", "s", "0.4", "the longest time of a position"),
            key("first_timeout", "s", "2", "the longest time of the first position of a turn"),
            key(
                "mount_offset",
                "rad",
                "0",
                "the antenna's direction at the motor's zero, counter-clockwise from the nose",
            ),
            key("floor_dbm", "dBm", "none", "the receiver's weakest reading"),
        ],
    },
    KeyTable {
        table: "source rotating-body",
        about: "an antenna that is fixed to the drone, which turns as a whole",
        keys: &[
            key(
                "rate_rad_s",
                "rad/s",
                "1.571, 90° a second",
                "the rate of turn, counter-clockwise",
            ),
            key("keeps_turning", "", "`true`", "`false`: the drone holds its nose between turns"),
            key("positions", "", "128", "the positions that samples are sorted into"),
            key("spacing_s", "s", "0", "the least time from one request to the next"),
            key("answer_timeout_s", "s", "0.05", "the longest wait for an answer"),
            key("turn_timeout_s", "s", "12", "the longest time of a turn"),
            key(
                "mount_offset_rad",
                "rad",
                "0",
                "the antenna's direction, counter-clockwise from the nose",
            ),
            key(
                "measured_at",
                "",
                "0",
                "the moment of the measurement between request (0) and answer (1)",
            ),
            key("floor_dbm", "dBm", "none", "the receiver's weakest reading"),
            key(
                "interval_s",
                "s",
                "beacons answer",
                "the time from pulse to pulse of beacons that send by themselves",
            ),
        ],
    },
    KeyTable {
        table: "source omnidirectional",
        about: "an antenna without a direction: levels, no bearings",
        keys: &[
            key("questions", "", "768", "the requests to each beacon"),
            key("spacing_s", "s", "0", "the least time from one request to the next"),
            key("answer_timeout_s", "s", "0.05", "the longest wait for an answer"),
            key(
                "measured_at",
                "",
                "0",
                "the moment of the measurement between request (0) and answer (1)",
            ),
            key("floor_dbm", "dBm", "none", "the receiver's weakest reading"),
        ],
    },
    KeyTable {
        table: "source range-difference",
        about: "a receiver that shares its clock with a reference receiver",
        keys: &[
            key("reference_m", "m", "needed", "East, North and Up of the reference receiver"),
            key("sigma_m", "m", "needed", "σ of a range difference"),
        ],
    },
    KeyTable {
        table: "source three-axis",
        about: "three coils across each other, for the magnetic field of a beacon",
        keys: &[
            key("share_sigma", "", "0.05", "σ of each axis, as a share of the field"),
            key("noise_ua_per_m", "µA/m", "0.0005", "σ of each axis besides"),
        ],
    },
    KeyTable {
        table: "turns",
        about: "turns that go on for a stated σ",
        keys: &[
            key("bearing_sigma_deg", "degrees", "needed", "σ of the bearing at which a turn ends"),
            key("longest_s", "s", "needed", "the longest time of a turn"),
        ],
    },
    KeyTable {
        table: "model",
        about: "the propagation that the estimator assumes",
        keys: &[
            key("reference_dbm", "dBm", "needed", "P₀, the power at one metre"),
            key("exponent", "", "needed", "γ, the path-loss exponent"),
            key("target_up_m", "m", "0, on the ground", "the height of the beacons"),
            key(
                "antenna",
                "",
                "the level is the same at every elevation",
                "the antenna whose vertical pattern the level follows",
            ),
            key(
                "reference_m",
                "m",
                "none",
                "East, North and Up of the reference receiver, for estimators of differences",
            ),
            key(
                "pulses",
                "",
                "the model's own",
                "the errors of single pulses, for the estimator `pulses`",
            ),
            key(
                "terrain",
                "",
                "level ground",
                "`true` for the world's terrain, or a table like it",
            ),
        ],
    },
    KeyTable {
        table: "extractor pritzl2018",
        about: "the reference's extractor of level and bearing",
        keys: &[
            key("window", "positions", "7", "the length of the moving mean"),
            key("rss_sigma_db", "dB", "7.9", "σ of the level"),
            key("width_db", "dB", "2", "the depth at which the lobe's width is σ"),
            key("min_sigma", "rad", "0.05", "the least σ of the bearing"),
            key("max_sigma", "rad", "3", "the greatest σ of the bearing"),
            key("min_positions", "positions", "16", "the fewest positions of a bearing"),
        ],
    },
    KeyTable {
        table: "hunt",
        about: "the prior, the waiting times and the rules",
        keys: &[
            key(
                "prior_sigma_m",
                "m",
                "50",
                "σ of each coordinate of a beacon before the first reception",
            ),
            key(
                "prior_centre_m",
                "m",
                "the drones' centroid",
                "East and North of the prior's centre",
            ),
            key(
                "arrival_tolerance_m",
                "m",
                "0.3",
                "the distance from its goal at which a drone has arrived",
            ),
            key("move_timeout_s", "s", "120", "the longest wait for a drone's move"),
            key(
                "turn_timeout_s",
                "s",
                "90",
                "the longest wait for a turn, for each beacon of the turn",
            ),
            key(
                "shared_turns",
                "",
                "`false`",
                "`true`: every turn measures all beacons that are not done, and the planner sees \
                 them all",
            ),
            key(
                "attempts",
                "",
                "3",
                "turns at a place without a reception before the beacon is given up, or a sweep \
                 flies on",
            ),
            key("receiver_sigma_m", "m", "the place is known", "σ of a drone's own place (GNSS)"),
            key("separation_m", "m", "2", "the least distance of two drones"),
            key(
                "stopping_m",
                "m",
                "1",
                "the distance that a drone flies on after an order to stop",
            ),
            key("airspace", "", "no fence", "the permitted area and altitudes"),
            key("void", "", "none", "the area about the beacon that drones avoid"),
            key("endurance", "", "endless batteries", "the time in the air"),
            key("return_home", "", "`false`", "`true`: the drones fly home after the last beacon"),
            key(
                "attendance",
                "",
                "its own defaults",
                "the rules by which a drone no longer takes part",
            ),
            key("stop", "", "the planner decides alone", "rules that end a search"),
        ],
    },
    KeyTable {
        table: "hunt.airspace",
        about: "the permitted area and altitudes",
        keys: &[
            key(
                "fence_m",
                "m",
                "no fence",
                "East and North of the corners of a polygon; drones stay inside",
            ),
            key(
                "keep_out",
                "m",
                "none",
                "zones that drones do not fly over: a centre and a radius, or corners",
            ),
            key("altitude_m", "m", "none", "the lowest and the highest Up"),
        ],
    },
    KeyTable {
        table: "hunt.void",
        about: "the area about the beacon that drones avoid",
        keys: &[
            key("radius_m", "m", "needed", "its radius"),
            key(
                "probability",
                "",
                "needed",
                "the greatest probability that the beacon is within the radius of a drone",
            ),
        ],
    },
    KeyTable {
        table: "hunt.endurance",
        about: "the time in the air",
        keys: &[
            key("endurance_s", "s", "900", "the longest time of a drone in the air"),
            key("reserve_s", "s", "120", "the part of that time that is left at the landing"),
            key("speed_mps", "m/s", "2", "the speed over ground that is reckoned with"),
            key("climb_mps", "m/s", "1", "the speed up and down that is reckoned with"),
        ],
    },
    KeyTable {
        table: "hunt.attendance",
        about: "the rules by which a drone no longer takes part",
        keys: &[
            key(
                "misses",
                "turns",
                "2",
                "the turns in a row without a delivery after which it is silent",
            ),
            key("lost_after_s", "s", "5", "the time without a known place after which it is lost"),
            key(
                "still_after_s",
                "s",
                "15",
                "the time under way after which it may count as standing still",
            ),
            key("still_m", "m", "0.5", "the distance below which it then does"),
            key("tried_again_after_s", "s", "60", "the time to its next chance, doubled each time"),
        ],
    },
    KeyTable {
        table: "hunt.stop",
        about: "rules that end a search",
        keys: &[
            key(
                "ellipse_95_m",
                "m",
                "none",
                "the semi-major axis of the 95 % ellipse is below this",
            ),
            key(
                "least_gain_nats_per_s",
                "nats/s",
                "none",
                "the last two formation positions each taught less than this",
            ),
            key(
                "settled_m",
                "m",
                "none",
                "a formation position moved the estimate by less than this",
            ),
            key(
                "settled_positions",
                "positions",
                "three, with `settled_m`",
                "the formation positions before `settled_m` counts",
            ),
            key("time_s", "s", "none", "the time since the search began"),
            key("path_m", "m", "none", "the distance that all drones together have flown"),
            key("positions", "positions", "none", "the formation positions that were measured"),
        ],
    },
    KeyTable {
        table: "simulation",
        about: "the run of the simulation",
        keys: &[
            key("tick_s", "s", "0.01", "the step of the simulation"),
            key("limit_s", "s", "14400, 4 hours", "its longest duration"),
        ],
    },
];
