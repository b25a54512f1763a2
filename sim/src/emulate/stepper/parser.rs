/// Bytes from the host as ConfigurableFirmata takes them.
///
/// It looks at no length and no high bit within a system exclusive message: a short one is taken
/// with the bytes that the message before left in the same places, and one whose end was lost
/// goes on with the next.
#[derive(Clone, Debug)]
pub(super) struct Parser {
    stored: [u8; LONGEST],
    length: usize,
    in_sysex: bool,
    status: u8,
    waiting: usize,
}

/// A message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Taken {
    Version,
    Reset,
    PinMode { pin: u8, mode: u8 },
    PinLevel { pin: u8, high: bool },
    Levels { port: u8, levels: u8 },
    ReportDigital { port: u8, on: bool },
    Sysex,
}

/// Most bytes between F0 and F7.
const LONGEST: usize = 64;

impl Default for Parser {
    fn default() -> Self {
        Self { stored: [0; LONGEST], length: 0, in_sysex: false, status: 0, waiting: 0 }
    }
}

impl Parser {
    /// Takes a byte; the message that it completes.
    pub(super) fn push(&mut self, byte: u8) -> Option<Taken> {
        if byte == 0xFF {
            *self = Self::default();
            return Some(Taken::Reset);
        }
        if self.in_sysex {
            return self.within(byte);
        }
        if self.waiting > 0 && byte < 0x80 {
            self.waiting -= 1;
            self.stored[self.waiting] = byte;
            return if self.waiting == 0 { self.short() } else { None };
        }
        match byte {
            0xF0 => (self.in_sysex, self.length) = (true, 0),
            0xF9 => return Some(Taken::Version),
            0xF4 | 0xF5 | 0x90..=0x9F | 0xE0..=0xEF => (self.status, self.waiting) = (byte, 2),
            0xC0..=0xDF => (self.status, self.waiting) = (byte, 1),
            _ => {}
        }
        None
    }

    /// The command of a system exclusive message, its length without that, and all places behind
    /// it, whatever they hold.
    pub(super) fn sysex(&self) -> (u8, usize, &[u8]) {
        (self.stored[0], self.length - 1, &self.stored[1..])
    }

    fn within(&mut self, byte: u8) -> Option<Taken> {
        if byte == 0xF7 {
            self.in_sysex = false;
            return (self.length > 0).then_some(Taken::Sysex);
        }
        if let Some(place) = self.stored.get_mut(self.length) {
            *place = byte;
            self.length += 1;
        } else {
            (self.in_sysex, self.length, self.waiting) = (false, 0, 0);
        }
        None
    }

    fn short(&mut self) -> Option<Taken> {
        // The bytes stand there in reverse.
        let [last, first] = [self.stored[0], self.stored[1]];
        let status = std::mem::take(&mut self.status);
        let port = status & 0x0F;
        match status {
            0xF4 => Some(Taken::PinMode { pin: first, mode: last }),
            0xF5 => Some(Taken::PinLevel { pin: first, high: last != 0 }),
            0x90..=0x9F => Some(Taken::Levels { port, levels: first | (last & 1) << 7 }),
            0xD0..=0xDF => Some(Taken::ReportDigital { port, on: last != 0 }),
            _ => None,
        }
    }
}
