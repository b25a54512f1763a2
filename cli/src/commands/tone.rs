//! The tone of the received level (`fly --tone`): WAV, written while the hunt goes on.

use std::{
    f64::consts::TAU,
    fs::File,
    io::{self, BufWriter, Seek, SeekFrom, Write},
    path::{Path, PathBuf},
    sync::mpsc::{self, Receiver, RecvTimeoutError, SyncSender, TrySendError},
    thread,
    time::Duration,
};

use foxhunt::fly::{Pitch, PitchConfig};

use crate::{error::CliError, output::warn};

/// Samples per second: enough for the highest tone.
const RATE_HZ: u32 = 8000;

/// Bytes of the header of a WAV file.
const HEADER: u32 = 44;

/// Loudness of the tone, of the greatest number of 16 bits.
const AMPLITUDE: f64 = 12_000.0;

/// Time constant by which the tone fades in and out, in seconds: without it every change clicks.
const FADE_S: f64 = 0.01;

/// Longest piece that is written at once, in bytes, of 10 s. After a longer gap the sound goes on
/// at the present: a clock that was set is no reason for hours of sound.
const LONGEST: usize = 160_000;

/// Number of pieces that wait to be written, 1.3 s at the steps of a flight. More are left out: a
/// player that was stopped must not stop the flight.
const QUEUE: usize = 256;

/// Time for which the end of the writing is waited for, in seconds.
const FINISH_S: u64 = 3;

/// Flags of the tone.
#[derive(Debug, clap::Args)]
pub struct ToneArgs {
    /// Write a tone whose pitch follows the level of carried receivers to this WAV file; `-` writes
    /// to standard output, for a player. All carried receivers and all beacons share the tone: the
    /// highest level counts
    #[arg(long, value_name = "FILE")]
    tone: Option<PathBuf>,
    /// The level in dBm below which there is no tone
    #[arg(
        long,
        value_name = "DBM",
        requires = "tone",
        default_value_t = -100.0,
        allow_negative_numbers = true
    )]
    tone_floor_dbm: f64,
}

impl ToneArgs {
    /// The tone, if one is wanted. `waits` is true if nothing flies in real time: each piece is
    /// then waited for, and none is left out.
    pub fn open(&self, waits: bool) -> Result<Option<Tone>, CliError> {
        let Some(path) = &self.tone else { return Ok(None) };
        let config = PitchConfig { floor_dbm: self.tone_floor_dbm, ..PitchConfig::default() };
        let pitch = Pitch::new(config)
            .map_err(|error| CliError::input(format!("--tone-floor-dbm: {error}")))?;
        let out = match self.takes_stdout() {
            true => Out::Stream(Box::new(io::stdout())),
            false => {
                let file = File::create(path).map_err(|error| CliError::writing(path, error))?;
                Out::File(BufWriter::new(file))
            }
        };
        let tone = Tone::start(path, out, pitch, waits);
        tone.map(Some).map_err(|error| CliError::writing(path, error))
    }

    /// True if a tone is wanted.
    pub fn is_given(&self) -> bool {
        self.tone.is_some()
    }

    /// True if the tone takes standard output.
    pub fn takes_stdout(&self) -> bool {
        self.tone.as_deref() == Some(Path::new("-"))
    }
}

/// A tone that a thread of its own writes as time passes.
pub struct Tone {
    path: PathBuf,
    synthesis: Synthesis,
    /// Pieces for the thread.
    pieces: SyncSender<Vec<u8>>,
    /// Result of the thread, once it has ended.
    ended: Receiver<io::Result<()>>,
    waits: bool,
    /// True if a piece was left out.
    left_out: bool,
}

/// Destination of a tone.
enum Out {
    /// A file, whose header gets its length in the end.
    File(BufWriter<File>),
    /// A player, which does not know the length.
    Stream(Box<dyn Write + Send>),
}

impl Out {
    /// Writes all pieces until the last.
    fn write(mut self, pieces: &Receiver<Vec<u8>>) -> io::Result<()> {
        let mut count = 0_u32;
        // The longest that a header can announce: players of streams read until the end.
        self.put(&header(u32::MAX - HEADER))?;
        for piece in pieces {
            let added = u32::try_from(piece.len()).unwrap_or(u32::MAX);
            count = count.saturating_add(added).min(u32::MAX - HEADER);
            self.put(&piece)?;
        }
        match self {
            Self::Stream(_) => Ok(()),
            Self::File(mut file) => {
                file.seek(SeekFrom::Start(0))?;
                file.write_all(&header(count))?;
                file.flush()
            }
        }
    }

    fn put(&mut self, bytes: &[u8]) -> io::Result<()> {
        match self {
            Self::File(file) => file.write_all(bytes),
            Self::Stream(stream) => stream.write_all(bytes).and_then(|()| stream.flush()),
        }
    }
}

impl Tone {
    fn start(path: &Path, out: Out, pitch: Pitch, waits: bool) -> io::Result<Self> {
        let (pieces, written) = mpsc::sync_channel(QUEUE);
        let (end, ended) = mpsc::channel();
        // It ends with the last piece, with an error, or with the program.
        thread::Builder::new().name("tone".to_owned()).spawn(move || {
            // Nobody may be left to hear of it.
            let _ = end.send(out.write(&written));
        })?;
        let synthesis = Synthesis::new(pitch);
        Ok(Self { path: path.to_owned(), synthesis, pieces, ended, waits, left_out: false })
    }

    /// Takes a level in dBm of a time in seconds.
    pub fn received(&mut self, time: f64, level_dbm: f64) {
        self.synthesis.pitch.received(time, level_dbm);
    }

    /// Has the sound until a time written. Never blocks unless it [waits](ToneArgs::open).
    ///
    /// # Errors
    ///
    /// If the sound cannot be written any more.
    pub fn pass(&mut self, time: f64) -> Result<(), CliError> {
        let samples = self.synthesis.until(time);
        if samples.is_empty() {
            return Ok(());
        }
        let sent = match self.waits {
            true => self.pieces.send(samples).map_err(|error| TrySendError::Disconnected(error.0)),
            false => self.pieces.try_send(samples),
        };
        match sent {
            Ok(()) => Ok(()),
            Err(TrySendError::Full(_)) => {
                if !std::mem::replace(&mut self.left_out, true) {
                    let path = self.path.display();
                    warn(&format!("{path}: written too slowly; parts of the tone are left out"));
                }
                Ok(())
            }
            Err(TrySendError::Disconnected(_)) => self.end(),
        }
    }

    /// Waits a moment until all is written, and the length stands in the header of a file.
    ///
    /// # Errors
    ///
    /// If the sound could not be written, or is not yet.
    pub fn finish(self) -> Result<(), CliError> {
        let Self { path, pieces, ended, .. } = self;
        drop(pieces);
        result(&path, &ended)
    }

    /// The result of a thread that takes no more pieces.
    fn end(&self) -> Result<(), CliError> {
        result(&self.path, &self.ended)
    }
}

/// Waits a moment for the result of the thread that writes.
fn result(path: &Path, ended: &Receiver<io::Result<()>>) -> Result<(), CliError> {
    let ended = ended.recv_timeout(Duration::from_secs(FINISH_S)).unwrap_or_else(|error| {
        Err(match error {
            RecvTimeoutError::Timeout => io::ErrorKind::TimedOut.into(),
            RecvTimeoutError::Disconnected => io::ErrorKind::BrokenPipe.into(),
        })
    });
    ended.map_err(|error| CliError::writing(path, error))
}

/// The sound of a pitch, sample by sample.
struct Synthesis {
    pitch: Pitch,
    /// Time at which the sound begins; `None` before the first call.
    begin: Option<f64>,
    /// Number of samples until now.
    count: u64,
    /// Phase in turns.
    phase: f64,
    /// Present tone and loudness from 0 to 1.
    hz: f64,
    loudness: f64,
}

impl Synthesis {
    fn new(pitch: Pitch) -> Self {
        Self { pitch, begin: None, count: 0, phase: 0.0, hz: 0.0, loudness: 0.0 }
    }

    /// The samples until a time.
    fn until(&mut self, time: f64) -> Vec<u8> {
        let rate = f64::from(RATE_HZ);
        let begin = *self.begin.get_or_insert(time);
        let mut bytes = Vec::new();
        let fade = 1.0 - (-1.0 / (FADE_S * rate)).exp();
        let tone = self.pitch.hz(time);
        self.hz = tone.unwrap_or(self.hz);
        let goal = f64::from(u8::from(tone.is_some()));
        #[expect(clippy::cast_precision_loss, reason = "flights have less than 2^53 samples")]
        while begin + self.count as f64 / rate < time && bytes.len() < LONGEST {
            self.loudness += (goal - self.loudness) * fade;
            self.phase = (self.phase + self.hz / rate).fract();
            let value = AMPLITUDE * self.loudness * (TAU * self.phase).sin();
            #[expect(clippy::cast_possible_truncation, reason = "within 12,000")]
            bytes.extend((value as i16).to_le_bytes());
            self.count += 1;
        }
        if bytes.len() >= LONGEST {
            self.begin = Some(time);
            self.count = 0;
        }
        bytes
    }
}

/// The header of a WAV file with one channel of 16 bits and this number of bytes.
fn header(bytes: u32) -> Vec<u8> {
    let mut header = Vec::new();
    header.extend(b"RIFF");
    header.extend((bytes + HEADER - 8).to_le_bytes());
    header.extend(b"WAVEfmt ");
    header.extend(16_u32.to_le_bytes());
    // PCM, one channel.
    header.extend([1, 0, 1, 0]);
    header.extend(RATE_HZ.to_le_bytes());
    header.extend((2 * RATE_HZ).to_le_bytes());
    // Two bytes a sample, 16 bits.
    header.extend([2, 0, 16, 0]);
    header.extend(b"data");
    header.extend(bytes.to_le_bytes());
    header
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Zero crossings from below per second.
    fn crossings(bytes: &[u8]) -> usize {
        let samples: Vec<i16> =
            bytes.chunks_exact(2).map(|pair| i16::from_le_bytes([pair[0], pair[1]])).collect();
        samples.windows(2).filter(|pair| pair[0] < 0 && pair[1] >= 0).count()
    }

    #[test]
    fn the_sound_has_the_pitch_of_the_level_and_is_silent_below_the_floor() {
        let pitch = Pitch::new(PitchConfig::default()).expect("in range");
        let mut sound = Synthesis::new(pitch);
        assert!(sound.until(100.0).is_empty(), "it begins here");
        sound.pitch.received(100.0, -70.0);
        let second = sound.until(101.0);
        assert_eq!(second.len(), 16_000);
        // 200 · √10 Hz.
        assert!(crossings(&second).abs_diff(632) <= 2, "{}", crossings(&second));
        sound.pitch.received(101.0, -40.0);
        assert!(crossings(&sound.until(102.0)).abs_diff(2000) <= 2);
        let quiet = sound.until(105.0);
        let end = &quiet[quiet.len() - 1000..];
        assert!(end.chunks_exact(2).all(|pair| i16::from_le_bytes([pair[0], pair[1]]) == 0));
        assert_eq!(sound.until(1e6).len(), 160_000, "a clock that jumps");
        assert_eq!(sound.until(1e6 + 0.1).len(), 1600, "it goes on at the present");
    }

    /// A player that is stopped: it reads nothing until the other end is dropped.
    struct Stopped(Receiver<()>);

    impl Write for Stopped {
        fn write(&mut self, _bytes: &[u8]) -> io::Result<usize> {
            let _ = self.0.recv();
            Err(io::ErrorKind::BrokenPipe.into())
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    #[test]
    fn a_player_that_is_stopped_or_closed_does_not_stop_the_flight() {
        let (player, stopped) = mpsc::channel();
        let pitch = Pitch::new(PitchConfig::default()).expect("in range");
        let out = Out::Stream(Box::new(Stopped(stopped)));
        let mut tone = Tone::start(Path::new("-"), out, pitch, false).expect("a thread");
        let steps = 2 * u32::try_from(QUEUE).expect("small");
        for step in 0..steps {
            tone.pass(0.01 * f64::from(step)).expect("it is stopped, and may go on");
        }
        assert!(tone.left_out);
        drop(player);
        let error = tone.finish().expect_err("it is closed").to_string();
        assert!(error.contains("cannot be written"), "{error}");
    }

    #[test]
    fn a_file_that_is_waited_for_has_all_of_its_sound() {
        let path = std::env::temp_dir().join(format!("tone-{}.wav", std::process::id()));
        let args = ToneArgs { tone: Some(path.clone()), tone_floor_dbm: -100.0 };
        let mut tone = args.open(true).expect("it can be written").expect("it is wanted");
        for step in 0..1001 {
            tone.pass(f64::from(step)).expect("a file");
        }
        tone.finish().expect("a file");
        let written = std::fs::read(&path).expect("a file");
        std::fs::remove_file(&path).expect("a file");
        assert_eq!(written.len(), 44 + 16_000_000);
        assert_eq!(written[..44], header(16_000_000));
    }

    #[test]
    fn a_header_is_that_of_mono_pcm() {
        let header = header(16_000);
        assert_eq!(u32::try_from(header.len()), Ok(HEADER));
        assert_eq!(header[4..8], 16_036_u32.to_le_bytes());
        assert_eq!(header[24..28], 8000_u32.to_le_bytes());
        assert_eq!(header[40..44], 16_000_u32.to_le_bytes());
    }
}
