use std::fmt::Write as _;

/// An order, as the AR.Drone's SDK 2.0 has them (Developer Guide, chapter 6).
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum ArDroneCommand {
    /// `AT*REF`: orders to fly or land, and to stop the motors at once.
    Reference {
        /// Takes off, or stays in the air; lands, or stays on the ground.
        fly: bool,
        /// Stops the motors in the air; ends an emergency if there is one.
        emergency: bool,
    },
    /// `AT*PCMD`: tilts, climbs and turns in shares of what is configured as the most, −1 to 1.
    /// Nothing of it counts while it is not progressive: it hovers.
    Progressive {
        /// True if the shares count.
        progressive: bool,
        /// Share of the tilt to the right.
        roll: f32,
        /// Share of the tilt backwards: the nose up.
        pitch: f32,
        /// Share of the speed upwards.
        climb: f32,
        /// Share of the rate of turn, clockwise from above.
        yaw: f32,
    },
    /// `AT*FTRIM`: it stands level now. Not to be sent in the air.
    FlatTrim,
    /// `AT*CTRL`: a request about configuration and state; 5 ends the state after boot.
    Control {
        /// The request.
        mode: i32,
        /// Argument of the request.
        argument: i32,
    },
    /// `AT*CONFIG`: sets a value of the configuration.
    Config {
        /// Such as `general:navdata_demo`.
        key: String,
        /// Such as `FALSE`.
        value: String,
    },
    /// `AT*COMWDG`: somebody is still there.
    Watchdog,
}

/// Bits of `AT*REF` that count; the others are of old firmware, which later ones do not need.
const FLY: i32 = 1 << 9;
const EMERGENCY: i32 = 1 << 8;

/// Bits that older programs set besides (18, 20, 22, 24, 28), without a meaning.
const HISTORICAL: i32 = 0x1154_0000;

/// The longest datagram that the drone reads.
const MOST_BYTES: usize = 1024;

impl ArDroneCommand {
    /// Hovering in place, on its own.
    #[must_use]
    pub fn hover() -> Self {
        let roll = 0.0;
        let pitch = 0.0;
        let climb = 0.0;
        let yaw = 0.0;
        Self::Progressive { progressive: false, roll, pitch, climb, yaw }
    }

    /// The order with its sequence number, and the carriage return at its end.
    #[must_use]
    pub fn encode(&self, sequence: u32) -> String {
        match self {
            Self::Reference { fly, emergency } => {
                let bits = if *fly { FLY } else { 0 } | if *emergency { EMERGENCY } else { 0 };
                format!("AT*REF={sequence},{bits}\r")
            }
            Self::Progressive { progressive, roll, pitch, climb, yaw } => {
                let mut text = format!("AT*PCMD={sequence},{}", i32::from(*progressive));
                for share in [roll, pitch, climb, yaw] {
                    // The bits of the number, taken for a whole one; −0 is 0.
                    let bits = (share + 0.0).to_bits().cast_signed();
                    let _ = write!(text, ",{bits}");
                }
                text.push('\r');
                text
            }
            Self::FlatTrim => format!("AT*FTRIM={sequence}\r"),
            Self::Control { mode, argument } => format!("AT*CTRL={sequence},{mode},{argument}\r"),
            Self::Config { key, value } => {
                let clean = |text: &str| -> String {
                    text.chars().filter(|c| !c.is_control() && *c != '"').collect()
                };
                format!("AT*CONFIG={sequence},\"{}\",\"{}\"\r", clean(key), clean(value))
            }
            Self::Watchdog => format!("AT*COMWDG={sequence}\r"),
        }
    }

    fn parse(line: &str) -> Option<(u32, Self)> {
        let (name, rest) = line.strip_prefix("AT*")?.split_once('=')?;
        let (sequence, arguments) = rest.split_once(',').unwrap_or((rest, ""));
        let sequence = sequence.parse().ok()?;
        let whole = |text: &str| text.parse::<i32>().ok();
        let command = match name {
            "REF" => {
                let bits = whole(arguments)?;
                if bits & !(FLY | EMERGENCY | HISTORICAL) != 0 {
                    return None;
                }
                Self::Reference { fly: bits & FLY != 0, emergency: bits & EMERGENCY != 0 }
            }
            "PCMD" => {
                let mut numbers = arguments.split(',').map(whole);
                let flag = numbers.next()??;
                let mut share = || -> Option<f32> {
                    let share = f32::from_bits(numbers.next()??.cast_unsigned());
                    (share.abs() <= 1.0).then_some(share)
                };
                let roll = share()?;
                let pitch = share()?;
                let climb = share()?;
                let yaw = share()?;
                let progressive = flag & 1 != 0;
                let command = Self::Progressive { progressive, roll, pitch, climb, yaw };
                return numbers.next().is_none().then_some((sequence, command));
            }
            "FTRIM" if arguments.is_empty() => Self::FlatTrim,
            "COMWDG" if arguments.is_empty() => Self::Watchdog,
            "CTRL" => {
                let (mode, argument) = arguments.split_once(',')?;
                Self::Control { mode: whole(mode)?, argument: whole(argument)? }
            }
            "CONFIG" => {
                let inner = arguments.strip_prefix('"')?.strip_suffix('"')?;
                let (key, value) = inner.split_once("\",\"")?;
                if key.contains('"') || value.contains('"') {
                    return None;
                }
                Self::Config { key: key.into(), value: value.into() }
            }
            _ => return None,
        };
        Some((sequence, command))
    }
}

/// Reason for refusing a datagram of orders.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ArDroneCommandError {
    /// It is longer than the drone reads, or not text.
    #[error("a datagram of {length} bytes; orders are text of at most 1024")]
    Datagram {
        /// Length of the datagram in bytes.
        length: usize,
    },
    /// A line is no order.
    #[error("{line:?} is not an order")]
    Line {
        /// The line.
        line: String,
    },
}

/// A datagram of orders; their numbers count on from `sequence`, which is left at the next one.
#[must_use]
pub fn encode_commands(commands: &[ArDroneCommand], sequence: &mut u32) -> Vec<u8> {
    let mut text = String::new();
    for command in commands {
        text.push_str(&command.encode(*sequence));
        *sequence = sequence.wrapping_add(1);
    }
    text.into_bytes()
}

/// The orders of a datagram, with their sequence numbers.
///
/// # Errors
///
/// [`ArDroneCommandError`] names the text that is no order; nothing of the datagram is taken then.
pub fn parse_commands(datagram: &[u8]) -> Result<Vec<(u32, ArDroneCommand)>, ArDroneCommandError> {
    let length = datagram.len();
    let text = std::str::from_utf8(datagram).ok().filter(|_| length <= MOST_BYTES);
    let text = text.ok_or(ArDroneCommandError::Datagram { length })?;
    text.split_terminator('\r')
        .map(|line| {
            let wrong = || ArDroneCommandError::Line { line: line.chars().take(80).collect() };
            ArDroneCommand::parse(line).ok_or_else(wrong)
        })
        .collect()
}
