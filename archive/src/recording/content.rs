use super::{RecordingError, flight_log::Kind};

/// Bytes in which a byte of zero is looked for.
const LOOKED_AT: usize = 4096;

/// Contents that are no table, by their first bytes: the name, and the command that would work,
/// in which `{}` is the file.
const CONTENTS: [(&[u8], &str, &str); 14] = [
    (b"SQLite format 3\0", "an SQLite database", BAG),
    (b"\x89MCAP", "a bag of ROS 2", BAG),
    (b"PK\x03\x04", "a spreadsheet or another ZIP archive", SPREADSHEET),
    (b"\xd0\xcf\x11\xe0", "a spreadsheet of Excel 97", SPREADSHEET),
    (b"RIFF", "a file of samples", SAMPLES),
    (b"RF64", "a file of samples", SAMPLES),
    (b"BW64", "a file of samples", SAMPLES),
    (b"riff\x2e\x91\xcf\x11", "a file of samples", SAMPLES),
    (b"<?xml", "an XML file", TRACK),
    (b"<gpx", "a GPX track", TRACK),
    (b"<kml", "a KML file", TRACK),
    (b"%PDF", "a PDF document", NOTHING),
    (b"\x89PNG", "a picture", NOTHING),
    (b"\xff\xd8\xff", "a picture", NOTHING),
];

const BAG: &str = "a bag of ROS 2 becomes a table with: foxhunt convert {} OUT.csv";
#[cfg(feature = "spreadsheets")]
const SPREADSHEET: &str = "save its sheet as CSV, then: foxhunt locate FILE.csv";
#[cfg(not(feature = "spreadsheets"))]
const SPREADSHEET: &str = "a build with the feature `spreadsheets` reads .xlsx, .xls and .ods; or \
                           save the sheet as CSV, then: foxhunt locate FILE.csv";
const SAMPLES: &str = "it becomes a table of pulses with: foxhunt pulses {} --csv";
const TRACK: &str = "a path alone locates nothing; give it beside a table of levels with their \
                     times: foxhunt locate {} LEVELS.csv";
const NOTHING: &str = "a recording is a CSV file whose first line names the columns";

/// Refuses a file that is no text, and names what it is.
pub(super) fn check(bytes: &[u8], file: &str) -> Result<(), RecordingError> {
    let known = CONTENTS.iter().find(|(magic, ..)| bytes.starts_with(magic));
    let log = Kind::of(bytes).map(|kind| (kind.name(), TRACK));
    let known = known.map(|(_, what, advice)| (*what, *advice)).or(log);
    // The first element stands behind the declaration of XML.
    let begin = bytes.get(..LOOKED_AT).unwrap_or(bytes);
    let has = |element: &[u8]| begin.windows(element.len()).any(|word| word == element);
    let known = known.map(|(what, advice)| match what {
        "an XML file" if has(b"<kml") => ("a KML file", advice),
        "an XML file" if has(b"<gpx") => ("a GPX track", advice),
        what => (what, advice),
    });
    let (what, advice) = match known {
        Some(known) => known,
        None if bytes.iter().take(LOOKED_AT).any(|byte| *byte == 0) => ("a binary file", NOTHING),
        None => return Ok(()),
    };
    let file = file.to_owned();
    Err(RecordingError::NotATable { what, advice: advice.replace("{}", &file), file })
}
