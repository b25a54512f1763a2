use std::borrow::Cow;

use foxhunt_core::{
    BeaconId, BearingModes, Correction, Estimate, Level, MeasuredList, Pose, Quantity, Reception,
    Receptions, Remark,
};
use foxhunt_filters::ShadowingGridConfig;
use foxhunt_sensors::{AntennaError, LogDistance, OverTerrain, RssBearing};
use nalgebra::Vector3;

use super::{EstimatorEntry, Need, Registry, RegistryError, TrackRequest};
use crate::{
    config::{EstimatorConfig, ModelConfig, PulseModel, ReceiverModel},
    hunt::{Components, Search, TrackStep, cloud},
    locate::{
        Area, AtEnds, CalibratedPower, FREE_POWER_SIGMA_DB, Height, LocateConfig, LocateError,
        Located, Locator, Paths, Power, Residual, Uses, examine, extent_m, receiver_sigma_m,
        reference_power, residuals,
    },
};

/// Number of places that stand for a belief.
const PLACES: u32 = 2000;

impl EstimatorEntry {
    /// Locates a transmitter that stays where it is, from the receptions of one or more drones: one
    /// drone after the other, each in the order of its path. An estimator that takes all at once
    /// gets them so; any other one gets them in the order of time, through a
    /// [`Track`](crate::hunt::Track) as in flight.
    ///
    /// # Errors
    ///
    /// [`LocateError`] when there is too little to go by, or the estimator cannot use it.
    pub fn locate(
        &self,
        receptions: &Receptions,
        config: &LocateConfig,
    ) -> Result<Located, LocateError> {
        self.locate_named(receptions, config, &|_| None)
    }

    /// Locates a transmitter as [`locate`](Self::locate) does; remarks on single receptions call
    /// them as `name` says of their index, such as by file and line.
    ///
    /// # Errors
    ///
    /// [`LocateError`] when there is too little to go by, or the estimator cannot use it.
    pub fn locate_named(
        &self,
        receptions: &Receptions,
        config: &LocateConfig,
        name: &dyn Fn(usize) -> Option<String>,
    ) -> Result<Located, LocateError> {
        let holds = |r: &Reception| r.level.is_some() || r.has_bearing() || !r.measured.is_empty();
        if !receptions.kinds().iter().any(holds) {
            return Err(LocateError::Nothing { receptions: receptions.len() });
        }
        if config.pattern.is_some() && !self.uses_antennas() {
            return Err(LocateError::NoUseOfAntennas { estimator: self.name.clone().into_owned() });
        }
        if config.terrain.is_some() && !self.uses_terrain() {
            return Err(LocateError::NoUseOfTerrain { estimator: self.name.clone().into_owned() });
        }
        let can_estimate = self.locator().is_some_and(Locator::estimates_height);
        let recorded = receptions;
        let given = config;
        let config = &config.decided(can_estimate, receptions);
        if config.height == Height::Free && !can_estimate {
            return Err(LocateError::NoFreeHeight { estimator: self.name.clone().into_owned() });
        }
        let receptions = &*on_clock(receptions, config);
        let mut located = self.unexamined(receptions, config)?;
        let config = &LocateConfig { target_up_m: located.up_m(config), ..config.clone() };
        let uses = self.uses();
        let outliers = examine(&mut located, receptions, config, uses, name);
        if let Some(found) = located.clock_offset.take() {
            let stated = LocateConfig { clock_offset_s: Some(found.offset_s), ..given.clone() };
            if let Ok(joined) = self.locate_named(recorded, &stated, name) {
                return Ok(joined.with_clock(found, &located.estimate.mean));
            }
        }
        if outliers.is_empty() {
            return Ok(located);
        }
        let kept = receptions.iter().enumerate().map(|(index, reception)| {
            if outliers.contains(&index) { without_geometry(reception) } else { reception }
        });
        let kept: Receptions = kept.collect();
        let without = self.unexamined(&kept, config);
        match without {
            Ok(mut without) if self.leaves_out_outliers() => {
                without.rejected += outliers.len();
                let up_m = without.up_m(config);
                let config = &LocateConfig { target_up_m: up_m, ..config.clone() };
                let _ = examine(&mut without, &kept, config, uses, name);
                // What the outliers themselves cast doubt on is settled without them.
                let told = located.remarks.into_iter().filter(|remark| remark.code == "outlier");
                let told = told.map(|remark| Remark {
                    text: format!("{}; it was left out", remark.text),
                    ..remark
                });
                without.remarks.splice(..0, told);
                without.outliers = outliers;
                Ok(without)
            }
            Ok(without) => {
                let place = &without.estimate.mean;
                for remark in located.remarks.iter_mut().filter(|r| r.code == "outlier") {
                    remark.text += &format!(
                        "; without the outliers the place would be at {:.1} m East, {:.1} m \
                         North; leave them out with --ignore if they are wrong",
                        place.x, place.y
                    );
                }
                Ok(located)
            }
            Err(_) => Ok(located),
        }
    }

    /// Returns the doubts about a place that the estimator found in flight, from receptions one
    /// after the other, by the law that it took for that of propagation.
    #[must_use]
    pub fn remarks_in_flight(
        &self,
        estimate: &Estimate<2>,
        receptions: &Receptions,
        model: &ModelConfig,
    ) -> Vec<Remark> {
        let knows_power = self.settings().is_none_or(|s| s.power_sigma_db.is_none());
        let ModelConfig { reference_dbm, exponent, .. } = *model;
        let config = LocateConfig {
            power: match knows_power {
                true => Power::Known { reference_dbm, exponent },
                false => Power::FreeReference { exponent },
            },
            target_up_m: model.target_up_m,
            reference_m: model.reference_m.map(Vector3::from),
            // Nothing is located again in flight.
            clock_offset_s: Some(0.0),
            ..LocateConfig::default()
        };
        let uses = self.uses();
        // The log-distance law alone is examined; antennas and terrain bend it.
        let follows_law =
            model.antenna.is_none() && model.terrain.is_none() && !self.takes_samples();
        let levels = uses.levels && follows_law;
        let uses = Uses { levels, searches_area: false, ..uses };
        let mut located = Located::at(*estimate);
        let _ = examine(&mut located, receptions, &config, uses, &|_| None);
        located.remarks
    }

    /// Returns the residual of each measurement from the place that [`locate`](Self::locate) found
    /// by the same receptions, in their order.
    #[must_use]
    pub fn residuals(
        &self,
        located: &Located,
        receptions: &Receptions,
        config: &LocateConfig,
    ) -> Vec<Residual> {
        let offset_s = located.clock_offset.map(|found| found.offset_s);
        let config = LocateConfig {
            target_up_m: located.up_m(config),
            clock_offset_s: offset_s.or(config.clock_offset_s),
            ..config.clone()
        };
        residuals(located, &on_clock(receptions, &config), &config, self.uses())
    }

    /// Locates a transmitter without a look at how well the receptions fit.
    fn unexamined(
        &self,
        receptions: &Receptions,
        config: &LocateConfig,
    ) -> Result<Located, LocateError> {
        let receptions = &*about_law(receptions, config.power);
        let Some(locator) = self.locator() else { return in_time(receptions, self, config) };
        let located = locator.locate(receptions, config).map_err(|source| LocateError::Named {
            estimator: self.name.clone().into_owned(),
            source: Box::new(source),
        })?;
        Ok(match receiver_sigma_m(receptions) {
            sigma_m if sigma_m > 0.0 && !locator.uses_receiver_sigma() => located.shifted(sigma_m),
            _ => located,
        })
    }

    /// Returns the components of receptions that an answer depends on.
    fn uses(&self) -> Uses {
        let needs = self.needs();
        Uses {
            levels: needs.level != Need::Unused,
            bearings: needs.bearing != Need::Unused,
            differences: needs.others.contains(&Quantity::RANGE_DIFFERENCE),
            searches_area: self.locator().is_none(),
        }
    }

    /// Returns true if it takes one reception after the other, levels among them.
    fn streams_levels(&self) -> bool {
        let uses =
            |settings: &EstimatorConfig| settings.track.components != Components::BearingOnly;
        self.settings().is_some_and(uses)
    }

    /// Returns true if terrain is in its model of levels.
    fn uses_terrain(&self) -> bool {
        self.locator().is_none() && (self.streams_levels() || self.takes_samples())
    }

    /// Returns true if the antennas' pattern is in its model of levels.
    fn uses_antennas(&self) -> bool {
        match self.locator() {
            Some(locator) => locator.uses_antennas(),
            None => self.streams_levels() || self.takes_samples(),
        }
    }
}

impl Registry {
    /// The estimator that suits some receptions of a still transmitter: the grid with correlated
    /// shadowing where there are levels alone, and with `batch` where there are bearings beside
    /// levels of enough places; with `batch` the grid of bearings where there are bearings alone,
    /// each with one direction, multilateration where there are ranges alone, and range differences
    /// where there are these alone; level differences alone have `level-difference`; else the
    /// particle filter, which takes them as they are.
    ///
    /// # Errors
    ///
    /// [`RegistryError`] where it is not in the registry.
    pub fn suited_to(&self, receptions: &Receptions) -> Result<&EstimatorEntry, RegistryError> {
        let kinds = || receptions.kinds().iter();
        let bearings = kinds().any(Reception::has_bearing);
        let plain =
            |r: &Reception| r.level.is_none() && r.bearing.is_some() && r.measured.is_empty();
        let levels = || kinds().all(|r| r.measured.is_empty()) && have_levels_of_places(receptions);
        let only = |quantity| {
            let holds = |r: &Reception| r.measured.get(quantity).is_some();
            !bearings && kinds().all(|r| r.any_level().is_none() && holds(r))
        };
        if !receptions.is_empty() {
            if only(Quantity::RSS_DIFFERENCE) {
                return self.estimator("level-difference");
            }
            if cfg!(feature = "batch") && only(Quantity::RANGE) {
                return self.estimator("multilateration");
            }
            if cfg!(feature = "batch") && only(Quantity::RANGE_DIFFERENCE) {
                return self.estimator("range-differences");
            }
        }
        self.estimator(match bearings {
            true if cfg!(feature = "batch") && kinds().all(plain) => "bearing-grid",
            true if cfg!(feature = "batch") && levels() => "shadowing-grid",
            true => "particle",
            false => "shadowing-grid",
        })
    }
}

/// Returns the receptions with the receivers where they were by the measurements' clock.
fn on_clock<'a>(receptions: &'a Receptions, config: &LocateConfig) -> Cow<'a, Receptions> {
    match config.clock_offset_s {
        Some(offset_s) if offset_s.abs() > 0.0 => {
            Cow::Owned(Paths::new(receptions).shifted(offset_s, 1, AtEnds::Without))
        }
        Some(_) | None => Cow::Borrowed(receptions),
    }
}

/// Returns the receptions with at least the calibration's σ of levels.
fn about_law(receptions: &Receptions, power: Power) -> Cow<'_, Receptions> {
    let Power::Calibrated(CalibratedPower { sigma_db, .. }) = power else {
        return Cow::Borrowed(receptions);
    };
    let widened = |level: &mut Level| level.sigma_db = level.sigma_db.max(sigma_db);
    let own = receptions.iter().map(|mut reception| {
        let levels = [&mut reception.level, &mut reception.silence, &mut reception.saturation];
        levels.into_iter().flatten().for_each(widened);
        reception
    });
    Cow::Owned(own.collect())
}

/// Returns a reception without its bearing and its other measurements; the level stays.
fn without_geometry(reception: Reception) -> Reception {
    Reception {
        bearing: None,
        modes: BearingModes::default(),
        covariance: 0.0,
        measured: MeasuredList::default(),
        ..reception
    }
}

/// Returns true if there are levels of the three places that `shadowing-grid` needs.
fn have_levels_of_places(receptions: &Receptions) -> bool {
    let extent_m = extent_m(receptions);
    let apart_m = ShadowingGridConfig::over(extent_m).segment_m;
    let mut last: Option<Pose> = None;
    let apart = receptions.iter().filter(|reception| {
        let place = reception.receiver.position.xy();
        let moved = last.is_none_or(|last| (place - last.position.xy()).norm() >= apart_m);
        let counts = reception.level.is_some() && moved;
        if counts {
            last = Some(reception.receiver);
        }
        counts
    });
    apart.take(3).count() == 3
}

/// One reception after the other, in the order of time.
fn in_time(
    receptions: &Receptions,
    estimator: &EstimatorEntry,
    config: &LocateConfig,
) -> Result<Located, LocateError> {
    if estimator
        .settings()
        .is_some_and(|settings| settings.receivers.is_some() || settings.several.is_some())
    {
        return Err(LocateError::OfHunts);
    }
    let area = Area::about(receptions, config.margin_m);
    let prior = area.prior();
    let (law, power_sigma_db) = match config.power.law() {
        Some((reference_dbm, exponent)) => {
            let sigma_db = config.power.centroid().map(|law| law.most_sigma_db(area.side()));
            (LogDistance::new(reference_dbm, exponent)?, sigma_db.filter(|sigma| *sigma > 0.0))
        }
        None => {
            let exponent = config.power.exponent();
            let up = config.target_up_m;
            let power = reference_power(receptions, &prior.mean, up, exponent)?;
            (LogDistance::new(power, exponent)?, Some(FREE_POWER_SIGMA_DB))
        }
    };
    let model = RssBearing::new(law).with_target_up(config.target_up_m)?;
    let model = config.through_antennas(model)?;
    let loss = config.terrain_loss()?;
    let model: ReceiverModel = match &loss {
        Some(loss) => OverTerrain::new(model, loss.clone()).with_target_up(config.target_up_m)?,
        None => model.into(),
    };
    // Who does not use levels needs no power; who has settings is given the one that is not known.
    let estimator = match power_sigma_db {
        Some(sigma_db) if estimator.streams_levels() => {
            let change = |settings: &mut EstimatorConfig| settings.power_sigma_db = Some(sigma_db);
            estimator.with_settings("power_sigma_db", change)?
        }
        _ => estimator.clone(),
    };
    let pulses = match &config.antenna {
        Some(antenna) if estimator.takes_samples() => {
            let reason = |error: AntennaError| LocateError::Antenna { reason: error.to_string() };
            let antenna = antenna.build().map_err(reason)?;
            let mut pulses = config.pulses;
            if let Some(sigma_db) = power_sigma_db {
                pulses.power_sigma_db = sigma_db;
            }
            let model = PulseModel::new(law, antenna, config.target_up_m, pulses)?;
            Some(match loss {
                Some(loss) => model.over_terrain(loss),
                None => model,
            })
        }
        _ => None,
    };
    let beacon = BeaconId(0);
    let request = TrackRequest {
        search: Search { beacon, name: "transmitter", prior },
        model: &model,
        reference: config.reference_m,
        pulses: pulses.as_ref(),
        seed: config.seed,
    };
    let mut track = estimator.track(&request, false).map_err(LocateError::Start)?;
    let mut used = 0;
    let mut left_out = Vec::new();
    for (index, reception) in receptions.in_time() {
        // A recording has no formation positions.
        match track.update(&reception, false) {
            Ok(TrackStep::Updated { correction: Correction::Fused { .. }, .. }) => used += 1,
            Ok(TrackStep::Updated { correction: Correction::Rejected { .. }, .. }) => {
                left_out.push(index);
            }
            Ok(TrackStep::Updated { .. } | TrackStep::Skipped) => {}
            Err(source) => {
                return Err(LocateError::Reception { index, time: reception.time, source });
            }
        }
    }
    if used == 0 {
        return Err(LocateError::NotUsed {
            estimator: estimator.name.clone().into_owned(),
            receptions: receptions.len(),
            quantities: track.quantities(),
        });
    }
    Ok(Located {
        observations: used,
        rejected: left_out.len(),
        left_out,
        places: cloud(track.belief(), PLACES).unwrap_or_default(),
        ..Located::of_belief(track.belief())
    })
}
