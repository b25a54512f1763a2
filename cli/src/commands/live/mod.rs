//! A hunt that goes on: its page, served to browsers, the hunt for programs that fetch it, events
//! for TAK servers and teams, and places for an MQTT broker.

#[cfg(any(feature = "live", feature = "hardware"))]
mod feed;
#[cfg(any(feature = "live", feature = "hardware"))]
mod happening;
#[cfg(feature = "live")]
mod page;
#[cfg(feature = "live")]
mod server;
#[cfg(not(any(feature = "live", feature = "hardware")))]
mod without;

#[cfg(any(feature = "live", feature = "hardware"))]
pub use feed::LiveView;
#[cfg(not(any(feature = "live", feature = "hardware")))]
pub use without::LiveView;

#[cfg(feature = "live")]
use std::sync::Arc;
use std::{
    env,
    net::SocketAddr,
    path::PathBuf,
    thread,
    time::{Duration, Instant},
};

#[cfg(feature = "cot")]
use foxhunt::hardware::cot::CotSender;
#[cfg(feature = "hardware")]
use foxhunt::hardware::{cot::CotConfig, link::MqttConfig};
use foxhunt::{
    config::ExtractorConfig,
    export::CotPlatform,
    log::LogHeader,
    registry::{EstimatorEntry, Registry},
};

use super::{cot::CotArgs, mqtt::MqttArgs, tiles::Tiles};
use crate::{error::CliError, hints};

/// Arguments of the live view of a hunt.
#[derive(Debug, clap::Args)]
pub struct LiveArgs {
    /// Show the hunt in browsers while it goes on [default address: 127.0.0.1:8017]; an address
    /// that others can reach needs a token
    #[arg(
        long,
        value_name = "ADDRESS:PORT",
        num_args = 0..=1,
        require_equals = true,
        default_missing_value = "127.0.0.1:8017"
    )]
    live: Option<SocketAddr>,
    /// A token that viewers need; FOXHUNT_LIVE_TOKEN in the environment does the same, and is not
    /// shown in lists of processes
    #[arg(long, value_name = "TOKEN", requires = "live")]
    live_token: Option<String>,
    /// End with the hunt; the page is served until Ctrl-C otherwise
    #[arg(long, requires = "live")]
    live_until_done: bool,
    /// A map below the hunt, in the live view and in the page, from tiles on this computer: a
    /// folder with z/x/y.png, or an .mbtiles or .pmtiles file of images; the hunt needs an origin
    /// in degrees
    #[arg(long, value_name = "PATH")]
    tiles: Option<PathBuf>,
    #[command(flatten)]
    cot: CotArgs,
    #[command(flatten)]
    mqtt: MqttArgs,
}

/// The environment variable of the token.
const TOKEN_VARIABLE: &str = "FOXHUNT_LIVE_TOKEN";

/// Minimum length of a token.
const SHORTEST_TOKEN: usize = 8;

/// Plan to show a hunt: on a page, to teams, and at a broker.
#[derive(Debug)]
#[cfg_attr(
    not(any(feature = "live", feature = "hardware")),
    expect(dead_code, reason = "nothing is shown")
)]
pub struct LivePlan {
    #[cfg_attr(
        all(feature = "hardware", not(feature = "live")),
        expect(dead_code, reason = "nothing is served")
    )]
    page: Option<PagePlan>,
    #[cfg(feature = "cot")]
    cot: Option<CotSender>,
    #[cfg(feature = "hardware")]
    mqtt: Option<MqttConfig>,
}

/// Plan to serve the page of a hunt: the address, the token, the end and the map.
#[derive(Clone, Debug)]
#[cfg_attr(not(feature = "live"), expect(dead_code, reason = "nothing is served"))]
struct PagePlan {
    address: SocketAddr,
    token: Option<String>,
    until_done: bool,
    #[cfg(feature = "live")]
    tiles: Option<Arc<Tiles>>,
}

/// The hunt that is shown.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(
    not(any(feature = "live", feature = "hardware")),
    expect(dead_code, reason = "nothing is shown")
)]
pub struct Shown<'a> {
    pub header: &'a LogHeader,
    pub registry: &'a Registry,
    pub estimator: &'a EstimatorEntry,
    pub extractor: &'a ExtractorConfig,
    /// Names of the receivers in their order, if the hunt's own names are not theirs.
    #[cfg_attr(
        all(feature = "live", not(feature = "hardware")),
        expect(dead_code, reason = "nothing is sent")
    )]
    pub platforms: &'a [CotPlatform],
    /// True if viewers with the token may break it off.
    #[cfg_attr(
        all(feature = "hardware", not(feature = "live")),
        expect(dead_code, reason = "nothing is served")
    )]
    pub orders: bool,
    /// Reason why a hunt without an origin is not sent.
    #[cfg_attr(
        all(feature = "live", not(feature = "hardware")),
        expect(dead_code, reason = "nothing is sent")
    )]
    pub nowhere: &'static str,
    /// True if the devices are not real.
    #[cfg_attr(
        all(feature = "live", not(feature = "hardware")),
        expect(dead_code, reason = "nothing is sent")
    )]
    pub is_simulated: bool,
}

impl LiveArgs {
    /// Returns the plan for `--live`, `--cot` and `--mqtt`, if one is given; a wrong one is refused
    /// before anything flies.
    pub fn plan(&self) -> Result<Option<LivePlan>, CliError> {
        #[cfg(feature = "hardware")]
        return self.plan_of(None, "");
        #[cfg(not(feature = "hardware"))]
        {
            self.cot.check()?;
            self.mqtt.check()?;
            Ok(self.page()?.map(|page| LivePlan { page: Some(page) }))
        }
    }

    /// Returns the plan as [`plan`](Self::plan) does; without `--cot` a file's addresses are used.
    #[cfg(feature = "hardware")]
    pub fn plan_of(
        &self,
        cot: Option<&CotConfig>,
        file: &str,
    ) -> Result<Option<LivePlan>, CliError> {
        #[cfg(not(feature = "cot"))]
        {
            self.cot.check()?;
            if cot.is_some() {
                return Err(super::cot::not_built(&format!("{file}: [cot]")));
            }
        }
        let page = self.page()?;
        let mqtt = self.mqtt.config()?;
        let is_shown = page.is_some() || mqtt.is_some();
        #[cfg(feature = "cot")]
        let cot = self.cot.open(cot.map(|cot| (cot, file)))?;
        #[cfg(feature = "cot")]
        let is_shown = is_shown || cot.is_some();
        Ok(is_shown.then_some(LivePlan {
            page,
            #[cfg(feature = "cot")]
            cot,
            mqtt,
        }))
    }

    fn page(&self) -> Result<Option<PagePlan>, CliError> {
        let Some(address) = self.live else { return Ok(None) };
        if !cfg!(feature = "live") {
            return Err(CliError::input(format!(
                "--live needs a build with the feature live: {}, or in the repository `cargo run \
                 --release -p foxhunt-cli --features live -- hunt --live`",
                hints::build("live")
            )));
        }
        let token = self.live_token.clone().or_else(|| env::var(TOKEN_VARIABLE).ok());
        let plan = plan(address, token, self.live_until_done)?;
        #[cfg(feature = "live")]
        let plan = PagePlan { tiles: self.map()?.map(Arc::new), ..plan };
        Ok(Some(plan))
    }

    /// Opens the map; a faulty one is refused before anything flies.
    pub fn map(&self) -> Result<Option<Tiles>, CliError> {
        self.tiles.as_deref().map(Tiles::open).transpose()
    }

    /// Returns true if the hunt has to have a place on Earth.
    pub fn is_on_map(&self) -> bool {
        self.tiles.is_some() || self.live.is_some() || self.cot.is_given() || self.mqtt.is_given()
    }
}

fn plan(
    address: SocketAddr,
    token: Option<String>,
    until_done: bool,
) -> Result<PagePlan, CliError> {
    let plain = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '_';
    if let Some(token) = &token
        && (token.len() < SHORTEST_TOKEN || !token.chars().all(plain))
    {
        return Err(CliError::input(format!(
            "the token of --live needs at least {SHORTEST_TOKEN} letters, digits, - or _"
        )));
    }
    if token.is_none() && !address.ip().is_loopback() {
        return Err(CliError::input(format!(
            "--live={address}: others can reach it and would see where the drones and beacons \
             are; it needs a token: --live-token, or {TOKEN_VARIABLE} in the environment"
        )));
    }
    Ok(PagePlan {
        address,
        token,
        until_done,
        #[cfg(feature = "live")]
        tiles: None,
    })
}

/// Pace of simulated time in the live view.
#[derive(Debug, clap::Args)]
pub struct PaceArgs {
    /// With --live, --cot or --mqtt: the simulated seconds that pass in one second [default: 20]
    #[arg(long, value_name = "FACTOR", value_parser = factor)]
    pace: Option<f64>,
}

/// Default pace of simulated time.
const FACTOR: f64 = 20.0;

impl PaceArgs {
    /// Returns true if the pace was given.
    pub fn is_given(&self) -> bool {
        self.pace.is_some()
    }

    /// Simulated time that begins at 0 now.
    pub fn start(&self) -> Pace {
        Pace { begun: Instant::now(), factor: self.pace.unwrap_or(FACTOR) }
    }
}

/// Simulated time by the clock of this computer.
pub struct Pace {
    begun: Instant,
    factor: f64,
}

impl Pace {
    /// Waits until this simulated time, in seconds; not at all if it is over.
    pub fn wait_until(&self, time: f64) {
        let due = Duration::try_from_secs_f64(time / self.factor).unwrap_or_default();
        thread::sleep(due.saturating_sub(self.begun.elapsed()));
    }
}

/// Parses a positive factor.
fn factor(text: &str) -> Result<f64, &'static str> {
    let factor = text.parse::<f64>().ok().filter(|factor| factor.is_finite() && *factor > 0.0);
    factor.ok_or("it must be a number above 0")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_others_can_reach_needs_a_token() {
        let address = |text: &str| text.parse::<SocketAddr>().expect("an address");
        let token = |text: &str| Some(text.to_owned());
        assert!(plan(address("127.0.0.1:8017"), None, false).is_ok());
        assert!(plan(address("[::1]:8017"), None, false).is_ok());
        for open in ["0.0.0.0:8017", "192.168.1.5:80", "[::]:8017"] {
            let error = plan(address(open), None, false).expect_err("others can reach it");
            assert!(error.to_string().contains(open), "{error}");
            assert!(plan(address(open), token("correct-horse"), false).is_ok());
        }
        for short in ["", "secret", "with a space", "semi;colon"] {
            assert!(plan(address("127.0.0.1:0"), token(short), false).is_err(), "{short:?}");
        }
    }
}
