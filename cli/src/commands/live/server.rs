//! Server of the live page, and what it shares with the hunt's thread.

use std::{
    convert::Infallible,
    net::TcpListener,
    sync::{
        Arc, Mutex, PoisonError,
        atomic::{AtomicBool, Ordering},
        mpsc::{self, Sender},
    },
    thread,
    time::Duration,
};

use axum::{
    Router,
    extract::{Path, Request, State},
    http::{HeaderMap, StatusCode, header},
    middleware::{self, Next},
    response::{
        Html, IntoResponse, Response,
        sse::{Event, KeepAlive, Sse},
    },
    routing::{get, post},
};
use foxhunt::export::{ExportError, Format};
use futures_util::{Stream, stream};
use tokio::sync::{oneshot, watch};

use super::happening::{Asked, Happening};
use crate::{
    commands::tiles::{Tile, TileAt, Tiles},
    error::CliError,
};

/// Page and news of a hunt, shared by the hunt, the thread that reads it and the server.
pub struct Shared {
    page: String,
    pub token: Option<String>,
    pub orders: bool,
    tiles: Option<Arc<Tiles>>,
    /// Name of the run that the numbers of the news belong to; another hunt has another name.
    run: String,
    /// All news since the beginning, in order. Each browser has its place in it, so that the hunt
    /// waits for no browser and late ones get everything.
    news: Mutex<Vec<Arc<str>>>,
    /// Number of news, and if they are complete.
    pub progress: watch::Sender<Progress>,
    /// True if a viewer with the token has broken the flight off.
    broken_off: AtomicBool,
    /// Sender of questions to the hunt's thread.
    questions: Option<Sender<Happening>>,
}

/// Progress of a hunt.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Progress {
    news: usize,
    pub over: bool,
}

impl Shared {
    /// Begins without news.
    pub fn new(
        page: String,
        token: Option<String>,
        orders: bool,
        tiles: Option<Arc<Tiles>>,
        run: String,
    ) -> Self {
        Self {
            page,
            token,
            orders,
            tiles,
            run,
            news: Mutex::new(Vec::new()),
            progress: watch::Sender::new(Progress::default()),
            broken_off: AtomicBool::new(false),
            questions: None,
        }
    }

    /// Sends questions of programs to the hunt's thread.
    pub fn with_questions(self, questions: Sender<Happening>) -> Self {
        Self { questions: Some(questions), ..self }
    }

    /// Returns the hunt as it is now, in a format; `None` if it is not shown any more.
    async fn ask(&self, format: Format) -> Option<Result<Vec<u8>, ExportError>> {
        let (answer, answered) = oneshot::channel();
        let asked = Happening::Asked(Asked { format, answer });
        self.questions.as_ref()?.send(asked).ok()?;
        answered.await.ok()
    }

    /// The news of a number, from 0.
    fn news(&self, number: usize) -> Option<Arc<str>> {
        let news = self.news.lock().unwrap_or_else(PoisonError::into_inner);
        news.get(number).cloned()
    }

    /// Adds news for every browser.
    pub fn add(&self, text: String) {
        let mut news = self.news.lock().unwrap_or_else(PoisonError::into_inner);
        news.push(text.into());
        let count = news.len();
        drop(news);
        self.progress.send_modify(|progress| progress.news = count);
    }

    fn break_off(&self) {
        self.broken_off.store(true, Ordering::Relaxed);
    }

    /// Returns true if the flight was broken off since the last call.
    #[cfg(feature = "hardware")]
    pub fn take_break_off(&self) -> bool {
        self.broken_off.swap(false, Ordering::Relaxed)
    }
}

/// Time between two messages to a browser without news, so that lost connections are noticed.
const KEEP_ALIVE: Duration = Duration::from_secs(10);

/// The cookie of the token.
const COOKIE: &str = "foxhunt_live_token";

/// Maximum number of browsers served at once.
const MOST_BROWSERS: usize = 100;

/// Serves the page on a thread of its own; `end` is dropped when it ends: never, or when the hunt
/// is over and every browser has all of it.
pub fn start(
    listener: TcpListener,
    shared: Arc<Shared>,
    until_done: bool,
    end: mpsc::Sender<()>,
) -> Result<(), CliError> {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build();
    let runtime = runtime.map_err(CliError::failure)?;
    thread::spawn(move || {
        let _end = end;
        let mut progress = shared.progress.subscribe();
        let over = async move {
            // The sender lives as long as the server.
            let _ = progress.wait_for(|progress| until_done && progress.over).await;
        };
        // A server that fails leaves the hunt as it is.
        let _ = runtime.block_on(async move {
            let listener = tokio::net::TcpListener::from_std(listener)?;
            axum::serve(listener, router(shared)).with_graceful_shutdown(over).await
        });
    });
    Ok(())
}

fn router(shared: Arc<Shared>) -> Router {
    Router::new()
        .route("/", get(page))
        .route("/events", get(events))
        .route("/break-off", post(break_off))
        .route("/fixes.geojson", get(geojson))
        .route("/fixes.czml", get(czml))
        .route("/fixes.kml", get(kml))
        .route("/link.kml", get(link))
        .route("/tiles/{zoom}/{column}/{row}", get(tile))
        .layer(middleware::from_fn_with_state(Arc::clone(&shared), admit))
        .with_state(shared)
}

/// Admits everybody on this computer if there is no token, and otherwise holders of the token: in
/// the address once and in a cookie from then on.
async fn admit(State(shared): State<Arc<Shared>>, request: Request, next: Next) -> Response {
    let headers = request.headers();
    let mut response = match &shared.token {
        // A page of another site can make its own name mean this computer, and would read along.
        None if !is_local(headers) => refused(StatusCode::FORBIDDEN, "not the name of loopback"),
        None => next.run(request).await,
        Some(token) if has_token(headers, token) => next.run(request).await,
        Some(token) => match request.uri().query().and_then(|query| query.strip_prefix("token=")) {
            // Programs that fetch a file follow no way over a cookie.
            Some(given) if same(given, token) && request.uri().path() != "/" => {
                next.run(request).await
            }
            Some(given) if same(given, token) => to_the_page(token),
            _ => refused(StatusCode::UNAUTHORIZED, "this hunt is shown at /?token=TOKEN"),
        },
    };
    for (name, value) in [
        (header::CACHE_CONTROL, "no-store"),
        (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
        (header::REFERRER_POLICY, "no-referrer"),
        (header::X_FRAME_OPTIONS, "DENY"),
    ] {
        let _ = response.headers_mut().insert(name, header::HeaderValue::from_static(value));
    }
    response
}

fn refused(status: StatusCode, why: &'static str) -> Response {
    (status, why).into_response()
}

/// Keeps the token in a cookie, and out of the address.
fn to_the_page(token: &str) -> Response {
    let cookie = format!("{COOKIE}={token}; Path=/; HttpOnly; SameSite=Strict");
    let headers = [(header::LOCATION, "/".to_owned()), (header::SET_COOKIE, cookie)];
    (StatusCode::SEE_OTHER, headers).into_response()
}

/// Returns true if the browser's `Host` is this computer: a loopback address or `localhost`.
fn is_local(headers: &HeaderMap) -> bool {
    let host = headers.get(header::HOST).and_then(|host| host.to_str().ok()).unwrap_or_default();
    let name =
        host.rsplit_once(':').filter(|_| !host.ends_with(']')).map_or(host, |(name, _)| name);
    let name = name.trim_start_matches('[').trim_end_matches(']');
    let loopback = name.parse().is_ok_and(|ip: std::net::IpAddr| ip.is_loopback());
    loopback || name.eq_ignore_ascii_case("localhost")
}

fn has_token(headers: &HeaderMap, token: &str) -> bool {
    let text = |name| headers.get_all(name).iter().filter_map(|value| value.to_str().ok());
    let bearer = |value: &str| value.strip_prefix("Bearer ").is_some_and(|it| same(it, token));
    let is_ours = |cookie: &str| {
        let given = cookie.trim().split_once('=').filter(|(name, _)| *name == COOKIE);
        given.is_some_and(|(_, value)| same(value, token))
    };
    text(header::AUTHORIZATION).any(bearer)
        || text(header::COOKIE).flat_map(|cookies| cookies.split(';')).any(is_ours)
}

/// Compares in a time that does not depend on where two texts differ.
fn same(given: &str, token: &str) -> bool {
    let differences = given.bytes().zip(token.bytes()).fold(0, |all, (a, b)| all | (a ^ b));
    given.len() == token.len() && differences == 0
}

async fn page(State(shared): State<Arc<Shared>>) -> Html<String> {
    Html(shared.page.clone())
}

/// Serves a tile of the map. A tile off the map, missing or not an image gives no content, which
/// browsers do not report as an error.
async fn tile(
    State(shared): State<Arc<Shared>>,
    Path((zoom, column, row)): Path<(u8, u32, u32)>,
) -> Response {
    let (Some(tiles), Some(at)) = (shared.tiles.clone(), TileAt::new(zoom, column, row)) else {
        return StatusCode::NO_CONTENT.into_response();
    };
    // A slow disk holds up no other browser.
    let read = tokio::task::spawn_blocking(move || tiles.tile(at)).await;
    match read.ok().flatten() {
        Some(Tile { bytes, content_type }) => {
            ([(header::CONTENT_TYPE, content_type)], bytes).into_response()
        }
        None => StatusCode::NO_CONTENT.into_response(),
    }
}

async fn geojson(State(shared): State<Arc<Shared>>) -> Response {
    file(&shared, Format::GeoJson, "application/geo+json").await
}

async fn czml(State(shared): State<Arc<Shared>>) -> Response {
    file(&shared, Format::Czml, "application/json").await
}

async fn kml(State(shared): State<Arc<Shared>>) -> Response {
    file(&shared, Format::Kml, KML).await
}

/// Content type of KML.
const KML: &str = "application/vnd.google-earth.kml+xml";

/// The hunt as it is now, in a format of other programs.
async fn file(shared: &Shared, format: Format, content_type: &'static str) -> Response {
    match shared.ask(format).await {
        Some(Ok(bytes)) => ([(header::CONTENT_TYPE, content_type)], bytes).into_response(),
        Some(Err(error)) => (StatusCode::CONFLICT, error.to_string()).into_response(),
        None => refused(StatusCode::SERVICE_UNAVAILABLE, "the hunt is not shown any more"),
    }
}

/// Seconds from one look of Google Earth at the hunt to the next.
const LOOK_S: u32 = 5;

/// A network link: Google Earth and others that open it fetch the hunt again and again.
async fn link(State(shared): State<Arc<Shared>>, headers: HeaderMap) -> Response {
    let host = headers.get(header::HOST).and_then(|host| host.to_str().ok());
    let plain = |c: char| c.is_ascii_alphanumeric() || matches!(c, '.' | '-' | ':' | '[' | ']');
    let Some(host) = host.filter(|host| host.chars().all(plain)) else {
        return refused(StatusCode::BAD_REQUEST, "the request has no host");
    };
    // A token has letters, digits, - and _ alone.
    let query = shared.token.as_ref().map_or(String::new(), |token| format!("?token={token}"));
    let text = format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n\
         <kml xmlns=\"http://www.opengis.net/kml/2.2\"><NetworkLink><name>foxhunt</name><Link>\
         <href>http://{host}/fixes.kml{query}</href><refreshMode>onInterval</refreshMode>\
         <refreshInterval>{LOOK_S}</refreshInterval></Link></NetworkLink></kml>\n"
    );
    ([(header::CONTENT_TYPE, KML)], text).into_response()
}

async fn break_off(State(shared): State<Arc<Shared>>) -> StatusCode {
    if !shared.orders {
        return StatusCode::FORBIDDEN;
    }
    shared.break_off();
    StatusCode::ACCEPTED
}

/// Streams the whole hunt, or the part that a returning browser lacks.
async fn events(State(shared): State<Arc<Shared>>, headers: HeaderMap) -> Response {
    if shared.progress.receiver_count() > MOST_BROWSERS {
        return refused(StatusCode::SERVICE_UNAVAILABLE, "too many browsers");
    }
    let last = headers.get("last-event-id").and_then(|last| last.to_str().ok());
    let begin = match last.map(|last| last.split_once('-')) {
        None => Some(0),
        Some(Some((run, number))) if run == shared.run => number.parse().ok(),
        Some(_) => None,
    };
    let Some(begin) = begin else {
        let other = Event::default().event("other").data("other");
        return Sse::new(stream::iter([Ok::<_, Infallible>(other)])).into_response();
    };
    let keep_alive = KeepAlive::new().interval(KEEP_ALIVE);
    Sse::new(from(shared, begin)).keep_alive(keep_alive).into_response()
}

/// Streams the news from a number on, as fast as a browser takes them, and the end of the hunt.
fn from(shared: Arc<Shared>, begin: usize) -> impl Stream<Item = Result<Event, Infallible>> {
    let progress = shared.progress.subscribe();
    stream::unfold(Some((shared, progress, begin)), |state| async move {
        let (shared, mut progress, next) = state?;
        let known = progress.wait_for(|now| now.news > next || now.over).await;
        let known: Progress = known.map(|known| *known).unwrap_or_default();
        match shared.news(next).filter(|_| next < known.news) {
            Some(news) => {
                let id = format!("{}-{}", shared.run, next + 1);
                let event = Event::default().id(id).data(&*news);
                Some((Ok(event), Some((shared, progress, next + 1))))
            }
            None => Some((Ok(Event::default().event("over").data("over")), None)),
        }
    })
}

#[cfg(test)]
mod tests {
    use axum::http::HeaderValue;

    use super::*;

    fn headers(name: header::HeaderName, value: &'static str) -> HeaderMap {
        HeaderMap::from_iter([(name, HeaderValue::from_static(value))])
    }

    #[test]
    fn other_names_of_this_computer_are_refused() {
        for host in ["127.0.0.1:8017", "localhost:8017", "LOCALHOST", "[::1]:8017", "[::1]"] {
            assert!(is_local(&headers(header::HOST, host)), "{host}");
        }
        for host in ["evil.example:8017", "127.0.0.1.evil.example", "192.168.0.3:8017", ""] {
            assert!(!is_local(&headers(header::HOST, host)), "{host}");
        }
        assert!(!is_local(&HeaderMap::new()));
    }

    #[test]
    fn a_token_opens() {
        let token = "correct-horse";
        for (name, value) in [
            (header::AUTHORIZATION, "Bearer correct-horse"),
            (header::COOKIE, "a=b; foxhunt_live_token=correct-horse"),
        ] {
            assert!(has_token(&headers(name, value), token), "{value}");
        }
        for (name, value) in [
            (header::AUTHORIZATION, "Bearer correct-hors"),
            (header::AUTHORIZATION, "Bearer correct-horsf"),
            (header::AUTHORIZATION, "correct-horse"),
            (header::COOKIE, "foxhunt_live_token=; foxhunt_live_tokens=correct-horse"),
        ] {
            assert!(!has_token(&headers(name, value), token), "{value}");
        }
        assert!(!has_token(&HeaderMap::new(), token));
    }
}
