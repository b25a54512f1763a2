//! Files of samples: by their kinds, and SigMF's metadata.

use std::{
    collections::VecDeque,
    fs::{self, File},
    io::{self, BufReader, Read, Seek, SeekFrom},
    path::{Path, PathBuf},
};

use serde_json::{Map, Value};

use super::{
    SampleError, SampleFormat, SampleSource, archive,
    sdriq::{self, Sdriq},
    wave,
};

/// Longer metadata than a recording has; what is longer is no metadata.
const MOST_METADATA: u64 = 64 << 20;

/// The properties of a file of samples besides its content.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
#[non_exhaustive]
pub struct OpenOptions {
    /// Samples per second; must be given for raw samples, and is refused where the file has it.
    pub rate_hz: Option<f64>,
    /// The frequency in the middle of the band; overrides what the file has.
    pub center_hz: Option<f64>,
    /// The format of raw samples, where the extension does not give it.
    pub format: Option<SampleFormat>,
}

/// The metadata of a SigMF recording: the format, rate and centre of its samples, and where some
/// are missing (SigMF specification 1.2).
#[derive(Debug, Clone, PartialEq)]
pub struct SigMf {
    /// The format of the samples.
    pub format: SampleFormat,
    /// Samples per second.
    pub rate_hz: f64,
    /// The frequency in the middle of the band, where it is given.
    pub center_hz: Option<f64>,
    /// The name of the file of samples, where it is not that of the metadata.
    pub dataset: Option<String>,
    /// Jumps of the receiver's count of samples: the number of samples before each, and the index
    /// after it.
    pub jumps: VecDeque<(u64, u64)>,
}

impl SigMf {
    /// Reads the text of a `.sigmf-meta` file; `file` is what errors name.
    ///
    /// # Errors
    ///
    /// [`SampleError::Field`] if it is no JSON, a field is missing or of another type, the samples
    /// are of another format, have several channels or headers, or the captures differ in
    /// frequency.
    pub fn parse(file: &str, text: &str) -> Result<Self, SampleError> {
        let json: Value = serde_json::from_str(text)
            .map_err(|error| SampleError::field(file, "the text", error, "JSON"))?;
        let global = json.get("global").and_then(Value::as_object);
        let global = Object { file, name: "global", object: global };
        let datatype = global.text("core:datatype")?;
        let of_datatype = |name: &str| {
            Some(match name {
                "cu8" => SampleFormat::Cu8,
                "ci8" => SampleFormat::Cs8,
                "ci16_le" => SampleFormat::Cs16,
                "cf32_le" => SampleFormat::Cf32,
                _ => return None,
            })
        };
        let known = "cu8, ci8, ci16_le or cf32_le";
        let format = datatype.and_then(of_datatype).ok_or_else(|| {
            let value = datatype.unwrap_or("missing");
            SampleError::field(file, "global core:datatype", value, known)
        })?;
        let rate_hz = global.number("core:sample_rate")?.filter(|rate| *rate > 0.0);
        let rate_hz = rate_hz.ok_or_else(|| global.bad("core:sample_rate", "a number above 0"))?;
        if global.count("core:num_channels")?.is_some_and(|channels| channels != 1) {
            return Err(global.bad("core:num_channels", "1"));
        }
        let dataset = global.text("core:dataset")?.map(str::to_owned);
        let captures = match json.get("captures") {
            None => &[],
            Some(Value::Array(captures)) => captures.as_slice(),
            Some(other) => return Err(SampleError::field(file, "captures", other, "a list")),
        };
        let mut center_hz = None;
        let mut jumps = VecDeque::new();
        let mut next = (0_u64, 0_u64);
        for (number, capture) in captures.iter().enumerate() {
            let name = format!("captures[{number}]");
            let capture = Object { file, name: &name, object: capture.as_object() };
            if capture.count("core:header_bytes")?.is_some_and(|bytes| bytes > 0) {
                return Err(capture.bad("core:header_bytes", "0 or missing"));
            }
            let start = capture.count("core:sample_start")?;
            let start = start.filter(|start| *start >= next.0).ok_or_else(|| {
                capture.bad("core:sample_start", "a count that does not decrease")
            })?;
            // What the receiver counted if nothing was lost.
            let expected = next
                .1
                .checked_add(start - next.0)
                .ok_or_else(|| capture.bad("core:sample_start", "one that can be counted to"))?;
            let index = capture.count("core:global_index")?;
            // The first capture's index is where the recording begins, not a loss.
            let index = match (index, number) {
                (Some(_), 0) | (None, _) => expected,
                (Some(index), _) => index.saturating_sub(first_index(captures)),
            };
            if index < expected {
                return Err(capture.bad("core:global_index", "one that does not go back"));
            }
            if index > expected {
                jumps.push_back((start, index));
            }
            next = (start, index);
            let frequency = capture.number("core:frequency")?;
            if number > 0 && frequency.is_some() && frequency != center_hz {
                let requirement = "that of the other captures: one centre for each recording";
                return Err(capture.bad("core:frequency", requirement));
            }
            center_hz = center_hz.or(frequency);
        }
        Ok(Self { format, rate_hz, center_hz, dataset, jumps })
    }
}

/// An object of the metadata, with its name for errors.
struct Object<'a> {
    file: &'a str,
    name: &'a str,
    object: Option<&'a Map<String, Value>>,
}

impl<'a> Object<'a> {
    fn get(&self, field: &str) -> Option<&'a Value> {
        self.object.and_then(|object| object.get(field))
    }

    fn bad(&self, field: &str, requirement: &str) -> SampleError {
        let value = self.get(field).map_or_else(|| "missing".to_owned(), Value::to_string);
        SampleError::field(self.file, format!("{} {field}", self.name), value, requirement)
    }

    fn text(&self, field: &str) -> Result<Option<&'a str>, SampleError> {
        let Some(value) = self.get(field) else { return Ok(None) };
        value.as_str().map(Some).ok_or_else(|| self.bad(field, "a text"))
    }

    fn number(&self, field: &str) -> Result<Option<f64>, SampleError> {
        let Some(value) = self.get(field) else { return Ok(None) };
        value.as_f64().map(Some).ok_or_else(|| self.bad(field, "a number"))
    }

    fn count(&self, field: &str) -> Result<Option<u64>, SampleError> {
        let Some(value) = self.get(field) else { return Ok(None) };
        value.as_u64().map(Some).ok_or_else(|| self.bad(field, "a count from 0"))
    }
}

/// Bytes by which a kind of file is recognised.
const LOOKED_AT: u64 = 512;

/// Opens a file of samples: WAV (also RF64, BW64 and Wave64), SDRangel's `.sdriq`, an archive of
/// SigMF by what is in it, SigMF by either of its files, gqrx's `.raw` by its name, or raw (`.cu8`,
/// `.cs8`, `.cs16`, `.cf32`); `-` is raw samples from standard input.
///
/// # Errors
///
/// [`SampleError`] if it cannot be opened, its kind is not known, or options are missing or left
/// over.
pub fn open(path: &Path, options: &OpenOptions) -> Result<SampleSource, SampleError> {
    let file = path.display().to_string();
    let extension = path.extension().and_then(|e| e.to_str()).unwrap_or("").to_ascii_lowercase();
    let own_rate = |kind: &str| match options.rate_hz {
        Some(rate) => {
            let requirement = format!("left out: {kind} has its own");
            Err(SampleError::field(&file, "the given sample rate", rate, requirement))
        }
        None => Ok(()),
    };
    let of_name = SampleFormat::of_name(&extension);
    if extension == "sigmf-meta" || extension == "sigmf-data" {
        own_rate("a SigMF recording")?;
        return open_sigmf(path, options);
    }
    if options.format.is_none() && of_name.is_none() && path != Path::new("-") {
        let begin = begin(path)?;
        if extension == "wav" || wave::is_wave(&begin) {
            own_rate("a WAV file")?;
            let length = fs::metadata(path).map_err(|source| cannot_open(path, source))?.len();
            let center_hz = options.center_hz;
            let length = Some(length);
            let source = SampleSource::wav_of_length(&file, reader(path)?, length, center_hz)?;
            return Ok(source.with_center_unless_known(center_in_name(path)));
        }
        if archive::is_archive(&begin) {
            own_rate("a SigMF recording")?;
            return open_archive(path, options);
        }
        if extension == "sigmf" {
            own_rate("a SigMF recording")?;
            return open_sigmf(path, options);
        }
        if let Some(header) = sdriq::header(&begin) {
            own_rate("a file of SDRangel")?;
            let mut input = reader(path)?;
            let header_bytes = sdriq::HEADER_BYTES as u64;
            io::copy(&mut input.by_ref().take(header_bytes), &mut io::sink())
                .map_err(|source| cannot_open(path, source))?;
            let Sdriq { encoding, rate_hz, center_hz } = header;
            let center_hz = options.center_hz.or(Some(center_hz));
            return SampleSource::new(&file, input, encoding, None, rate_hz, center_hz);
        }
        if let Some([center_hz, rate_hz]) = of_gqrx(path) {
            own_rate("a recording of gqrx")?;
            let center_hz = options.center_hz.or(Some(center_hz));
            let format = SampleFormat::Cf32;
            return SampleSource::raw(&file, reader(path)?, format, rate_hz, center_hz);
        }
        if extension == "sdriq" {
            let requirement = "one whose checksum matches, of samples of 16 or 24 bits";
            return Err(SampleError::field(&file, "the header", "another one", requirement));
        }
    }
    let format = options.format.or(of_name);
    let format = format.ok_or_else(|| {
        let requirement = "cu8, cs8, cs16 or cf32, by the file's extension or given";
        let value = if extension.is_empty() { "missing" } else { &extension };
        SampleError::field(&file, "the format of the samples", value, requirement)
    })?;
    let rate_hz = options.rate_hz.ok_or_else(|| {
        let requirement = "given: raw samples do not have it";
        SampleError::field(&file, "the sample rate", "missing", requirement)
    })?;
    SampleSource::raw(&file, reader(path)?, format, rate_hz, options.center_hz)
}

fn begin(path: &Path) -> Result<Vec<u8>, SampleError> {
    let mut begin = Vec::new();
    let read = File::open(path).and_then(|file| file.take(LOOKED_AT).read_to_end(&mut begin));
    read.map_err(|source| cannot_open(path, source))?;
    Ok(begin)
}

/// Centre and rate in the name of a recording of gqrx, `gqrx_20260621_140300_150100000_250000_fc`,
/// whose samples are floats; `None` for any other name.
fn of_gqrx(path: &Path) -> Option<[f64; 2]> {
    let mut parts = path.file_stem()?.to_str()?.strip_prefix("gqrx_")?.split('_');
    let is_digits = |part: &str| part.len() >= 6 && part.bytes().all(|byte| byte.is_ascii_digit());
    if !(is_digits(parts.next()?) && is_digits(parts.next()?)) {
        return None;
    }
    let center_hz = parts.next()?.parse().ok()?;
    let rate_hz: f64 = parts.next()?.parse().ok()?;
    (parts.next()? == "fc" && parts.next().is_none()).then_some([center_hz, rate_hz])
}

/// The frequency in the name of a file as receivers' programs write it, such as `433920000Hz` or
/// `433920kHz` between `_`; `None` if there is not one alone.
fn center_in_name(path: &Path) -> Option<f64> {
    let name = path.file_stem()?.to_str()?;
    let frequency = |part: &str| {
        let number = part.strip_suffix("Hz")?;
        let (digits, scale) = match number.strip_suffix('k') {
            Some(digits) => (digits, 1e3),
            None => (number, 1.0),
        };
        let is_number = !digits.is_empty() && digits.bytes().all(|byte| byte.is_ascii_digit());
        is_number.then(|| digits.parse::<f64>().ok()).flatten().map(|hz| hz * scale)
    };
    let mut found = name.split('_').filter_map(frequency);
    found.next().filter(|_| found.next().is_none())
}

fn reader(path: &Path) -> Result<Box<dyn Read + Send>, SampleError> {
    if path == Path::new("-") {
        return Ok(Box::new(io::stdin()));
    }
    let opened = File::open(path);
    let opened = opened.map_err(|source| cannot_open(path, source))?;
    Ok(Box::new(BufReader::with_capacity(1 << 16, opened)))
}

fn cannot_open(path: &Path, source: io::Error) -> SampleError {
    SampleError::Open { file: path.display().to_string(), source }
}

fn open_sigmf(path: &Path, options: &OpenOptions) -> Result<SampleSource, SampleError> {
    let meta = path.with_extension("sigmf-meta");
    let name = meta.display().to_string();
    let size = fs::metadata(&meta).map_err(|source| cannot_open(&meta, source))?.len();
    check_length(&name, size)?;
    let text = fs::read_to_string(&meta).map_err(|source| cannot_open(&meta, source))?;
    let sigmf = metadata(&name, &text, options)?;
    let data: PathBuf = match &sigmf.dataset {
        // The name alone counts, so that metadata open nothing elsewhere.
        Some(dataset) => match Path::new(dataset).file_name() {
            Some(file) => meta.with_file_name(file),
            None => {
                let requirement = "the name of a file";
                return Err(SampleError::field(&name, "core:dataset", dataset, requirement));
            }
        },
        None => path.with_extension("sigmf-data"),
    };
    of_sigmf(&data.display().to_string(), reader(&data)?, sigmf, options)
}

/// Opens the only recording of an archive.
fn open_archive(path: &Path, options: &OpenOptions) -> Result<SampleSource, SampleError> {
    let file = path.display().to_string();
    let failed = |source| cannot_open(path, source);
    let mut input = File::open(path).map_err(failed)?;
    let members = archive::members(&mut input).map_err(failed)?;
    let of_kind = |end: &str| members.iter().filter(|of| of.name.ends_with(end)).count();
    let metas = of_kind(".sigmf-meta");
    let meta = members.iter().find(|of| of.name.ends_with(".sigmf-meta"));
    let Some(meta) = meta.filter(|_| metas == 1) else {
        let requirement = "1; unpack an archive of several, and name one";
        return Err(SampleError::field(&file, "the number of recordings", metas, requirement));
    };
    let name = format!("{file}: {}", meta.name);
    check_length(&name, meta.bytes)?;
    let mut text = String::new();
    input.seek(SeekFrom::Start(meta.begin)).map_err(failed)?;
    input.by_ref().take(meta.bytes).read_to_string(&mut text).map_err(failed)?;
    let sigmf = metadata(&name, &text, options)?;
    let stem = meta.name.strip_suffix("sigmf-meta").unwrap_or_default();
    let data = members.iter().find(|of| of.name == format!("{stem}sigmf-data"));
    let Some(data) = data else {
        let requirement = "beside its metadata in the archive";
        return Err(SampleError::field(&name, "the file of samples", "missing", requirement));
    };
    input.seek(SeekFrom::Start(data.begin)).map_err(failed)?;
    let samples = BufReader::with_capacity(1 << 16, input).take(data.bytes);
    of_sigmf(&format!("{file}: {}", data.name), Box::new(samples), sigmf, options)
}

fn check_length(name: &str, bytes: u64) -> Result<(), SampleError> {
    if bytes > MOST_METADATA {
        let requirement = format!("at most {MOST_METADATA} bytes");
        return Err(SampleError::field(name, "the length", bytes, requirement));
    }
    Ok(())
}

/// Reads metadata, and refuses a given format that is another one.
fn metadata(name: &str, text: &str, options: &OpenOptions) -> Result<SigMf, SampleError> {
    let sigmf = SigMf::parse(name, text)?;
    if let Some(format) = options.format.filter(|format| *format != sigmf.format) {
        let requirement = format!("left out, or {} as in the metadata", sigmf.format.name());
        return Err(SampleError::field(name, "the given format", format.name(), requirement));
    }
    Ok(sigmf)
}

fn of_sigmf(
    file: &str,
    input: Box<dyn Read + Send>,
    sigmf: SigMf,
    options: &OpenOptions,
) -> Result<SampleSource, SampleError> {
    let center_hz = options.center_hz.or(sigmf.center_hz);
    let source = SampleSource::raw(file, input, sigmf.format, sigmf.rate_hz, center_hz)?;
    Ok(source.with_jumps(sigmf.jumps))
}

/// The index that the receiver gave the first sample.
fn first_index(captures: &[Value]) -> u64 {
    let first = captures.first();
    first.and_then(|c| c.get("core:global_index")).and_then(Value::as_u64).unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A folder of this test's own.
    fn folder(name: &str) -> PathBuf {
        let folder = std::env::temp_dir().join(format!("foxhunt-{}-{name}", std::process::id()));
        fs::create_dir_all(&folder).expect("a folder");
        folder
    }

    #[test]
    fn kinds_are_known_by_extension() {
        let folder = folder("kinds");
        let write = |name: &str, bytes: &[u8]| {
            let path = folder.join(name);
            fs::write(&path, bytes).expect("a file");
            path
        };
        let raw = write("a.CU8", &[0; 8]);
        let options = OpenOptions { rate_hz: Some(10.0), ..OpenOptions::default() };
        let mut chunk = Vec::new();
        let mut source = open(&raw, &options).expect("it is raw");
        assert_eq!(source.read(&mut chunk).expect("samples"), Some(0));
        assert_eq!(chunk.len(), 4);
        let error = open(&raw, &OpenOptions::default()).expect_err("no rate");
        assert!(error.to_string().contains("the sample rate is missing"), "{error}");
        let odd = write("a.xyz", &[0; 8]);
        let error = open(&odd, &options).expect_err("no such format");
        assert!(error.to_string().contains("a.xyz: the format of the samples is xyz"), "{error}");
        let given = OpenOptions { format: Some(SampleFormat::Cf32), ..options };
        assert!(open(&odd, &given).is_ok());

        let meta = br#"{"global": {"core:datatype": "cf32_le", "core:sample_rate": 4},
            "captures": [{"core:sample_start": 0, "core:frequency": 7}]}"#;
        let meta = write("b.sigmf-meta", meta);
        let data = write("b.sigmf-data", &[0; 24]);
        for path in [&meta, &data] {
            let mut source = open(path, &OpenOptions::default()).expect("it is SigMF");
            assert_eq!((source.rate_hz(), source.center_hz()), (4.0, Some(7.0)));
            source.read(&mut chunk).expect("samples");
            assert_eq!(chunk.len(), 3);
        }
        let error = open(&meta, &options).expect_err("two rates");
        assert!(error.to_string().contains("the given sample rate is 10"), "{error}");
        fs::remove_file(&data).expect("it was written");
        let error = open(&meta, &OpenOptions::default()).expect_err("no samples");
        assert!(error.to_string().contains("b.sigmf-data: cannot be opened"), "{error}");
        fs::remove_dir_all(&folder).expect("it was made");
    }

    #[test]
    fn files_with_a_header_are_known_by_it() {
        let folder = folder("headers");
        let spec = hound::WavSpec {
            channels: 2,
            sample_rate: 8_000,
            bits_per_sample: 16,
            sample_format: hound::SampleFormat::Int,
        };
        let mut wav = io::Cursor::new(Vec::new());
        let mut writer = hound::WavWriter::new(&mut wav, spec).expect("a header");
        [16_384_i16, 0, -8_192, 0].iter().for_each(|v| writer.write_sample(*v).expect("memory"));
        writer.finalize().expect("memory");
        let mut wav = wav.into_inner();
        // As a program leaves it that was ended while it recorded.
        let size = wav.len() - 12;
        wav[size..size + 4].fill(0xff);
        let read = |name: &str, bytes: &[u8], options: &OpenOptions| {
            let path = folder.join(name);
            fs::write(&path, bytes).expect("a file");
            let mut source = open(&path, options)?;
            let mut chunk = Vec::new();
            source.read(&mut chunk)?;
            assert_eq!(source.read(&mut Vec::new())?, None);
            let parts: Vec<f32> = chunk.iter().map(|sample| sample.re).collect();
            Ok::<_, SampleError>((source.rate_hz(), source.center_hz(), parts))
        };
        let plain = OpenOptions::default();
        for (name, center_hz) in [
            ("a.wav", None),
            ("a.rf64", None),
            ("SDRSharp_20260621_140300Z_150100000Hz_IQ.wav", Some(150.1e6)),
            ("HDSDR_20260621_140300Z_150100kHz_RF.wav", Some(150.1e6)),
        ] {
            let read = read(name, &wav, &plain).expect("a WAV file");
            assert_eq!(read, (8_000.0, center_hz, vec![0.5, -0.25]), "{name}");
        }
        let mut sdriq = 2_000_000_u32.to_le_bytes().to_vec();
        sdriq.extend(433_920_000_u64.to_le_bytes());
        sdriq.extend([0; 8]);
        sdriq.extend([24_u32, 0].map(u32::to_le_bytes).concat());
        let mut crc = flate2::Crc::new();
        crc.update(&sdriq);
        sdriq.extend(crc.sum().to_le_bytes());
        sdriq.extend([1 << 22, 0, -(1 << 21), 0].map(i32::to_le_bytes).concat());
        let expected = (2e6, Some(433.92e6), vec![0.5, -0.25]);
        assert_eq!(read("a.sdriq", &sdriq, &plain).expect("of SDRangel"), expected);
        sdriq[0] ^= 1;
        let error = read("b.sdriq", &sdriq, &plain).expect_err("damaged").to_string();
        assert!(error.contains("b.sdriq: the header is another one"), "{error}");
        let floats: Vec<u8> = [0.5_f32, 0.0, -0.25, 0.0].map(f32::to_le_bytes).concat();
        let name = "gqrx_20260621_140300_150100000_250000_fc.raw";
        let expected = (250e3, Some(150.1e6), vec![0.5, -0.25]);
        assert_eq!(read(name, &floats, &plain).expect("of gqrx"), expected);
        let error = read("gqrx_20260621_140300_1_fc.raw", &floats, &plain).expect_err("no rate");
        assert!(error.to_string().contains("the format of the samples is raw"), "{error}");
        let given = OpenOptions { rate_hz: Some(1.0), ..plain };
        let error = read(name, &floats, &given).expect_err("two rates").to_string();
        assert!(error.contains("the given sample rate is 1"), "{error}");
        fs::remove_dir_all(&folder).expect("it was made");
    }

    /// By the `tarfile` of Python, as the `sigmf` package writes it.
    #[test]
    fn an_archive_holds_metadata_and_samples() {
        let folder = folder("archive");
        let path = folder.join("rec.sigmf");
        fs::write(&path, include_bytes!("../../tests/data/rec.sigmf")).expect("a file");
        let mut source = open(&path, &OpenOptions::default()).expect("an archive");
        assert_eq!((source.rate_hz(), source.center_hz()), (250e3, Some(150.1e6)));
        let mut chunk = Vec::new();
        assert_eq!(source.read(&mut chunk).expect("samples"), Some(0));
        let parts: Vec<f32> = chunk.iter().map(|sample| sample.re).collect();
        assert_eq!(parts, [0.5, -0.25, 0.125]);
        assert_eq!(source.read(&mut chunk).expect("the end"), None);
        fs::write(&path, &include_bytes!("../../tests/data/rec.sigmf")[1..]).expect("a file");
        let error = open(&path, &OpenOptions::default()).expect_err("another file").to_string();
        assert!(error.contains("rec.sigmf"), "{error}");
        fs::remove_dir_all(&folder).expect("it was made");
    }

    fn parse(global: &str, captures: &str) -> Result<SigMf, String> {
        let text = format!("{{\"global\": {global}, \"captures\": {captures}}}");
        SigMf::parse("a.sigmf-meta", &text).map_err(|error| error.to_string())
    }

    const GLOBAL: &str = r#"{"core:datatype": "ci16_le", "core:sample_rate": 250e3}"#;

    #[test]
    fn metadata_are_read() {
        let read = parse(
            GLOBAL,
            r#"[{"core:sample_start": 0, "core:frequency": 150e6, "core:global_index": 500},
                {"core:sample_start": 100, "core:global_index": 600},
                {"core:sample_start": 200, "core:global_index": 950}]"#,
        )
        .expect("they are in order");
        assert_eq!(read.format, SampleFormat::Cs16);
        assert_eq!((read.rate_hz, read.center_hz), (250e3, Some(150e6)));
        // The first 500 samples are before the recording; the receiver lost 250 before the third
        // capture.
        assert_eq!(read.jumps, [(200, 450)]);
        assert_eq!(parse(GLOBAL, "[]").expect("none is needed").center_hz, None);
    }

    #[test]
    fn bad_metadata_are_named() {
        let cases = [
            ("{}", "[]", "global core:datatype is missing"),
            (r#"{"core:datatype": "rf32_le"}"#, "[]", "core:datatype is rf32_le"),
            (r#"{"core:datatype": "cu8"}"#, "[]", "core:sample_rate is missing"),
            (r#"{"core:datatype": "cu8", "core:sample_rate": "x"}"#, "[]", "is \"x\""),
            (r#"{"core:datatype": "cu8", "core:sample_rate": -2}"#, "[]", "is -2"),
            (
                r#"{"core:datatype": "cu8", "core:sample_rate": 2, "core:num_channels": 2}"#,
                "[]",
                "core:num_channels is 2",
            ),
            (GLOBAL, "7", "captures is 7"),
            (GLOBAL, "[{}]", "captures[0] core:sample_start is missing"),
            (
                GLOBAL,
                r#"[{"core:sample_start": 5}, {"core:sample_start": 4}]"#,
                "captures[1] core:sample_start is 4",
            ),
            (
                GLOBAL,
                r#"[{"core:sample_start": 0, "core:frequency": 1},
                    {"core:sample_start": 4, "core:frequency": 2}]"#,
                "captures[1] core:frequency is 2",
            ),
            (
                GLOBAL,
                r#"[{"core:sample_start": 0, "core:global_index": 10},
                    {"core:sample_start": 4, "core:global_index": 12}]"#,
                "captures[1] core:global_index is 12",
            ),
            (GLOBAL, r#"[{"core:sample_start": 0, "core:header_bytes": 8}]"#, "header_bytes is 8"),
            (
                GLOBAL,
                r#"[{"core:sample_start": 0},
                    {"core:sample_start": 4, "core:global_index": 18446744073709551615},
                    {"core:sample_start": 5}]"#,
                "captures[2] core:sample_start is 5",
            ),
        ];
        for (global, captures, wanted) in cases {
            let error = parse(global, captures).expect_err("it is bad");
            assert!(error.starts_with("a.sigmf-meta: ") && error.contains(wanted), "{error}");
        }
        assert!(SigMf::parse("a", "{").is_err());
    }
}
