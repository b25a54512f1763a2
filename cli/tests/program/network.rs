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
        let shadows: Vec<f64> = self.stations.iter().map(|_| draws.normal(TOWER_SIGMA_DB)).collect();
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
        let places = f64::from(draws.count(2, 20)) * f64::from(u32::try_from(self.stations.len()).unwrap_or(1));
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
pub(crate) fn write(folder: &Path, seed: u64, fixes: u32) -> [String; 2] {
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

    fn median_m(errors_m: &[f64]) -> f64 {
        let mut sorted = errors_m.to_vec();
        sorted.sort_by(f64::total_cmp);
        sorted.get(sorted.len() / 2).copied().unwrap_or(f64::INFINITY)
    }
}

/// Calibrates each of these networks by its walk and judges it on its other tags.
fn judged(folder: &Path, seeds: std::ops::Range<u64>, fixes: u32) -> Judged {
    let mut all = Judged::default();
    for seed in seeds {
        let [walk, others] = write(folder, seed, fixes);
        let file = folder.join(format!("calibration{seed}.toml"));
        let file = file.to_str().expect("the target folder is UTF-8");
        let calibrated = foxhunt(["calibrate", &walk, "--beacon", "tag", "--out", file]);
        assert_eq!(calibrated.code, 0, "{calibrated:?}");
        let command = ["judge", "--json", &others, "--calibration", file, "--against", "strongest"];
        all.add(&foxhunt(command).json());
    }
    all
}
