//! The reports of campaigns, and the running figures that they are made of.

use foxhunt_core::Outcome;
use foxhunt_filters::{
    consistency::{ChiSquaredAverage, ChiSquaredSums, Coverage, Verdict},
    multi::Gospa,
};
use serde::Serialize;

use crate::{FirstPassage, Spread, StepSpread, simulation::Found, statistics::Running};

/// Name in reports of a planner or an estimator that is the scenario's own.
pub const OWN: &str = "scenario's own";

/// The results of a campaign.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CampaignReport {
    /// The scenario's name.
    pub scenario: String,
    /// The planner: the scenario's own, [`OWN`], unless the caller names another one; absent where
    /// nothing flies.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub planner: Option<String>,
    /// The number of hunts that each estimator flew.
    pub runs: u32,
    /// The seed of the first run; run i has this plus i.
    pub seed: u64,
    /// The estimators, in the order of the call.
    pub estimators: Vec<EstimatorCampaign>,
}

/// One estimator's campaign.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct EstimatorCampaign {
    /// The estimator's name.
    pub estimator: String,
    /// The beacons, in their order.
    pub beacons: Vec<BeaconCampaign>,
}

/// One estimator on one beacon over all runs.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct BeaconCampaign {
    /// The beacon's name.
    pub name: String,
    /// Distance from the estimate to the truth; absent when every run failed, like all that
    /// follows.
    pub error_m: Option<Spread>,
    /// Receptions that went through the estimator.
    pub steps: Option<StepSpread>,
    /// The number of steps after which the semi-major axis of the 95 % ellipse was below 3 m for
    /// the first time, over all runs; absent where nothing flies. A run that could not go on never
    /// got there.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub steps_to_3m: Option<FirstPassage>,
    /// Time until then in simulated seconds, from when the search for this beacon began.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub time_to_3m_s: Option<FirstPassage>,
    /// The distance that all drones together flew from the beginning of the search to its end, in
    /// metres, over the runs in which it ended; absent where nothing flies.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub path_m: Option<Spread>,
    /// The average normalised estimation error squared; 2 for a consistent estimator.
    pub anees: Option<f64>,
    /// The 95 % interval of a consistent estimator's ANEES.
    pub anees_interval: Option<[f64; 2]>,
    /// The verdict by the ANEES on whether the errors are as large as the covariances claim.
    pub verdict: Verdict,
    /// The share of truths inside the 95 % ellipse.
    pub coverage_95: Option<f64>,
    /// The interval that holds the true share with at least 95 %.
    pub coverage_95_interval: Option<[f64; 2]>,
    /// The average normalised innovation squared over all steps that have one.
    pub anis: Option<f64>,
    /// The 95 % interval of a consistent estimator's ANIS.
    pub anis_interval: Option<[f64; 2]>,
    /// Runs without a fix: nothing received before the search ended, not over in time, or an
    /// estimate without a positive definite covariance.
    pub failed: u32,
    /// The root mean square of a bound on the error of any estimator, such as the posterior
    /// Cramér-Rao bound, at the end; where there is one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bound_m: Option<f64>,
    /// The root mean square error over the whole track, not only at its end; where there is one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub track_rms_m: Option<f64>,
    /// The errors on the way, where the scenario sets checkpoints.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub checkpoints: Vec<Checkpoint>,
    /// All transmitters on its frequency, where the estimator looks for several; the errors above
    /// are then of the one that is nearest to the last place sought.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub transmitters: Option<TransmittersCampaign>,
}

/// Transmitters on one frequency over all runs with a fix.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct TransmittersCampaign {
    /// Distance from those that were found to those that there are: GOSPA with c = 50 m, p = 2 and
    /// α = 2.
    pub gospa_m: Spread,
    /// Share of the runs in which each was found, and nothing else.
    pub right: f64,
    /// Number of transmitters that were not found.
    pub missed: u32,
    /// Number of transmitters that were found and are not there.
    pub invented: u32,
}

/// The errors after some of the measurements.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Checkpoint {
    /// The number of measurements.
    pub measurements: u32,
    /// Distance from the estimate to the truth; absent when every run failed, like what follows.
    pub error_m: Option<Spread>,
    /// The average normalised estimation error squared; 2 for a consistent estimator.
    pub anees: Option<f64>,
    /// The root mean square of a bound on the error of any estimator, where there is one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bound_m: Option<f64>,
}

/// The figures of one run for one beacon: all that summaries are made of. A search that
/// did not end has none.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BeaconRun {
    /// The end of the search.
    pub outcome: Option<Outcome>,
    /// Distance from the estimate to the truth, in metres.
    pub error_m: Option<f64>,
    /// The normalised estimation error squared; absent where the covariance is not positive
    /// definite.
    pub nees: Option<f64>,
    /// The number of receptions that went through the estimator.
    pub steps: u32,
    /// The number of receptions after which the semi-major axis of the 95 % ellipse was below 3 m.
    pub steps_to_3m: Option<u32>,
    /// Time until then in simulated seconds, from when the search began.
    pub time_to_3m_s: Option<f64>,
    /// The distance that all drones together flew meanwhile, in metres.
    pub path_m: Option<f64>,
    /// The normalised innovations squared, summed up.
    pub nis: ChiSquaredSums,
    /// All transmitters on its frequency, where the estimator looks for several. A store does not
    /// keep it.
    pub transmitters: Option<Gospa>,
}

impl BeaconRun {
    pub(super) fn of(found: &Found) -> Self {
        let mut nis = ChiSquaredAverage::default();
        nis.extend(found.nis.iter().copied());
        Self {
            outcome: Some(found.fix.outcome),
            error_m: Some(found.error_m()),
            nees: found.nees(),
            steps: found.fix.steps,
            steps_to_3m: found.progress.steps_to_3m,
            time_to_3m_s: found.progress.time_to_3m_s,
            path_m: Some(found.progress.path_m),
            nis: nis.sums(),
            transmitters: found.gospa(),
        }
    }

    /// The figures, if they are good for a statistic.
    pub(crate) fn sample(&self) -> Option<Sample> {
        let Self { steps, nis, .. } = *self;
        let sample = Sample { error_m: self.error_m?, nees: self.nees?, steps, nis };
        // However the search ended: without a reception the estimate is the prior.
        let received = steps > 0;
        (received && sample.nees.is_finite() && sample.error_m.is_finite()).then_some(sample)
    }
}

/// The figures of one beacon in one run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Sample {
    pub error_m: f64,
    pub nees: f64,
    pub steps: u32,
    /// The normalised innovations squared, summed up.
    pub nis: ChiSquaredSums,
}

/// The running statistics of one beacon, over good runs as they come.
#[derive(Clone, Debug)]
pub(crate) struct BeaconSummary {
    errors: Running,
    steps: Running,
    anees: ChiSquaredAverage,
    anis: ChiSquaredAverage,
    coverage: Coverage,
}

impl Default for BeaconSummary {
    fn default() -> Self {
        Self {
            errors: Running::default(),
            steps: Running::default(),
            anees: ChiSquaredAverage::default(),
            anis: ChiSquaredAverage::default(),
            coverage: Coverage::new(0.95, 0.95).expect("both are in (0, 1)"),
        }
    }
}

impl BeaconSummary {
    /// Adds a good run.
    pub(crate) fn add(&mut self, sample: &Sample) {
        self.errors.add(sample.error_m);
        self.steps.add(f64::from(sample.steps));
        self.anees.add(sample.nees, 2);
        self.coverage.add_nees(sample.nees);
        self.anis.add_sums(&sample.nis);
    }

    /// The statistics of the good ones of `total` runs, without checkpoints and bounds, and without
    /// the figures of flights alone.
    pub(crate) fn report(&self, name: &str, total: u32) -> BeaconCampaign {
        let Self { errors, steps, anees, anis, coverage } = self;
        let good = u32::try_from(coverage.count()).unwrap_or(u32::MAX);
        BeaconCampaign {
            name: name.to_owned(),
            error_m: errors.spread(),
            steps: steps.step_spread(),
            steps_to_3m: None,
            time_to_3m_s: None,
            path_m: None,
            anees: anees.average(),
            anees_interval: anees.interval(),
            verdict: anees.verdict(),
            coverage_95: coverage.share(),
            coverage_95_interval: coverage.interval(),
            anis: anis.average(),
            anis_interval: anis.interval(),
            failed: total.saturating_sub(good),
            bound_m: None,
            track_rms_m: None,
            checkpoints: Vec::new(),
            transmitters: None,
        }
    }
}

impl Checkpoint {
    /// The statistics of the good runs after a number of measurements, without a bound.
    pub(crate) fn of(measurements: u32, good: &[Sample]) -> Self {
        let errors: Vec<f64> = good.iter().map(|sample| sample.error_m).collect();
        let error_m = Spread::of(&errors);
        let anees = anees(good).average();
        Self { measurements, error_m, anees, bound_m: None }
    }
}

/// The running statistics of hunts for some beacons.
#[derive(Clone, Debug)]
pub(crate) struct FlightsSummary<'a> {
    runs: u32,
    beacons: Vec<FlownBeacon<'a>>,
}

/// The running statistics of hunts for one beacon.
#[derive(Clone, Debug)]
struct FlownBeacon<'a> {
    name: &'a str,
    good: BeaconSummary,
    steps_to_3m: Running,
    time_to_3m_s: Running,
    path_m: Running,
    transmitters: TransmittersSummary,
}

/// The running statistics of several transmitters on one frequency.
#[derive(Clone, Debug, Default)]
struct TransmittersSummary {
    gospa_m: Running,
    runs: u32,
    right: u32,
    missed: u32,
    invented: u32,
}

impl TransmittersSummary {
    fn add(&mut self, gospa: &Gospa) {
        let count = |number: usize| u32::try_from(number).unwrap_or(u32::MAX);
        self.gospa_m.add(gospa.distance);
        self.runs += 1;
        self.right += u32::from(gospa.missed + gospa.false_alarms == 0);
        self.missed = self.missed.saturating_add(count(gospa.missed));
        self.invented = self.invented.saturating_add(count(gospa.false_alarms));
    }

    fn report(&self) -> Option<TransmittersCampaign> {
        Some(TransmittersCampaign {
            gospa_m: self.gospa_m.spread()?,
            right: f64::from(self.right) / f64::from(self.runs),
            missed: self.missed,
            invented: self.invented,
        })
    }
}

impl<'a> FlightsSummary<'a> {
    pub(crate) fn new(beacons: &'a [String]) -> Self {
        let beacon = |name: &'a String| FlownBeacon {
            name,
            good: BeaconSummary::default(),
            steps_to_3m: Running::default(),
            time_to_3m_s: Running::default(),
            path_m: Running::default(),
            transmitters: TransmittersSummary::default(),
        };
        Self { runs: 0, beacons: beacons.iter().map(beacon).collect() }
    }

    /// Adds a run: `of` gives its figures for the beacon of an index.
    pub(crate) fn add(&mut self, mut of: impl FnMut(usize) -> BeaconRun) {
        self.runs += 1;
        for (index, beacon) in self.beacons.iter_mut().enumerate() {
            let run = of(index);
            if let Some(sample) = run.sample() {
                beacon.good.add(&sample);
            }
            let or_never = |value: Option<f64>| value.unwrap_or(f64::INFINITY);
            beacon.steps_to_3m.add(or_never(run.steps_to_3m.map(f64::from)));
            beacon.time_to_3m_s.add(or_never(run.time_to_3m_s));
            if let Some(path_m) = run.path_m {
                beacon.path_m.add(path_m);
            }
            if let Some(gospa) = &run.transmitters {
                beacon.transmitters.add(gospa);
            }
        }
    }

    pub(crate) fn report(&self, name: &str) -> EstimatorCampaign {
        let beacon = |beacon: &FlownBeacon<'_>| BeaconCampaign {
            steps_to_3m: beacon.steps_to_3m.first_passage(),
            time_to_3m_s: beacon.time_to_3m_s.first_passage(),
            path_m: beacon.path_m.spread(),
            transmitters: beacon.transmitters.report(),
            ..beacon.good.report(beacon.name, self.runs)
        };
        let beacons = self.beacons.iter().map(beacon).collect();
        EstimatorCampaign { estimator: name.to_owned(), beacons }
    }
}

fn anees(good: &[Sample]) -> ChiSquaredAverage {
    let mut anees = ChiSquaredAverage::default();
    anees.extend(good.iter().map(|sample| (sample.nees, 2)));
    anees
}
