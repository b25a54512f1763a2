use foxhunt_core::Receptions;
use nalgebra::Vector2;
use serde::Serialize;

use super::{
    Area, LocateConfig, Power, loss_db,
    searched::{Silent, detected, silences},
};

/// Prior probability that a transmitter is in the area.
const PRIOR: f64 = 0.5;

/// Probability of absence from which on a transmitter counts as absent.
const CONFIDENCE: f64 = 0.95;

/// Cells along each side of the area.
const SIDE: u8 = 48;

/// Range of reference powers in dBm, from far below to far above any transmitter.
const POWERS_DBM: [f64; 2] = [-200.0, 200.0];

/// Number of halvings of the range: the power is then known to 10⁻⁴ dB.
const HALVINGS: u8 = 22;

/// Exponents and their weights where the exponent is not known: 2.3 ± 0.5 by three nodes of Gauss
/// and Hermite.
const EXPONENTS: [(f64, f64); 3] = [
    (2.3 - 0.5 * 1.732_050_807_568_877_2, 1.0 / 6.0),
    (2.3, 2.0 / 3.0),
    (2.3 + 0.5 * 1.732_050_807_568_877_2, 1.0 / 6.0),
];

/// Statement of a silent search: no transmitter is in the area, unless it is weak.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Absence {
    /// Probability that no transmitter of [`weakest_dbm`](Self::weakest_dbm) is in the area, given
    /// the silence; a stronger one is less probable still.
    pub confidence: f64,
    /// Prior probability of a transmitter in the area.
    pub prior: f64,
    /// Power at one metre, in dBm, from which on a transmitter is absent with the confidence.
    pub weakest_dbm: f64,
    /// Probability that a transmitter of the stated power is in the area all the same, where the
    /// power was stated.
    pub existence: Option<f64>,
    /// Number of silences.
    pub silences: usize,
    /// Number of squares of 25 m with silences, each of which counts once.
    pub places: usize,
    /// Centre of the area, East and North in metres.
    pub centre: Vector2<f64>,
    /// Side of the area in metres.
    pub side_m: f64,
}

impl Absence {
    /// The statement of silences: `None` if nothing was silent, or something was received.
    ///
    /// A transmitter is in the square about the receivers, with [`LocateConfig::margin_m`] about
    /// it, with the prior probability 0.5, and equally likely to be anywhere in it. The power of
    /// the statement is the one at which its probability, given that every receiver stayed below
    /// its floor, is 5 %: that of a Bernoulli filter after silence
    /// (`filters::multi::BernoulliFilter`). Of silences within a square of 25 m the one with the
    /// lowest floor counts, because shadowing is common to them.
    #[must_use]
    pub fn of(receptions: &Receptions, config: &LocateConfig) -> Option<Self> {
        let (places, silences) = silences(receptions)?;
        let area = Area::about(receptions, config.margin_m);
        let silent = Silence::new(&area, config, places);
        let [mut low, mut high] = POWERS_DBM;
        for _ in 0..HALVINGS {
            let middle = 0.5 * (low + high);
            if silent.existence(middle) > 1.0 - CONFIDENCE {
                low = middle;
            } else {
                high = middle;
            }
        }
        let stated = config.power.law().map(|(reference_dbm, _)| reference_dbm);
        let (centre, half_side) = area.square();
        Some(Self {
            confidence: CONFIDENCE,
            prior: PRIOR,
            weakest_dbm: high,
            existence: stated.map(|power_dbm| silent.existence(power_dbm)),
            silences,
            places: silent.places.len(),
            centre,
            side_m: 2.0 * half_side,
        })
    }
}

/// Silent receivers, and the losses to them from each cell of the area.
struct Silence {
    places: Vec<Silent>,
    /// Losses in dB to each receiver, from each cell and for each exponent, with the weight of
    /// both.
    losses: Vec<(Vec<f64>, f64)>,
}

impl Silence {
    fn new(area: &Area, config: &LocateConfig, places: Vec<Silent>) -> Self {
        let exponents = match config.power {
            Power::Free => EXPONENTS.to_vec(),
            known => vec![(known.exponent(), 1.0)],
        };
        let share = 1.0 / (f64::from(SIDE) * f64::from(SIDE));
        let mut losses = Vec::new();
        for cell in area.lattice(SIDE) {
            let at = cell.push(config.target_up_m);
            losses.extend(exponents.iter().map(|(exponent, weight)| {
                let to = |silent: &Silent| exponent * loss_db(&(at - silent.place));
                (places.iter().map(to).collect(), weight * share)
            }));
        }
        Self { places, losses }
    }

    /// Probability that every receiver stays below its floor, for a transmitter of this power at
    /// one metre somewhere in the area.
    fn silence(&self, power_dbm: f64) -> f64 {
        let silent = |(losses, weight): &(Vec<f64>, f64)| {
            weight * (1.0 - detected(&self.places, losses, power_dbm))
        };
        self.losses.iter().map(silent).sum()
    }

    /// Probability that a transmitter of this power is in the area, given the silence.
    fn existence(&self, power_dbm: f64) -> f64 {
        let present = PRIOR * self.silence(power_dbm);
        present / (present + 1.0 - PRIOR)
    }
}

#[cfg(test)]
mod tests {
    use approx::assert_abs_diff_eq;
    use foxhunt_core::{Level, Pose, Reception};
    use rand::{RngExt, SeedableRng, rngs::Xoshiro256PlusPlus};
    use rand_distr::StandardNormal;

    use super::*;

    const FLOOR_DBM: f64 = -110.0;
    const SIGMA_DB: f64 = 6.0;

    fn silence(east: f64, north: f64) -> Reception {
        Reception {
            receiver: Pose::at(east, north, 2.0),
            silence: Some(Level { rss_dbm: FLOOR_DBM, sigma_db: SIGMA_DB }),
            ..Reception::default()
        }
    }

    /// A walk along the middle of the area.
    fn walk() -> Receptions {
        (0..12_u8).map(|step| silence(60.0 * f64::from(step), 0.0)).collect()
    }

    fn config(reference_dbm: f64) -> LocateConfig {
        LocateConfig {
            power: Power::Known { reference_dbm, exponent: 3.0 },
            margin_m: 150.0,
            ..LocateConfig::default()
        }
    }

    /// Searches, seeds from 1, until 100 were silent: each area has a transmitter with the
    /// probability 0.5, at the power of the statement or up to 20 dB above it, anywhere; each level
    /// has an error of its own. The statement is wrong if a transmitter is there. At the very power
    /// of the statement 5 of 100 are wrong on average, at higher ones fewer.
    #[test]
    fn a_silent_search_is_right_in_95_of_100() {
        let stated = Absence::of(&walk(), &config(-30.0)).expect("silent");
        let mut silent = 0;
        let mut right = 0;
        let mut heard = 0;
        for seed in 1.. {
            let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
            let power_dbm = stated.weakest_dbm + 20.0 * rng.random::<f64>();
            let is_there = rng.random::<f64>() < 0.5;
            let mut coordinate = || (rng.random::<f64>() - 0.5) * stated.side_m;
            let place = stated.centre + Vector2::new(coordinate(), coordinate());
            let hears = |reception: Reception, rng: &mut Xoshiro256PlusPlus| {
                let way = place.push(0.0) - reception.receiver.position;
                let error: f64 = rng.sample(StandardNormal);
                power_dbm + 3.0 * loss_db(&way) + SIGMA_DB * error > FLOOR_DBM
            };
            if is_there && walk().iter().any(|reception| hears(reception, &mut rng)) {
                heard += 1;
                continue;
            }
            silent += 1;
            right += usize::from(!is_there);
            if silent == 100 {
                break;
            }
        }
        assert!(right >= 95, "{right} of 100 silent searches; {heard} heard a transmitter");
    }

    /// At the very power of the statement its confidence is exact: of 2000 searches with a
    /// transmitter with the probability 0.5, 5 % of the silent ones have one. The binomial standard
    /// deviation of some 1050 silent ones is 0.7 %; three of it.
    #[test]
    fn the_confidence_is_exact_at_the_power_of_the_statement() {
        let stated = Absence::of(&walk(), &config(-30.0)).expect("silent");
        let mut silent = 0.0;
        let mut wrong = 0.0;
        for seed in 1..=2000 {
            let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
            let is_there = rng.random::<f64>() < 0.5;
            let mut coordinate = || (rng.random::<f64>() - 0.5) * stated.side_m;
            let place = stated.centre + Vector2::new(coordinate(), coordinate());
            let mut hears = |reception: Reception| {
                let way = place.push(0.0) - reception.receiver.position;
                let error: f64 = rng.sample(StandardNormal);
                stated.weakest_dbm + 3.0 * loss_db(&way) + SIGMA_DB * error > FLOOR_DBM
            };
            if !(is_there && walk().iter().any(&mut hears)) {
                silent += 1.0;
                wrong += f64::from(u8::from(is_there));
            }
        }
        assert_abs_diff_eq!(wrong / silent, 0.05, epsilon = 0.021);
    }

    #[test]
    fn a_longer_search_and_a_known_exponent_state_more() {
        let short: Receptions = walk().iter().take(4).collect();
        let wide = LocateConfig { margin_m: 150.0, ..LocateConfig::default() };
        let long = Absence::of(&walk(), &wide).expect("silent");
        // A search of a third of the area: laid over the whole of it by receivers at its corners
        // that hear nothing at all.
        let deaf = |east: f64| Reception {
            silence: Some(Level { rss_dbm: 300.0, sigma_db: SIGMA_DB }),
            ..silence(east, 0.0)
        };
        let short: Receptions = short.iter().chain([deaf(0.0), deaf(660.0)]).collect();
        let part = Absence::of(&short, &wide).expect("silent");
        assert_abs_diff_eq!(part.side_m, long.side_m, epsilon = 1e-9);
        assert!(part.weakest_dbm > long.weakest_dbm + 3.0, "{part:?} {long:?}");
        let known = LocateConfig { power: Power::FreeReference { exponent: 2.3 }, ..wide };
        let known = Absence::of(&walk(), &known).expect("silent");
        assert!(known.weakest_dbm < long.weakest_dbm, "{known:?} {long:?}");
        assert_eq!((long.silences, long.places, long.existence), (12, 12, None));
    }

    #[test]
    fn silences_of_one_place_count_once() {
        let once = Absence::of(&walk(), &config(-30.0)).expect("silent");
        let thrice: Receptions = walk().iter().chain(walk().iter()).chain(walk().iter()).collect();
        let thrice = Absence::of(&thrice, &config(-30.0)).expect("silent");
        assert_eq!((thrice.silences, thrice.places), (36, once.places));
        assert_abs_diff_eq!(thrice.weakest_dbm, once.weakest_dbm, epsilon = 1e-9);
        let existence = once.existence.expect("the power is stated");
        let consistent = (existence <= 0.05) == (once.weakest_dbm <= -30.0);
        assert!(consistent, "{once:?}");
    }

    #[test]
    fn a_search_that_received_something_has_no_statement() {
        let level = Some(Level { rss_dbm: -80.0, sigma_db: SIGMA_DB });
        let heard = Reception { level, silence: None, ..silence(0.0, 0.0) };
        let mixed: Receptions = walk().iter().chain([heard]).collect();
        assert_eq!(Absence::of(&mixed, &config(-30.0)), None);
        assert_eq!(Absence::of(&Receptions::default(), &config(-30.0)), None);
    }
}
