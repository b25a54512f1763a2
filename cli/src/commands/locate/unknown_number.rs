//! An unknown number of transmitters on one frequency.

use foxhunt::{
    locate::{Absence, Transmitter, Transmitters},
    overview::SearchOverview,
    struck::RowId,
};
use serde::Serialize;

use super::{
    super::locating::{Prepared, Received, not_located},
    found::{Found, Others},
};
use crate::{
    error::CliError,
    table::{number, table},
};

/// Transmitters of an unknown number in JSON, each with a report of the type `R`.
#[derive(Debug, Serialize)]
pub struct Several<R> {
    beacon: Option<String>,
    /// Distribution of the number of transmitters with two bearings or more; empty for a silent
    /// search.
    numbers: Vec<f64>,
    transmitters: Vec<OneOfSeveral<R>>,
    /// Rows that belong to none of the transmitters.
    unassigned: Vec<RowId>,
    /// Statement of a search that received nothing.
    absence: Option<Absence>,
}

/// One of several transmitters in JSON.
#[derive(Debug, Serialize)]
struct OneOfSeveral<R> {
    existence: f64,
    /// Rows that belong to it.
    belonging: Vec<Belonging>,
    #[serde(flatten)]
    report: R,
}

/// Row that belongs to a transmitter, with the probability that it does.
#[derive(Debug, Serialize)]
struct Belonging {
    #[serde(flatten)]
    row: RowId,
    probability: f64,
}

impl<R> Several<R> {
    /// Returns the rows that belong to no transmitter: all of a silent search.
    pub fn others(&self) -> Others<'_> {
        let rows = self.absence.is_none().then_some(&*self.unassigned);
        Others { beacon: self.beacon.as_deref(), rows }
    }
}

/// Sorts the receptions by transmitter, and locates each by `locate`.
pub fn several<R>(
    prepared: &Prepared,
    beacon: Option<String>,
    locate: impl Fn(Received) -> Result<(R, Found), CliError>,
) -> Result<(Several<R>, Vec<Found>), CliError> {
    let received = prepared.received(beacon.as_deref())?;
    let config = prepared.config();
    if let Some(absence) = Absence::of(received.receptions(), config) {
        let silent = Several {
            beacon,
            numbers: Vec::new(),
            transmitters: Vec::new(),
            unassigned: Vec::new(),
            absence: Some(absence),
        };
        return Ok((silent, Vec::new()));
    }
    let sorted = Transmitters::sort(received.receptions(), config).map_err(not_located)?;
    let mut transmitters = Vec::new();
    let mut found = Vec::new();
    for (number_of, transmitter) in (1..).zip(&sorted.found) {
        let name = format!("transmitter {number_of}");
        let belonging = belonging(transmitter, prepared, &received);
        let rows = belonging.iter().map(|of| of.row.clone()).collect();
        let (report, place) = locate(received.only(&transmitter.receptions))?;
        let search = SearchOverview { name, ..place.search };
        found.push(Found { search, rows: Some(rows), ..place });
        transmitters.push(OneOfSeveral { existence: transmitter.existence, belonging, report });
    }
    let unassigned = sorted.clutter.iter().filter_map(|index| prepared.row(&received, *index));
    let unassigned = unassigned.collect();
    let numbers = sorted.numbers;
    Ok((Several { beacon, numbers, transmitters, unassigned, absence: None }, found))
}

fn belonging(
    transmitter: &Transmitter,
    prepared: &Prepared,
    received: &Received,
) -> Vec<Belonging> {
    let rows = transmitter.receptions.iter().zip(&transmitter.memberships);
    rows.filter_map(|(index, probability)| {
        Some(Belonging { row: prepared.row(received, *index)?, probability: *probability })
    })
    .collect()
}

/// Returns the answer as text: `cells` makes the cells of a report in the table, and `details` the
/// text below it.
pub fn answer<R>(
    several: &Several<R>,
    cells: impl Fn(&R) -> Vec<String>,
    details: impl Fn(&R, &str) -> String,
) -> String {
    if let Some(absence) = &several.absence {
        return absent(absence);
    }
    let mut places = table(&[
        "transmitter",
        "existence",
        "estimator",
        "lat °",
        "lon °",
        "east m",
        "north m",
        "95 % ellipse m",
        "along °",
        "rows",
    ]);
    for (number_of, OneOfSeveral { existence, belonging, report }) in
        (1..).zip(&several.transmitters)
    {
        let mut row = vec![i32::to_string(&number_of), number(*existence, 2)];
        row.extend(cells(report));
        row.push(belonging.len().to_string());
        places.add_row(row);
    }
    let probable = several.numbers.iter().enumerate().filter(|(_, p)| **p >= 0.005);
    let probable: Vec<String> =
        probable.map(|(count, p)| format!("{count} ({:.0} %)", 100.0 * p)).collect();
    let numbers = probable.join(", ");
    let mut rows = String::new();
    for (number_of, OneOfSeveral { belonging, .. }) in (1..).zip(&several.transmitters) {
        let own = belonging.iter().map(|of| &of.row);
        rows += &format!("\nRows of transmitter {number_of}: {}.", lines(own));
    }
    if !several.unassigned.is_empty() {
        rows += &format!("\nRows of no transmitter: {}.", lines(several.unassigned.iter()));
    }
    let places = match several.transmitters.is_empty() {
        true => "No place is more probable than a coincidence of bearings.".to_owned(),
        false => format!(
            "{places}\nThe ellipse's semi-axes, and the direction of the longer one \
             counter-clockwise from East, if the transmitter exists."
        ),
    };
    let details: String = (1..)
        .zip(&several.transmitters)
        .map(|(number_of, of)| details(&of.report, &format!(" of transmitter {number_of}")))
        .collect();
    format!(
        "{places}\nNumber of transmitters with two bearings or more, and its probability: \
         {numbers}.{rows}{details}"
    )
}

/// Lines of files, in ranges.
fn lines<'a>(rows: impl Iterator<Item = &'a RowId>) -> String {
    let mut ranges: Vec<(&str, u64, u64)> = Vec::new();
    for row in rows {
        match ranges.last_mut() {
            Some((file, _, last)) if *file == row.file && *last + 1 == row.line => *last += 1,
            _ => ranges.push((&row.file, row.line, row.line)),
        }
    }
    let mut text = String::new();
    let mut named = None;
    for (file, first, last) in ranges {
        if named != Some(file) {
            text += if named.is_none() { "" } else { "; " };
            text += &format!("{file} ");
        } else {
            text += ", ";
        }
        named = Some(file);
        text += &if first == last { first.to_string() } else { format!("{first}–{last}") };
    }
    text
}

/// Returns the statement of a silent search.
fn absent(absence: &Absence) -> String {
    let Absence { confidence, weakest_dbm, existence, silences, places, centre, side_m, .. } =
        absence;
    let stated = existence.map_or_else(String::new, |existence| {
        format!("\nA transmitter of the stated power is there with {:.1} %.", 100.0 * existence)
    });
    format!(
        "None is here with {:.0} %, unless it is weaker than {weakest_dbm:.1} dBm at one metre.\n\
         Here is the square of {side_m:.0} m about {:.1} m East and {:.1} m North. Before the \
         search a transmitter is there with 50 %.\nSilences: {silences}, in {places} squares of \
         25 m, each of which counts once.{stated}",
        100.0 * confidence,
        centre.x,
        centre.y,
    )
}
