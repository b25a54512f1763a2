use std::iter;

use super::rows::{Converted, Made, RowsWriter, not_written};
use crate::recording::RecordingError;

/// Records in which a file is recognised.
const LOOKED_AT: usize = 20;

/// First byte of a frame.
const DELIMITER: u8 = 0x7e;

/// Byte behind which a byte is escaped, and the bits that are turned over in it.
const ESCAPE: u8 = 0x7d;
const ESCAPED: u8 = 0x20;

/// Command for the level of the last packet, and its text in transparent mode.
const LEVEL: &[u8] = b"DB";
const TYPED: &[u8] = b"ATDB";

/// Most bytes of a line that is typed in transparent mode.
const MOST_TYPED: usize = 64;

/// Levels in a console log of Digi's XCTU, of an XBee module.
///
/// The log is CSV (Digi, XCTU user guide 90001458, "Console log files"): a session record
/// `02-05-2015 11:44:56.017,-,API,"…"` with the mode, and records of bytes in hexadecimal,
/// `02-05-2015 11:44:58.857,0,RECV,7E000…`. Frames are those of the XBee's API: received packets
/// of 802.15.4 (types 80 to 83) hold their level, and responses to the command DB (types 88 and 97)
/// that of the last packet; a level is a number of decibels below 0 dBm. In transparent mode the
/// response to `ATDB` is that number in hexadecimal digits.
pub(super) fn convert(text: &str, file: &str) -> Result<Option<Converted>, RecordingError> {
    let mut lines = text.lines().filter(|line| !line.trim().is_empty()).take(LOOKED_AT).peekable();
    if lines.peek().is_none() || !lines.all(|line| Record::of(line).is_some()) {
        return Ok(None);
    }
    let Log { rows, others } = Log::read(text).map_err(|error| not_written(file, error))?;
    let rows = rows.finish().map_err(|error| not_written(file, error))?;
    if rows.lines.is_empty() {
        return Err(RecordingError::NotATable {
            file: file.to_owned(),
            what: "a log of XCTU's console without a level",
            advice: "send the command DB after each packet and save the session again, then: \
                     foxhunt locate TRACK.gpx CONSOLE.log"
                .to_owned(),
        });
    }
    let what = format!(
        "a log of XCTU's console; levels of packets and of responses to DB are the rows, and a \
         beacon is the address of a module; records without a level: {others}"
    );
    Ok(Some(Converted { table: Made::Rows(rows), what }))
}

/// A line of the log.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Record<'l> {
    /// The mode of the session.
    Session { mode: &'l str },
    /// Bytes in hexadecimal.
    Bytes { time: &'l str, received: bool, hexadecimal: &'l str },
}

impl<'l> Record<'l> {
    fn of(line: &'l str) -> Option<Self> {
        let mut cells = line.trim().trim_start_matches('\u{feff}').splitn(4, ',');
        let [time, id, kind, rest] = [cells.next()?, cells.next()?, cells.next()?, cells.next()?];
        let is_time = time.contains(':') && time.starts_with(|c: char| c.is_ascii_digit());
        let is_number = !id.is_empty() && id.bytes().all(|byte| byte.is_ascii_digit());
        match kind {
            "API" | "API2" | "AT" | "Serial" if is_time && id == "-" => {
                Some(Self::Session { mode: kind })
            }
            "SENT" | "RECV" if is_time && is_number => {
                let hexadecimal = rest.trim().trim_matches('"');
                Some(Self::Bytes { time, received: kind == "RECV", hexadecimal })
            }
            _ => None,
        }
    }
}

/// Level in a frame.
#[derive(Debug, PartialEq)]
enum Heard {
    /// A packet's level in decibels below 0 dBm, and the sender's address.
    Packet(u64, String),
    /// A packet without its level, and the sender's address.
    Sender(String),
    /// The level of the last packet.
    Last(u64),
    /// No level.
    Nothing,
}

/// The rows of a log.
struct Log {
    rows: RowsWriter,
    /// Records without a level.
    others: u64,
}

impl Log {
    fn read(text: &str) -> csv::Result<Self> {
        let mut rows = RowsWriter::new(&["time_utc", "beacon", "rss_dbm"]);
        let mut others = 0;
        let mut mode = "API";
        // The sender of the last packet.
        let mut sender = String::new();
        let mut typed = Vec::new();
        let mut answered = Vec::new();
        for (number, line) in (1..).zip(text.lines()) {
            if line.trim().is_empty() {
                continue;
            }
            let Some(record) = Record::of(line) else {
                rows.rows.broken.push((number, "not a record of XCTU's console".to_owned()));
                continue;
            };
            let (time, received, hexadecimal) = match record {
                Record::Session { mode: of_session } => {
                    mode = of_session;
                    continue;
                }
                Record::Bytes { time, received, hexadecimal } => (time, received, hexadecimal),
            };
            let heard = match (bytes(hexadecimal), mode) {
                (None, _) => Err("not bytes in hexadecimal".to_owned()),
                (Some(bytes), "API" | "API2") if received => frame(&bytes, mode == "API2"),
                (Some(_), "API" | "API2") => Ok(Heard::Nothing),
                (Some(bytes), _) if received => Ok(answer(&bytes, &typed, &mut answered)),
                (Some(bytes), _) => {
                    type_in(&bytes, &mut typed);
                    answered.clear();
                    Ok(Heard::Nothing)
                }
            };
            let level = match heard {
                Ok(Heard::Packet(level, of)) => {
                    sender = of;
                    Some(level)
                }
                Ok(Heard::Sender(of)) => {
                    sender = of;
                    None
                }
                // Zero says that there was no packet as yet.
                Ok(Heard::Last(level)) => Some(level).filter(|level| *level > 0),
                Ok(Heard::Nothing) => None,
                Err(problem) => {
                    rows.rows.broken.push((number, problem));
                    continue;
                }
            };
            match level {
                Some(level) => rows.write(number, &[time, &sender, &format!("-{level}")])?,
                None => others += 1,
            }
        }
        Ok(Self { rows, others })
    }
}

/// Bytes of a text in hexadecimal; `None` for another text.
fn bytes(hexadecimal: &str) -> Option<Vec<u8>> {
    let digits: Vec<u8> = hexadecimal.bytes().filter(|byte| *byte != b' ').collect();
    let pairs = digits.chunks(2).map(|pair| {
        let pair = std::str::from_utf8(pair).ok().filter(|pair| pair.len() == 2)?;
        u8::from_str_radix(pair, 16).ok()
    });
    pairs.collect()
}

/// A number in big-endian order.
fn number(bytes: &[u8]) -> u64 {
    bytes.iter().fold(0, |number, byte| (number << 8) | u64::from(*byte))
}

/// An address as it is printed on a module.
fn address(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02X}")).collect()
}

/// Reads the level of a frame: delimiter, length, content and checksum.
fn frame(bytes: &[u8], is_escaped: bool) -> Result<Heard, String> {
    let plain: Vec<u8> = if is_escaped { unescaped(bytes) } else { bytes.to_vec() };
    let [DELIMITER, high, low, rest @ ..] = plain.as_slice() else {
        return Err("the frame does not begin with 7E".to_owned());
    };
    let length = usize::from(u16::from_be_bytes([*high, *low]));
    let Some(([checksum, ..], content)) = rest.get(length..).zip(rest.get(..length)) else {
        return Err(format!("the frame ends before its {length} bytes"));
    };
    let sum = content.iter().fold(*checksum, |sum, byte| sum.wrapping_add(*byte));
    if sum != u8::MAX {
        return Err("the frame's checksum is wrong".to_owned());
    }
    Ok(match content {
        // Packets of 802.15.4 with an address of 64 or of 16 bits.
        [0x80 | 0x82, rest @ ..] => packet(rest, 8),
        [0x81 | 0x83, rest @ ..] => packet(rest, 2),
        // Packets of other protocols.
        [0x90..=0x92, rest @ ..] => {
            rest.get(..8).map_or(Heard::Nothing, |of| Heard::Sender(address(of)))
        }
        // Responses: the frame's number, the command, a status of 0 and the value.
        [0x88, _, a, b, 0, value @ ..] if LEVEL == [*a, *b] => last(value),
        // Behind the frame's number stand the module's addresses of 64 and 16 bits.
        [0x97, _, rest @ ..] => match rest.split_at_checked(8) {
            Some((module, [_, _, a, b, 0, value @ ..])) if LEVEL == [*a, *b] => match last(value) {
                Heard::Last(level) if level > 0 => Heard::Packet(level, address(module)),
                _ => Heard::Nothing,
            },
            _ => Heard::Nothing,
        },
        _ => Heard::Nothing,
    })
}

/// A packet: an address of this length and the level.
fn packet(content: &[u8], length: usize) -> Heard {
    match content.split_at_checked(length) {
        Some((of, [level, ..])) => Heard::Packet(u64::from(*level), address(of)),
        _ => Heard::Nothing,
    }
}

/// The value of a response to the command for the level.
fn last(value: &[u8]) -> Heard {
    if (1..=2).contains(&value.len()) { Heard::Last(number(value)) } else { Heard::Nothing }
}

/// Bytes without their escapes; the first one is never escaped.
fn unescaped(bytes: &[u8]) -> Vec<u8> {
    let mut rest = bytes.iter().copied();
    iter::from_fn(|| match rest.next()? {
        ESCAPE => rest.next().map(|byte| byte ^ ESCAPED),
        byte => Some(byte),
    })
    .collect()
}

/// Adds sent bytes to the line that is being typed.
fn type_in(bytes: &[u8], typed: &mut Vec<u8>) {
    if typed.ends_with(b"\r") || typed.len() > MOST_TYPED {
        typed.clear();
    }
    typed.extend(bytes.iter().filter(|byte| **byte != b'\n').take(MOST_TYPED));
}

/// Reads the level of what came in transparent mode: digits and a carriage return behind ATDB.
fn answer(bytes: &[u8], typed: &[u8], answered: &mut Vec<u8>) -> Heard {
    let is_asked = typed.strip_suffix(b"\r").is_some_and(|line| {
        line.len() >= TYPED.len() && line.to_ascii_uppercase().ends_with(TYPED)
    });
    if !is_asked || answered.ends_with(b"\r") || answered.len() > MOST_TYPED {
        return Heard::Nothing;
    }
    answered.extend(bytes.iter().filter(|byte| **byte != b'\n').take(MOST_TYPED));
    let digits = answered.strip_suffix(b"\r").and_then(|line| std::str::from_utf8(line).ok());
    let level = digits.and_then(|digits| u64::from_str_radix(digits, 16).ok());
    level.filter(|level| *level <= u64::from(u8::MAX)).map_or(Heard::Nothing, Heard::Last)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recording::converted::Rows;

    /// The session record of the user guide.
    const API: &str = "21-06-2026 14:03:00.017,-,API,\"A,0013A2004031A8D7,ZigBee Router API,23A7,\
                       COM4 - 9600/8/N/1/N,0\"\n";

    fn read(text: &str) -> Rows {
        let made = convert(text, "console.log").expect("levels").expect("a log");
        let Made::Rows(rows) = made.table else { panic!("rows") };
        rows
    }

    fn csv(rows: Rows) -> String {
        String::from_utf8(rows.csv).expect("text").replace('"', "")
    }

    #[test]
    fn frames_hold_levels() {
        // The request is the data record of the user guide; sums by hand.
        let rows = read(&format!(
            "{API}21-06-2026 14:03:01.000,0,SENT,7E000408764944F4\n\
             21-06-2026 14:03:02.000,1,RECV,7E000681AAAA2D007885\n\
             21-06-2026 14:03:03.000,2,RECV,7E000688014442003CB4\n\
             21-06-2026 14:03:04.000,3,RECV,7E0006880144420028FF\n\
             21-06-2026 14:03:05.000,4,RECV,7E000688\n\
             21-06-2026 14:03:06.000,5,RECV,7E00109701 0013A20040401122 FFFE 444200 3745\n"
        ));
        assert_eq!(rows.header, ["time_utc", "beacon", "rss_dbm"]);
        let problems: Vec<&str> = rows.broken.iter().map(|(_, problem)| problem.as_str()).collect();
        assert_eq!(
            problems,
            ["the frame's checksum is wrong", "the frame ends before its 6 bytes"],
            "{:?}",
            rows.broken
        );
        assert_eq!(
            csv(rows),
            "21-06-2026 14:03:02.000,AAAA,-45\n21-06-2026 14:03:03.000,AAAA,-60\n\
             21-06-2026 14:03:06.000,0013A20040401122,-55\n"
        );
    }

    #[test]
    fn escaped_bytes_are_read() {
        // The address 7E11 is 7D 5E 31 here, of which 31 was 11.
        let session = API.replace(",API,", ",API2,");
        let rows =
            read(&format!("{session}21-06-2026 14:03:02.000,1,RECV,7E0006817D5E7D312D0078 4A\n"));
        assert_eq!(csv(rows), "21-06-2026 14:03:02.000,7E11,-45\n");
    }

    #[test]
    fn the_answer_to_a_typed_command_is_a_level() {
        let session = API.replace(",API,", ",AT,");
        let rows = read(&format!(
            "{session}21-06-2026 14:03:01.000,0,SENT,2B2B2B\n\
             21-06-2026 14:03:02.000,1,RECV,4F4B0D\n21-06-2026 14:03:02.500,2,SENT,61746462\n\
             21-06-2026 14:03:02.600,3,SENT,0D\n21-06-2026 14:03:02.700,4,RECV,33\n\
             21-06-2026 14:03:02.800,5,RECV,430D\n21-06-2026 14:03:03.000,6,RECV,33430D\n"
        ));
        assert_eq!(csv(rows), "21-06-2026 14:03:02.800,,-60\n");
    }

    #[test]
    fn others_are_left_alone() {
        for other in ["", "time,lat,lon,rssi\n", "21-06-2026 14:03:00,1,2,3\n"] {
            assert!(convert(other, "f").expect("no error").is_none(), "{other}");
        }
        let error = convert(API, "console.log").expect_err("no level").to_string();
        assert!(error.contains("XCTU's console without a level"), "{error}");
    }
}
