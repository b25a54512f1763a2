use std::{
    ffi::OsString,
    fs,
    path::{Path, PathBuf},
};

use rusqlite::{OptionalExtension, params};

use super::{Contender, Store, StoreError, StoredCampaign, export::COLUMNS, first};

/// The columns of a run that are its result; those before them are what it is of.
const RESULTS: &[&str] = COLUMNS.split_at(7).1;

/// Puts the runs of several stores into a new one: what one process would have written, row by row.
/// A run that several have must be the same in all of them. The new file is there once it is
/// whole.
///
/// # Errors
///
/// [`StoreError`] when a store is of another version, scenario, planner or estimator than the
/// first, when two have other results for the same run, when there is a file of that name, or
/// one cannot be read or written.
pub fn merge(sources: &[PathBuf], to: &Path) -> Result<(), StoreError> {
    let io = |path: &Path, doing| {
        let file = path.display().to_string();
        move |source| StoreError::Io { file, doing, source }
    };
    if to.exists() {
        let there = std::io::Error::from(std::io::ErrorKind::AlreadyExists);
        return Err(io(to, "making it")(there));
    }
    let beside = |end: &str| {
        let mut name: OsString = to.as_os_str().to_owned();
        name.push(end);
        PathBuf::from(name)
    };
    let part = beside(".part");
    // The write-ahead log of a store that was removed would be taken for the new one's.
    for left in [&part, &beside("-wal"), &beside("-shm")] {
        if left.exists() {
            fs::remove_file(left).map_err(io(left, "removing what was left"))?;
        }
    }
    if let Err(error) = join(sources, &part) {
        // What is left of it is no use; that it stays is not worth another error.
        let _ = fs::remove_file(&part);
        return Err(error);
    }
    fs::rename(&part, to).map_err(io(to, "making it"))
}

/// Puts stores into a new one, which may be left half done.
fn join(sources: &[PathBuf], part: &Path) -> Result<(), StoreError> {
    let store = Store::create(part)?;
    let mut whole: Option<Known> = None;
    for path in sources {
        let source = Store::open(path)?;
        let known = Known::of(&source)?;
        let whole = match &whole {
            None => {
                known.enter(&store)?;
                whole.insert(known.clone())
            }
            Some(whole) => {
                whole.require_same(&known)?;
                whole
            }
        };
        drop(source);
        store.take_in(path, whole, &known)?;
    }
    store.settle();
    Ok(())
}

/// The campaigns and contenders of a store.
#[derive(Clone, Debug)]
struct Known {
    file: String,
    campaigns: Vec<StoredCampaign>,
    contenders: Vec<Contender>,
}

impl Known {
    fn of(store: &Store) -> Result<Self, StoreError> {
        let campaigns = store.campaigns()?;
        let contenders = store.contenders()?;
        Ok(Self { file: store.file(), campaigns, contenders })
    }

    /// Enters campaigns and contenders in the order that they have here.
    fn enter(&self, store: &Store) -> Result<(), StoreError> {
        store.at_once(|| {
            for campaign in &self.campaigns {
                let id = store.doing("entering a campaign", store.campaign_id(campaign))?;
                for contender in self.contenders.iter().filter(|c| c.campaign == campaign.id) {
                    let contender = Contender { campaign: id, ..contender.clone() };
                    store.doing("entering a contender", store.contender_id(&contender))?;
                }
            }
            Ok(())
        })
    }

    /// Refuses another store that is about something else.
    fn require_same(&self, other: &Self) -> Result<(), StoreError> {
        let differ =
            |what| StoreError::Other { first: self.file.clone(), second: other.file.clone(), what };
        let own = self.campaigns.iter().find(|own| !other.has(own));
        let theirs = other.campaigns.iter().find(|theirs| !self.has(theirs));
        if own.is_some() || theirs.is_some() {
            return Err(differ(difference(theirs, own)));
        }
        let names = |known: &Self| {
            let mut names: Vec<_> = known.contenders.iter().map(Contender::full_name).collect();
            names.sort();
            names
        };
        let own = names(self);
        let theirs = names(other);
        if own != theirs {
            let lists = [theirs, own].map(|names| names.join(", "));
            return Err(differ(format!("contenders {}, not {}", lists[0], lists[1])));
        }
        Ok(())
    }

    fn has(&self, campaign: &StoredCampaign) -> bool {
        self.campaigns.iter().any(|own| own.digest == campaign.digest)
    }
}

/// The difference between two campaigns, the second one's value after the first one's.
fn difference(second: Option<&StoredCampaign>, first: Option<&StoredCampaign>) -> String {
    let (Some(second), Some(first)) = (second, first) else {
        let more = second.or(first).map_or("", |campaign| &campaign.scenario);
        return format!("one of them has {more} besides");
    };
    for (what, second, first) in [
        ("program", &second.program, &first.program),
        ("scenario", &second.scenario, &first.scenario),
        ("planner", &second.planner, &first.planner),
    ] {
        if second != first {
            return format!("{what} {second}, not {first}");
        }
    }
    let line = second.definition.lines().zip(first.definition.lines()).find(|(a, b)| a != b);
    let (second_line, first_line) = line.unwrap_or(("", ""));
    format!("in its scenario {}, `{second_line}`, not `{first_line}`", second.scenario)
}

impl Store {
    /// Takes in the runs of another store of the same contenders.
    fn take_in(&self, path: &Path, whole: &Known, other: &Known) -> Result<(), StoreError> {
        const ATTACHING: &str = "taking in a store";
        let path = path.to_string_lossy();
        let attached = self.connection.execute("ATTACH ?1 AS other", [&path]);
        self.doing(ATTACHING, attached)?;
        let own = self.contenders()?;
        let taken = self.at_once(|| {
            for theirs in &other.contenders {
                let same = own.iter().find(|own| own.digest == theirs.digest);
                let Some(own) = same else { continue };
                let contradiction = self.contradiction(own.id, theirs.id);
                if let Some(seed) = self.doing(ATTACHING, contradiction)? {
                    return Err(StoreError::Contradiction {
                        first: whole.file.clone(),
                        second: other.file.clone(),
                        estimator: own.estimator.clone(),
                        seed,
                    });
                }
                let columns = RESULTS.join(", ");
                let runs = format!(
                    "INSERT OR IGNORE INTO main.run SELECT ?1, seed, beacon, {columns} \
                     FROM other.run WHERE contender = ?2 ORDER BY seed, beacon"
                );
                let logs = "INSERT OR IGNORE INTO main.log SELECT ?1, seed, jsonl_gz \
                            FROM other.log WHERE contender = ?2 ORDER BY seed";
                for sql in [&runs[..], logs] {
                    let inserted = self.connection.execute(sql, params![own.id, theirs.id]);
                    self.doing(ATTACHING, inserted)?;
                }
            }
            Ok(())
        });
        taken.and_then(|()| self.doing(ATTACHING, self.connection.execute_batch("DETACH other")))
    }

    /// A seed for which the attached store has other results.
    fn contradiction(&self, own: i64, theirs: i64) -> Result<Option<i64>, rusqlite::Error> {
        let differ: Vec<String> = RESULTS.iter().map(|c| format!("a.{c} IS NOT b.{c}")).collect();
        let sql = format!(
            "SELECT a.seed FROM other.run a CROSS JOIN main.run b \
             ON b.contender = ?1 AND b.seed = a.seed AND b.beacon = a.beacon \
             WHERE a.contender = ?2 AND ({}) LIMIT 1",
            differ.join(" OR ")
        );
        self.connection.query_row(&sql, params![own, theirs], first).optional()
    }
}
