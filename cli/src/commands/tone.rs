//! The tone of the received level (`fly --tone`): WAV, written while the hunt goes on.

use std::{
    f64::consts::TAU,
    fs::File,
    io::{self, BufWriter, Seek, SeekFrom, Write},
    path::{Path, PathBuf},
};

use foxhunt::fly::{Pitch, PitchConfig};

use crate::error::CliError;

/// Samples per second: enough for the highest tone.
const RATE_HZ: u32 = 8000;

/// Bytes of the header of a WAV file.
const HEADER: u32 = 44;

/// Loudness of the tone, of the greatest number of 16 bits.
const AMPLITUDE: f64 = 12_000.0;

/// Time constant by which the tone fades in and out, in seconds: without it every change clicks.
const FADE_S: f64 = 0.01;

/// Longest piece that is written at once, in bytes, of 10 s: a clock that was set is no reason for
/// hours of sound.
const LONGEST: usize = 160_000;

/// Flags of the tone.
#[derive(Debug, clap::Args)]
pub(super) struct ToneArgs {
    /// Write a tone whose pitch follows the level of carried receivers to this WAV file; `-` writes
    /// to standard output, for a player
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
    /// The tone, if one is wanted.
    pub(super) fn open(&self) -> Result<Option<Tone>, CliError> {
        let Some(path) = &self.tone else { return Ok(None) };
        let config = PitchConfig { floor_dbm: self.tone_floor_dbm, ..PitchConfig::default() };
        let pitch = Pitch::new(config)
            .map_err(|error| CliError::input(format!("--tone-floor-dbm: {error}")))?;
        Tone::to(path, pitch).map(Some).map_err(|error| CliError::writing(path, error))
    }

    /// True if the tone takes standard output.
    pub(super) fn takes_stdout(&self) -> bool {
        self.tone.as_deref() == Some(Path::new("-"))
    }
}

/// A tone that is written as time passes.
pub(super) struct Tone {
    path: PathBuf,
    out: Out,
    synthesis: Synthesis,
}

/// Destination of a tone.
enum Out {
    /// A file, whose header gets its length in the end.
    File(BufWriter<File>),
    /// A player, which does not know the length.
    Stream(io::Stdout),
}

impl Write for Out {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        match self {
            Self::File(file) => file.write(bytes),
            Self::Stream(stream) => stream.write(bytes),
        }
    }

    fn flush(&mut self) -> io::Result<()> {
        match self {
            Self::File(file) => file.flush(),
            Self::Stream(stream) => stream.flush(),
        }
    }
}

impl Tone {
    fn to(path: &Path, pitch: Pitch) -> io::Result<Self> {
        let mut out = match path == Path::new("-") {
            true => Out::Stream(io::stdout()),
            false => Out::File(BufWriter::new(File::create(path)?)),
        };
        // The longest that a header can announce: players of streams read until the end.
        out.write_all(&header(u32::MAX - HEADER))?;
        Ok(Self { path: path.to_owned(), out, synthesis: Synthesis::new(pitch) })
    }

    /// Takes a level in dBm of a time in seconds.
    pub(super) fn received(&mut self, time: f64, level_dbm: f64) {
        self.synthesis.pitch.received(time, level_dbm);
    }

    /// Writes the sound until a time.
    pub(super) fn pass(&mut self, time: f64) -> Result<(), CliError> {
        let samples = self.synthesis.until(time);
        if samples.is_empty() {
            return Ok(());
        }
        let written = self.out.write_all(&samples).and_then(|()| match &mut self.out {
            Out::Stream(stream) => stream.flush(),
            Out::File(_) => Ok(()),
        });
        written.map_err(|error| CliError::writing(&self.path, error))
    }

    /// Writes the length into the header of a file.
    pub(super) fn finish(mut self) -> Result<(), CliError> {
        let bytes = self.synthesis.bytes;
        let finished = self.out.flush().and_then(|()| match &mut self.out {
            Out::Stream(_) => Ok(()),
            Out::File(file) => {
                file.seek(SeekFrom::Start(0))?;
                file.write_all(&header(bytes))?;
                file.flush()
            }
        });
        finished.map_err(|error| CliError::writing(&self.path, error))
    }
}

/// The sound of a pitch, sample by sample.
struct Synthesis {
    pitch: Pitch,
    /// Time at which the sound begins; `None` before the first call.
    begin: Option<f64>,
    /// Number of samples until now.
    count: u64,
    /// Number of bytes until now, as far as a header can have them.
    bytes: u32,
    /// Phase in turns.
    phase: f64,
    /// Present tone and loudness from 0 to 1.
    hz: f64,
    loudness: f64,
}

impl Synthesis {
    fn new(pitch: Pitch) -> Self {
        Self { pitch, begin: None, count: 0, bytes: 0, phase: 0.0, hz: 0.0, loudness: 0.0 }
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
        let added = u32::try_from(bytes.len()).unwrap_or(u32::MAX);
        self.bytes = self.bytes.saturating_add(added).min(u32::MAX - HEADER);
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
        assert!(sound.until(1e6).len() <= 160_000, "a clock that jumps");
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
