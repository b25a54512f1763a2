use serde::Serialize;

use super::{Contender, Filter, Store, StoreError};
use crate::{Paired, PairedDifference, campaign::BeaconRun};

/// The comparison of two contenders of a store on one beacon over the seeds that both have.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SeedBySeed {
    /// The contender whose figures come first.
    pub first: String,
    /// The one that it is compared with.
    pub second: String,
    /// The beacon's name.
    pub beacon: String,
    /// The figure that is compared, as the column of the store is called.
    pub figure: &'static str,
    /// The first one's figure minus the second one's; absent for less than two runs.
    pub difference: Option<PairedDifference>,
    /// The first one's figure over the second one's; absent where there are no ratios.
    pub ratio: Option<Paired>,
}

/// A figure that is compared: a column and its value, where a run has one.
type Figure = (&'static str, fn(&BeaconRun) -> Option<f64>);

const FIGURES: [Figure; 4] = [
    ("error_m", |run| Some(run.sample()?.error_m)),
    ("steps_to_3m", |run| run.steps_to_3m.map(f64::from)),
    ("time_to_3m_s", |run| run.time_to_3m_s),
    ("path_m", |run| run.path_m),
];

/// Compares two contenders, seed by seed; runs that lack a figure with either are left out of its
/// comparison. Contenders are named by their estimators, with or without the beginning of the
/// digest; they may be of different campaigns. The figures are kept in memory, 136 bytes for each
/// run.
///
/// # Errors
///
/// [`StoreError`] when a name is not that of exactly one contender that the filter lets through, or
/// the file cannot be read.
pub fn compare(
    store: &Store,
    filter: &Filter,
    first: &str,
    second: &str,
) -> Result<Vec<SeedBySeed>, StoreError> {
    let campaigns = store.campaigns()?;
    let let_through =
        |id| campaigns.iter().any(|campaign| campaign.id == id && filter.campaign(campaign));
    let mut contenders = store.contenders()?;
    contenders.retain(|contender| let_through(contender.campaign));
    let first = named(store, &contenders, first)?;
    let second = named(store, &contenders, second)?;
    let names = |contender: &Contender| {
        campaigns.iter().find(|c| c.id == contender.campaign).map_or(&[][..], |c| &c.beacons)
    };
    let mut comparisons = Vec::new();
    for (index, beacon) in names(first).iter().enumerate() {
        let wanted = filter.beacon.as_ref().is_none_or(|wanted| wanted == beacon);
        let other = names(second).iter().position(|name| name == beacon);
        let (true, Some(other)) = (wanted, other) else { continue };
        let figures = |run: &BeaconRun| FIGURES.map(|(_, figure)| figure(run));
        let mut own = Vec::new();
        store.for_each_run(first, &filter.seeds(), |seed, beacon, run| {
            if beacon == index {
                own.push((seed, figures(&run)));
            }
            Ok(())
        })?;
        let mut pairs = FIGURES.map(|_| Vec::new());
        store.for_each_run(second, &filter.seeds(), |seed, beacon, run| {
            if beacon == other
                && let Ok(at) = own.binary_search_by_key(&seed, |(seed, _)| *seed)
            {
                for ((pairs, a), b) in pairs.iter_mut().zip(own[at].1).zip(figures(&run)) {
                    pairs.extend(a.zip(b));
                }
            }
            Ok(())
        })?;
        for ((figure, _), pairs) in FIGURES.iter().zip(pairs) {
            comparisons.push(SeedBySeed {
                first: first.full_name(),
                second: second.full_name(),
                beacon: beacon.clone(),
                figure,
                difference: PairedDifference::of(pairs.iter().copied()),
                ratio: Paired::of(pairs),
            });
        }
    }
    Ok(comparisons)
}

/// The one contender of a name.
pub(super) fn named<'a>(
    store: &Store,
    contenders: &'a [Contender],
    name: &str,
) -> Result<&'a Contender, StoreError> {
    let found: Vec<&Contender> = contenders.iter().filter(|one| one.is(name)).collect();
    match found[..] {
        [one] => Ok(one),
        _ => Err(StoreError::Contender {
            file: store.file(),
            name: name.to_owned(),
            count: found.len(),
            known: contenders.iter().map(Contender::full_name).collect(),
        }),
    }
}
