use std::path::Path;

use chrono::DateTime;

use super::{
    TagError,
    row::{Row, Rows, bytes_of},
};
use crate::Pulse;

/// The pulses of a file, in its order.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct PulseList {
    /// The program that wrote it.
    pub format: &'static str,
    /// The pulses.
    pub pulses: Vec<Pulse>,
    /// The entry of each pulse in a column `tags`, as `foxhunt tags --csv` writes it: empty for a
    /// pulse of no tag; `None` if there is no such column.
    pub tags: Option<Vec<String>>,
}

/// Length of the pulses that SensorGnome's detector searches for by default, in seconds; its files
/// do not hold a width.
const SENSORGNOME_WIDTH_S: f64 = 0.0025;

const KNOWN: &str = "a pulse file: time_s, frequency_hz, width_s, power_dbm, snr_db (foxhunt); \
                     time_unix_s, dfreq_kHz, sig_dB, noise_dB (SensorGnome); Time, Frequency, \
                     Duration, avg (dBW), snr (dB) (pyradiotracking)";

/// Reads a list of pulses; its header shows which program wrote it.
///
/// - foxhunt: `time_s, frequency_hz, width_s, power_dbm, snr_db`, separated by commas;
/// - SensorGnome: `time_unix_s, dfreq_kHz, sig_dB, noise_dB`; frequencies are relative to the
///   receiver's centre, widths are the 2.5 ms that its detector searches for;
/// - pyradiotracking: separated by semicolons, times in UTC with a date.
///
/// The ratios of the latter two are powers in their own bandwidths. As E/N0 they would be off by a
/// constant; nothing here depends on one.
///
/// # Errors
///
/// If the file cannot be read, no program is known by its header, or a field is not what it must
/// be, with line, field and value.
pub fn read_pulses(file: &Path) -> Result<PulseList, TagError> {
    parse_pulses(file, &bytes_of(file)?)
}

/// Reads the bytes of a list of pulses; errors name `file`.
///
/// # Errors
///
/// The errors of [`read_pulses`].
pub fn parse_pulses(file: &Path, bytes: &[u8]) -> Result<PulseList, TagError> {
    type Read = fn(&Row<'_>) -> Result<Pulse, TagError>;
    let rows = Rows::parse(file, bytes)?;
    let readers: [(&str, &[&str], Read); 3] = [
        ("foxhunt", &["time_s", "frequency_hz", "width_s", "power_dbm", "snr_db"], own),
        ("sensorgnome", &["time_unix_s", "dfreq_kHz", "sig_dB", "noise_dB"], sensorgnome),
        ("pyradiotracking", &["Time", "Frequency", "Duration", "avg (dBW)", "snr (dB)"], pyradio),
    ];
    let known = readers.into_iter().find(|(_, columns, _)| rows.has(columns));
    let (format, _, read) = known.ok_or_else(|| rows.unknown(KNOWN))?;
    let pulses = rows.iter().map(|row| read(&row)).collect::<Result<_, _>>()?;
    let tag = |row: Row<'_>| row.text("tags").unwrap_or_default().to_owned();
    let tags = rows.has(&["tags"]).then(|| rows.iter().map(tag).collect());
    Ok(PulseList { format, pulses, tags })
}

fn own(row: &Row<'_>) -> Result<Pulse, TagError> {
    Ok(Pulse::new(
        row.number("time_s")?,
        row.number("frequency_hz")?,
        row.positive("width_s")?,
        row.number("power_dbm")?,
        row.number("snr_db")?,
    ))
}

fn sensorgnome(row: &Row<'_>) -> Result<Pulse, TagError> {
    let power = row.number("sig_dB")?;
    Ok(Pulse::new(
        row.number("time_unix_s")?,
        1e3 * row.number("dfreq_kHz")?,
        SENSORGNOME_WIDTH_S,
        power,
        power - row.number("noise_dB")?,
    ))
}

fn pyradio(row: &Row<'_>) -> Result<Pulse, TagError> {
    let time = row.text("Time");
    let time = time.and_then(|t| DateTime::parse_from_str(t, "%Y-%m-%d %H:%M:%S%.f%:z").ok());
    let time = time.ok_or_else(|| row.error("Time", "a date and time with its offset from UTC"))?;
    let width = row.positive("Duration")?;
    // The time is that of the beginning.
    let begin = seconds(time.timestamp()) + f64::from(time.timestamp_subsec_micros()) * 1e-6;
    Ok(Pulse::new(
        begin + 0.5 * width,
        row.number("Frequency")?,
        width,
        // From dBW.
        row.number("avg (dBW)")? + 30.0,
        row.number("snr (dB)")?,
    ))
}

#[expect(clippy::cast_precision_loss, reason = "seconds of any year are below 2^53")]
fn seconds(whole: i64) -> f64 {
    whole as f64
}
