use alloc::vec::Vec;

use foxhunt_core::angle;
use nalgebra::{Matrix2, Vector2};

use super::{
    Chance, Floor, Lobe, StationBurst,
    shape::{Own, Shared},
};
use crate::{
    CalibrationError, StationModel, StationPattern, calibration::calibrated::ANY_DIRECTION,
};

/// Before anything was received: a beamwidth of 60° within a factor of 1.6, a front-to-back ratio
/// of 15 ± 6 dB.
const BEAMWIDTH: f64 = 1.05;
const BEAMWIDTH_SIGMA: f64 = 0.5;
const FRONT_TO_BACK_DB: f64 = 15.0;
const FRONT_TO_BACK_SIGMA_DB: f64 = 6.0;

/// The most that one step widens and deepens the lobe.
const MOST_STRETCH: f64 = 0.05;
const MOST_DEEPENING_DB: f64 = 1.0;

/// κ at first, for recorded boresights may be no more than names of the antennas (45°); before
/// anything was received, as if this many boresights had been off by so much (15°).
const FIRST_BORESIGHT_SIGMA: f64 = 0.785;
const BORESIGHT_SIGMA: f64 = 0.26;
const BORESIGHTS_BEFORE: f64 = 2.0;
const LEAST_BORESIGHT_SIGMA: f64 = 0.017;
/// κ of the first steps at least (10°).
const LEAST_FIRST_TURN: f64 = 0.17;

/// τ before anything was received, as if this many gains had been off by so much, and its range.
const GAIN_SIGMA_DB: f64 = 3.0;
const GAINS_BEFORE: f64 = 4.0;
const GAIN_SIGMAS_DB: [f64; 2] = [0.5, 6.0];

/// Range of the residuals' scale in dB.
const SCALES_DB: [f64; 2] = [0.1, 30.0];

/// Largest share of the readings that counts as fitted.
const MOST_FITTED: f64 = 0.75;

/// Rounds of a fit: of the lobe, boresights and gains first, then of the site.
const ROUNDS: u32 = 55;
const SITE_ROUNDS: u32 = 25;
/// Rounds of a fit that begins with one of nearly all bursts.
const REFIT_ROUNDS: u32 = 20;
const SITE_REFIT_ROUNDS: u32 = 15;

/// All stations as they are fitted together.
#[derive(Clone, Debug)]
pub(super) struct Pool {
    shared: Shared,
    stations: Vec<Own>,
    /// Scale of the residuals before the sites were fitted, which are then a part of them.
    scale_with_site: f64,
}

/// Bursts of each station.
type Bursts<'a> = [Vec<&'a StationBurst>];

impl Pool {
    /// Fits all stations to their bursts.
    pub(super) fn fitted(recorded: &[&[f64]], bursts: &Bursts<'_>) -> Self {
        let readings = bursts.iter().flatten().flat_map(|b| b.readings_dbm.iter().flatten());
        let weakest = readings.fold(f64::INFINITY, |a, &b| a.min(b));
        let shared = Shared {
            lobe: Lobe::new(BEAMWIDTH, FRONT_TO_BACK_DB),
            scale: 6.0,
            floor: Floor { dbm: weakest + 1.0, width_db: 2.0 },
            boresight_sigma: FIRST_BORESIGHT_SIGMA,
            gain_sigma_db: GAIN_SIGMA_DB,
        };
        let stations =
            recorded.iter().zip(bursts).map(|(recorded, own)| Own::new(recorded, own)).collect();
        let mut pool = Self { scale_with_site: shared.scale, shared, stations };
        pool.look_about(bursts);
        pool.look_about(bursts);
        pool.shared.boresight_sigma = pool.usual_turn().max(LEAST_FIRST_TURN);
        for round in 0..ROUNDS {
            if round == 15 || round == 30 {
                pool.look_about(bursts);
            }
            pool.step(bursts, round % 5 == 4);
            if round % 20 == 19 {
                pool.fit_floor(bursts);
            }
        }
        pool.learn_sites(bursts, SITE_ROUNDS);
        pool
    }

    /// Fits again to `bursts`, which are nearly all of the bursts of the present fit.
    pub(super) fn refitted(&self, bursts: &Bursts<'_>) -> Self {
        let stations = self.stations.iter().map(Own::without_bursts).collect();
        let shared = Shared { scale: self.scale_with_site, ..self.shared.clone() };
        let mut pool = Self { stations, shared, scale_with_site: self.scale_with_site };
        for round in 0..REFIT_ROUNDS {
            pool.step(bursts, round % 5 == 4);
            if round == 10 {
                pool.fit_floor(bursts);
            }
        }
        pool.learn_sites(bursts, SITE_REFIT_ROUNDS);
        pool
    }

    /// Returns the σ of a Gaussian with the median of all boresights' distances from the recorded
    /// ones.
    fn usual_turn(&self) -> f64 {
        let antennas = self.stations.iter().flat_map(|own| &own.antennas);
        let mut turned: Vec<f64> =
            antennas.map(|own| angle::distance(own.boresight, own.recorded_boresight)).collect();
        turned.sort_by(f64::total_cmp);
        turned.get(turned.len() / 2).map_or(0.0, |median| median / 0.6745)
    }

    fn look_about(&mut self, bursts: &Bursts<'_>) {
        for (own, bursts) in self.stations.iter_mut().zip(bursts) {
            own.look_about(bursts, &self.shared);
        }
    }

    /// Fits the levels of all bursts.
    fn level(&mut self, bursts: &Bursts<'_>) {
        for (own, bursts) in self.stations.iter_mut().zip(bursts) {
            own.level(bursts, &self.shared);
        }
    }

    /// Learns the residuals' scale by its marginal likelihood, the bursts' levels integrated out,
    /// and widens it by the numbers that were fitted to the readings.
    fn learn_scale(&mut self, bursts: &Bursts<'_>) {
        let each = self.stations.iter().zip(bursts);
        let value = |scale: f64| self.log_likelihood(bursts, scale);
        let mut readings = 0.0;
        let mut fitted = 0.0;
        for [own, of_own] in each.map(|(own, bursts)| own.freedom(bursts)) {
            readings += own;
            fitted += of_own;
        }
        let widening = libm::sqrt(1.0 - (fitted / f64::max(readings, 1.0)).min(MOST_FITTED));
        let [least, most] = SCALES_DB;
        let scale = likeliest_scale(self.shared.scale * widening, value);
        self.shared.scale = (scale / widening).clamp(least, most);
    }

    /// Returns the log likelihood of bursts that this was not fitted to, for a scale of the
    /// residuals.
    pub(super) fn log_likelihood(&self, bursts: &Bursts<'_>, scale: f64) -> f64 {
        let each = self.stations.iter().zip(bursts);
        each.map(|(own, bursts)| own.log_likelihood(bursts, &self.shared, scale)).sum()
    }

    /// Returns the scale of the residuals.
    pub(super) fn scale(&self) -> f64 {
        self.shared.scale
    }

    /// Sets the scale of the residuals to that of bursts that had no part in the fit.
    pub(super) fn set_scale(&mut self, scale: f64) {
        self.shared.scale = scale;
        self.scale_with_site = self.scale_with_site.max(scale);
    }

    /// One round of levels, boresights, gains and the lobe; with `spreads`, also of κ, τ and the
    /// residuals' scale.
    fn step(&mut self, bursts: &Bursts<'_>, spreads: bool) {
        self.level(bursts);
        for (own, bursts) in self.stations.iter_mut().zip(bursts) {
            own.turn(bursts, &self.shared, spreads);
        }
        self.stretch(bursts);
        if spreads {
            self.learn_spreads();
            self.learn_scale(bursts);
        }
    }

    /// One step of Gauss and Newton for the beamwidth and the front-to-back ratio.
    fn stretch(&mut self, bursts: &Bursts<'_>) {
        let variance = self.shared.scale * self.shared.scale;
        let prior = Vector2::new(
            variance / (BEAMWIDTH_SIGMA * BEAMWIDTH_SIGMA),
            variance / (FRONT_TO_BACK_SIGMA_DB * FRONT_TO_BACK_SIGMA_DB),
        );
        let lobe = &self.shared.lobe;
        let width = libm::log(lobe.beamwidth);
        let depth = lobe.front_to_back_db;
        let from_start = Vector2::new(libm::log(BEAMWIDTH) - width, FRONT_TO_BACK_DB - depth);
        let mut normal = Matrix2::from_diagonal(&prior);
        let mut right = prior.component_mul(&from_start);
        for (own, bursts) in self.stations.iter().zip(bursts) {
            own.add_to_lobe(bursts, lobe, &mut normal, &mut right);
        }
        let Some(factor) = normal.cholesky() else { return };
        let step = factor.solve(&right);
        let stretched = step.x.clamp(-MOST_STRETCH, MOST_STRETCH);
        let deepened = step.y.clamp(-MOST_DEEPENING_DB, MOST_DEEPENING_DB);
        self.shared.lobe = Lobe::new(libm::exp(width + stretched), depth + deepened);
    }

    /// Learns κ and τ by their marginal likelihood (MacKay 1992): squares of the deviations by
    /// the number of deviations that the readings determine.
    fn learn_spreads(&mut self) {
        let turned = self.shared.boresight_sigma * self.shared.boresight_sigma;
        let gained = self.shared.gain_sigma_db * self.shared.gain_sigma_db;
        let mut boresights =
            (BORESIGHTS_BEFORE, BORESIGHTS_BEFORE * BORESIGHT_SIGMA * BORESIGHT_SIGMA);
        let mut gains = (GAINS_BEFORE, GAINS_BEFORE * GAIN_SIGMA_DB * GAIN_SIGMA_DB);
        for own in &self.stations {
            let variances = own.boresight_variances.iter().zip(&own.gain_variances);
            for (antenna, (of_boresight, of_gain)) in own.antennas.iter().zip(variances) {
                let off = angle::wrap(antenna.boresight - antenna.recorded_boresight);
                boresights.0 += (1.0 - of_boresight / turned).clamp(0.0, 1.0);
                boresights.1 += off * off;
                gains.0 += (1.0 - of_gain / gained).clamp(0.0, 1.0);
                gains.1 += antenna.gain_db * antenna.gain_db;
            }
        }
        self.shared.boresight_sigma =
            libm::sqrt(boresights.1 / boresights.0).clamp(LEAST_BORESIGHT_SIGMA, ANY_DIRECTION);
        let [least, most] = GAIN_SIGMAS_DB;
        self.shared.gain_sigma_db = libm::sqrt(gains.1 / gains.0).clamp(least, most);
    }

    fn learn_sites(&mut self, bursts: &Bursts<'_>, rounds: u32) {
        self.scale_with_site = self.shared.scale;
        for round in 0..rounds {
            self.level(bursts);
            if round % 5 == 4 {
                self.learn_scale(bursts);
                // Few bursts would otherwise have fitted sites that explain less than nothing.
                self.shared.scale = self.shared.scale.min(self.scale_with_site);
            }
            for (own, bursts) in self.stations.iter_mut().zip(bursts) {
                own.learn_site(bursts, &self.shared);
            }
        }
        self.fit_floor(bursts);
    }

    fn fit_floor(&mut self, bursts: &Bursts<'_>) {
        let lobe = &self.shared.lobe;
        let each = self.stations.iter().zip(bursts);
        let chances: Vec<Chance> =
            each.flat_map(|(own, bursts)| own.chances(bursts, lobe)).collect();
        self.shared.floor = self.shared.floor.fitted(chances.iter().copied(), self.shared.scale);
    }

    /// Returns the model of stations that were not fitted. Their site is part of the residual.
    pub(super) fn model(&self) -> StationModel {
        let Shared { lobe, floor, boresight_sigma, gain_sigma_db, .. } = &self.shared;
        StationModel {
            beamwidth: lobe.beamwidth,
            front_to_back_db: lobe.front_to_back_db,
            residual_db: self.scale_with_site,
            floor: Some([floor.dbm, floor.width_db]),
            boresight_sigma: *boresight_sigma,
            gain_sigma_db: *gain_sigma_db,
        }
    }

    /// Returns the pattern of a station.
    pub(super) fn pattern(&self, station: usize) -> Result<StationPattern, CalibrationError> {
        let Shared { lobe, scale, floor, .. } = &self.shared;
        let antennas = self.stations.get(station).map_or_else(Vec::new, |o| o.antennas.clone());
        StationPattern::new(antennas, lobe.beamwidth, lobe.front_to_back_db)
            .and_then(|pattern| pattern.with_residual_db(*scale))
            .and_then(|pattern| pattern.with_floor(floor.dbm, floor.width_db))
            .map_err(CalibrationError::Station)
    }
}

/// Returns the scale of the residuals with the largest value, near `start`.
pub(super) fn likeliest_scale(start: f64, value: impl Fn(f64) -> f64) -> f64 {
    let [least, most] = SCALES_DB;
    let mut scale = start.clamp(least, most);
    let mut best = value(scale);
    let mut factor = 1.3;
    while factor > 1.02 {
        let tries = [scale * factor, scale / factor].map(|tried| tried.clamp(least, most));
        let mut tried = tries.into_iter().map(|tried| (value(tried), tried));
        match tried.find(|(value, _)| *value > best + 1e-9) {
            Some((value, tried)) => (best, scale) = (value, tried),
            None => factor = libm::sqrt(factor),
        }
    }
    scale
}
