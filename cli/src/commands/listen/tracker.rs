use foxhunt::signal::{
    Pulse,
    tags::{AssociationConfig, Tag, TagTable, associate},
};
use serde::Serialize;

use crate::{
    commands::tags::name,
    table::{number, table},
};

/// Time between two associations, in seconds of the samples.
const EVERY_S: f64 = 2.0;

/// Pulses are associated again while they are no older than this, in seconds, and no more than
/// this: the time that it takes grows with their third power. With twenty tags in one kilohertz 500
/// pulses took 0.24 s, 960 took 2.6 s and 1,800 took 20 s, with little optimisation.
const WINDOW_S: f64 = 120.0;
const MOST_PULSES: usize = 600;

/// An unknown tag is the same one again within this difference of frequencies, in Hz, and of
/// intervals, as a share.
const SAME_HZ: f64 = 300.0;
const SAME_INTERVAL: f64 = 0.02;

/// A tag as it is shown.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TagRow {
    name: String,
    /// True if its name comes from a table.
    known: bool,
    frequency_hz: f64,
    interval_s: f64,
    jitter_s: f64,
    width_s: f64,
    /// Power of the last pulse.
    power_dbm: f64,
    snr_db: f64,
    /// Time of the last pulse, in seconds of the samples' clock.
    last_pulse_s: f64,
    /// Number of its pulses.
    pub pulses: usize,
    /// Number of its pulses that are too old to be associated again.
    #[serde(skip)]
    before: usize,
}

/// The tags of pulses that go on coming. Pulses of the last two minutes are associated again and
/// again; older ones keep their tags.
#[derive(Debug)]
pub struct Tracker {
    table: TagTable,
    config: AssociationConfig,
    /// Pulses that are associated, in the order of their times.
    pulses: Vec<Pulse>,
    /// Number of pulses no longer associated.
    older: usize,
    /// True if pulses have come since the last association.
    is_stale: bool,
    associated_s: f64,
    rows: Vec<TagRow>,
    /// Row of each pulse by the last association, if it has one.
    given: Vec<Option<usize>>,
    unknown: usize,
}

impl Tracker {
    pub fn new(table: TagTable, intervals_s: Option<[f64; 2]>) -> Self {
        let mut config = AssociationConfig::default();
        config.intervals_s = intervals_s.unwrap_or(config.intervals_s);
        Self {
            table,
            config,
            pulses: Vec::new(),
            older: 0,
            is_stale: false,
            associated_s: 0.0,
            rows: Vec::new(),
            given: Vec::new(),
            unknown: 0,
        }
    }

    /// Takes a pulse; its tag is known at the next association.
    pub fn take(&mut self, pulse: Pulse) {
        let place = self.pulses.partition_point(|other| other.time_s <= pulse.time_s);
        self.pulses.insert(place, pulse);
        // A row of the last association is that of its own pulse.
        self.given.insert(place.min(self.given.len()), None);
        self.is_stale = true;
    }

    /// Associates if it is time to.
    pub fn refresh(&mut self, time_s: f64) {
        if self.is_stale && time_s >= self.associated_s + EVERY_S {
            self.associated_s = time_s;
            self.forget(time_s - WINDOW_S);
            self.associate();
        }
    }

    pub fn rows(&self) -> &[TagRow] {
        &self.rows
    }

    pub fn into_rows(self) -> Vec<TagRow> {
        self.rows
    }

    /// Returns the number of pulses of no tag.
    pub fn others(&self) -> usize {
        let all = self.older + self.pulses.len();
        all.saturating_sub(self.rows.iter().map(|row| row.pulses).sum())
    }

    /// Stops associating pulses that are older or too many.
    fn forget(&mut self, before_s: f64) {
        let old = self.pulses.partition_point(|pulse| pulse.time_s < before_s);
        let old = old.max(self.pulses.len().saturating_sub(MOST_PULSES));
        self.pulses.drain(..old);
        self.older += old;
        for row in self.given.drain(..old.min(self.given.len())).flatten() {
            if let Some(row) = self.rows.get_mut(row) {
                row.before += 1;
            }
        }
    }

    /// Assigns the pulses to their tags.
    pub fn associate(&mut self) {
        self.is_stale = false;
        // A configuration that cannot be was refused before; a list that cannot be has no tags.
        let Ok(given) = associate(&self.pulses, &self.table, &self.config) else { return };
        for row in &mut self.rows {
            row.pulses = row.before;
        }
        self.given = vec![None; self.pulses.len()];
        let mut taken = Vec::new();
        for tag in &given.tags {
            let Some(last) = tag.pulses.iter().filter_map(|i| self.pulses.get(*i)).next_back()
            else {
                continue;
            };
            let last = *last;
            let place = self.row_of(tag, &taken);
            taken.push(place);
            // A pulse of two tags counts for the first.
            let mut own = 0;
            for index in &tag.pulses {
                if let Some(given @ None) = self.given.get_mut(*index) {
                    *given = Some(place);
                    own += 1;
                }
            }
            if let Some(row) = self.rows.get_mut(place) {
                row.frequency_hz = tag.frequency_hz;
                row.interval_s = tag.interval_s;
                row.jitter_s = tag.jitter_s;
                row.width_s = tag.width_s;
                (row.power_dbm, row.snr_db) = (last.power_dbm, last.snr_db);
                row.last_pulse_s = last.time_s;
                row.pulses = row.before + own;
            }
        }
        // What looked like a tag for a while.
        let is_gone = |row: &TagRow| row.pulses == 0 && !row.known;
        if self.rows.iter().any(is_gone) {
            let mut places = Vec::new();
            let mut kept = 0;
            for row in &self.rows {
                places.push((!is_gone(row)).then_some(kept));
                kept += usize::from(!is_gone(row));
            }
            self.rows.retain(|row| !is_gone(row));
            for given in &mut self.given {
                *given = given.and_then(|place| places.get(place).copied().flatten());
            }
        }
    }

    /// Returns the row of a tag, by its name or else by frequency and interval.
    fn row_of(&mut self, tag: &Tag, taken: &[usize]) -> usize {
        let known = !tag.names.is_empty();
        let named = known.then(|| name(tag, 0));
        let is_same = |(place, row): (usize, &TagRow)| {
            let unnamed = || {
                !row.known
                    && (row.frequency_hz - tag.frequency_hz).abs() < SAME_HZ
                    && (row.interval_s / tag.interval_s - 1.0).abs() < SAME_INTERVAL
            };
            let same = named.as_ref().map_or_else(unnamed, |name| row.name == *name);
            (same && !taken.contains(&place)).then_some(place)
        };
        if let Some(place) = self.rows.iter().enumerate().find_map(is_same) {
            return place;
        }
        self.rows.push(TagRow {
            name: named.unwrap_or_else(|| {
                self.unknown += 1;
                format!("unknown {}", self.unknown)
            }),
            known,
            frequency_hz: tag.frequency_hz,
            interval_s: tag.interval_s,
            jitter_s: tag.jitter_s,
            width_s: tag.width_s,
            power_dbm: 0.0,
            snr_db: 0.0,
            last_pulse_s: 0.0,
            pulses: 0,
            before: 0,
        });
        self.rows.len() - 1
    }
}

/// Rows of tags at a time, in the samples' clock.
pub fn rows(tags: &[TagRow], time_s: f64, is_calibrated: bool) -> String {
    let level = if is_calibrated { "dBm" } else { "dBFS" };
    let columns =
        ["tag", "frequency Hz", "interval s", "± ms", "width ms", level, "E/N0 dB", "last s", "n"];
    let mut table = table(&columns);
    for tag in tags {
        table.add_row([
            tag.name.clone(),
            number(tag.frequency_hz, 0),
            number(tag.interval_s, 4),
            number(1e3 * tag.jitter_s, 1),
            number(1e3 * tag.width_s, 1),
            number(tag.power_dbm, 1),
            number(tag.snr_db, 1),
            format!("-{:.1}", (time_s - tag.last_pulse_s).max(0.0)),
            tag.pulses.to_string(),
        ]);
    }
    table.to_string()
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::{abs_diff_eq, assert_abs_diff_eq};

    /// Two tags for two minutes and a half, one of them in the table; each pulse counts once.
    #[test]
    fn each_pulse_counts_once_for_its_tag() {
        let known = foxhunt::signal::tags::KnownTag::new("fox", 1.3).with_frequency_hz(150e6);
        let mut tracker = Tracker::new(TagTable::new(vec![known]), None);
        let mut pulses: Vec<Pulse> = (0..110)
            .map(|n| Pulse::new(1.3 * f64::from(n), 150e6, 0.02, -80.0, 20.0))
            .chain(
                (0..130).map(|n| Pulse::new(0.4 + 1.1 * f64::from(n), 150.01e6, 0.02, -85.0, 16.0)),
            )
            .collect();
        pulses.sort_by(|a, b| a.time_s.total_cmp(&b.time_s));
        for pulse in &pulses {
            tracker.take(*pulse);
            tracker.refresh(pulse.time_s);
            let counted: usize = tracker.rows().iter().map(|row| row.pulses).sum();
            assert!(counted <= tracker.older + tracker.pulses.len());
        }
        tracker.associate();
        let names: Vec<_> =
            tracker.rows().iter().map(|row| (row.name.as_str(), row.pulses)).collect();
        assert_eq!(names, [("fox", 110), ("unknown 1", 130)]);
        assert_eq!(tracker.others(), 0);
        let other = &tracker.rows()[1];
        assert!(abs_diff_eq!(other.interval_s, 1.1, epsilon = 1e-6) && !other.known, "{other:?}");
        assert_abs_diff_eq!(other.last_pulse_s - 0.4, 1.1 * 129.0, epsilon = 1e-9);
    }
}
