use super::rows::{Converted, Made, RowsWriter, not_written};
use crate::recording::{
    RecordingError, Rover,
    flight_log::{Kind, Levels},
    utc::utc,
};

/// Levels in an autopilot's log, each at the vehicle's place; `None` for a log without levels,
/// which is a path alone, and for any other file. `level` is the name of the levels to read: a log
/// without them is refused.
pub(super) fn convert(
    bytes: &[u8],
    file: &str,
    level: Option<&str>,
) -> Result<Option<Converted>, RecordingError> {
    let Some(kind) = Kind::of(bytes) else { return Ok(None) };
    let log = match kind.log(bytes) {
        Ok(log) => log,
        Err(_) if level.is_none() => return Ok(None),
        Err(problem) => {
            let file = file.to_owned();
            return Err(RecordingError::NoPath { file, what: kind.name(), problem });
        }
    };
    if level.is_none() && log.levels.is_empty() {
        return Ok(None);
    }
    let Some((name, levels)) = log.levels.chosen(level) else {
        return Err(RecordingError::ChooseLevel {
            file: file.to_owned(),
            what: kind.name(),
            named: level.map(str::to_owned),
            levels: log.levels.listed(),
        });
    };
    let what = format!(
        "{}, whose levels {name} were read at its places, {}; --level takes another one of {}",
        kind.name(),
        Levels::scale(name),
        log.levels.listed()
    );
    let rover = Rover::of_fixes(log.fixes, file)?;
    let mut made = RowsWriter::new(&["time_utc", "rss_db", "lat_deg", "lon_deg", "alt_m"]);
    for ([time, level], line) in levels.iter().zip(1..) {
        let place = rover.place(*time);
        let cell = |of: fn(&foxhunt_wire::geodesy::Geodetic) -> f64, digits: usize| {
            place.as_ref().map_or_else(String::new, |place| format!("{:.digits$}", of(place)))
        };
        let cells = [
            utc(*time),
            format!("{level:.2}"),
            cell(|place| place.lat_deg, 8),
            cell(|place| place.lon_deg, 8),
            cell(|place| place.alt_m, 2),
        ];
        made.write(line, &cells).map_err(|error| not_written(file, error))?;
    }
    made.rows.has_named_level = true;
    let rows = made.finish().map_err(|error| not_written(file, error))?;
    Ok(Some(Converted { table: Made::Rows(rows), what }))
}
