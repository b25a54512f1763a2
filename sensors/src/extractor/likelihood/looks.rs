use alloc::vec::Vec;

use foxhunt_core::{NoReading, Pose, Sweep, angle};

use crate::extractor::check;

/// Readings of a turn along one boresight.
#[derive(Clone, Copy, Debug)]
pub(in crate::extractor) struct Look {
    /// Boresight in radians counter-clockwise of the turn's first one.
    pub(in crate::extractor) offset: f64,
    /// Position and tilt of the body.
    pub(in crate::extractor) receiver: Pose,
    /// The boresight in radians counter-clockwise of the nose.
    pub(in crate::extractor) mount: f64,
    /// The mean of the readings in dB.
    pub(in crate::extractor) mean_dbm: f64,
    /// Number of readings.
    pub(in crate::extractor) count: f64,
}

/// A turn's readings gathered by boresight, each with its own: bins of a turning body are not all
/// looked through along their nominal angle.
///
/// Angles are counted from the first boresight, so that a sweep that is turned as a whole gives
/// the same numbers.
#[derive(Clone, Debug)]
pub(in crate::extractor) struct Looks {
    pub(in crate::extractor) looks: Vec<Look>,
    /// Zero of the angles, in the world frame.
    pub(in crate::extractor) origin: f64,
    /// The sum of squares of the readings about their look's mean, in dB².
    scatter: f64,
    /// Its degrees of freedom.
    freedom: f64,
    /// Readings come in whole dB.
    pub(in crate::extractor) whole_db: bool,
    /// The antenna is nowhere tilted by more than a degree.
    pub(in crate::extractor) level: bool,
    /// The largest pitch or roll, in radians.
    pub(in crate::extractor) tilt: f64,
}

/// Readings whose boresights differ by less than this, in radians, are of one look: a quarter of
/// a degree to either side changes the gain of a 30° lobe by less than 0.01 dB on average.
pub(super) const SAME_LOOK: f64 = 0.0087;

/// Below this an antenna is level, in radians.
const LEVEL: f64 = 0.0175;

/// Step of a receiver that reports whole dB: the variance of rounding is its square over 12
/// (Sheppard 1898), and no spread of readings shows less of it.
const ROUNDING_VARIANCE: f64 = 1.0 / 12.0;

impl Looks {
    pub(in crate::extractor) fn new(sweep: &Sweep<'_>) -> Result<Self, NoReading> {
        check(sweep)?;
        let origin = sweep.samples.first().map_or(0.0, |sample| sample.boresight);
        let mut of_position: Vec<Option<usize>> = Vec::new();
        of_position.resize(usize::from(sweep.positions), None);
        let mut looks: Vec<Look> = Vec::with_capacity(of_position.len());
        let tilt = |pose: &Pose| pose.pitch.abs().max(pose.roll.abs());
        let tilt = sweep.samples.iter().map(|s| tilt(&s.receiver)).fold(0.0, f64::max);
        let level = tilt < LEVEL;
        let mut scatter = 0.0;
        let mut freedom = 0.0;
        let mut whole_db = true;
        for sample in sweep.samples {
            whole_db &= (sample.rss_dbm - libm::round(sample.rss_dbm)).abs() < 1e-9;
            let Pose { pitch, roll, .. } = sample.receiver;
            let offset = angle::wrap(sample.boresight - origin);
            let same = |look: &Look| {
                let tilt = |pose: &Pose| (pose.pitch - pitch).abs().max((pose.roll - roll).abs());
                // An antenna without a direction looks everywhere, however its drone turns.
                sweep.positions == 1
                    || angle::distance(look.offset, offset) < SAME_LOOK
                        && (level || tilt(&look.receiver) < SAME_LOOK)
            };
            let last = &mut of_position[usize::from(sample.position)];
            match last.and_then(|index| looks.get_mut(index)).filter(|look| same(look)) {
                Some(look) => {
                    let off = sample.rss_dbm - look.mean_dbm;
                    look.count += 1.0;
                    look.mean_dbm += off / look.count;
                    scatter += off * (sample.rss_dbm - look.mean_dbm);
                    freedom += 1.0;
                }
                None => {
                    *last = Some(looks.len());
                    let receiver = sample.receiver;
                    let mount = angle::wrap(sample.boresight - receiver.heading);
                    looks.push(Look {
                        offset,
                        receiver,
                        mount,
                        mean_dbm: sample.rss_dbm,
                        count: 1.0,
                    });
                }
            }
        }
        Ok(Self { looks, origin, scatter, freedom, whole_db, level, tilt })
    }

    /// The variance of a reading about its look's mean: the turn's scatter, pooled with a prior of
    /// `sigma_db` that counts for `prior_freedom` degrees of freedom.
    pub(in crate::extractor) fn sample_variance(&self, sigma_db: f64, prior_freedom: f64) -> f64 {
        let pooled =
            (self.scatter + prior_freedom * sigma_db * sigma_db) / (self.freedom + prior_freedom);
        if self.whole_db { pooled.max(ROUNDING_VARIANCE) } else { pooled }
    }

    /// Number of looks, as a number to reckon with.
    pub(in crate::extractor) fn len(&self) -> f64 {
        self.looks.iter().map(|_| 1.0).sum()
    }

    /// The mean over the looks and the root mean square about it, in dB.
    pub(in crate::extractor) fn spread(&self) -> (f64, f64) {
        let mean = self.looks.iter().map(|look| look.mean_dbm).sum::<f64>() / self.len();
        let square = |look: &Look| (look.mean_dbm - mean) * (look.mean_dbm - mean);
        (mean, libm::sqrt(self.looks.iter().map(square).sum::<f64>() / self.len()))
    }
}
