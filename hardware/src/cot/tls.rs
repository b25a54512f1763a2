//! Certificates of a TAK server, as PEM or PKCS#12.

use std::{fs, path::Path, sync::Arc};

use p12_keystore::Pkcs12Archive;
use pkcs8::{EncryptedPrivateKeyInfoRef, der::pem};
use rustls::{
    ClientConfig, RootCertStore,
    crypto::ring,
    pki_types::{CertificateDer, PrivateKeyDer, ServerName, pem::PemObject},
};

use super::config::{CotConfig, CotError};

/// Largest file that is read as certificates or a key, in bytes.
const MOST_BYTES: u64 = 4 << 20;

/// Begin of an encrypted key in PEM.
const ENCRYPTED: &str = "-----BEGIN ENCRYPTED PRIVATE KEY-----";

/// End of an encrypted key in PEM.
const END_OF_ENCRYPTED: &str = "-----END ENCRYPTED PRIVATE KEY-----";

/// Lines of keys in PEM that OpenSSL encrypted in its own way.
const OF_OPENSSL: &str = "Proc-Type: 4,ENCRYPTED";

/// Certificates and a key.
#[derive(Default)]
struct Papers {
    certificates: Vec<CertificateDer<'static>>,
    key: Option<PrivateKeyDer<'static>>,
}

/// Returns the client's settings. The server's certificate is always checked, by the authorities of
/// `ca` alone.
pub(super) fn client(
    config: &CotConfig,
    password: Option<&str>,
) -> Result<Arc<ClientConfig>, CotError> {
    let missing = CotError::Setting { name: "ca", reason: "TLS needs it" };
    let file = config.ca.as_deref().ok_or(missing)?;
    let mut roots = RootCertStore::empty();
    let authorities = papers(file, password)?.certificates;
    if authorities.is_empty() {
        return Err(refused(file, "no certificate in it"));
    }
    for authority in authorities {
        roots.add(authority).map_err(|error| refused(file, error))?;
    }
    let open =
        |error: rustls::Error| CotError::Open { what: "TLS".to_owned(), reason: error.to_string() };
    let client = ClientConfig::builder_with_provider(Arc::new(ring::default_provider()))
        .with_safe_default_protocol_versions()
        .map_err(open)?
        .with_root_certificates(roots);
    let Some(file) = &config.cert else {
        return Ok(Arc::new(client.with_no_client_auth()));
    };
    let Papers { certificates, key } = papers(file, password)?;
    if certificates.is_empty() {
        return Err(refused(file, "no certificate in it"));
    }
    let key = match &config.key {
        Some(file) => papers(file, password)?.key.ok_or_else(|| refused(file, "no key in it"))?,
        None => {
            key.ok_or_else(|| refused(file, "no key beside the certificate; give it as key"))?
        }
    };
    let client = client.with_client_auth_cert(certificates, key);
    client.map(Arc::new).map_err(|error| refused(file, error))
}

/// Returns the name that the server's certificate must have: that of the setting, or else the host
/// of the address.
pub(super) fn name(setting: Option<&str>, host: &str) -> Result<ServerName<'static>, CotError> {
    let reason = "no certificate can have such a name";
    let name = setting.unwrap_or(host).to_owned();
    ServerName::try_from(name).map_err(|_| match setting {
        Some(_) => CotError::Setting { name: "server_name", reason },
        None => CotError::Address { given: host.to_owned(), reason },
    })
}

fn refused(file: &Path, reason: impl ToString) -> CotError {
    CotError::File { file: file.to_owned(), reason: reason.to_string() }
}

/// Reads the certificates and the key of a file.
fn papers(file: &Path, password: Option<&str>) -> Result<Papers, CotError> {
    let bytes = fs::metadata(file).map_err(|error| refused(file, error))?.len();
    if bytes > MOST_BYTES {
        return Err(refused(file, format!("{bytes} bytes are too many for certificates")));
    }
    let bytes = fs::read(file).map_err(|error| refused(file, error))?;
    match std::str::from_utf8(&bytes) {
        Ok(text) if text.contains("-----BEGIN ") => of_pem(file, text, password),
        _ => of_pkcs12(file, &bytes, password),
    }
}

fn of_pem(file: &Path, text: &str, password: Option<&str>) -> Result<Papers, CotError> {
    let certificates = CertificateDer::pem_slice_iter(text.as_bytes())
        .collect::<Result<_, _>>()
        .map_err(|error| refused(file, error))?;
    if text.contains(OF_OPENSSL) {
        return Err(refused(
            file,
            "the key is encrypted in OpenSSL's own way; `openssl pkcs8 -topk8` converts it",
        ));
    }
    let key = match text.find(ENCRYPTED) {
        Some(begin) => Some(decrypted(file, &text[begin..], password)?),
        None => PrivateKeyDer::pem_slice_iter(text.as_bytes())
            .next()
            .transpose()
            .map_err(|error| refused(file, error))?,
    };
    Ok(Papers { certificates, key })
}

fn decrypted(
    file: &Path,
    text: &str,
    password: Option<&str>,
) -> Result<PrivateKeyDer<'static>, CotError> {
    let password = password.ok_or_else(|| refused(file, "the key is encrypted: a password"))?;
    let end = text.find(END_OF_ENCRYPTED).ok_or_else(|| refused(file, "the key has no end"))?;
    let text = &text[..end + END_OF_ENCRYPTED.len()];
    let (_, bytes) = pem::decode_vec(text.as_bytes()).map_err(|error| refused(file, error))?;
    let encrypted = EncryptedPrivateKeyInfoRef::try_from(bytes.as_slice())
        .map_err(|error| refused(file, error))?;
    let key = encrypted
        .decrypt(password)
        .map_err(|error| refused(file, format!("the password does not open it: {error}")))?;
    PrivateKeyDer::try_from(key.as_bytes().to_vec()).map_err(|error| refused(file, error))
}

fn of_pkcs12(file: &Path, bytes: &[u8], password: Option<&str>) -> Result<Papers, CotError> {
    let archive =
        Pkcs12Archive::from_pkcs12(bytes, password.unwrap_or_default()).map_err(|error| {
            let password =
                if password.is_some() { "the password does not open it" } else { "a password" };
            refused(file, format!("neither PEM nor a PKCS#12 that opens ({password}): {error}"))
        })?;
    let key = archive.keys.first();
    let id = key.and_then(|key| key.local_key_id.as_ref()).map(AsRef::<[u8]>::as_ref);
    let mut bags = archive.certs;
    // The certificate of the key comes first, those that signed it behind.
    bags.sort_by_key(|bag| id.is_none() || bag.local_key_id.as_deref() != id);
    let certificates =
        bags.iter().map(|bag| CertificateDer::from(bag.cert.as_der().to_vec())).collect();
    let key = key.map(|key| PrivateKeyDer::try_from(key.key.as_der().to_vec())).transpose();
    Ok(Papers { certificates, key: key.map_err(|error| refused(file, error))? })
}
