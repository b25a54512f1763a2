use alloc::{vec, vec::Vec};
use core::f64::consts::TAU;

use foxhunt_core::{angle, elementary};
use nalgebra::{DMatrix, DVector, SMatrix, SVector};

use super::{Chance, Floor, Lobe, StationBurst};
use crate::{StationAntenna, extractor::TAIL};

/// Number of harmonics of the site over the circle.
const HARMONICS: usize = 5;
const SITE_SIZE: usize = 2 * HARMONICS;

/// The σ of harmonic k before anything was received is this over k, in dB: what reflections of a
/// few dB make of lobes that are wider than they.
const SITE_SIGMA_DB: f64 = 2.0;

/// The most that one step turns a boresight (5°): from far off the slope leads astray.
const MOST_TURN: f64 = 0.087;

/// Candidates of a boresight over the circle, where it is looked for.
const CANDIDATES: u16 = 72;

/// Nats by which another boresight has to be likelier, for a boresight that is looked for all over
/// the circle fits a few bursts better than the true one.
const CLEARLY: f64 = 4.0;

/// Bursts that an antenna has to receive best before they show where it looks.
const BEST_RECEIVED: f64 = 8.0;

/// Range of levels about the strongest reading, in dB, and the step in scales of the residuals.
const LEVELS_DB: [f64; 2] = [15.0, 35.0];
const LEVEL_STEP: f64 = 0.5;

/// Numbers that all stations share.
#[derive(Clone, Debug)]
pub(super) struct Shared {
    pub lobe: Lobe,
    /// Scale of the residuals in dB.
    pub scale: f64,
    pub floor: Floor,
    /// κ: σ of the recorded boresights' errors.
    pub boresight_sigma: f64,
    /// τ: σ of gains in dB.
    pub gain_sigma_db: f64,
}

/// A reading to be explained, or one that was imputed.
#[derive(Clone, Copy, Debug)]
struct Term {
    value: f64,
    weight: f64,
    measured: bool,
}

/// One station as it is fitted.
#[derive(Clone, Debug)]
pub(super) struct Own {
    pub antennas: Vec<StationAntenna>,
    /// Level of each burst in dBm.
    levels: Vec<f64>,
    /// Terms of each burst, an antenna after the other.
    terms: Vec<Vec<Term>>,
    /// Variances of boresights and gains by the readings alone, silences left out.
    pub boresight_variances: Vec<f64>,
    pub gain_variances: Vec<f64>,
    /// Numbers that the readings, and not their prior, determine.
    determined: f64,
    site_determined: f64,
}

impl Own {
    /// A station whose antennas look where they are recorded to, or, with enough bursts, where the
    /// bursts come from that each receives best.
    pub(super) fn new(recorded: &[f64], bursts: &[&StationBurst]) -> Self {
        let mut best = vec![(angle::Resultant::default(), 0.0); recorded.len()];
        for burst in bursts {
            let readings = burst.readings_dbm.iter().enumerate();
            let strongest = readings
                .filter_map(|(antenna, reading)| Some((antenna, (*reading)?)))
                .max_by(|a, b| a.1.total_cmp(&b.1));
            if let Some((resultant, count)) =
                strongest.and_then(|(antenna, _)| best.get_mut(antenna))
            {
                resultant.add(burst.truth, 1.0);
                *count += 1.0;
            }
        }
        let antenna = |(recorded, (best, count)): (&f64, (angle::Resultant, f64))| {
            let shown = best.direction(0.2).filter(|_| count >= BEST_RECEIVED);
            StationAntenna {
                boresight: shown.unwrap_or(*recorded),
                ..StationAntenna::as_recorded(*recorded)
            }
        };
        let count = recorded.len();
        Self {
            antennas: recorded.iter().zip(best).map(antenna).collect(),
            levels: Vec::new(),
            terms: Vec::new(),
            boresight_variances: vec![0.0; count],
            gain_variances: vec![0.0; count],
            determined: 0.0,
            site_determined: 0.0,
        }
    }

    /// Forgets the bursts and the site, and keeps the antennas.
    pub(super) fn without_bursts(&self) -> Self {
        let mut kept = Self { levels: Vec::new(), terms: Vec::new(), ..self.clone() };
        kept.antennas.iter_mut().for_each(|antenna| antenna.site_db.clear());
        kept.site_determined = 0.0;
        kept
    }

    /// The gain of an antenna in a direction, in dB.
    fn gain(&self, lobe: &Lobe, antenna: usize, direction: f64) -> f64 {
        self.antennas.get(antenna).map_or(0.0, |own| {
            own.gain_db + lobe.at(direction - own.boresight).gain_db + own.site(direction)
        })
    }

    /// Fits the level of each burst, with silences imputed, and weighs the readings.
    pub(super) fn level(&mut self, bursts: &[&StationBurst], shared: &Shared) {
        let count = self.antennas.len();
        let mut levels = Vec::with_capacity(bursts.len());
        let mut all = Vec::with_capacity(bursts.len());
        for (index, burst) in bursts.iter().enumerate() {
            let gains: Vec<f64> =
                (0..count).map(|i| self.gain(&shared.lobe, i, burst.truth)).collect();
            let level = self.levels.get(index).copied().unwrap_or_else(|| {
                let heard = burst.readings_dbm.iter().flatten();
                let strongest = heard.fold(-200.0_f64, |a, &b| a.max(b));
                strongest - gains.iter().copied().fold(f64::NEG_INFINITY, f64::max)
            });
            let mut weights = 0.0;
            let mut sum = 0.0;
            let mut terms = Vec::with_capacity(count);
            for (reading, gain) in burst.readings_dbm.iter().zip(&gains) {
                let expected = level + gain;
                let value = reading.unwrap_or_else(|| shared.floor.imputed(expected, shared.scale));
                let off = (value - expected) / shared.scale;
                let weight = (TAIL + 1.0) / (TAIL + off * off);
                weights += weight;
                sum += weight * (value - gain);
                terms.push(Term { value, weight, measured: reading.is_some() });
            }
            levels.push(if weights > 0.0 { sum / weights } else { level });
            all.push(terms);
        }
        (self.levels, self.terms) = (levels, all);
    }

    /// Log likelihood of the bursts for a scale of the residuals, the level of each integrated out
    /// under a uniform prior as the extractor does, but for a constant.
    pub(super) fn log_likelihood(
        &self,
        bursts: &[&StationBurst],
        shared: &Shared,
        scale: f64,
    ) -> f64 {
        let step = LEVEL_STEP * scale;
        let [below, above] = LEVELS_DB;
        let mut sum = 0.0;
        for burst in bursts {
            let gain = |antenna| self.gain(&shared.lobe, antenna, burst.truth);
            let gains: Vec<f64> = (0..self.antennas.len()).map(gain).collect();
            let readings = || burst.readings_dbm.iter().zip(&gains);
            let received = burst.readings_dbm.iter().flatten();
            let count = received.clone().map(|_| 1.0).sum::<f64>();
            let strongest = received.fold(f64::NEG_INFINITY, |a, &b| a.max(b));
            let mut ones = 0.0;
            let mut best = f64::NEG_INFINITY;
            let mut level = strongest - below;
            while count > 0.0 && level <= strongest + above {
                let one = |(reading, gain): (&Option<f64>, &f64)| {
                    shared.floor.log_likelihood(*reading, level + gain, scale)
                };
                let log: f64 = readings().map(one).sum();
                if log > best {
                    ones *= elementary::exp(best - log);
                    best = log;
                }
                ones += elementary::exp(log - best);
                level += step;
            }
            if ones > 0.0 {
                sum += best + libm::log(ones * step) - count * libm::log(scale);
            }
        }
        sum
    }

    /// Numbers of readings beside the first of each burst, and numbers fitted to them.
    pub(super) fn freedom(&self, bursts: &[&StationBurst]) -> [f64; 2] {
        let beside = |burst: &&StationBurst| -> f64 {
            burst.readings_dbm.iter().flatten().skip(1).map(|_| 1.0).sum()
        };
        [bursts.iter().map(beside).sum(), self.determined + self.site_determined]
    }

    /// One step of Gauss and Newton for all boresights and gains of the station, its levels
    /// integrated out; with `variances`, these too.
    pub(super) fn turn(&mut self, bursts: &[&StationBurst], shared: &Shared, variances: bool) {
        let count = self.antennas.len();
        let variance = shared.scale * shared.scale;
        let priors = [
            variance / (shared.boresight_sigma * shared.boresight_sigma),
            variance / (shared.gain_sigma_db * shared.gain_sigma_db),
        ];
        let mut normal = DMatrix::<f64>::zeros(2 * count, 2 * count);
        let mut right = DVector::<f64>::zeros(2 * count);
        let mut received = normal.clone();
        for ((burst, terms), level) in bursts.iter().zip(&self.terms).zip(&self.levels) {
            let row = |(antenna, term): (usize, &Term)| {
                let own = &self.antennas[antenna];
                let slopes = shared.lobe.at(burst.truth - own.boresight);
                let gain = own.gain_db + slopes.gain_db + own.site(burst.truth);
                ([-slopes.by_angle, 1.0], term.value - level - gain, *term)
            };
            let rows: Vec<([f64; 2], f64, Term)> = terms.iter().enumerate().map(row).collect();
            add_centred(&mut normal, Some(&mut right), &rows, |_| true);
            if variances {
                add_centred(&mut received, None, &rows, |term| term.measured);
            }
        }
        for (antenna, own) in self.antennas.iter().enumerate() {
            let from_recorded = angle::wrap(own.recorded_boresight - own.boresight);
            right[2 * antenna] += priors[0] * from_recorded;
            right[2 * antenna + 1] -= priors[1] * own.gain_db;
            for (k, prior) in priors.iter().enumerate() {
                normal[(2 * antenna + k, 2 * antenna + k)] += prior;
                received[(2 * antenna + k, 2 * antenna + k)] += prior;
            }
        }
        if variances && let Some(factor) = received.cholesky() {
            let covariance = factor.inverse() * variance;
            self.determined = 0.0;
            for antenna in 0..count {
                let own = [0, 1].map(|k| covariance[(2 * antenna + k, 2 * antenna + k)]);
                [self.boresight_variances[antenna], self.gain_variances[antenna]] = own;
                let shares =
                    own.iter().zip(&priors).map(|(own, prior)| 1.0 - own * prior / variance);
                self.determined += shares.sum::<f64>();
            }
            self.uncertain(&covariance);
        }
        let Some(factor) = normal.cholesky() else { return };
        let step = factor.solve(&right);
        for (antenna, own) in self.antennas.iter_mut().enumerate() {
            let turned = step[2 * antenna].clamp(-MOST_TURN, MOST_TURN);
            own.boresight = angle::wrap(own.boresight + turned);
            own.gain_db += step[2 * antenna + 1];
        }
    }

    /// Sets how far boresights and gains are known. What all gains have in common is the level's.
    fn uncertain(&mut self, covariance: &DMatrix<f64>) {
        let count = self.antennas.len();
        let number = (0..count).map(|_| 1.0).sum::<f64>();
        let gain = |a: usize, b: usize| covariance[(2 * a + 1, 2 * b + 1)];
        let row = |a: usize| (0..count).map(|b| gain(a, b)).sum::<f64>() / number;
        let all = (0..count).map(row).sum::<f64>() / number;
        let centred: Vec<f64> = (0..count).map(|a| gain(a, a) - 2.0 * row(a) + all).collect();
        for (antenna, own) in self.antennas.iter_mut().enumerate() {
            own.boresight_sigma = libm::sqrt(covariance[(2 * antenna, 2 * antenna)].max(0.0));
            own.gain_sigma_db = libm::sqrt(centred[antenna].max(0.0));
        }
    }

    /// Adds the normal equations of the shared lobe: logarithm of the beamwidth, front-to-back
    /// ratio.
    pub(super) fn add_to_lobe(
        &self,
        bursts: &[&StationBurst],
        lobe: &Lobe,
        normal: &mut SMatrix<f64, 2, 2>,
        right: &mut SVector<f64, 2>,
    ) {
        for ((burst, terms), level) in bursts.iter().zip(&self.terms).zip(&self.levels) {
            let mut weights = 0.0;
            let mut rest = 0.0;
            let mut mean = SVector::<f64, 2>::zeros();
            for (term, own) in terms.iter().zip(&self.antennas) {
                let slopes = lobe.at(burst.truth - own.boresight);
                let left =
                    term.value - level - own.gain_db - slopes.gain_db - own.site(burst.truth);
                let row = SVector::<f64, 2>::new(slopes.by_width, slopes.by_depth);
                *normal += row * row.transpose() * term.weight;
                *right += row * (term.weight * left);
                weights += term.weight;
                rest += term.weight * left;
                mean += row * term.weight;
            }
            if weights > 0.0 {
                *normal -= mean * mean.transpose() / weights;
                *right -= mean * (rest / weights);
            }
        }
    }

    /// Fits each antenna's Fourier series to what its readings still show over the direction, drawn
    /// to zero where little was received.
    pub(super) fn learn_site(&mut self, bursts: &[&StationBurst], shared: &Shared) {
        let variance = shared.scale * shared.scale;
        let mut precisions = SVector::<f64, SITE_SIZE>::zeros();
        let mut k = 1.0;
        for pair in 0..HARMONICS {
            let precision = variance * (k / SITE_SIGMA_DB) * (k / SITE_SIGMA_DB);
            precisions[2 * pair] = precision;
            precisions[2 * pair + 1] = precision;
            k += 1.0;
        }
        // The level of a burst takes one of its readings.
        let count = self.antennas.iter().map(|_| 1.0).sum::<f64>();
        let beside = 1.0 - 1.0 / f64::max(count, 1.0);
        self.site_determined = 0.0;
        for (antenna, own) in self.antennas.iter_mut().enumerate() {
            let mut normal = SMatrix::<f64, SITE_SIZE, SITE_SIZE>::from_diagonal(&precisions);
            let mut right = SVector::<f64, SITE_SIZE>::zeros();
            let mut received = normal;
            for ((burst, terms), level) in bursts.iter().zip(&self.terms).zip(&self.levels) {
                let Some(term) = terms.get(antenna) else { continue };
                let mut row = SVector::<f64, SITE_SIZE>::zeros();
                let mut k = 1.0;
                for pair in 0..HARMONICS {
                    row[2 * pair] = libm::cos(k * burst.truth);
                    row[2 * pair + 1] = libm::sin(k * burst.truth);
                    k += 1.0;
                }
                let lobe = shared.lobe.at(burst.truth - own.boresight).gain_db;
                let left = term.value - level - own.gain_db - lobe;
                let square = row * row.transpose() * term.weight;
                normal += square;
                if term.measured {
                    received += square;
                }
                right += row * (term.weight * left);
            }
            let Some(factor) = normal.cholesky() else { continue };
            own.site_db = factor.solve(&right).iter().copied().collect();
            let Some(received) = received.cholesky() else { continue };
            let inverse = received.inverse();
            let share = |k: usize| 1.0 - precisions[k] * inverse[(k, k)];
            self.site_determined += (0..SITE_SIZE).map(share).sum::<f64>() * beside;
        }
    }

    /// Looks for better boresights: all as recorded, with equal gains, then one antenna after the
    /// other all over the circle, as the others look now.
    pub(super) fn look_about(&mut self, bursts: &[&StationBurst], shared: &Shared) {
        if self.antennas.len() < 2 {
            return;
        }
        let recorded = |own: &StationAntenna| StationAntenna {
            site_db: own.site_db.clone(),
            ..StationAntenna::as_recorded(own.recorded_boresight)
        };
        let recorded: Vec<StationAntenna> = self.antennas.iter().map(recorded).collect();
        let mut best = log_posterior(&self.antennas, bursts, shared);
        let value = log_posterior(&recorded, bursts, shared);
        if value > best {
            (best, self.antennas) = (value, recorded);
        }
        for antenna in 0..self.antennas.len() {
            let start = self.antennas[antenna].boresight;
            let mut kept = start;
            let mut needed = CLEARLY;
            for candidate in 1..CANDIDATES {
                let turned = TAU * f64::from(candidate) / f64::from(CANDIDATES);
                let tried = angle::wrap(start + turned);
                self.antennas[antenna].boresight = tried;
                let value = log_posterior(&self.antennas, bursts, shared);
                if value > best + needed {
                    (best, kept, needed) = (value, tried, 0.0);
                }
            }
            self.antennas[antenna].boresight = kept;
        }
    }

    /// Receptions and silences, as the floor is fitted to them.
    pub(super) fn chances(&self, bursts: &[&StationBurst], lobe: &Lobe) -> Vec<Chance> {
        let mut chances = Vec::new();
        for (burst, level) in bursts.iter().zip(&self.levels) {
            for (antenna, reading) in burst.readings_dbm.iter().enumerate() {
                let expected = level + self.gain(lobe, antenna, burst.truth);
                chances.push(reading.map_or(Chance::Silent(expected), Chance::Received));
            }
        }
        chances
    }
}

/// Adds the rows of a burst to the normal equations of a station, the burst's level integrated
/// out.
fn add_centred(
    normal: &mut DMatrix<f64>,
    right: Option<&mut DVector<f64>>,
    rows: &[([f64; 2], f64, Term)],
    counts: impl Fn(&Term) -> bool,
) {
    let mut weights = 0.0;
    let mut rest = 0.0;
    let mut mean = DVector::<f64>::zeros(normal.nrows());
    let mut sums = DVector::<f64>::zeros(normal.nrows());
    for (antenna, (row, left, term)) in rows.iter().enumerate() {
        if !counts(term) {
            continue;
        }
        weights += term.weight;
        rest += term.weight * left;
        for (k, a) in row.iter().enumerate() {
            mean[2 * antenna + k] = term.weight * a;
            sums[2 * antenna + k] = term.weight * a * left;
            for (m, b) in row.iter().enumerate() {
                normal[(2 * antenna + k, 2 * antenna + m)] += term.weight * a * b;
            }
        }
    }
    if weights > 0.0 {
        normal.ger(-1.0 / weights, &mean, &mean, 1.0);
        if let Some(right) = right {
            *right += sums - mean * (rest / weights);
        }
    }
}

/// Log posterior of a station's antennas, but for a constant; the level of each burst is the mean
/// of its readings without gains.
fn log_posterior(antennas: &[StationAntenna], bursts: &[&StationBurst], shared: &Shared) -> f64 {
    let mut sum = 0.0;
    for own in antennas {
        let off = angle::wrap(own.boresight - own.recorded_boresight) / shared.boresight_sigma;
        let gain = own.gain_db / shared.gain_sigma_db;
        sum -= 0.5 * (off * off + gain * gain);
    }
    let mut gains = vec![0.0; antennas.len()];
    for burst in bursts {
        let mut count = 0.0;
        let mut level = 0.0;
        for ((gain, own), reading) in gains.iter_mut().zip(antennas).zip(&burst.readings_dbm) {
            *gain = own.gain_db + shared.lobe.at(burst.truth - own.boresight).gain_db;
            if let Some(reading) = reading {
                count += 1.0;
                level += reading - *gain;
            }
        }
        if count < 1.0 {
            continue;
        }
        level /= count;
        for (reading, gain) in burst.readings_dbm.iter().zip(&gains) {
            sum += shared.floor.log_likelihood(*reading, level + gain, shared.scale);
        }
    }
    sum
}
