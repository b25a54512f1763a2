use std::{
    fmt::{self, Write as _},
    fs::{File, OpenOptions},
    io::{self, Read, Write},
    path::Path,
};

use hmac_sha256::HMAC;

/// Number of bytes of a key: as many as the digest, which is as strong as HMAC gets (RFC 2104).
const BYTES: usize = 32;

/// Beginning of a key's file.
const HEAD: &str = "foxhunt-key-1 ";

/// No file of a key is longer.
const MOST_BYTES: u64 = 256;

/// The key that all nodes of a team share. Whoever has it can fly the drones.
///
/// In a file it is one line: `foxhunt-key-1` and 64 hexadecimal digits.
#[derive(Clone, PartialEq, Eq)]
pub struct TeamKey([u8; BYTES]);

/// Hides the digits of the key.
impl fmt::Debug for TeamKey {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("TeamKey(..)")
    }
}

impl TeamKey {
    /// A new key, from the randomness of the operating system.
    ///
    /// # Errors
    ///
    /// [`KeyError::Random`] when that has none.
    pub fn generate() -> Result<Self, KeyError> {
        let mut bytes = [0; BYTES];
        getrandom::fill(&mut bytes).map_err(|error| KeyError::Random(error.to_string()))?;
        Ok(Self(bytes))
    }

    /// Reads a file.
    ///
    /// # Errors
    ///
    /// [`KeyError`] names the file and what is wrong; a file that others than its owner may read is
    /// refused.
    pub fn read(path: &Path) -> Result<Self, KeyError> {
        let file = path.display().to_string();
        let failed = |source| KeyError::File { file: file.clone(), source };
        let opened = File::open(path).map_err(failed)?;
        #[cfg(unix)]
        {
            use std::os::unix::fs::MetadataExt;
            let mode = opened.metadata().map_err(failed)?.mode() & 0o777;
            if mode & 0o077 != 0 {
                return Err(KeyError::Readable { file, mode });
            }
        }
        let mut text = String::new();
        opened.take(MOST_BYTES).read_to_string(&mut text).map_err(failed)?;
        Self::parse(&text).ok_or(KeyError::Form { file })
    }

    fn parse(text: &str) -> Option<Self> {
        let digits = text.trim_end().strip_prefix(HEAD)?.as_bytes();
        let mut bytes = [0; BYTES];
        if digits.len() != 2 * BYTES {
            return None;
        }
        for (byte, pair) in bytes.iter_mut().zip(digits.chunks_exact(2)) {
            *byte = digit(pair[0])? << 4 | digit(pair[1])?;
        }
        Some(Self(bytes))
    }

    /// Writes it into a new file that only its owner may read.
    ///
    /// # Errors
    ///
    /// [`KeyError::File`] when it cannot be written; a file that is there is not overwritten.
    pub fn write(&self, path: &Path) -> Result<(), KeyError> {
        let mut options = OpenOptions::new();
        options.write(true).create_new(true);
        #[cfg(unix)]
        {
            use std::os::unix::fs::OpenOptionsExt;
            options.mode(0o600);
        }
        let write = || {
            let mut file = options.open(path)?;
            file.write_all(format!("{HEAD}{}\n", hexadecimal(&self.0)).as_bytes())?;
            file.sync_all()
        };
        write().map_err(|source| KeyError::File { file: path.display().to_string(), source })
    }

    fn digest(&self, parts: &[&[u8]]) -> HMAC {
        let mut digest = HMAC::new(self.0);
        for part in parts {
            digest.update(part);
        }
        digest
    }

    /// The HMAC-SHA-256 (RFC 2104, FIPS 180-4) of bytes, as 64 hexadecimal digits.
    pub(super) fn sign(&self, parts: &[&[u8]]) -> String {
        hexadecimal(&self.digest(parts).finalize())
    }

    /// Returns true if these digits are the signature of the bytes; it takes as long whatever they
    /// are.
    pub(super) fn verifies(&self, parts: &[&[u8]], signature: &str) -> bool {
        let digits = signature.as_bytes();
        let pairs = digits.chunks_exact(2);
        let bytes: Option<Vec<u8>> =
            pairs.map(|pair| Some(digit(pair[0])? << 4 | digit(pair[1])?)).collect();
        digits.len() == 64
            && bytes
                .and_then(|bytes| bytes.try_into().ok())
                .is_some_and(|bytes| self.digest(parts).finalize_verify(&bytes))
    }
}

fn digit(ascii: u8) -> Option<u8> {
    match ascii {
        b'0'..=b'9' => Some(ascii - b'0'),
        b'a'..=b'f' => Some(ascii - b'a' + 10),
        _ => None,
    }
}

fn hexadecimal(bytes: &[u8]) -> String {
    bytes.iter().fold(String::new(), |mut text, byte| {
        write!(text, "{byte:02x}").expect("a string takes everything");
        text
    })
}

/// Error of a key that cannot be made, read or written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum KeyError {
    /// The operating system gives no random numbers.
    #[error("the operating system gives no random numbers: {0}")]
    Random(String),
    /// The file cannot be read or written.
    #[error("{file}: {source}")]
    File {
        /// The file.
        file: String,
        /// Error of the system.
        source: io::Error,
    },
    /// Others may read the file.
    #[error("{file}: its mode is {mode:o}, so that others may read it; chmod 600 {file}")]
    Readable {
        /// The file.
        file: String,
        /// Mode of the file.
        mode: u32,
    },
    /// The file holds no key.
    #[error("{file}: not \"foxhunt-key-1\" and 64 hexadecimal digits; foxhunt node key makes one")]
    Form {
        /// The file.
        file: String,
    },
}

#[cfg(test)]
mod tests {
    use super::*;

    /// RFC 4231, test cases 1 and 2, whose keys are shorter and filled up with zeros.
    #[test]
    fn signatures_are_those_of_the_standard() {
        let key = |bytes: &[u8]| {
            let mut key = [0; BYTES];
            key[..bytes.len()].copy_from_slice(bytes);
            TeamKey(key)
        };
        let first = "b0344c61d8db38535ca8afceaf0bf12b881dc200c9833da726e9376c2e32cff7";
        assert_eq!(key(&[0x0b; 20]).sign(&[b"Hi ", b"There"]), first);
        assert!(key(&[0x0b; 20]).verifies(&[b"Hi There"], first));
        let second = "5bdcc146bf60754e6a042426089575c75a003f089d2739839dec58b964ec3843";
        assert_eq!(key(b"Jefe").sign(&[b"what do ya want for nothing?"]), second);
        for wrong in [second, "", "b0", &first.to_uppercase(), &format!("{first}00")] {
            assert!(!key(&[0x0b; 20]).verifies(&[b"Hi There"], wrong), "{wrong}");
        }
    }

    #[test]
    fn a_key_is_read_as_it_was_written() {
        let folder = std::env::temp_dir().join(format!("foxhunt-key-{}", std::process::id()));
        std::fs::create_dir_all(&folder).expect("there is room");
        let path = folder.join("team.key");
        let key = TeamKey::generate().expect("randomness");
        assert_ne!(key, TeamKey::generate().expect("randomness"));
        key.write(&path).expect("there is room");
        assert_eq!(TeamKey::read(&path).expect("as written"), key);
        let digits = hexadecimal(&key.0);
        assert!(!format!("{key:?}").contains(&digits[..8]));
        let again = key.write(&path).expect_err("it is there").to_string();
        assert!(again.contains("team.key"), "{again}");
        #[cfg(unix)]
        {
            use std::os::unix::fs::PermissionsExt;
            let mode = |mode| std::fs::Permissions::from_mode(mode);
            assert_eq!(path.metadata().expect("it is there").permissions().mode() & 0o777, 0o600);
            std::fs::set_permissions(&path, mode(0o640)).expect("it is ours");
            let error = TeamKey::read(&path).expect_err("others may read it").to_string();
            assert!(error.contains("mode is 640"), "{error}");
            std::fs::set_permissions(&path, mode(0o600)).expect("it is ours");
        }
        for text in ["", "foxhunt-key-1 abc", &digits, &format!("{HEAD}{digits}0"), "ä"] {
            std::fs::write(&path, text).expect("there is room");
            let error = TeamKey::read(&path).expect_err("no key").to_string();
            assert!(error.contains("hexadecimal"), "{error}");
        }
        std::fs::remove_dir_all(&folder).expect("it is ours");
    }
}
