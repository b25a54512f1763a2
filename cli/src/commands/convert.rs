use std::{
    fs,
    path::{Path, PathBuf},
    str::FromStr,
};

use foxhunt::{
    bag::{self, Converted, Topics, is_bag},
    recording::write_recordings,
};
use serde::Serialize;

use super::recorded::Reading;
use crate::{
    context::Context,
    error::{CliError, InFile},
    output::warn,
    writable,
};

/// Convert recordings to the program's own format
///
/// Reads recordings of any format that `locate` and `bearing` read, and writes them as one CSV with
/// the columns of docs/recordings.md: degrees of WGS84 or local metres, angles clockwise from true
/// North, seconds or UTC. A bag of ROS 2 (.mcap or .db3) is read by its topics: levels
/// (`std_msgs/Float32`, `Float64`) where the receiver was then (`geometry_msgs/PoseStamped`,
/// `nav_msgs/Odometry`, `sensor_msgs/NavSatFix`), or foxhunt's own receptions.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  foxhunt convert detections.csv foxhunt.csv --format motus\n  \
                        foxhunt convert run.csv run-true-north.csv --north magnetic\n  \
                        foxhunt convert flight.mcap flight.csv --pose-topic /uav/fix \
                        --rssi-topic /rssi=fox"
)]
pub(crate) struct Args {
    /// Recordings or one bag, and at last the file that is written
    #[arg(required = true, num_args = 2.., value_names = ["IN", "OUT"])]
    files: Vec<PathBuf>,
    /// The topic with the receiver's places, where a bag has several
    #[arg(long, value_name = "TOPIC", help_heading = "Bags of ROS 2")]
    pose_topic: Option<String>,
    /// A topic with levels in dBm, and the name of its beacon; again for each more
    #[arg(long, value_name = "TOPIC[=BEACON]", help_heading = "Bags of ROS 2")]
    rssi_topic: Vec<LevelTopic>,
    /// How far apart in seconds the places before and after a level may be
    #[arg(long, value_name = "S", default_value_t = 2.0, help_heading = "Bags of ROS 2")]
    most_gap_s: f64,
    #[command(flatten)]
    reading: Reading,
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

/// What was written, as JSON has it.
#[derive(Debug, Serialize)]
struct Report<'a> {
    file: &'a Path,
    formats: Vec<String>,
    rows: u64,
    /// Levels of a bag that were left out, since it has no place near them in time.
    without_place: u64,
}

pub(crate) fn run(args: &Args, context: Context<'_>) -> Result<(), CliError> {
    let Some((out, files)) = args.files.split_last() else {
        return Err(CliError::input("there is nothing to convert"));
    };
    if files.contains(out) {
        let text = format!("{}: it is read and would be written over", out.display());
        return Err(CliError::input(text));
    }
    writable::file(out)?;
    let bags = files.iter().filter(|file| is_bag(file).unwrap_or(false)).count();
    let report = match files {
        [bag] if bags == 1 => of_bag(args, bag, out)?,
        _ if bags > 0 => return Err(CliError::input("a bag is converted by itself")),
        _ => of_recordings(args, files, out)?,
    };
    if report.without_place > 0 {
        warn(&format!(
            "{} levels left out: no place of the receiver within {} s on both sides",
            report.without_place, args.most_gap_s
        ));
    }
    context
        .output
        .result(&report, |report| format!("{} rows: {}", report.rows, report.file.display()))
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
    Ok(Report { file: out, formats, rows, without_place: 0 })
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
    Ok(Report { file: out, formats: vec!["ROS 2 bag".to_owned()], rows, without_place })
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
