use alloc::{vec, vec::Vec};

use foxhunt_core::angle;
use nalgebra::{Matrix2, SMatrix, SVector, Vector2};

use crate::{StationAntenna, extractor::lobe_db};

/// Number of harmonics of the site over the circle.
pub(super) const HARMONICS: usize = 5;

/// The σ of harmonic k before anything was received is this over k, in dB: what reflections of a
/// few dB make of lobes that are wider than they.
const SITE_SIGMA_DB: f64 = 2.0;

/// Before anything was received: boresights within 30° of where they start, gains within 3 dB of
/// each other, a beamwidth of 60° within a factor of 1.6, a front-to-back ratio of 15 ± 6 dB.
const BORESIGHT_SIGMA: f64 = 0.52;
const GAIN_SIGMA_DB: f64 = 3.0;
const BEAMWIDTH: f64 = 1.05;
const BEAMWIDTH_SIGMA: f64 = 0.5;
const FRONT_TO_BACK_DB: f64 = 15.0;
const FRONT_TO_BACK_SIGMA_DB: f64 = 6.0;

/// The most that one step turns a boresight (5°) and widens a lobe: from far off the slope leads
/// astray.
const MOST_TURN: f64 = 0.087;
const MOST_STRETCH: f64 = 0.05;
const MOST_DEEPENING_DB: f64 = 1.0;

/// One reading to be explained: its direction, its remainder without the antennas, its weight.
#[derive(Clone, Copy, Debug)]
pub(super) struct Term {
    pub(super) direction: f64,
    pub(super) rest_db: f64,
    pub(super) weight: f64,
}

/// The antennas' pattern as it is fitted.
#[derive(Clone, Debug)]
pub(super) struct Shape {
    pub(super) antennas: Vec<StationAntenna>,
    started: Vec<f64>,
    pub(super) beamwidth: f64,
    pub(super) front_to_back_db: f64,
}

impl Shape {
    pub(super) fn new(recorded: &[f64], started: Vec<f64>) -> Self {
        let antenna = |(recorded_boresight, boresight): (&f64, &f64)| StationAntenna {
            recorded_boresight: *recorded_boresight,
            boresight: *boresight,
            gain_db: 0.0,
            site_db: Vec::new(),
        };
        let antennas = recorded.iter().zip(&started).map(antenna).collect();
        Self { antennas, started, beamwidth: BEAMWIDTH, front_to_back_db: FRONT_TO_BACK_DB }
    }

    fn lobe(&self, angle: f64) -> f64 {
        lobe_db(angle, self.beamwidth, self.front_to_back_db)
    }

    /// The gain of an antenna in a direction, in dB.
    pub(super) fn gain(&self, antenna: usize, direction: f64) -> f64 {
        self.antennas.get(antenna).map_or(0.0, |own| {
            own.gain_db + self.lobe(direction - own.boresight) + own.site(direction)
        })
    }

    /// One step of Gauss and Newton for each antenna's boresight and gain.
    pub(super) fn turn(&mut self, terms: &[Vec<Term>], variance: f64) {
        const H: f64 = 0.01;
        for (index, terms) in terms.iter().enumerate() {
            let boresight = self.antennas[index].boresight;
            let gain = self.antennas[index].gain_db;
            let prior = Vector2::new(
                variance / (BORESIGHT_SIGMA * BORESIGHT_SIGMA),
                variance / (GAIN_SIGMA_DB * GAIN_SIGMA_DB),
            );
            let mut normal = Matrix2::from_diagonal(&prior);
            let from_start = angle::wrap(self.started[index] - boresight);
            let mut right = prior.component_mul(&Vector2::new(from_start, -gain));
            for term in terms {
                let off = term.direction - boresight;
                let slope = (self.lobe(off - H) - self.lobe(off + H)) / (2.0 * H);
                let row = Vector2::new(slope, 1.0);
                let left = term.rest_db - self.gain(index, term.direction);
                normal += row * row.transpose() * term.weight;
                right += row * (term.weight * left);
            }
            let Some(factor) = normal.cholesky() else { continue };
            let step = factor.solve(&right);
            let turned = step.x.clamp(-MOST_TURN, MOST_TURN);
            let own = &mut self.antennas[index];
            own.boresight = angle::wrap(boresight + turned);
            own.gain_db += step.y;
        }
    }

    /// One such step for the beamwidth and the front-to-back ratio that all share.
    pub(super) fn stretch(&mut self, terms: &[Vec<Term>], variance: f64) {
        const H: f64 = 0.01;
        let prior = Vector2::new(
            variance / (BEAMWIDTH_SIGMA * BEAMWIDTH_SIGMA),
            variance / (FRONT_TO_BACK_SIGMA_DB * FRONT_TO_BACK_SIGMA_DB),
        );
        let width = libm::log(self.beamwidth);
        let depth = self.front_to_back_db;
        let from_start = Vector2::new(libm::log(BEAMWIDTH) - width, FRONT_TO_BACK_DB - depth);
        let mut normal = Matrix2::from_diagonal(&prior);
        let mut right = prior.component_mul(&from_start);
        for (index, terms) in terms.iter().enumerate() {
            for term in terms {
                let off = term.direction - self.antennas[index].boresight;
                let at = |w: f64, d: f64| lobe_db(off, libm::exp(width + w), depth + d);
                let row = Vector2::new(
                    (at(H, 0.0) - at(-H, 0.0)) / (2.0 * H),
                    (at(0.0, H) - at(0.0, -H)) / (2.0 * H),
                );
                let left = term.rest_db - self.gain(index, term.direction);
                normal += row * row.transpose() * term.weight;
                right += row * (term.weight * left);
            }
        }
        let Some(factor) = normal.cholesky() else { return };
        let step = factor.solve(&right);
        let stretched = step.x.clamp(-MOST_STRETCH, MOST_STRETCH);
        let deepened = step.y.clamp(-MOST_DEEPENING_DB, MOST_DEEPENING_DB);
        self.beamwidth = libm::exp(width + stretched).clamp(0.2, 3.0);
        self.front_to_back_db = (depth + deepened).clamp(3.0, 40.0);
    }

    /// Fits each antenna's Fourier series to what its readings still show over the direction, drawn
    /// to zero where little was received.
    pub(super) fn learn_site(&mut self, terms: &[Vec<Term>], variance: f64) {
        const SIZE: usize = 2 * HARMONICS;
        for (index, terms) in terms.iter().enumerate() {
            let (mut normal, mut right) =
                (SMatrix::<f64, SIZE, SIZE>::zeros(), SVector::<f64, SIZE>::zeros());
            let mut k = 1.0;
            for pair in 0..HARMONICS {
                let precision = variance * (k / SITE_SIGMA_DB) * (k / SITE_SIGMA_DB);
                normal[(2 * pair, 2 * pair)] = precision;
                normal[(2 * pair + 1, 2 * pair + 1)] = precision;
                k += 1.0;
            }
            let own = &self.antennas[index];
            for term in terms {
                let mut row = SVector::<f64, SIZE>::zeros();
                let mut k = 1.0;
                for pair in 0..HARMONICS {
                    row[2 * pair] = libm::cos(k * term.direction);
                    row[2 * pair + 1] = libm::sin(k * term.direction);
                    k += 1.0;
                }
                let left = term.rest_db - own.gain_db - self.lobe(term.direction - own.boresight);
                normal += row * row.transpose() * term.weight;
                right += row * (term.weight * left);
            }
            let site = normal
                .cholesky()
                .map_or(vec![0.0; SIZE], |factor| factor.solve(&right).iter().copied().collect());
            self.antennas[index].site_db = site;
        }
    }
}
