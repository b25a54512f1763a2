//! Networks of stations with fixed antennas, drawn from seeds: calibrated together, then judged on
//! other transmitters by the program's own chain.

use std::{f64::consts::TAU, fmt::Write as _, fs, path::Path};

use rand::{RngExt, SeedableRng, rngs::Xoshiro256PlusPlus};
use serde_json::Value;

use crate::support::{folder, foxhunt};

const HEADER: &str = "drone,beacon,turn,time_s,east_m,north_m,boresight_deg_compass,rss_dbm,\
                      truth_east_m,truth_north_m\n";

/// Level at which a receiver receives half the bursts, in dBm, and the share of bursts that it
/// loses above it.
const FLOOR_DBM: f64 = -108.0;
const LOST: f64 = 0.03;

/// σ of a burst's power and of the shadowing between one place and one station, in dB.
const BURST_SIGMA_DB: f64 = 3.0;
const TOWER_SIGMA_DB: f64 = 4.0;

struct Draws(Xoshiro256PlusPlus);

impl Draws {
    fn between(&mut self, least: f64, most: f64) -> f64 {
        least + (most - least) * self.0.random::<f64>()
    }

    fn count(&mut self, least: u32, most: u32) -> u32 {
        self.0.random_range(least..=most)
    }

    /// Draws from a normal distribution about zero (Box & Muller 1958).
    fn normal(&mut self, sigma: f64) -> f64 {
        let radius = (-2.0 * (1.0 - self.0.random::<f64>()).ln()).sqrt();
        sigma * radius * (TAU * self.0.random::<f64>()).cos()
    }
}

/// A station: its place, and the true boresight, the recorded one in whole degrees and the gain of
/// each Yagi. An omnidirectional antenna has no boresight.
struct Station {
    at: [f64; 2],
    antennas: Vec<(Option<(f64, f64)>, f64)>,
}

/// A network, its law of propagation and the multipath that each reading meets.
struct Network {
    stations: Vec<Station>,
    side_m: f64,
    p0_dbm: f64,
    exponent: f64,
    multipath_db: f64,
    beamwidth_deg: f64,
    front_to_back_db: f64,
}

impl Network {
    fn draw(draws: &mut Draws) -> Self {
        let count = draws.count(4, 30);
        let side_m = 1000.0 * f64::from(count).sqrt();
        let exponent = draws.between(2.5, 3.5);
        let station = |draws: &mut Draws| {
            let at = [draws.between(0.0, side_m), draws.between(0.0, side_m)];
            if draws.between(0.0, 1.0) < 0.12 {
                return Station { at, antennas: vec![(None, draws.normal(3.0))] };
            }
            let yagis = draws.count(3, 6);
            let first = draws.between(0.0, 360.0);
            let antenna = |k: u32| {
                let boresight = first + 360.0 * f64::from(k) / f64::from(yagis);
                let recorded = (boresight + draws.normal(10.0)).round().rem_euclid(360.0);
                (Some((boresight, recorded)), draws.normal(3.0))
            };
            Station { at, antennas: (0..yagis).map(antenna).collect() }
        };
        Self {
            stations: (0..count).map(|_| station(draws)).collect(),
            side_m,
            // 2 to 14 dB above the floor at a kilometre.
            p0_dbm: FLOOR_DBM + draws.between(2.0, 14.0) + 30.0 * exponent,
            exponent,
            multipath_db: draws.between(4.0, 8.0),
            beamwidth_deg: draws.between(45.0, 70.0),
            front_to_back_db: draws.between(12.0, 20.0),
        }
    }

    fn place(&self, draws: &mut Draws) -> [f64; 2] {
        [0, 1].map(|_| draws.between(0.05, 0.95) * self.side_m)
    }

    /// Writes `bursts` bursts of a transmitter at one place; returns the number of rows.
    fn transmit(
        &self,
        draws: &mut Draws,
        text: &mut String,
        beacon: &str,
        place: [f64; 2],
        bursts: std::ops::Range<u32>,
    ) -> usize {
        let mut rows = 0;
        let shadows: Vec<f64> =
            self.stations.iter().map(|_| draws.normal(TOWER_SIGMA_DB)).collect();
        for burst in bursts {
            let power = self.p0_dbm + draws.normal(BURST_SIGMA_DB);
            for ((number, station), shadow) in self.stations.iter().enumerate().zip(&shadows) {
                let way = [place[0] - station.at[0], place[1] - station.at[1]];
                let range_m = way[0].hypot(way[1]).max(10.0);
                let level = power - 10.0 * self.exponent * range_m.log10() + shadow;
                let towards = way[0].atan2(way[1]).to_degrees();
                for (boresights, gain) in &station.antennas {
                    let lobe = boresights.map_or(-8.0, |(boresight, _)| {
                        let off = (towards - boresight + 180.0).rem_euclid(360.0) - 180.0;
                        // Of the shape that 3GPP TR 36.814 gives sectors.
                        -(12.0 * (off / self.beamwidth_deg).powi(2)).min(self.front_to_back_db)
                    });
                    let dbm = level + lobe + gain + draws.normal(self.multipath_db);
                    if dbm < FLOOR_DBM + draws.normal(1.0) || draws.between(0.0, 1.0) < LOST {
                        continue;
                    }
                    rows += 1;
                    let [east, north] = station.at;
                    let recorded = boresights.map_or_else(String::new, |(_, r)| r.to_string());
                    let [truth_east, truth_north] = place;
                    writeln!(
                        text,
                        "tower{number},{beacon},{burst},{},{east:.1},{north:.1},{recorded},{},\
                         {truth_east:.1},{truth_north:.1}",
                        30 * burst,
                        dbm.round()
                    )
                    .expect("a text takes it all");
                }
            }
        }
        rows
    }

    /// Writes the calibration's walk of a tag to known places, and fixes of other tags.
    fn record(&self, draws: &mut Draws, fixes: u32) -> [String; 2] {
        let [mut walk, mut others] = [HEADER.to_owned(), HEADER.to_owned()];
        // 2 to 20 places for each station's area, with two bursts each.
        let places = f64::from(draws.count(2, 20))
            * f64::from(u32::try_from(self.stations.len()).unwrap_or(1));
        let mut burst = 0;
        while f64::from(burst) < 2.0 * places {
            let place = self.place(draws);
            self.transmit(draws, &mut walk, "tag", place, burst..burst + 2);
            burst += 2;
        }
        let mut fix = 0;
        while fix < fixes {
            let place = self.place(draws);
            let bursts = [1, 1, 2, 4, 8][usize::try_from(draws.count(0, 4)).unwrap_or(0)];
            let first = 10_000 + 100 * fix;
            let name = format!("tag{fix}");
            if self.transmit(draws, &mut others, &name, place, first..first + bursts) > 0 {
                fix += 1;
            }
        }
        [walk, others]
    }
}

/// Draws a network and writes both recordings; returns their names.
fn write(folder: &Path, seed: u64, fixes: u32) -> [String; 2] {
    let mut draws = Draws(Xoshiro256PlusPlus::seed_from_u64(seed));
    let network = Network::draw(&mut draws);
    let texts = network.record(&mut draws, fixes);
    [("walk", &texts[0]), ("others", &texts[1])].map(|(name, text)| {
        let file = folder.join(format!("{name}{seed}.csv"));
        fs::write(&file, text).expect("the folder can be written to");
        file.to_str().expect("the target folder is UTF-8").to_owned()
    })
}

/// Errors of all fixes of some networks, by the chosen estimator and by the strongest station.
#[derive(Debug, Default)]
struct Judged {
    fixes: usize,
    answered: usize,
    held: usize,
    nees: f64,
    errors_m: Vec<f64>,
    strongest_m: Vec<f64>,
}

impl Judged {
    fn add(&mut self, report: &Value) {
        for fix in report["fixes"].as_array().expect("a list") {
            self.fixes += 1;
            let answer = &fix["answers"][0];
            if let Some(error_m) = answer["error_m"].as_f64() {
                self.answered += 1;
                self.errors_m.push(error_m);
                self.nees += answer["nees"].as_f64().unwrap_or(f64::INFINITY);
                self.held += usize::from(answer["inside_95"] == true);
            }
            self.strongest_m.extend(fix["answers"][1]["error_m"].as_f64());
        }
    }

    /// Median errors of the chosen estimator and of the strongest station.
    fn medians_m(&self) -> [f64; 2] {
        [&self.errors_m, &self.strongest_m].map(|errors_m| {
            let mut sorted = errors_m.clone();
            sorted.sort_by(f64::total_cmp);
            sorted.get(sorted.len() / 2).copied().unwrap_or(f64::INFINITY)
        })
    }

    fn mean_nees(&self) -> f64 {
        self.nees / count(self.answered)
    }
}

fn count(of: usize) -> f64 {
    f64::from(u32::try_from(of).expect("few"))
}

/// The command that judges a recording beside the strongest station.
fn judging<'a>(others: &'a str, file: &'a str) -> [&'a str; 7] {
    ["judge", "--json", others, "--calibration", file, "--against", "strongest"]
}

/// Calibrates each of these networks by its walk and judges it on its other tags.
fn judged(folder: &Path, seeds: &[u64], fixes: u32) -> Judged {
    let mut all = Judged::default();
    for &seed in seeds {
        let [walk, others] = write(folder, seed, fixes);
        let file = folder.join(format!("calibration{seed}.toml"));
        let file = file.to_str().expect("the target folder is UTF-8");
        let calibrated = foxhunt(["calibrate", &walk, "--beacon", "tag", "--out", file]);
        assert_eq!(calibrated.code, 0, "{calibrated:?}");
        all.add(&foxhunt(judging(&others, file)).json());
    }
    all
}

/// Two networks of few stations, seeds 3 and 7, with few bursts for the calibration. The first
/// holds a station with an omnidirectional antenna, which keeps no other one from its bearings. Of
/// 12 fixes all are answered, and at least nine 95 % ellipses hold (fewer have a probability of
/// 0.2 %).
#[test]
fn a_network_calibrates_together_and_locates() {
    let folder = folder("network");
    let both = judged(&folder, &[3, 7], 6);
    assert_eq!((both.fixes, both.answered), (12, 12), "{both:?}");
    assert!(both.held >= 9, "{both:?}");
    let [own_m, strongest_m] = both.medians_m();
    assert!(own_m < strongest_m, "{both:?}");

    // Stations without a section of their own are those of the model.
    let file = folder.join("calibration3.toml");
    let text = fs::read_to_string(&file).expect("it was written");
    let (model, _) = text.split_once("[[station]]").expect("stations");
    assert!(model.contains("[station_model]"), "{model}");
    fs::write(&file, model).expect("the folder can be written to");
    let others = folder.join("others3.csv");
    let [file, others] =
        [&file, &others].map(|path| path.to_str().expect("the target folder is UTF-8").to_owned());
    let turns = foxhunt(["bearing", "--json", &others, "--calibration", &file]).json();
    let turns = turns["turns"].as_array().expect("a list").clone();
    let with_bearing = turns.iter().filter(|turn| turn["bearing_deg_compass"].is_number());
    assert!(2 * with_bearing.count() > turns.len(), "{turns:?}");
    let mut unseen = Judged::default();
    unseen.add(&foxhunt(judging(&others, &file)).json());
    assert_eq!((unseen.fixes, unseen.answered), (6, 6), "{unseen:?}");
    assert!(unseen.held >= 4, "{unseen:?}");
}

/// 12 networks of 4 to 30 stations, seeds 1 to 12, 120 fixes. Of the ellipses 95 % hold, with
/// 4 · √(0.95 · 0.05/120) = 8.0 % to either side.
#[test]
#[ignore = "campaign: ten minutes"]
fn networks_are_located_honestly() {
    let seeds: Vec<u64> = (1..=12).collect();
    let all = judged(&folder("networks"), &seeds, 10);
    let [own_m, strongest_m] = all.medians_m();
    let nees = all.mean_nees();
    let held = all.held;
    println!("{} of {} answered, {held} hold, NEES {nees:.2}", all.answered, all.fixes);
    println!("median {own_m:.0} m; strongest station {strongest_m:.0} m");
    assert_eq!((all.fixes, all.answered), (120, 120), "{all:?}");
    assert!(own_m < 0.6 * strongest_m, "{own_m} {strongest_m}");
    assert!((0.87..=1.0).contains(&(count(held) / 120.0)), "{held}");
    assert!(nees < 3.0, "{nees}");
}
