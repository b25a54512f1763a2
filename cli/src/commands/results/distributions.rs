use foxhunt::{
    campaign::EstimatorCampaign,
    picture::Distribution,
    store::{Filter, Held, Store, StoreError, Summary},
};

use crate::{commands::storing::reading, error::CliError};

/// Returns the distributions of one campaign's runs for one beacon, and their title.
pub(in crate::commands) fn titled_distributions(
    store: &Store,
    filter: &Filter,
) -> Result<(String, Vec<Distribution>), CliError> {
    let summaries = store.summaries(filter).map_err(reading)?;
    let [summary] = &summaries[..] else {
        return Err(CliError::input(format!(
            "a picture shows one campaign, and {} fit; choose with --scenario and --planner",
            summaries.len()
        )));
    };
    let campaign = &summary.campaign;
    let wanted = |name: &&String| filter.beacon.as_ref().is_none_or(|beacon| beacon == *name);
    let names: Vec<&String> = campaign.beacons.iter().filter(wanted).collect();
    let [name] = names[..] else {
        return Err(CliError::input(format!(
            "a picture shows one beacon; choose one of {} with --beacon",
            campaign.beacons.join(", ")
        )));
    };
    let beacon = campaign.beacons.iter().position(|beacon| beacon == name).unwrap_or(0);
    let distributions = distributions(store, filter, summary, beacon)?;
    let title = format!("{}, {name}, planner {}", campaign.scenario, campaign.planner);
    Ok((title, distributions))
}

/// Returns the errors and the NEES of each contender's runs for the beacon of an index.
pub(super) fn distributions(
    store: &Store,
    filter: &Filter,
    summary: &Summary,
    beacon: usize,
) -> Result<Vec<Distribution>, CliError> {
    let distribution = |(held, of): (&Held, &EstimatorCampaign)| {
        let [errors_m, nees] = store.samples(&held.contender, beacon, filter)?;
        Ok(Distribution { name: of.estimator.clone(), errors_m, nees })
    };
    let of = summary.held.iter().zip(&summary.report.estimators).map(distribution);
    of.collect::<Result<_, StoreError>>().map_err(reading)
}
