use std::io::Write;

use super::{Contender, Filter, Row, Store, StoreError, StoredCampaign, read::name_of};

/// The columns of a table of runs.
const COLUMNS: [&str; 20] = [
    "program",
    "scenario",
    "planner",
    "estimator",
    "contender",
    "seed",
    "beacon",
    "ended",
    "failure",
    "duration_s",
    "error_m",
    "nees",
    "steps",
    "steps_to_3m",
    "time_to_3m_s",
    "path_m",
    "nis_sum",
    "nis_sum_of_squares",
    "nis_degrees_of_freedom",
    "nis_count",
];

/// Writes runs as CSV, a row for each run and beacon; what is absent is empty. How many rows.
///
/// # Errors
///
/// [`StoreError`] when the store cannot be read, or `out` not be written.
pub fn write_csv(store: &Store, filter: &Filter, out: impl Write) -> Result<u64, StoreError> {
    let unwritten = |error: csv::Error| StoreError::Io {
        file: store.file(),
        doing: "writing it as CSV",
        source: error.into(),
    };
    let mut writer = csv::Writer::from_writer(out);
    writer.write_record(COLUMNS).map_err(unwritten)?;
    let mut rows = 0;
    each(store, filter, |campaign, contender, beacon, row| {
        rows += 1;
        fn text<T: ToString>(value: Option<T>) -> String {
            value.map_or_else(String::new, |value| value.to_string())
        }
        let run = &row.run;
        let record = [
            campaign.program.clone(),
            campaign.scenario.clone(),
            campaign.planner.clone(),
            contender.estimator.clone(),
            contender.digest.clone(),
            row.seed.to_string(),
            beacon.to_owned(),
            text(run.outcome.map(name_of)),
            text(row.failure.as_deref()),
            text(row.duration_s),
            text(run.error_m),
            text(run.nees),
            run.steps.to_string(),
            text(run.steps_to_3m),
            text(run.time_to_3m_s),
            text(run.path_m),
            run.nis.sum.to_string(),
            run.nis.sum_of_squares.to_string(),
            run.nis.degrees_of_freedom.to_string(),
            run.nis.count.to_string(),
        ];
        writer.write_record(record).map_err(unwritten)
    })?;
    writer.flush().map_err(|error| unwritten(error.into()))?;
    Ok(rows)
}

/// Calls `take` with campaign, contender, name of the beacon and each row that a filter lets
/// through.
fn each(
    store: &Store,
    filter: &Filter,
    mut take: impl FnMut(&StoredCampaign, &Contender, &str, Row) -> Result<(), StoreError>,
) -> Result<(), StoreError> {
    let contenders = store.contenders()?;
    for campaign in store.campaigns()?.iter().filter(|campaign| filter.campaign(campaign)) {
        let own = contenders.iter().filter(|contender| contender.campaign == campaign.id);
        for contender in own.filter(|contender| filter.contender(contender)) {
            store.rows(contender, &filter.seeds(), |row| {
                let name = campaign.beacons.get(row.beacon).map_or("", |name| &name[..]);
                if filter.beacon.as_ref().is_none_or(|wanted| wanted == name) {
                    take(campaign, contender, name, row)?;
                }
                Ok::<_, StoreError>(())
            })?;
        }
    }
    Ok(())
}
