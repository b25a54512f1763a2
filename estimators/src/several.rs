//! An unknown number of transmitters on one frequency.

use foxhunt_core::{
    Bearing, Belief, ByQuantity, Correction, Estimate, Estimator, EstimatorError, Intake,
    Observation, ObservationError, Quantity, Reception,
    parameter::{not_negative, probability},
};
use foxhunt_filters::multi::{self, Detection, Label, LabelledMultiBernoulli, Reduction};
use nalgebra::Vector2;
use serde::{Deserialize, Serialize};

use crate::{
    BoxedEstimator,
    track::{Fed, FoundTransmitter, Untaken},
};

/// Levels that a wrong direction may have, in dB: wrong ones are spread evenly over them and over
/// the circle.
const LEVEL_WIDTH_DB: f64 = 60.0;

/// Share of a track's heaviest history below which one is dropped, and the largest number of them.
const LEAST_SHARE: f64 = 1e-3;
const MOST_HISTORIES: usize = 4;

/// Existence below which a track is dropped, and the largest number of tracks.
const LEAST_EXISTENCE: f64 = 1e-3;
const MOST_TRACKS: usize = 30;

/// Largest σ of a direction, in radians. A wider one stands for a wrong direction, of which the
/// filter has its own account.
const LARGEST_SIGMA: f64 = 1.0;

/// Existence from which on a hunt goes on for a track.
const WORTH_A_LOOK: f64 = 0.02;

/// Ratio of expected square errors from which on a hunt leaves its transmitter for another one: it
/// would go to and fro between two that are known alike.
const MUCH_WORSE: f64 = 4.0;

/// An unknown number of transmitters on one frequency: what a turn of the antenna shows of them.
///
/// The modes of a reception's bearing are then directions of different transmitters, each with its
/// share of the level.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SeveralConfig {
    /// Probability that a reception holds the direction of a transmitter that is there. A reception
    /// without any direction says nothing.
    pub detection: f64,
    /// Mean number of directions of a reception that no transmitter is in.
    pub wrong: f64,
    /// Mean number of transmitters that a reception holds for the first time.
    pub births: f64,
    /// Largest probability that a direction which no track explains is a transmitter's.
    pub most_birth: f64,
}

type Filter = LabelledMultiBernoulli<BoxedEstimator<2, 2>, 2, 2>;

/// A labelled multi-Bernoulli filter (Reuter, Vo, Vo & Dietmayer 2014) over any estimator of level
/// and bearing. Its place is that of one transmitter, the one that a hunt goes on for: it stays
/// with that until another one is much worse known.
pub(crate) struct Several {
    filter: Filter,
    /// A transmitter anywhere.
    prior: BoxedEstimator<2, 2>,
    config: SeveralConfig,
    intake: ByQuantity<2>,
    /// The transmitter that a hunt goes on for.
    sought: Option<Label>,
}

type Track = multi::Track<BoxedEstimator<2, 2>, 2>;

impl Several {
    /// No transmitter yet; each begins as `prior` with the direction that shows it first.
    pub(crate) fn new(
        config: SeveralConfig,
        prior: BoxedEstimator<2, 2>,
    ) -> Result<Self, EstimatorError> {
        let widths = [LEVEL_WIDTH_DB, std::f64::consts::TAU];
        let detection = Detection::new(config.detection, config.wrong, widths)?;
        not_negative("births", config.births)?;
        probability("most_birth", config.most_birth)?;
        let filter = LabelledMultiBernoulli::new([], 1.0, detection)?
            .with_reduction(Reduction::new(LEAST_SHARE, MOST_HISTORIES)?)
            .with_pruning(LEAST_EXISTENCE, MOST_TRACKS)?;
        let intake = ByQuantity(prior.quantities());
        Ok(Self { filter, prior, config, intake, sought: None })
    }

    /// The directions of a reception, each as an observation of its own with its share of the
    /// level; none for a reception without a direction.
    fn scan(&self, reception: &Reception) -> Result<Vec<Observation<2>>, ObservationError> {
        let mut alone = *reception;
        alone.modes = Default::default();
        let modes = reception.modes.as_slice();
        if modes.is_empty() {
            let one = self.intake.observation(&alone)?.filter(|_| reception.has_bearing());
            return Ok(one.into_iter().collect());
        }
        let mut scan = Vec::with_capacity(modes.len());
        for mode in modes.iter().filter(|mode| mode.sigma <= LARGEST_SIGMA) {
            let mut one = alone;
            let bearing = Bearing {
                angle: mode.angle,
                sigma: mode.sigma,
                confidence: alone.bearing.map_or(0.0, |bearing| bearing.confidence),
            };
            one.bearing = Some(bearing);
            // The covariance is that of the level of all with their mean direction.
            one.covariance = 0.0;
            if let Some(level) = &mut one.level {
                level.rss_dbm += 10.0 * libm::log10(mode.weight);
            }
            scan.extend(self.intake.observation(&one)?);
        }
        Ok(scan)
    }

    /// The track of the transmitter that is sought.
    fn sought(&self) -> Option<&Track> {
        self.filter.tracks().iter().find(|track| Some(track.label()) == self.sought)
    }

    /// Decides which transmitter is sought: the one with the largest expected square error, its
    /// existence taken into account.
    fn seek(&mut self) {
        let loss = |track: &Track| track.existence() * track.estimate().covariance.trace();
        let tracks = self.filter.tracks().iter();
        let worth = tracks.filter(|track| track.existence() >= WORTH_A_LOOK);
        let worst = worth.max_by(|a, b| loss(a).total_cmp(&loss(b)));
        let now = self.sought().filter(|track| track.existence() >= WORTH_A_LOOK);
        let stays = worst.zip(now).is_some_and(|(worst, now)| loss(worst) < MUCH_WORSE * loss(now));
        if !stays {
            self.sought = worst.map(Track::label);
        }
    }
}

impl Belief for Several {
    fn position(&self) -> Estimate<2> {
        self.sought().map_or_else(|| self.prior.estimate(), |track| *track.estimate())
    }

    fn visit_positions(&self, visit: &mut dyn FnMut(&Vector2<f64>, f64)) {
        match self.sought() {
            Some(track) => track.visit_samples::<2>(visit),
            None => self.prior.visit_samples(visit),
        }
    }
}

impl Fed for Several {
    fn quantities(&self) -> Vec<Quantity> {
        self.intake.quantities().to_vec()
    }

    fn update(&mut self, dt: f64, reception: &Reception) -> Result<(Correction, usize), Untaken> {
        let scan = self.scan(reception).map_err(Untaken::before)?;
        self.prior.predict(dt).map_err(Untaken::before)?;
        self.filter.predict(dt).map_err(Untaken::before)?;
        if scan.is_empty() {
            return Ok((Correction::Empty, 0));
        }
        let associations = self.filter.update(&scan).map_err(Untaken::after)?;
        let SeveralConfig { births, most_birth, .. } = self.config;
        // A reception whose directions are all explained shows nothing for the first time.
        let unexplained: f64 = (0..scan.len()).map(|index| associations.clutter(index)).sum();
        let births = births * unexplained.min(1.0);
        let added = self.filter.add_births(&self.prior, &scan, &associations, births, most_birth);
        added.map_err(Untaken::after)?;
        self.seek();
        let fused = Correction::Fused { nis: None, log_evidence: 0.0, effective_sample_size: None };
        Ok((fused, 0))
    }

    fn as_belief(&self) -> &dyn Belief {
        self
    }

    fn found(&self) -> Option<Vec<FoundTransmitter>> {
        let found = self.filter.found();
        let transmitter = |track: &&Track| FoundTransmitter {
            existence: track.existence(),
            estimate: *track.estimate(),
        };
        Some(found.iter().map(transmitter).collect())
    }
}
