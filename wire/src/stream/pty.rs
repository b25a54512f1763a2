use std::{
    fs::File,
    io::{self, Read, Write},
    os::fd::{AsFd, OwnedFd},
    path::{Path, PathBuf},
};

use rustix::{
    fs::{Mode, OFlags, fcntl_getfl, fcntl_setfl, open},
    pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt},
    termios::{OptionalActions, tcgetattr, tcsetattr},
};

use super::ByteStream;

/// The device's end of a pseudo-terminal: a program that opens its [path](Self::path) takes it for
/// a serial port.
#[derive(Debug)]
pub struct PtyStream {
    master: File,
    path: PathBuf,
    /// The program's end, held open: otherwise the device would see a hang-up whenever no program
    /// has the port open.
    _slave: OwnedFd,
}

impl PtyStream {
    /// A new pseudo-terminal, raw: no echo, no line ends, every byte as it is.
    ///
    /// # Errors
    ///
    /// Any error of the system.
    pub fn open() -> io::Result<Self> {
        let master = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC)?;
        grantpt(&master)?;
        unlockpt(&master)?;
        let name = ptsname(&master, Vec::new())?;
        let path = PathBuf::from(name.to_string_lossy().into_owned());
        let slave = open(&path, OFlags::RDWR | OFlags::NOCTTY | OFlags::CLOEXEC, Mode::empty())?;
        let mut settings = tcgetattr(&slave)?;
        settings.make_raw();
        tcsetattr(&slave, OptionalActions::Now, &settings)?;
        fcntl_setfl(&master, fcntl_getfl(master.as_fd())? | OFlags::NONBLOCK)?;
        Ok(Self { master: File::from(master), path, _slave: slave })
    }

    /// Path of the terminal that a program opens.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }
}

impl ByteStream for PtyStream {
    fn receive(&mut self, into: &mut [u8]) -> io::Result<usize> {
        use io::ErrorKind::{Interrupted, WouldBlock};
        match self.master.read(into) {
            Err(error) if matches!(error.kind(), WouldBlock | Interrupted) => Ok(0),
            other => other,
        }
    }

    /// Bytes that nobody fetches are dropped when the terminal is full, as a serial line drops
    /// them.
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        match self.master.write_all(bytes) {
            Err(error) if error.kind() == io::ErrorKind::WouldBlock => Ok(()),
            other => other,
        }
    }
}

#[cfg(test)]
mod tests {
    use std::{thread, time::Duration};

    use super::*;
    use crate::SerialStream;

    #[test]
    fn it_passes_for_a_serial_port_and_a_dropped_one_for_a_pulled_cable() {
        let mut device = PtyStream::open().expect("it works");
        let path = device.path().to_str().expect("it works").to_owned();
        let mut port = SerialStream::open(&path, 57_600).expect("it works");
        // Every byte, those that terminals take for commands included.
        let all: Vec<u8> = (0..=255).collect();
        device.send(&all).expect("it works");
        assert_eq!(all_of(&mut port, 256), all);
        port.send(&all).expect("it works");
        assert_eq!(all_of(&mut device, 256), all);
        drop(device);
        let mut gone = || {
            (0..500).find_map(|_| {
                thread::sleep(Duration::from_millis(2));
                port.receive(&mut [0; 8]).err()
            })
        };
        assert!(gone().is_some(), "a pulled cable is an error");
    }

    /// Terminals hand bytes on a little later.
    fn all_of(stream: &mut dyn ByteStream, count: usize) -> Vec<u8> {
        let mut all = Vec::new();
        let mut into = [0; 64];
        for _ in 0..5000 {
            let taken = stream.receive(&mut into).expect("it works");
            all.extend_from_slice(&into[..taken]);
            if all.len() >= count {
                break;
            }
            thread::sleep(Duration::from_micros(200));
        }
        all
    }
}
