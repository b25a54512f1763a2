//! Real recordings, cut, thinned and spoilt at random; their truth is known.

use std::{fs, io, path::Path};

use crate::{
    radio::whole,
    random::Random,
    scene::{Class, DrawnFile, DrawnRecording},
};

/// Classes, in the order of tables.
pub const CLASSES: [Class; 21] = [
    Class::cut("afar", "AERPAW rover, a part", rover_part),
    Class::cut("afar-thin", "AERPAW rover, 5 to 50 % of rows", rover_thinned),
    Class::cut("afar-outside", "AERPAW rover beside the flight", rover_outside),
    Class::cut("afar-ceiling", "AERPAW rover, clipped", rover_ceiling),
    Class::cut("afar-weak", "AERPAW rover, weak rows missing", rover_deaf),
    Class::cut("afar-coarse", "AERPAW rover, steps of 2 to 6 dB", rover_coarse),
    Class::cut("afar-late", "AERPAW rover, 5 to 60 rows late", rover_late),
    Class::cut("afar-outliers", "AERPAW rover, one level in eight is any", rover_outliers),
    Class::cut("afar-jumps", "AERPAW rover, places that jump", rover_jumps),
    Class::cut("tower", "AERPAW tower, a part", tower_part),
    Class::cut("tower-thin", "AERPAW tower, 5 to 50 % of rows", tower_thinned),
    Class::cut("tower-high", "AERPAW tower from 70 and 100 m", tower_high),
    Class::cut("tower-ceiling", "AERPAW tower, clipped", tower_ceiling),
    Class::cut("otter", "an otter's bearings of a day", otter),
    Class::cut("otter-few", "two or three of them", otter_few),
    Class::cut("otter-back", "one of them points back", otter_back),
    Class::cut("otter-outlier", "one of them is wrong", otter_outlier),
    Class::cut("otter-groups", "5 to 20 otters, σ not stated", otter_groups),
    Class::cut("yagis", "a walking tag and a station of Yagis", yagis),
    Class::cut("collars", "flights over VHF collars", collars),
    Class::cut("collars-floor", "flights over VHF collars, with a floor", collars_floor),
];

/// A table of a file, cell by cell.
struct Table {
    header: Vec<String>,
    rows: Vec<Vec<String>>,
}

impl Table {
    fn read(file: &Path) -> io::Result<Self> {
        let unread =
            |error: io::Error| io::Error::new(error.kind(), format!("{}: {error}", file.display()));
        let text = fs::read_to_string(file).map_err(unread)?;
        let cells = |line: &str| line.split(',').map(str::to_owned).collect::<Vec<_>>();
        let mut lines = text.lines().map(cells);
        let header = lines.next().unwrap_or_default();
        let rows: Vec<Vec<String>> = lines.filter(|row| row.len() == header.len()).collect();
        if rows.is_empty() {
            return Err(unread(io::Error::new(io::ErrorKind::InvalidData, "it holds no rows")));
        }
        Ok(Self { header, rows })
    }

    /// Returns the text of a cell.
    fn cell<'a>(&self, row: &'a [String], column: &str) -> &'a str {
        let index = self.header.iter().position(|name| name == column);
        index.and_then(|index| row.get(index)).map_or("", String::as_str)
    }

    /// Returns the numbers of a column.
    fn numbers(&self, column: &str) -> Vec<f64> {
        self.rows.iter().filter_map(|row| self.cell(row, column).parse().ok()).collect()
    }

    /// Replaces the numbers of a column.
    fn change(&mut self, column: &str, mut change: impl FnMut(f64) -> f64) {
        let Some(index) = self.header.iter().position(|name| name == column) else { return };
        for cell in self.rows.iter_mut().filter_map(|row| row.get_mut(index)) {
            if let Ok(number) = cell.parse::<f64>() {
                *cell = format!("{:.3}", change(number));
            }
        }
    }

    /// Replaces a column's numbers in some rows, to seven decimals.
    fn change_some(
        &mut self,
        random: &mut Random,
        count: usize,
        column: &str,
        mut change: impl FnMut(&mut Random, f64) -> f64,
    ) {
        let Some(index) = self.header.iter().position(|name| name == column) else { return };
        for row in random.some_of(count, self.rows.len()) {
            let Some(cell) = self.rows.get_mut(row).and_then(|row| row.get_mut(index)) else {
                continue;
            };
            if let Ok(number) = cell.parse::<f64>() {
                *cell = format!("{:.7}", change(random, number));
            }
        }
    }

    /// Keeps a part of the rows that holds a share of them.
    fn cut(&mut self, random: &mut Random, least: f64, most: f64) {
        let count = f64::from(u32::try_from(self.rows.len()).unwrap_or(u32::MAX));
        let keep = usize::try_from(whole(random.between(least, most) * count)).unwrap_or(1).max(1);
        let start = random.index(self.rows.len() - keep.min(self.rows.len()) + 1);
        self.rows = self.rows.drain(start..).take(keep).collect();
    }

    /// Keeps a share of the rows at random.
    fn thin(&mut self, random: &mut Random, share: f64) {
        self.rows.retain(|_| random.chance(share));
    }

    fn text(&self) -> String {
        let mut lines = vec![self.header.join(",")];
        lines.extend(self.rows.iter().map(|row| row.join(",")));
        lines.push(String::new());
        lines.join("\n")
    }

    fn into_recording(self, name: &str, flags: Vec<String>) -> DrawnRecording {
        DrawnRecording {
            files: vec![DrawnFile { name: name.to_owned(), text: self.text() }],
            flags,
            header: 1,
            bound: None,
            is_empty: false,
        }
    }
}

/// Reads a file that lies beside a recording.
fn beside(folder: &Path, name: &str) -> io::Result<DrawnFile> {
    let file = folder.join(name);
    let unread =
        |error: io::Error| io::Error::new(error.kind(), format!("{}: {error}", file.display()));
    Ok(DrawnFile { name: name.to_owned(), text: fs::read_to_string(&file).map_err(unread)? })
}

/// A flight of AERPAW's Find-A-Rover and the place of its transmitter.
struct Rover {
    table: Table,
    truth: String,
}

/// Column of its levels.
const ROVER_LEVEL: &str = "power_db";

impl Rover {
    fn read(random: &mut Random, data: &Path, places: [u32; 2]) -> io::Result<Self> {
        let folder = data.join("aerpaw_afar");
        let team = if random.chance(0.5) { 288 } else { 300 };
        let place = random.count(places[0], places[1]);
        let mut table = Table::read(&folder.join(format!("afar_exp{team}_loc{place}_1hz.csv")))?;
        // Without lock, and on the ground, the levels are noise: what is cut is the search.
        let lost = |table: &Table, row: &[String]| {
            let number = |column: &str| table.cell(row, column).parse::<f64>().unwrap_or(0.0);
            number("alt_agl_m") < 15.0 || number("quality_db") < 60.0
        };
        let kept = table.rows.iter().filter(|row| !lost(&table, row)).cloned().collect();
        table.rows = kept;
        let truths = Table::read(&folder.join("truth.csv"))?;
        let own = |row: &&Vec<String>| truths.cell(row, "location") == place.to_string();
        let row = truths.rows.iter().find(own).cloned().unwrap_or_default();
        let truth = format!("{},{}", truths.cell(&row, "lat_deg"), truths.cell(&row, "lon_deg"));
        Ok(Self { table, truth })
    }

    fn recording(self) -> DrawnRecording {
        self.table.into_recording("afar.csv", vec![format!("--truth={}", self.truth)])
    }

    /// A share of the levels in rising order.
    fn quantile(&self, share: f64) -> f64 {
        let mut levels = self.table.numbers(ROVER_LEVEL);
        levels.sort_by(f64::total_cmp);
        let count = f64::from(u32::try_from(levels.len()).unwrap_or(u32::MAX));
        let rank = usize::try_from(whole(share * count)).unwrap_or(0);
        levels.get(rank.min(levels.len().saturating_sub(1))).copied().unwrap_or(0.0)
    }
}

/// A part of a flight.
fn rover_part(random: &mut Random, data: &Path) -> io::Result<DrawnRecording> {
    let mut rover = Rover::read(random, data, [1, 2])?;
    rover.table.cut(random, 0.25, 1.0);
    Ok(rover.recording())
}

/// Few of its rows.
fn rover_thinned(random: &mut Random, data: &Path) -> io::Result<DrawnRecording> {
    let mut rover = Rover::read(random, data, [1, 2])?;
    let share = random.log_between(0.05, 0.5);
    rover.table.thin(random, share);
    Ok(rover.recording())
}

/// A part of a flight beside whose area the transmitter is.
fn rover_outside(random: &mut Random, data: &Path) -> io::Result<DrawnRecording> {
    let mut rover = Rover::read(random, data, [3, 3])?;
    rover.table.cut(random, 0.4, 1.0);
    Ok(rover.recording())
}

/// A part of a flight by a receiver that clips.
fn rover_ceiling(random: &mut Random, data: &Path) -> io::Result<DrawnRecording> {
    let mut rover = Rover::read(random, data, [1, 3])?;
    let most = rover.quantile(random.between(0.5, 0.9));
    rover.table.change(ROVER_LEVEL, |level| level.min(most));
    rover.table.cut(random, 0.5, 1.0);
    Ok(rover.recording())
}

/// A part of a flight without what is weak.
fn rover_deaf(random: &mut Random, data: &Path) -> io::Result<DrawnRecording> {
    let mut rover = Rover::read(random, data, [1, 3])?;
    let least = rover.quantile(random.between(0.3, 0.7));
    let strong = |table: &Table, row: &[String]| {
        table.cell(row, ROVER_LEVEL).parse::<f64>().is_ok_and(|level| level >= least)
    };
    let kept = rover.table.rows.iter().filter(|row| strong(&rover.table, row)).cloned().collect();
    rover.table.rows = kept;
    Ok(rover.recording())
}

/// A part of a flight in steps of some decibels.
fn rover_coarse(random: &mut Random, data: &Path) -> io::Result<DrawnRecording> {
    let mut rover = Rover::read(random, data, [1, 3])?;
    let step_db = f64::from(random.count(2, 6));
    rover.table.change(ROVER_LEVEL, |level| (level / step_db).round() * step_db);
    rover.table.cut(random, 0.4, 1.0);
    Ok(rover.recording())
}

/// A flight whose levels belong to places some seconds away.
fn rover_late(random: &mut Random, data: &Path) -> io::Result<DrawnRecording> {
    let mut rover = Rover::read(random, data, [1, 3])?;
    let late = usize::try_from(random.count(5, 60)).unwrap_or(5);
    let levels = rover.table.numbers(ROVER_LEVEL);
    let mut later = levels.iter().skip(late);
    rover.table.change(ROVER_LEVEL, |level| later.next().copied().unwrap_or(level));
    let kept = rover.table.rows.len().saturating_sub(late).max(1);
    rover.table.rows.truncate(kept);
    Ok(rover.recording())
}

/// A flight in which one level in eight is any.
fn rover_outliers(random: &mut Random, data: &Path) -> io::Result<DrawnRecording> {
    let mut rover = Rover::read(random, data, [1, 2])?;
    rover.table.change(ROVER_LEVEL, |level| {
        if random.chance(0.125) { level + random.between(-30.0, 30.0) } else { level }
    });
    rover.table.cut(random, 0.4, 1.0);
    Ok(rover.recording())
}

/// A part of a flight with places that jump in a few rows.
fn rover_jumps(random: &mut Random, data: &Path) -> io::Result<DrawnRecording> {
    let mut rover = Rover::read(random, data, [1, 2])?;
    rover.table.cut(random, 0.4, 1.0);
    rover.table.change_some(random, 4, "lat_deg", |random, lat_deg| {
        lat_deg + random.sign() * random.log_between(0.002, 0.05)
    });
    Ok(rover.recording())
}

/// Place of the tower's antenna.
const TOWER: &str = "--truth=35.727451,-78.695974";

fn tower(random: &mut Random, data: &Path, flights: &[&str]) -> io::Result<Table> {
    let flight = flights[random.index(flights.len())];
    let mut table = Table::read(&data.join(format!("aerpaw_tower/flight_{flight}.csv")))?;
    let low = |table: &Table, row: &[String]| {
        table.cell(row, "alt_agl_m").parse::<f64>().is_ok_and(|up_m| up_m < 2.0)
    };
    table.rows = table.rows.iter().filter(|row| !low(&table, row)).cloned().collect();
    Ok(table)
}

/// A part of a flight over a tower.
fn tower_part(random: &mut Random, data: &Path) -> io::Result<DrawnRecording> {
    let mut table = tower(random, data, &["40m_fs5MHz", "40m_fs10MHz", "40m_fs20MHz"])?;
    table.cut(random, 0.3, 1.0);
    Ok(table.into_recording("tower.csv", vec![TOWER.to_owned()]))
}

/// Few rows of it.
fn tower_thinned(random: &mut Random, data: &Path) -> io::Result<DrawnRecording> {
    let mut table = tower(random, data, &["40m_fs5MHz", "40m_fs10MHz", "40m_fs20MHz"])?;
    let share = random.log_between(0.05, 0.5);
    table.thin(random, share);
    Ok(table.into_recording("tower.csv", vec![TOWER.to_owned()]))
}

/// A part of a flight at 70 or 100 m.
fn tower_high(random: &mut Random, data: &Path) -> io::Result<DrawnRecording> {
    let mut table = tower(random, data, &["70m_fs20MHz", "100m_fs20MHz"])?;
    table.cut(random, 0.3, 1.0);
    Ok(table.into_recording("tower.csv", vec![TOWER.to_owned()]))
}

/// A part of a flight by a receiver that clips near the tower.
fn tower_ceiling(random: &mut Random, data: &Path) -> io::Result<DrawnRecording> {
    let mut table = tower(random, data, &["40m_fs5MHz", "40m_fs10MHz", "40m_fs20MHz"])?;
    let mut levels = table.numbers("rss_db");
    levels.sort_by(f64::total_cmp);
    let most = levels.get(levels.len() * 3 / 4).copied().unwrap_or(0.0);
    table.change("rss_db", |level| level.min(most));
    table.cut(random, 0.5, 1.0);
    Ok(table.into_recording("tower.csv", vec![TOWER.to_owned()]))
}

/// Bearings of some of the otters, `rows` at most of each.
fn otters(
    random: &mut Random,
    data: &Path,
    animals: [u32; 2],
    rows: usize,
) -> io::Result<(Table, DrawnFile)> {
    let folder = data.join("otter_telemetr");
    let mut table = Table::read(&folder.join("bearings.csv"))?;
    let name = |table: &Table, row: &[String]| {
        format!("{}-{}", table.cell(row, "animal"), table.cell(row, "day"))
    };
    let mut all: Vec<String> = table.rows.iter().map(|row| name(&table, row)).collect();
    all.dedup();
    let count = usize::try_from(random.count(animals[0], animals[1])).unwrap_or(1);
    let chosen = random.some_of(count, all.len());
    let mut kept = Vec::new();
    for animal in chosen.iter().filter_map(|index| all.get(*index)) {
        let own: Vec<Vec<String>> =
            table.rows.iter().filter(|row| name(&table, row) == *animal).cloned().collect();
        let some = random.some_of(rows, own.len());
        kept.extend(some.iter().filter_map(|index| own.get(*index).cloned()));
    }
    table.rows = kept;
    Ok((table, beside(&folder, "truth.csv")?))
}

fn of_otters((table, truth): (Table, DrawnFile)) -> DrawnRecording {
    let mut recording = table.into_recording("bearings.csv", Vec::new());
    recording.files.push(truth);
    recording
}

/// One animal on one day.
fn otter(random: &mut Random, data: &Path) -> io::Result<DrawnRecording> {
    Ok(of_otters(otters(random, data, [1, 1], 4)?))
}

/// Two or three of its bearings.
fn otter_few(random: &mut Random, data: &Path) -> io::Result<DrawnRecording> {
    let rows = if random.chance(0.5) { 2 } else { 3 };
    Ok(of_otters(otters(random, data, [1, 1], rows)?))
}

/// One of its bearings points back.
fn otter_back(random: &mut Random, data: &Path) -> io::Result<DrawnRecording> {
    let (mut table, truth) = otters(random, data, [1, 1], 4)?;
    table.change_some(random, 1, "bearing_deg", |_, deg| (deg + 180.0).rem_euclid(360.0));
    Ok(of_otters((table, truth)))
}

/// One of its bearings is wrong.
fn otter_outlier(random: &mut Random, data: &Path) -> io::Result<DrawnRecording> {
    let (mut table, truth) = otters(random, data, [1, 1], 4)?;
    table.change_some(random, 1, "bearing_deg", |random, deg| {
        (deg + random.sign() * random.between(40.0, 120.0)).rem_euclid(360.0)
    });
    Ok(of_otters((table, truth)))
}

/// Several animals at once, whose σ is learned in common.
fn otter_groups(random: &mut Random, data: &Path) -> io::Result<DrawnRecording> {
    Ok(of_otters(otters(random, data, [5, 20], 4)?))
}

/// A tag that walks about a station of four Yagis, some dozens of bursts.
fn yagis(random: &mut Random, data: &Path) -> io::Result<DrawnRecording> {
    let folder = data.join("uri_yagi_station");
    let mut table = Table::read(&folder.join("detections.csv"))?;
    let rows = usize::try_from(random.count(60, 200)).unwrap_or(60);
    let start = random.index(table.rows.len().saturating_sub(rows));
    let day = table.cell(&table.rows[start], "time").get(..10).unwrap_or("").to_owned();
    let cut: Vec<Vec<String>> = table.rows.iter().skip(start).take(rows).cloned().collect();
    table.rows = cut.into_iter().filter(|row| table.cell(row, "time").starts_with(&day)).collect();
    let mut recording = table.into_recording("detections.csv", vec!["--track".to_owned()]);
    recording.files.push(beside(&folder, "station.csv")?);
    Ok(recording)
}

/// A part of a flight over three collars.
fn collars(random: &mut Random, data: &Path) -> io::Result<DrawnRecording> {
    let folder = data.join("pulses");
    let flight = if random.chance(0.5) { "419" } else { "427" };
    let mut table = Table::read(&folder.join(format!("ucsd_run_000{flight}.csv")))?;
    table.cut(random, 0.4, 1.0);
    let mut recording = table.into_recording("ucsd.csv", Vec::new());
    recording.files.push(beside(&folder, "ucsd_truth.csv")?);
    Ok(recording)
}

/// A part of a flight over three collars, with a floor between the noise of a frame and a collar's
/// power.
fn collars_floor(random: &mut Random, data: &Path) -> io::Result<DrawnRecording> {
    let mut recording = collars(random, data)?;
    recording.flags.push(format!("--floor-dbm={:.1}", random.between(-42.0, -34.0)));
    Ok(recording)
}
