use std::io;

use foxhunt_wire::{
    ByteStream,
    receivers::{HttpError, HttpResponse},
};

/// One page, which is fetched over a connection of its own.
#[derive(Debug)]
pub(super) struct Page<S> {
    stream: S,
    response: HttpResponse,
    /// Time of the request.
    pub(super) requested_at: f64,
}

/// Error of a page that does not come.
pub(super) enum PageError {
    Stream(io::Error),
    Http(HttpError),
}

impl<S: ByteStream> Page<S> {
    /// Asks for it.
    pub(super) fn request(mut stream: S, host: &str, path: &str, now: f64) -> io::Result<Self> {
        stream.send(&HttpResponse::request(host, path))?;
        Ok(Self { stream, response: HttpResponse::default(), requested_at: now })
    }

    /// The page, once it is complete.
    pub(super) fn poll(&mut self) -> Result<Option<Vec<u8>>, PageError> {
        let mut chunk = [0; 4096];
        loop {
            match self.stream.receive(&mut chunk) {
                Ok(0) => return Ok(None),
                Ok(count) => {
                    let came = chunk.get(..count).unwrap_or_default();
                    if let Some(body) = self.response.push(came).map_err(PageError::Http)? {
                        return Ok(Some(body));
                    }
                }
                Err(error) if error.kind() == io::ErrorKind::UnexpectedEof => {
                    let response = std::mem::take(&mut self.response);
                    return response.end().map(Some).map_err(PageError::Http);
                }
                Err(error) => return Err(PageError::Stream(error)),
            }
        }
    }
}
