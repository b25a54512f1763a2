use std::io::Write;

use super::{Contender, Filter, Row, Store, StoreError, StoredCampaign, read::name_of};

/// The columns of a table of runs.
pub(super) const COLUMNS: [&str; 20] = [
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

/// Writes runs as Parquet, the columns and rows of [`write_csv`]; what is absent is null. How many
/// rows. Some ten thousand of them are in memory at a time.
///
/// # Errors
///
/// [`StoreError`] when the store cannot be read, or `out` not be written.
#[cfg(feature = "parquet")]
pub fn write_parquet(
    store: &Store,
    filter: &Filter,
    out: impl Write + Send,
) -> Result<u64, StoreError> {
    use parquet::{
        errors::ParquetError,
        file::{properties::WriterProperties, writer::SerializedFileWriter},
        schema::parser::parse_message_type,
    };
    let unwritten = |error: ParquetError| StoreError::Io {
        file: store.file(),
        doing: "writing it as Parquet",
        source: std::io::Error::other(error),
    };
    let schema = columns::schema();
    let schema = parse_message_type(&schema).map_err(unwritten)?;
    let properties = WriterProperties::builder().build();
    let writer = SerializedFileWriter::new(out, schema.into(), properties.into());
    let mut writer = writer.map_err(unwritten)?;
    let mut rows = 0;
    let mut group = columns::Columns::default();
    each(store, filter, |campaign, contender, beacon, row| {
        rows += 1;
        group.push(campaign, contender, beacon, &row);
        if group.rows() < columns::ROWS_OF_GROUP {
            return Ok(());
        }
        std::mem::take(&mut group).write(&mut writer).map_err(unwritten)
    })?;
    group.write(&mut writer).map_err(unwritten)?;
    writer.close().map_err(unwritten)?;
    Ok(rows)
}

#[cfg(feature = "parquet")]
mod columns {
    use std::io::Write;

    use parquet::{
        data_type::{ByteArray, ByteArrayType, DoubleType, Int64Type},
        errors::ParquetError,
        file::writer::SerializedFileWriter,
    };

    use super::{COLUMNS, Contender, Row, StoredCampaign, name_of};

    /// The number of rows that are written at a time.
    pub(super) const ROWS_OF_GROUP: usize = 1 << 16;

    /// A column of some rows; what is absent is no value.
    enum Column {
        Text(Vec<Option<ByteArray>>),
        Whole(Vec<Option<i64>>),
        Number(Vec<Option<f64>>),
    }

    impl Column {
        /// An empty column of the kind that a name has.
        fn of(name: &str) -> Self {
            match name {
                "program" | "scenario" | "planner" | "estimator" | "contender" | "beacon"
                | "ended" | "failure" => Self::Text(Vec::new()),
                "seed" | "steps" | "steps_to_3m" | "nis_degrees_of_freedom" | "nis_count" => {
                    Self::Whole(Vec::new())
                }
                _ => Self::Number(Vec::new()),
            }
        }
    }

    /// The schema of a file.
    pub(super) fn schema() -> String {
        let column = |name: &&str| match Column::of(name) {
            Column::Text(_) => format!("optional binary {name} (UTF8);"),
            Column::Whole(_) => format!("optional int64 {name};"),
            Column::Number(_) => format!("optional double {name};"),
        };
        format!("message run {{ {} }}", COLUMNS.iter().map(column).collect::<String>())
    }

    /// Some rows, column by column.
    pub(super) struct Columns(Vec<Column>);

    impl Default for Columns {
        fn default() -> Self {
            Self(COLUMNS.iter().map(|name| Column::of(name)).collect())
        }
    }

    /// A value of a row.
    enum Cell<'a> {
        Text(Option<&'a str>),
        Whole(Option<i64>),
        Number(Option<f64>),
    }

    impl Columns {
        pub(super) fn rows(&self) -> usize {
            match self.0.first() {
                Some(Column::Text(texts)) => texts.len(),
                _ => 0,
            }
        }

        pub(super) fn push(
            &mut self,
            campaign: &StoredCampaign,
            contender: &Contender,
            beacon: &str,
            row: &Row,
        ) {
            let run = &row.run;
            let ended = run.outcome.map(name_of);
            let whole = |count: usize| Cell::Whole(i64::try_from(count).ok());
            let cells = [
                Cell::Text(Some(&campaign.program)),
                Cell::Text(Some(&campaign.scenario)),
                Cell::Text(Some(&campaign.planner)),
                Cell::Text(Some(&contender.estimator)),
                Cell::Text(Some(&contender.digest)),
                Cell::Whole(i64::try_from(row.seed).ok()),
                Cell::Text(Some(beacon)),
                Cell::Text(ended.as_deref()),
                Cell::Text(row.failure.as_deref()),
                Cell::Number(row.duration_s),
                Cell::Number(run.error_m),
                Cell::Number(run.nees),
                Cell::Whole(Some(run.steps.into())),
                Cell::Whole(run.steps_to_3m.map(i64::from)),
                Cell::Number(run.time_to_3m_s),
                Cell::Number(run.path_m),
                Cell::Number(Some(run.nis.sum)),
                Cell::Number(Some(run.nis.sum_of_squares)),
                whole(run.nis.degrees_of_freedom),
                whole(run.nis.count),
            ];
            for (column, cell) in self.0.iter_mut().zip(cells) {
                match (column, cell) {
                    (Column::Text(texts), Cell::Text(text)) => texts.push(text.map(Into::into)),
                    (Column::Whole(wholes), Cell::Whole(whole)) => wholes.push(whole),
                    (Column::Number(numbers), Cell::Number(number)) => numbers.push(number),
                    // Columns and cells stand in the same order, which a test reads back.
                    _ => {}
                }
            }
        }

        pub(super) fn write<W: Write + Send>(
            self,
            writer: &mut SerializedFileWriter<W>,
        ) -> Result<(), ParquetError> {
            if self.rows() == 0 {
                return Ok(());
            }
            let mut group = writer.next_row_group()?;
            for column in self.0 {
                let Some(mut out) = group.next_column()? else { break };
                match column {
                    Column::Text(texts) => {
                        let (values, levels) = present(texts);
                        out.typed::<ByteArrayType>().write_batch(&values, Some(&levels), None)?;
                    }
                    Column::Whole(wholes) => {
                        let (values, levels) = present(wholes);
                        out.typed::<Int64Type>().write_batch(&values, Some(&levels), None)?;
                    }
                    Column::Number(numbers) => {
                        let (values, levels) = present(numbers);
                        out.typed::<DoubleType>().write_batch(&values, Some(&levels), None)?;
                    }
                }
                out.close()?;
            }
            group.close()?;
            Ok(())
        }
    }

    /// The values that are there, and where: definition levels of 1, and of 0 for null.
    fn present<T>(cells: Vec<Option<T>>) -> (Vec<T>, Vec<i16>) {
        let levels = cells.iter().map(|cell| i16::from(cell.is_some())).collect();
        (cells.into_iter().flatten().collect(), levels)
    }
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
