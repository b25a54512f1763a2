//! Headers of files of sound, which receivers write their samples into: RIFF WAVE (Microsoft and
//! IBM, 1991), RF64 and BW64 (EBU Tech 3306, ITU-R BS.2088) and Wave64 (Sony).

use std::io::{self, Read};

use super::{SampleFormat, encoding::Encoding};

/// Identifiers of Wave64 in place of four letters: the letters and these bytes, the first of the
/// file others than the further ones.
const W64_FILE: &[u8; 16] = b"riff\x2e\x91\xcf\x11\xa5\xd6\x28\xdb\x04\xc1\x00\x00";
const W64_CHUNK: &[u8; 12] = b"\xf3\xac\xd3\x11\x8c\xd1\x00\xc0\x4f\x8e\xdb\x8a";

/// Longer chunks than this are not kept.
const MOST_KEPT: u64 = 1 << 16;

/// Tags of the kinds of samples; the third has its kind in its further part.
const PCM: u16 = 1;
const FLOAT: u16 = 3;
const EXTENSIBLE: u16 = 0xfffe;

/// A size that stands for one that is not known yet, or for one in a `ds64` chunk.
const OPEN: u64 = 0xffff_ffff;

/// Place of the centre frequency in an `auxi` chunk as SpectraVue, SDR# and SDRuno write it: behind
/// two times of 16 bytes.
const AUXI_CENTER: usize = 32;

/// A header.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Wave {
    pub encoding: Encoding,
    pub channels: u16,
    pub rate_hz: f64,
    /// The frequency in the middle of the band, by an `auxi` chunk.
    pub center_hz: Option<f64>,
    /// The number of bytes of samples; `None` for all that follow.
    pub data_bytes: Option<u64>,
}

/// The reason why a header cannot be used.
#[derive(Debug)]
pub(super) enum Problem {
    /// The input cannot be read.
    Read(io::Error),
    /// A text that says what the header is.
    Header(String),
}

impl From<io::Error> for Problem {
    fn from(error: io::Error) -> Self {
        Self::Read(error)
    }
}

/// Returns true for the first bytes of such a file.
pub(super) fn is_wave(begin: &[u8]) -> bool {
    let is_riff = [b"RIFF", b"RF64", b"BW64"].iter().any(|name| begin.starts_with(*name));
    (is_riff && begin.get(8..12) == Some(b"WAVE")) || begin.starts_with(W64_FILE)
}

/// Reads the header up to the samples. `length` is the number of bytes of the whole file, where it
/// is known: by it a size that wrapped at 4 GiB is put right.
pub(super) fn header(mut input: impl Read, length: Option<u64>) -> Result<Wave, Problem> {
    let mut file = [0; 12];
    input.read_exact(&mut file)?;
    let mut read = 12;
    let is_w64 = file.starts_with(b"riff");
    let skipped = if is_w64 { 28 } else { 0 };
    let rest = bytes(&mut input, &mut read, skipped)?;
    let is_whole = file.iter().chain(&rest).take(W64_FILE.len()).eq(W64_FILE);
    if !(if is_w64 { is_whole } else { is_wave(&file) }) {
        return Err(Problem::Header("no file of sound".to_owned()));
    }
    let mut format = None;
    let mut center_hz = None;
    // Size of the samples in a file of more than 4 GiB.
    let mut ds64 = None;
    loop {
        let (name, size) = match chunk(&mut input, &mut read, is_w64)? {
            Some(chunk) => chunk,
            None => return Err(Problem::Header("without samples".to_owned())),
        };
        if name == *b"data" {
            let (encoding, channels, rate_hz) =
                format.ok_or_else(|| Problem::Header("without their format".to_owned()))?;
            let declared = ds64.filter(|_| size == OPEN).unwrap_or(size);
            let data_bytes = data_bytes(declared, length.map(|all| all.saturating_sub(read)));
            return Ok(Wave { encoding, channels, rate_hz, center_hz, data_bytes });
        }
        let kept = size.min(MOST_KEPT);
        let body = bytes(&mut input, &mut read, kept)?;
        match &name {
            b"fmt " => format = Some(format_of(&body)?),
            b"auxi" => center_hz = center_of(&body),
            b"ds64" => ds64 = eight(&body, 8).filter(|size| *size > 0),
            _ => {}
        }
        // Chunks begin at even bytes, those of Wave64 at each eighth.
        let end = size.checked_next_multiple_of(if is_w64 { 8 } else { 2 });
        skip(&mut input, &mut read, end.unwrap_or(size) - kept)?;
    }
}

/// The number of bytes of samples, of a size in the header and the bytes that follow it; `None` for
/// all that follow, as where the header was never closed or the file was cut off.
fn data_bytes(declared: u64, follow: Option<u64>) -> Option<u64> {
    if declared == 0 || declared >= OPEN {
        return (declared > OPEN).then_some(declared);
    }
    let Some(follow) = follow else { return Some(declared) };
    if declared > follow {
        return None;
    }
    // A size of 32 bits is the rest of a size that is larger by a multiple of 4 GiB. What stands
    // behind the samples is shorter than that.
    let wraps = follow.saturating_sub(declared) >> 32;
    Some(declared + (wraps << 32))
}

/// Name and size of the next chunk; `None` at the end of the file.
fn chunk(
    input: &mut impl Read,
    read: &mut u64,
    is_w64: bool,
) -> Result<Option<([u8; 4], u64)>, Problem> {
    let head = bytes(input, read, if is_w64 { 24 } else { 8 })?;
    let Some(name) = head.first_chunk::<4>() else { return Ok(None) };
    if !is_w64 {
        return Ok(four(&head, 4).map(|size| (*name, u64::from(size))));
    }
    let Some(size) = eight(&head, 16) else { return Ok(None) };
    // Its size counts the 24 bytes before it.
    let size =
        size.checked_sub(24).ok_or_else(|| Problem::Header("with a bad chunk".to_owned()))?;
    // A chunk of an unknown family is skipped by its size.
    let is_known = head.get(4..16) == Some(W64_CHUNK);
    Ok(Some((if is_known { *name } else { *b"????" }, size)))
}

/// Encoding, number of channels and rate of a `fmt ` chunk.
fn format_of(body: &[u8]) -> Result<(Encoding, u16, f64), Problem> {
    let short = || Problem::Header("with a format that is cut off".to_owned());
    let tag = two(body, 0).ok_or_else(short)?;
    let channels = two(body, 2).ok_or_else(short)?;
    let rate = four(body, 4).ok_or_else(short)?;
    let bits = two(body, 14).ok_or_else(short)?;
    let tag = if tag == EXTENSIBLE { two(body, 24).ok_or_else(short)? } else { tag };
    let encoding = match (tag, bits) {
        (PCM, 8) => Encoding::Offset8,
        (PCM, 16) => Encoding::Plain(SampleFormat::Cs16),
        (PCM, 24) => Encoding::Packed24,
        (PCM, 32) => Encoding::Wide(32),
        (FLOAT, 32) => Encoding::Plain(SampleFormat::Cf32),
        _ => return Err(Problem::Header(format!("with format {tag} of {bits} bits"))),
    };
    Ok((encoding, channels, f64::from(rate)))
}

/// The centre frequency in an `auxi` chunk: a number of SpectraVue and its like, or the XML of SDR
/// Console, in bytes or in UTF-16.
fn center_of(body: &[u8]) -> Option<f64> {
    let is_wide = body.get(1) == Some(&0);
    let step = if is_wide { 2 } else { 1 };
    if body.first() == Some(&b'<') {
        let text: Vec<u8> = body.iter().step_by(step).copied().collect();
        let text = String::from_utf8_lossy(&text).into_owned();
        let (_, value) = text.split_once("RadioCenterFreq=\"")?;
        let hz: f64 = value.split('"').next()?.trim().parse().ok()?;
        return Some(hz).filter(|hz| hz.is_finite() && *hz > 0.0);
    }
    four(body, AUXI_CENTER).filter(|hz| *hz > 0).map(f64::from)
}

/// The next bytes, as many as there are.
fn bytes(input: &mut impl Read, read: &mut u64, count: u64) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    input.by_ref().take(count).read_to_end(&mut bytes)?;
    *read += bytes.len() as u64;
    Ok(bytes)
}

fn skip(input: &mut impl Read, read: &mut u64, count: u64) -> io::Result<()> {
    *read += io::copy(&mut input.by_ref().take(count), &mut io::sink())?;
    Ok(())
}

fn two(bytes: &[u8], at: usize) -> Option<u16> {
    bytes.get(at..at + 2)?.try_into().ok().map(u16::from_le_bytes)
}

fn four(bytes: &[u8], at: usize) -> Option<u32> {
    bytes.get(at..at + 4)?.try_into().ok().map(u32::from_le_bytes)
}

fn eight(bytes: &[u8], at: usize) -> Option<u64> {
    bytes.get(at..at + 8)?.try_into().ok().map(u64::from_le_bytes)
}

#[cfg(test)]
mod tests {
    use proptest::{collection::vec, prelude::*};

    use super::*;

    const FORMAT: [u8; 16] = [1, 0, 2, 0, 0x80, 0xbb, 0, 0, 0, 0, 0, 0, 4, 0, 16, 0];

    fn riff(magic: &[u8], chunks: &[(&[u8; 4], &[u8])], data: u32) -> Vec<u8> {
        let mut file = [magic, &[0xff; 4], b"WAVE"].concat();
        for (name, body) in chunks {
            let size = u32::try_from(body.len()).expect("short");
            file.extend([&name[..], &size.to_le_bytes(), body].concat());
            file.extend(vec![0; body.len() % 2]);
        }
        file.extend([&b"data"[..], &data.to_le_bytes()].concat());
        file
    }

    fn read(file: &[u8], follow: u64) -> Wave {
        header(file, Some(file.len() as u64 + follow)).expect("a header")
    }

    #[test]
    fn a_size_that_wrapped_or_was_never_closed_is_that_of_the_file() {
        let fmt: (&[u8; 4], &[u8]) = (b"fmt ", &FORMAT);
        let of = |data, follow| read(&riff(b"RIFF", &[fmt], data), follow).data_bytes;
        assert_eq!(of(4000, 4000), Some(4000));
        // Behind the samples another chunk stands.
        assert_eq!(of(4000, 4100), Some(4000));
        assert_eq!(of(4000, 3000), None);
        // 5 GiB, with the rest of its size, and 9 GiB with the chunk.
        assert_eq!(of(1 << 30, 5 << 30), Some(5 << 30));
        assert_eq!(of(1 << 30, (9 << 30) + 100), Some(9 << 30));
        for open in [0, u32::MAX] {
            assert_eq!(of(open, 3 << 30), None);
        }
        let wave = read(&riff(b"RIFF", &[fmt], 4000), 4000);
        assert_eq!((wave.channels, wave.rate_hz, wave.center_hz), (2, 48_000.0, None));
        assert_eq!(wave.encoding, Encoding::Plain(SampleFormat::Cs16));
    }

    #[test]
    fn sizes_of_64_bits_are_read() {
        let sizes: Vec<u8> = [6_u64 << 30, 5 << 30, 0].map(u64::to_le_bytes).concat();
        for magic in [b"RF64", b"BW64"] {
            let file = riff(magic, &[(b"ds64", &sizes), (b"fmt ", &FORMAT)], u32::MAX);
            assert!(is_wave(&file));
            assert_eq!(read(&file, 5 << 30).data_bytes, Some(5 << 30));
        }
        let chunk =
            |name: &[u8], size: u64| [name, &W64_CHUNK[..], &(24 + size).to_le_bytes()].concat();
        let mut file = [&W64_FILE[..], &(1_u64 << 33).to_le_bytes()].concat();
        file.extend([b"wave", &W64_CHUNK[..]].concat());
        // A chunk of 5 bytes is followed by the next one at the next eighth.
        file.extend([chunk(b"junk", 5), vec![0; 8]].concat());
        file.extend([chunk(b"fmt ", 16), FORMAT.to_vec(), chunk(b"data", 6 << 30)].concat());
        assert!(is_wave(&file));
        let wave = read(&file, 6 << 30);
        assert_eq!((wave.data_bytes, wave.rate_hz), (Some(6 << 30), 48_000.0));
    }

    #[test]
    fn an_auxi_chunk_has_the_centre() {
        let of = |body: &[u8]| {
            read(&riff(b"RIFF", &[(b"fmt ", &FORMAT), (b"auxi", body)], 8), 8).center_hz
        };
        let mut binary = vec![0; 164];
        binary[..2].copy_from_slice(&2026_u16.to_le_bytes());
        binary[32..36].copy_from_slice(&150_100_000_u32.to_le_bytes());
        assert_eq!(of(&binary), Some(150.1e6));
        let xml = "<?xml version=\"1.0\"?><SDR-XML-Root><Definition RadioCenterFreq=\"162550000\" \
                   SampleRate=\"250000\"/></SDR-XML-Root>";
        assert_eq!(of(xml.as_bytes()), Some(162.55e6));
        let wide: Vec<u8> = xml.encode_utf16().flat_map(u16::to_le_bytes).collect();
        assert_eq!(of(&wide), Some(162.55e6));
        assert_eq!(of(&[0; 164]), None);
        assert_eq!(of(b"<"), None);
    }

    #[test]
    fn a_damaged_header_is_read_or_refused() {
        let auxi = [0; 40];
        let file = riff(b"RIFF", &[(b"ds64", &[0; 24]), (b"fmt ", &FORMAT), (b"auxi", &auxi)], 8);
        for index in 0..file.len() {
            for byte in [0, 1, 0x7f, 0x80, 0xff] {
                let mut damaged = file.clone();
                damaged[index] = byte;
                if let Ok(wave) = header(&damaged[..], Some(1 << 40)) {
                    assert!(wave.rate_hz.is_finite() && wave.encoding.bytes() > 0);
                }
            }
            assert!(header(&file[..index], None).is_err(), "cut off at {index}");
        }
    }

    proptest! {
        /// Any chunks make a header that can be read, or a reason; its samples are as many as their
        /// bytes, none beyond full scale.
        #[test]
        fn any_chunks_are_read_or_refused(
            format in vec(any::<u8>(), 0..40),
            other in vec(any::<u8>(), 0..40),
            bits in prop::sample::select(vec![8_u16, 16, 24, 32]),
            is_known in any::<bool>(),
            samples in vec(any::<u8>(), 0..100),
        ) {
            let bytes = 2 * bits / 8;
            let rate = 48_000 * u32::from(bytes);
            let known = [&[1, 0, 2, 0, 0x80, 0xbb, 0, 0][..], &rate.to_le_bytes()].concat();
            let known = [known, bytes.to_le_bytes().to_vec(), bits.to_le_bytes().to_vec()].concat();
            let format = if is_known { known } else { format };
            let size = u32::try_from(samples.len()).expect("few");
            let file = riff(b"RIFF", &[(b"junk", &other), (b"fmt ", &format)], size);
            let read = header(&file[..], Some((file.len() + samples.len()) as u64));
            prop_assert!(read.is_ok() || !is_known, "{read:?}");
            if let Ok(wave) = read {
                let mut decoded = Vec::new();
                wave.encoding.decode(&samples, &mut decoded);
                prop_assert_eq!(decoded.len(), samples.len() / wave.encoding.bytes());
                let in_scale = |part: f32| part.abs() <= 1.0;
                let are_in_scale = decoded.iter().all(|s| in_scale(s.re) && in_scale(s.im));
                prop_assert!(are_in_scale || !is_known, "{decoded:?}");
            }
        }
    }

    #[test]
    fn other_headers_are_named() {
        for (file, part) in [
            (b"OggS and more of it".to_vec(), "no file of sound"),
            (riff(b"RIFF", &[], 8), "without their format"),
            (riff(b"RIFF", &[(b"fmt ", &[6, 0])], 8), "cut off"),
            ([b"RIFF\0\0\0\0WAVE", &b"junk"[..]].concat(), "without samples"),
        ] {
            match header(&file[..], None) {
                Err(Problem::Header(text)) => assert!(text.contains(part), "{text}"),
                other => panic!("{part}: {other:?}"),
            }
        }
        assert!(matches!(header(&b"RIFF"[..], None), Err(Problem::Read(_))));
    }
}
