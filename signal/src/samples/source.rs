use std::{
    collections::VecDeque,
    fmt,
    io::{self, Read},
};

use rustfft::num_complex::Complex32;

use super::{
    SampleError, SampleFormat,
    encoding::Encoding,
    wave::{self, Problem, Wave},
};

/// The most samples that are read at once.
const CHUNK: usize = 1 << 14;

/// Complex samples in chunks, each with its place in the stream: a sample's time is its index over
/// the rate.
///
/// Indices count what the receiver took, not what arrived: where samples were lost they jump
/// ([`SampleSource::lost`], `core:global_index` of SigMF), so that what comes after keeps its time.
pub struct SampleSource {
    file: String,
    reader: Reader,
    rate_hz: f64,
    center_hz: Option<f64>,
    /// Index of the next sample, as the receiver counts.
    index: u64,
    /// The number of samples that were read.
    read: u64,
    /// Jumps of the index: the number of samples read before each, and the index after it.
    jumps: VecDeque<(u64, u64)>,
    /// The reason why the next samples are refused.
    refused: Option<SampleError>,
}

/// The reader that samples come from.
struct Reader {
    input: Box<dyn Read + Send>,
    encoding: Encoding,
    buffer: Vec<u8>,
    /// Bytes of a sample that has not come whole, at the buffer's beginning.
    kept: usize,
    /// Bytes that are still to come, where a header says so.
    left: Option<u64>,
}

impl fmt::Debug for SampleSource {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter
            .debug_struct("SampleSource")
            .field("file", &self.file)
            .field("rate_hz", &self.rate_hz)
            .field("center_hz", &self.center_hz)
            .field("index", &self.index)
            .finish_non_exhaustive()
    }
}

impl SampleSource {
    /// Samples of a format without a header; `file` is what errors name.
    ///
    /// # Errors
    ///
    /// [`SampleError::Field`] if the rate is not finite and above 0, or the centre not finite.
    pub fn raw(
        file: &str,
        input: Box<dyn Read + Send>,
        format: SampleFormat,
        rate_hz: f64,
        center_hz: Option<f64>,
    ) -> Result<Self, SampleError> {
        Self::new(file, input, Encoding::Plain(format), None, rate_hz, center_hz)
    }

    /// Samples of a WAV file (also RF64, BW64 and Wave64) of two channels, I and Q, of integers or
    /// floats; its header has the rate, and the centre where it has an `auxi` chunk.
    ///
    /// # Errors
    ///
    /// [`SampleError`] if it is no WAV file, or not one of two channels.
    pub fn wav(
        file: &str,
        input: Box<dyn Read + Send>,
        center_hz: Option<f64>,
    ) -> Result<Self, SampleError> {
        Self::wav_of_length(file, input, None, center_hz)
    }

    /// Samples of a WAV file that has `length` bytes in all. Where the size in its header wrapped,
    /// or was never written, the file's length holds.
    pub(super) fn wav_of_length(
        file: &str,
        mut input: Box<dyn Read + Send>,
        length: Option<u64>,
        center_hz: Option<f64>,
    ) -> Result<Self, SampleError> {
        let wave = wave::header(&mut input, length).map_err(|problem| match problem {
            Problem::Read(source) => {
                SampleError::Read { file: file.to_owned(), samples: 0, source }
            }
            Problem::Header(what) => {
                let requirement = "that of integers of 8, 16, 24 or 32 bits or of floats of 32";
                SampleError::field(file, "the WAV header", what, requirement)
            }
        })?;
        let Wave { encoding, channels, rate_hz, data_bytes, .. } = wave;
        if channels != 2 {
            let field = "the number of channels";
            return Err(SampleError::field(file, field, channels, "2, I and Q"));
        }
        Self::new(file, input, encoding, data_bytes, rate_hz, center_hz.or(wave.center_hz))
    }

    /// Samples of an encoding, in the bytes that are `left` or in all that come.
    pub(super) fn new(
        file: &str,
        input: Box<dyn Read + Send>,
        encoding: Encoding,
        left: Option<u64>,
        rate_hz: f64,
        center_hz: Option<f64>,
    ) -> Result<Self, SampleError> {
        if !(rate_hz.is_finite() && rate_hz > 0.0) {
            let requirement = "finite and above 0";
            return Err(SampleError::field(file, "the sample rate", rate_hz, requirement));
        }
        if let Some(center) = center_hz.filter(|center| !center.is_finite()) {
            return Err(SampleError::field(file, "the centre frequency", center, "finite"));
        }
        let buffer = vec![0; CHUNK * encoding.bytes()];
        Ok(Self {
            file: file.to_owned(),
            reader: Reader { input, encoding, buffer, kept: 0, left },
            rate_hz,
            center_hz,
            index: 0,
            read: 0,
            jumps: VecDeque::new(),
            refused: None,
        })
    }

    /// Jumps of the index, in the order of the samples.
    #[must_use]
    pub(super) fn with_jumps(mut self, jumps: VecDeque<(u64, u64)>) -> Self {
        self.jumps = jumps;
        self
    }

    /// Sets the centre where the file has none.
    #[must_use]
    pub(super) fn with_center_unless_known(mut self, center_hz: Option<f64>) -> Self {
        self.center_hz = self.center_hz.or(center_hz);
        self
    }

    /// The name of the file in errors.
    #[must_use]
    pub fn file(&self) -> &str {
        &self.file
    }

    /// Samples per second.
    #[must_use]
    pub fn rate_hz(&self) -> f64 {
        self.rate_hz
    }

    /// The frequency in the middle of the band, where it is known.
    #[must_use]
    pub fn center_hz(&self) -> Option<f64> {
        self.center_hz
    }

    /// The power of the noise that rounding gave the samples, over that of a tone at full scale.
    #[must_use]
    pub fn rounding_noise(&self) -> f64 {
        self.reader.encoding.rounding_noise()
    }

    /// The index of the next sample.
    #[must_use]
    pub fn index(&self) -> u64 {
        self.index
    }

    /// Places a gap before the next sample: `samples` samples were lost.
    pub fn lost(&mut self, samples: u64) {
        self.index = self.index.saturating_add(samples);
    }

    /// Replaces what is in `samples` by the next ones, and returns the index of the first; `None`
    /// at the end. A chunk has no gap inside. Bytes of an incomplete last sample are left out.
    ///
    /// A stream is not waited for longer than until it has one sample.
    ///
    /// # Errors
    ///
    /// [`SampleError`] if the input cannot be read, or holds a float that is not finite; the
    /// samples before it are given first.
    pub fn read(&mut self, samples: &mut Vec<Complex32>) -> Result<Option<u64>, SampleError> {
        samples.clear();
        if let Some(refused) = self.refused.take() {
            return Err(refused);
        }
        while let Some((_, index)) = self.jumps.front().filter(|(at, _)| *at <= self.read) {
            self.index = self.index.max(*index);
            self.jumps.pop_front();
        }
        let until_jump = self.jumps.front().map_or(u64::MAX, |(at, _)| at - self.read);
        let most = usize::try_from(until_jump).unwrap_or(CHUNK).min(CHUNK);
        let Reader { input, encoding, buffer, kept, left } = &mut self.reader;
        let size = encoding.bytes();
        let mut filled = *kept;
        while filled < size {
            let room = u64::try_from(most * size - filled).unwrap_or(u64::MAX);
            let room = left.map_or(room, |left| left.min(room));
            let end = filled + usize::try_from(room).unwrap_or(usize::MAX);
            let failed = |source| {
                let file = self.file.clone();
                Err(SampleError::Read { file, samples: self.read, source })
            };
            match input.read(&mut buffer[filled..end]) {
                Ok(0) if left.is_some_and(|left| left > 0) => {
                    return failed(io::ErrorKind::UnexpectedEof.into());
                }
                Ok(0) => return Ok(None),
                Ok(count) => {
                    filled += count;
                    *left = left.map(|left| left.saturating_sub(count as u64));
                }
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                Err(source) => return failed(source),
            }
        }
        let whole = filled - filled % size;
        encoding.decode(&buffer[..whole], samples);
        buffer.copy_within(whole..filled, 0);
        *kept = filled - whole;
        let bad = |sample: &Complex32| !(sample.re.is_finite() && sample.im.is_finite());
        if let Some(at) = samples.iter().position(bad) {
            let field = format!("sample {}", self.read + at as u64);
            let refused = SampleError::field(&self.file, field, samples[at], "finite");
            self.refused = Some(refused);
            samples.truncate(at);
        }
        if samples.is_empty() {
            return self.refused.take().map_or(Ok(None), Err);
        }
        let count = samples.len() as u64;
        let first = self.index;
        self.index = self.index.saturating_add(count);
        self.read += count;
        Ok(Some(first))
    }
}

#[cfg(test)]
mod tests {
    use approx::assert_abs_diff_eq;
    use std::io::Cursor;

    use super::*;

    /// Gives what it has in pieces of a few bytes, as a network does.
    struct Trickle(Cursor<Vec<u8>>, usize);

    impl Read for Trickle {
        fn read(&mut self, into: &mut [u8]) -> io::Result<usize> {
            let most = into.len().min(self.1);
            self.0.read(&mut into[..most])
        }
    }

    fn all(mut source: SampleSource) -> Vec<(u64, Complex32)> {
        let mut chunk = Vec::new();
        let mut samples = Vec::new();
        while let Some(first) = source.read(&mut chunk).expect("it can be read") {
            samples.extend((first..).zip(chunk.iter().copied()));
        }
        samples
    }

    fn raw(bytes: &[u8], format: SampleFormat, piece: usize) -> SampleSource {
        let input = Box::new(Trickle(Cursor::new(bytes.to_vec()), piece));
        SampleSource::raw("a", input, format, 100.0, None).expect("it is in order")
    }

    fn wav<S: hound::Sample + Copy>(spec: hound::WavSpec, values: &[S]) -> Vec<u8> {
        let mut bytes = Cursor::new(Vec::new());
        let mut writer = hound::WavWriter::new(&mut bytes, spec).expect("a header");
        for value in values {
            writer.write_sample(*value).expect("memory");
        }
        writer.finalize().expect("memory");
        bytes.into_inner()
    }

    #[test]
    fn formats_have_their_scales() {
        let floats: Vec<u8> = [0.5_f32, -0.25, 1.0, 0.0].map(f32::to_le_bytes).concat();
        let words: Vec<u8> = [16384_i16, -8192, 32767, 0].map(i16::to_le_bytes).concat();
        let cases: [(SampleFormat, &[u8], [f32; 4]); 4] = [
            (SampleFormat::Cu8, &[255, 0, 128, 127, 9], [1.0, -1.0, 0.5 / 127.5, -0.5 / 127.5]),
            (SampleFormat::Cs8, &[64, 224, 127, 128], [0.5, -0.25, 127.0 / 128.0, -1.0]),
            (SampleFormat::Cs16, &words, [0.5, -0.25, 32767.0 / 32768.0, 0.0]),
            (SampleFormat::Cf32, &floats, [0.5, -0.25, 1.0, 0.0]),
        ];
        for (format, bytes, [a, b, c, d]) in cases {
            for piece in [1, 3, 100] {
                let expected = [(0, Complex32::new(a, b)), (1, Complex32::new(c, d))];
                assert_eq!(all(raw(bytes, format, piece)), expected, "{format:?} {piece}");
            }
            assert_eq!(SampleFormat::of_name(format.name()), Some(format));
        }
    }

    #[test]
    fn wav_of_integers_and_floats() {
        for bits in [8, 16, 24, 32] {
            let spec = hound::WavSpec {
                channels: 2,
                sample_rate: 48_000,
                bits_per_sample: bits,
                sample_format: hound::SampleFormat::Int,
            };
            let full = 1_i64 << (bits - 1);
            let values = [full / 2, -full / 4].map(|v| i32::try_from(v).expect("it fits"));
            let input = Box::new(Cursor::new(wav(spec, &values)));
            let source = SampleSource::wav("a.wav", input, None).expect("a WAV file");
            assert_abs_diff_eq!(source.rate_hz(), 48e3, epsilon = 1e-9);
            assert_eq!(all(source), [(0, Complex32::new(0.5, -0.25))], "{bits} bits");
        }
        let spec = hound::WavSpec {
            channels: 2,
            sample_rate: 8_000,
            bits_per_sample: 32,
            sample_format: hound::SampleFormat::Float,
        };
        let floats: Vec<f32> = (0..50_000_u16).map(|n| f32::from(n) / 65_536.0).collect();
        let read = all(SampleSource::wav("a.wav", Box::new(Cursor::new(wav(spec, &floats))), None)
            .expect("a WAV file"));
        assert_eq!(read.len(), 25_000);
        assert_eq!(read[24_999], (24_999, Complex32::new(floats[49_998], floats[49_999])));

        let mono = hound::WavSpec { channels: 1, ..spec };
        let input = Box::new(Cursor::new(wav(mono, &floats)));
        let error = SampleSource::wav("m.wav", input, None).expect_err("one channel");
        assert!(error.to_string().contains("m.wav: the number of channels is 1"), "{error}");
        let error = SampleSource::wav("x.wav", Box::new(Cursor::new(vec![1; 100])), None);
        assert!(error.expect_err("no header").to_string().contains("x.wav"));
    }

    #[test]
    fn lost_samples_move_the_index() {
        let mut source = raw(&[0; 8], SampleFormat::Cu8, 4);
        let mut chunk = Vec::new();
        assert_eq!(source.read(&mut chunk).expect("samples"), Some(0));
        assert_eq!(chunk.len(), 2);
        source.lost(1000);
        assert_eq!(source.read(&mut chunk).expect("samples"), Some(1002));
        assert_eq!(source.read(&mut chunk).expect("the end"), None);

        let jumps = VecDeque::from([(1, 11), (3, 23)]);
        let source = raw(&[0; 8], SampleFormat::Cu8, 100).with_jumps(jumps);
        let indices: Vec<u64> = all(source).iter().map(|(index, _)| *index).collect();
        assert_eq!(indices, [0, 11, 12, 23]);
    }

    #[test]
    fn a_wav_file_that_was_cut_off_is_read_to_its_last_sample() {
        let spec = hound::WavSpec {
            channels: 2,
            sample_rate: 8000,
            bits_per_sample: 16,
            sample_format: hound::SampleFormat::Int,
        };
        let mut bytes = wav(spec, &[16384_i16, 0, -8192, 0, 1, 1]);
        bytes.truncate(bytes.len() - 3);
        let mut source = SampleSource::wav("a", Box::new(Cursor::new(bytes)), None).expect("WAV");
        let mut samples = Vec::new();
        assert_eq!(source.read(&mut samples).expect("those that are whole"), Some(0));
        assert_eq!(samples, [0.5, -0.25].map(|i| Complex32::new(i, 0.0)));
        assert!(source.read(&mut samples).is_err(), "and then it ends too early");
    }

    #[test]
    fn errors_name_file_field_and_value() {
        let bytes = [1.0_f32, 0.0, 0.0, f32::NAN].map(f32::to_le_bytes).concat();
        let mut source = raw(&bytes, SampleFormat::Cf32, 100);
        let mut samples = Vec::new();
        assert_eq!(source.read(&mut samples).expect("the one before"), Some(0));
        assert_eq!(samples, [Complex32::new(1.0, 0.0)]);
        let error = source.read(&mut samples);
        assert_eq!(error.expect_err("NaN").to_string(), "a: sample 1 is 0+NaNi; it must be finite");
        for rate in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            let input = Box::new(io::empty());
            let error = SampleSource::raw("a", input, SampleFormat::Cu8, rate, None);
            assert!(error.expect_err("no rate").to_string().contains("the sample rate is"));
        }
    }
}
