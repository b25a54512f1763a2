use std::{
    fs::{self, File},
    io::{self, BufReader, Read},
    path::{Path, PathBuf},
};

use super::{SampleError, SampleFormat, SampleSource, SigMf};

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

/// Opens a file of samples: raw (`.cu8`, `.cs8`, `.cs16`, `.cf32`), WAV, or SigMF by either of its
/// files; `-` is raw samples from standard input.
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
    match extension.as_str() {
        "wav" if options.format.is_none() => {
            own_rate("a WAV file")?;
            SampleSource::wav(&file, reader(path)?, options.center_hz)
        }
        "sigmf-meta" | "sigmf-data" | "sigmf" => {
            own_rate("a SigMF recording")?;
            open_sigmf(path, options)
        }
        _ => {
            let format = options.format.or_else(|| SampleFormat::of_name(&extension));
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
    }
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
    if size > MOST_METADATA {
        let requirement = format!("at most {MOST_METADATA} bytes");
        return Err(SampleError::field(&name, "the length", size, requirement));
    }
    let text = fs::read_to_string(&meta).map_err(|source| cannot_open(&meta, source))?;
    let sigmf = SigMf::parse(&name, &text)?;
    if let Some(format) = options.format.filter(|format| *format != sigmf.format) {
        let requirement = format!("left out, or {} as in the metadata", sigmf.format.name());
        return Err(SampleError::field(&name, "the given format", format.name(), requirement));
    }
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
    let file = data.display().to_string();
    let center_hz = options.center_hz.or(sigmf.center_hz);
    let source = SampleSource::raw(&file, reader(&data)?, sigmf.format, sigmf.rate_hz, center_hz)?;
    Ok(source.with_jumps(sigmf.jumps))
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
}
