use foxhunt_wire::xbee::{AtCommand, AtStatus};

use super::registers::Registers;

/// Silence that the line needs before `+++`, and until it is answered, in seconds (`GT`).
const GUARD_S: f64 = 1.0;
/// Commands are taken for this time after the last one, in seconds (`CT`).
const COMMAND_S: f64 = 10.0;

/// A radio that is not in an API mode: what comes is sent on the air, but for commands after `+++`.
#[derive(Debug, Default)]
pub(super) struct Text {
    received_at: f64,
    /// `+++` came after silence; answered then, if nothing follows.
    entering: Option<f64>,
    /// Commands are taken until then.
    commands_until: Option<f64>,
    line: Vec<u8>,
}

impl Text {
    /// Takes what has come; the radio's answer.
    pub(super) fn take_in(&mut self, bytes: &[u8], own: &mut Registers, now: f64) -> Vec<u8> {
        let mut sent = Vec::new();
        self.commands_until = self.commands_until.filter(|until| now < *until);
        if self.commands_until.is_none() && !bytes.is_empty() {
            let quiet = now - self.received_at >= GUARD_S;
            self.entering = (bytes == b"+++" && quiet).then_some(now + GUARD_S);
            self.received_at = now;
        } else if self.commands_until.is_some() {
            for byte in bytes {
                if *byte == b'\r' {
                    self.commands_until = Some(now + COMMAND_S);
                    sent.extend(self.command(own));
                } else if self.line.len() < 64 {
                    self.line.push(*byte);
                }
            }
        }
        if self.entering.is_some_and(|at| now >= at) {
            self.entering = None;
            self.commands_until = Some(now + COMMAND_S);
            self.line.clear();
            sent.extend(b"OK\r");
        }
        sent
    }

    /// Executes the line.
    fn command(&mut self, own: &mut Registers) -> Vec<u8> {
        let line = core::mem::take(&mut self.line);
        let (Some(b"AT"), Some(&[a, b])) =
            (line.get(..2), line.get(2..4).and_then(<[u8]>::first_chunk))
        else {
            return b"ERROR\r".to_vec();
        };
        let command = AtCommand([a, b]);
        if command.0 == *b"CN" {
            self.commands_until = None;
        }
        let text = String::from_utf8_lossy(line.get(4..).unwrap_or_default()).trim().to_owned();
        let parameter = match (text.as_str(), u32::from_str_radix(&text, 16)) {
            ("", _) => Vec::new(),
            (_, Ok(number)) if number < 256 => vec![number.to_be_bytes()[3]],
            (_, Ok(number)) => number.to_be_bytes().to_vec(),
            _ => return b"ERROR\r".to_vec(),
        };
        match own.query(command, &parameter) {
            (AtStatus::OK, value) if value.is_empty() => b"OK\r".to_vec(),
            (AtStatus::OK, value) => {
                let hex: String = value.iter().map(|byte| format!("{byte:02X}")).collect();
                let short = hex.trim_start_matches('0');
                format!("{}\r", if short.is_empty() { "0" } else { short }).into_bytes()
            }
            _ => b"ERROR\r".to_vec(),
        }
    }
}
