use std::{
    fs,
    path::{Path, PathBuf},
    str::FromStr,
};

use foxhunt::{
    bag::{self, Converted, Topics, is_bag},
    recording::{ClockOffset, PoseLog, TimedLevel, write_recordings},
    signal::{
        Pulse,
        tags::{PulseList, read_pulses},
    },
};
use serde::Serialize;

use super::recorded::{Reading, offset};
use crate::{
    error::{CliError, InFile},
    output::{Context, check_writable, warn},
};

/// Convert recordings to the program's own format
///
/// Reads recordings of any format that `locate` and `bearing` read, and writes them as one CSV with
/// the columns of docs/recordings.md: degrees of WGS84 or local metres, angles clockwise from true
/// North, seconds or UTC. A bag of ROS 2 (.mcap or .db3) is read by its topics: levels
/// (`std_msgs/Float32`, `Float64`) where the receiver was then (`geometry_msgs/PoseStamped`,
/// `nav_msgs/Odometry`, `sensor_msgs/NavSatFix`), or foxhunt's own receptions. With --poses it
/// reads pulses, as `pulses --csv` and `tags --csv` print them, and joins each with the pose at its
/// time.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  foxhunt convert detections.csv foxhunt.csv --format motus\n  \
                        foxhunt convert run.csv run-true-north.csv --north magnetic\n  \
                        foxhunt convert flight.mcap flight.csv --pose-topic /uav/fix \
                        --rssi-topic /rssi=fox\n  \
                        foxhunt convert pulses.csv joined.csv --poses poses.csv --clock-offset \
                        2026-11-24T10:00:00Z --clock-within-s 5"
)]
pub struct Args {
    /// Recordings or one bag, and at last the file that is written
    #[arg(required = true, num_args = 2.., value_names = ["IN", "OUT"])]
    files: Vec<PathBuf>,
    /// The topic with the receiver's places, where a bag has several
    #[arg(long, value_name = "TOPIC", help_heading = "Bags of ROS 2")]
    pose_topic: Option<String>,
    /// A topic with levels in dBm, and the name of its beacon; again for each more
    #[arg(long, value_name = "TOPIC[=BEACON]", help_heading = "Bags of ROS 2")]
    rssi_topic: Vec<LevelTopic>,
    /// Greatest time between the places before and after a level or pulse, in seconds
    #[arg(long, value_name = "S", default_value_t = 2.0)]
    most_gap_s: f64,
    #[command(flatten)]
    posing: Posing,
    #[command(flatten)]
    reading: Reading,
}

/// Poses of the receiver, for pulses that do not hold its place.
#[derive(Debug, clap::Args)]
#[command(next_help_heading = "Pulses")]
struct Posing {
    /// Places of the receiver and directions of its antenna: CSV with time_s or time_utc, places,
    /// heading_deg_compass, pitch_deg, roll_deg, boresight_deg_compass
    #[arg(long, value_name = "FILE", conflicts_with_all = ["pose_topic", "rssi_topic"])]
    poses: Option<PathBuf>,
    /// Seconds by which the clock of the poses is ahead of that of the pulses, or the time in UTC
    /// at which the pulses' clock showed 0 [default: 0]
    #[arg(
        long,
        value_name = "S|UTC",
        requires = "poses",
        allow_hyphen_values = true,
        value_parser = offset
    )]
    clock_offset: Option<f64>,
    /// Find the clocks' offset from levels and boresights, within this many seconds of
    /// --clock-offset; refused where they do not show it
    #[arg(long, value_name = "S", requires = "poses")]
    clock_within_s: Option<f64>,
    /// The levels of the pulses are in dBm, not in dB of full scale
    #[arg(long, requires = "poses")]
    calibrated: bool,
}

/// A topic with levels, as the command line has it.
#[derive(Clone, Debug, PartialEq, Eq)]
struct LevelTopic {
    name: String,
    beacon: Option<String>,
}

impl FromStr for LevelTopic {
    type Err = &'static str;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let (name, beacon) = match text.split_once('=') {
            Some((_, "")) => return Err("the beacon has no name"),
            Some((name, beacon)) => (name, Some(beacon.to_owned())),
            None => (text, None),
        };
        let name = Some(name).filter(|name| !name.is_empty()).ok_or("the topic has no name")?;
        Ok(Self { name: name.to_owned(), beacon })
    }
}

/// Result of a conversion, as JSON has it.
#[derive(Debug, Serialize)]
struct Report<'a> {
    file: &'a Path,
    formats: Vec<String>,
    rows: u64,
    /// Levels that were left out, since there is no place of the receiver near them in time.
    without_place: u64,
    /// Result of joining pulses with poses.
    #[serde(flatten, skip_serializing_if = "Option::is_none")]
    joined: Option<Joined>,
}

/// Result of joining pulses with poses, as JSON has it.
#[derive(Debug, Serialize)]
struct Joined {
    /// The offset of the clocks.
    clock_offset_s: f64,
    /// The offset's interval of 95 % confidence, where it was found.
    clock_interval_s: Option<[f64; 2]>,
    /// Pulses that were left out, since they are of no tag.
    of_no_tag: usize,
}

pub fn run(args: &Args, context: Context<'_>) -> Result<(), CliError> {
    let Some((out, files)) = args.files.split_last() else {
        return Err(CliError::input("there is nothing to convert"));
    };
    if files.contains(out) {
        let text = format!("{}: it is read and would be written over", out.display());
        return Err(CliError::input(text));
    }
    check_writable(out)?;
    let bags = files.iter().filter(|file| is_bag(file).unwrap_or(false)).count();
    let report = match (files, &args.posing.poses) {
        (_, Some(poses)) => of_pulses(args, poses, files, out)?,
        ([bag], None) if bags == 1 => of_bag(args, bag, out)?,
        _ if bags > 0 => return Err(CliError::input("a bag is converted by itself")),
        _ => of_recordings(args, files, out)?,
    };
    if report.without_place > 0 {
        warn(&format!(
            "{} levels left out: no place of the receiver within {} s on both sides",
            report.without_place, args.most_gap_s
        ));
    }
    if let Some(of_no_tag) = report.joined.as_ref().map(|of| of.of_no_tag).filter(|n| *n > 0) {
        warn(&format!("{of_no_tag} pulses left out: they are of no tag"));
    }
    context.output.result(&report, |report| {
        let found = report.joined.as_ref().and_then(|joined| {
            let [from, to] = joined.clock_interval_s?;
            let offset = joined.clock_offset_s;
            Some(format!("; clocks {offset:.3} s apart, {from:.3} to {to:.3} with 95 %"))
        });
        format!("{} rows: {}{}", report.rows, report.file.display(), found.unwrap_or_default())
    })
}

fn of_pulses<'a>(
    args: &Args,
    poses: &PathBuf,
    files: &[PathBuf],
    out: &'a Path,
) -> Result<Report<'a>, CliError> {
    let [file] = files else {
        return Err(CliError::input("--poses: one file of pulses is joined at a time"));
    };
    if poses == out {
        let text = format!("{}: it is read and would be written over", out.display());
        return Err(CliError::input(text));
    }
    let list = read_pulses(file).map_err(CliError::input)?;
    let log = PoseLog::read(poses).map_err(CliError::input)?;
    let levels = levels(&list);
    let given = args.posing.clock_offset.unwrap_or(0.0);
    let find = |within| {
        log.clock_offset(&levels, [given, within], args.most_gap_s).map_err(|error| {
            let file = format!("{} with {}", file.display(), poses.display());
            CliError::input(InFile { file, source: Box::new(error) })
        })
    };
    let found: Option<ClockOffset> = args.posing.clock_within_s.map(find).transpose()?;
    let clock_offset_s = found.map_or(given, |found| found.offset_s);
    let mut text = Vec::new();
    let [rows, without_place] = log
        .join(&levels, clock_offset_s, args.most_gap_s, args.posing.calibrated, &mut text)
        .map_err(CliError::failure)?;
    if rows == 0 {
        return Err(CliError::input(format!(
            "{}: none of {} pulses has a pose in {}; --clock-offset is how many seconds the clock \
             of the poses is ahead",
            file.display(),
            list.pulses.len(),
            poses.display()
        )));
    }
    fs::write(out, &text).map_err(|error| CliError::writing(out, error))?;
    Ok(Report {
        file: out,
        formats: vec![list.format.to_owned()],
        rows,
        without_place,
        joined: Some(Joined {
            clock_offset_s,
            clock_interval_s: found.map(|found| found.interval_s),
            of_no_tag: list.pulses.len() - levels.len(),
        }),
    })
}

/// Returns the levels of all pulses, or of the pulses with a tag if there is a column of tags.
fn levels(list: &PulseList) -> Vec<TimedLevel> {
    let tags = list.tags.iter().flatten().map(|tag| Some(tag.as_str()));
    let tags = tags.chain(std::iter::repeat(None));
    let of_a_tag = list.pulses.iter().zip(tags).filter(|(_, tag)| *tag != Some(""));
    let level = |(pulse, tag): (&Pulse, Option<&str>)| TimedLevel {
        time_s: pulse.time_s,
        level_db: pulse.power_dbm,
        beacon: tag.map(str::to_owned),
    };
    of_a_tag.map(level).collect()
}

fn of_recordings<'a>(
    args: &Args,
    files: &[PathBuf],
    out: &'a Path,
) -> Result<Report<'a>, CliError> {
    if args.pose_topic.is_some() || !args.rssi_topic.is_empty() {
        return Err(CliError::input("--pose-topic and --rssi-topic are for bags of ROS 2"));
    }
    if args.reading.wanted().is_some() {
        return Err(CliError::input("--beacon: all beacons are converted"));
    }
    let recordings = args.reading.read(files)?;
    let formats = recordings.iter().map(|recording| recording.format().to_owned()).collect();
    let mut text = Vec::new();
    let rows = write_recordings(&mut text, &recordings).map_err(CliError::failure)?;
    fs::write(out, &text).map_err(|error| CliError::writing(out, error))?;
    Ok(Report { file: out, formats, rows, without_place: 0, joined: None })
}

fn of_bag<'a>(args: &Args, bag: &Path, out: &'a Path) -> Result<Report<'a>, CliError> {
    let level = |topic: &LevelTopic| (topic.name.clone(), topic.beacon.clone());
    let topics = Topics {
        pose: args.pose_topic.clone(),
        levels: args.rssi_topic.iter().map(level).collect(),
        gap_s: args.most_gap_s,
    };
    let mut text = Vec::new();
    let converted = bag::convert(bag, &topics, &mut text).map_err(|error| {
        CliError::input(InFile { file: bag.display().to_string(), source: Box::new(error) })
    })?;
    let Converted { rows, without_place, .. } = converted;
    fs::write(out, &text).map_err(|error| CliError::writing(out, error))?;
    let formats = vec!["ROS 2 bag".to_owned()];
    Ok(Report { file: out, formats, rows, without_place, joined: None })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_topic_may_have_a_beacon() {
        let topic = |text: &str| text.parse::<LevelTopic>();
        let of = |name: &str, beacon: Option<&str>| LevelTopic {
            name: name.to_owned(),
            beacon: beacon.map(str::to_owned),
        };
        assert_eq!(topic("/rssi"), Ok(of("/rssi", None)));
        assert_eq!(topic("/rssi=fox 1"), Ok(of("/rssi", Some("fox 1"))));
        for wrong in ["", "=fox", "/rssi="] {
            assert!(topic(wrong).is_err(), "{wrong}");
        }
    }
}
