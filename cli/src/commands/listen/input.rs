use std::{
    path::Path,
    sync::mpsc::{Receiver, RecvTimeoutError, sync_channel},
    thread,
    time::Duration,
};

use foxhunt::signal::{
    Complex32,
    samples::{SampleError, SampleSource, open as open_file},
};
use serde::Serialize;

use super::args::Args;
use crate::error::CliError;

/// Result of a look for samples.
#[derive(Clone, Copy, Debug)]
pub enum Came {
    /// Samples, the first of which has this index.
    Samples(u64),
    /// No samples at present.
    Nothing,
    /// End of the samples.
    End,
}

/// Losses on the way.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Losses {
    pub gaps: u32,
    pub samples: u64,
    /// Number of times that a stream stalled and was opened again.
    pub stalls: u32,
}

/// Source of samples.
pub trait Input {
    /// Name in lists of pulses.
    fn name(&self) -> &str;

    fn rate_hz(&self) -> f64;

    fn center_hz(&self) -> Option<f64>;

    /// The power of the noise that rounding gave the samples.
    fn rounding_noise(&self) -> f64;

    /// Returns true if samples come as they are taken.
    fn is_live(&self) -> bool {
        false
    }

    /// Time since it was opened, in seconds, if time passes without samples.
    fn elapsed_s(&self) -> Option<f64> {
        None
    }

    /// Replaces the contents of `samples` by the next ones; waits a little if there are no new
    /// ones.
    fn read(&mut self, samples: &mut Vec<Complex32>) -> Result<Came, CliError>;

    fn losses(&self) -> Losses;

    /// Takes news about the source, if there is any.
    fn news(&mut self) -> Option<String> {
        None
    }
}

/// Prefix of the names of `SoapySDR` receivers.
const SOAPY: &str = "soapy:";

/// Opens what the arguments name.
pub fn open(args: &Args) -> Result<Box<dyn Input>, CliError> {
    if args.source.starts_with("tcp:") || args.source.starts_with(SOAPY) {
        return live::open(args);
    }
    for (given, flag) in [(args.gain_db.is_some(), "--gain-db"), (args.ppm.is_some(), "--ppm")] {
        if given {
            let text = format!("{flag}: only for receivers, tcp: and soapy:");
            return Err(CliError::input(text));
        }
    }
    let options = args.search.options();
    let source = open_file(Path::new(&args.source), &options).map_err(CliError::input)?;
    Ok(Box::new(Recorded::new(source)))
}

/// Maximum wait for a pipe until the view is looked after.
const PATIENCE: Duration = Duration::from_millis(100);

/// Number of chunks that are read ahead.
const AHEAD: usize = 8;

type Chunk = Result<(u64, Vec<Complex32>), SampleError>;

/// A file or a pipe, which a thread of its own waits for.
struct Recorded {
    name: String,
    rate_hz: f64,
    center_hz: Option<f64>,
    rounding_noise: f64,
    /// Index after the last sample; before the first one nothing counts as lost.
    next: Option<u64>,
    losses: Losses,
    chunks: Receiver<Chunk>,
}

impl Recorded {
    fn new(mut source: SampleSource) -> Self {
        let (sender, chunks) = sync_channel(AHEAD);
        let rate_hz = source.rate_hz();
        let center_hz = source.center_hz();
        let rounding_noise = source.rounding_noise();
        let name = source.file().to_owned();
        thread::spawn(move || {
            let mut samples = Vec::new();
            while let Some(chunk) = source.read(&mut samples).transpose() {
                let is_last = chunk.is_err();
                let chunk = chunk.map(|first| (first, std::mem::take(&mut samples)));
                // Whoever waited for it may be gone.
                if sender.send(chunk).is_err() || is_last {
                    break;
                }
            }
        });
        let losses = Losses::default();
        Self { name, rate_hz, center_hz, rounding_noise, next: None, losses, chunks }
    }
}

impl Input for Recorded {
    fn name(&self) -> &str {
        &self.name
    }

    fn rate_hz(&self) -> f64 {
        self.rate_hz
    }

    fn center_hz(&self) -> Option<f64> {
        self.center_hz
    }

    fn rounding_noise(&self) -> f64 {
        self.rounding_noise
    }

    fn read(&mut self, samples: &mut Vec<Complex32>) -> Result<Came, CliError> {
        let (first, chunk) = match self.chunks.recv_timeout(PATIENCE) {
            Ok(chunk) => chunk.map_err(CliError::input)?,
            Err(RecvTimeoutError::Timeout) => return Ok(Came::Nothing),
            Err(RecvTimeoutError::Disconnected) => return Ok(Came::End),
        };
        let lost = first.saturating_sub(self.next.unwrap_or(first));
        self.losses.samples += lost;
        self.losses.gaps += u32::from(lost > 0);
        self.next = Some(first.saturating_add(chunk.len() as u64));
        *samples = chunk;
        Ok(Came::Samples(first))
    }

    fn losses(&self) -> Losses {
        self.losses
    }
}

#[cfg(not(feature = "hardware"))]
mod live {
    use super::{Args, CliError, Input};

    pub fn open(args: &Args) -> Result<Box<dyn Input>, CliError> {
        let text = "it needs a build with the feature hardware";
        Err(CliError::input(format!("{}: {text}", args.source)))
    }
}

#[cfg(feature = "hardware")]
mod live {
    use std::{thread, time::Duration};

    use foxhunt::{
        core::Clock,
        hardware::{
            Reconnecting, RtlTcpRadioError, RtlTcpSamples, RtlTcpTuning, SampleLosses, SystemClock,
        },
        signal::{Complex32, samples::SampleFormat},
        wire::Endpoint,
    };

    use super::{Args, Came, CliError, Input, Losses, SOAPY};

    /// Time between two looks at a receiver.
    const PAUSE: Duration = Duration::from_millis(5);

    /// A receiver whose samples come as they are taken.
    trait Receiver {
        fn rate_hz(&self) -> f64;

        fn center_hz(&self) -> f64;

        fn rounding_noise(&self) -> f64;

        /// Replaces the contents of `samples` by the new ones, and returns the index of the first.
        fn poll(&mut self, samples: &mut Vec<Complex32>) -> Result<Option<u64>, Failure>;

        fn losses(&self) -> SampleLosses;
    }

    /// Reason why no samples come.
    enum Failure {
        /// Passing failure: samples may come again.
        Passing(String),
        /// Final failure: no samples will come.
        Final(CliError),
    }

    struct Live<R> {
        receiver: R,
        clock: SystemClock,
        name: String,
        /// True if samples come at present.
        flows: Option<bool>,
        news: Option<String>,
    }

    pub fn open(args: &Args) -> Result<Box<dyn Input>, CliError> {
        let search = &args.search;
        if search.format.is_some() {
            return Err(CliError::input(
                "--format: only for raw samples; receivers have their own",
            ));
        }
        let needed = |value: Option<f64>, flag: &str| {
            value.ok_or_else(|| CliError::input(format!("{flag}: a receiver needs it")))
        };
        let center_hz = needed(search.center_hz, "--center-hz")?;
        let rate_hz = needed(search.rate_hz, "--rate-hz")?;
        let clock = SystemClock::start();
        if let Some(device) = args.source.strip_prefix(SOAPY) {
            return soapy::open(args, device, [center_hz, rate_hz], clock);
        }
        let whole = |value: f64, flag: &str| {
            let range = 1.0..4.2e9;
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "in range")]
            let whole = range.contains(&value).then(|| value.round() as u32);
            let text = || CliError::input(format!("{flag} is {value}; it must be 1 to 4.2e9"));
            whole.ok_or_else(text)
        };
        let mut tuning =
            RtlTcpTuning::new(whole(center_hz, "--center-hz")?, whole(rate_hz, "--rate-hz")?);
        tuning.gain_db = args.gain_db.unwrap_or(tuning.gain_db);
        tuning.correction_ppm = args.ppm.unwrap_or(0);
        let endpoint: Endpoint = args.source.parse().map_err(CliError::input)?;
        let stream = Reconnecting::open(endpoint, clock).map_err(CliError::failure)?;
        let samples = RtlTcpSamples::new(tuning, stream, clock).map_err(CliError::input)?;
        Ok(Box::new(Live::new(args, RtlTcp { samples, bytes: Vec::new() }, clock)))
    }

    /// A receiver behind rtl_tcp.
    struct RtlTcp {
        samples: RtlTcpSamples<Reconnecting<SystemClock>, SystemClock>,
        bytes: Vec<u8>,
    }

    impl Receiver for RtlTcp {
        fn rate_hz(&self) -> f64 {
            f64::from(self.samples.tuning().sample_rate_hz)
        }

        fn center_hz(&self) -> f64 {
            f64::from(self.samples.tuning().center_hz)
        }

        fn rounding_noise(&self) -> f64 {
            SampleFormat::Cu8.rounding_noise()
        }

        fn poll(&mut self, samples: &mut Vec<Complex32>) -> Result<Option<u64>, Failure> {
            let first = self.samples.poll(&mut self.bytes).map_err(|error| match error {
                RtlTcpRadioError::Server(_) => Failure::Final(CliError::failure(error)),
                other => Failure::Passing(other.to_string()),
            })?;
            samples.clear();
            SampleFormat::Cu8.decode(&self.bytes, samples);
            Ok(first)
        }

        fn losses(&self) -> SampleLosses {
            self.samples.losses()
        }
    }

    impl<R> Live<R> {
        fn new(args: &Args, receiver: R, clock: SystemClock) -> Self {
            Self { receiver, clock, name: args.source.clone(), flows: None, news: None }
        }

        fn note(&mut self, flows: bool, news: impl FnOnce() -> String) {
            if self.flows.replace(flows) != Some(flows) {
                self.news = Some(format!("{}: {}", self.name, news()));
            }
        }
    }

    impl<R: Receiver> Input for Live<R> {
        fn name(&self) -> &str {
            &self.name
        }

        fn rate_hz(&self) -> f64 {
            self.receiver.rate_hz()
        }

        fn center_hz(&self) -> Option<f64> {
            Some(self.receiver.center_hz())
        }

        fn rounding_noise(&self) -> f64 {
            self.receiver.rounding_noise()
        }

        fn is_live(&self) -> bool {
            true
        }

        fn elapsed_s(&self) -> Option<f64> {
            Some(self.clock.now())
        }

        fn read(&mut self, samples: &mut Vec<Complex32>) -> Result<Came, CliError> {
            match self.receiver.poll(samples) {
                Ok(Some(first)) => {
                    let lost = self.receiver.losses().samples;
                    self.note(true, || format!("samples come; {lost} were lost"));
                    return Ok(Came::Samples(first));
                }
                Ok(None) => {}
                Err(Failure::Final(error)) => return Err(error),
                Err(Failure::Passing(error)) => {
                    self.note(false, || format!("{error}; it is tried again"));
                }
            }
            thread::sleep(PAUSE);
            Ok(Came::Nothing)
        }

        fn losses(&self) -> Losses {
            let SampleLosses { gaps, samples, stalls, .. } = self.receiver.losses();
            Losses { gaps, samples, stalls }
        }

        fn news(&mut self) -> Option<String> {
            self.news.take()
        }
    }

    #[cfg(not(feature = "soapy"))]
    mod soapy {
        use super::{Args, CliError, Input, SystemClock};

        pub fn open(
            args: &Args,
            _: &str,
            _: [f64; 2],
            _: SystemClock,
        ) -> Result<Box<dyn Input>, CliError> {
            let text = "it needs a build with the feature soapy";
            Err(CliError::input(format!("{}: {text}", args.source)))
        }
    }

    #[cfg(feature = "soapy")]
    mod soapy {
        use foxhunt::hardware::{SoapyError, SoapySamples, SoapyTuning};

        use super::{
            Args, CliError, Complex32, Failure, Input, Live, Receiver, SampleLosses, SystemClock,
        };

        pub fn open(
            args: &Args,
            device: &str,
            [center_hz, rate_hz]: [f64; 2],
            clock: SystemClock,
        ) -> Result<Box<dyn Input>, CliError> {
            let mut tuning = SoapyTuning::new(device.to_owned(), center_hz, rate_hz);
            tuning.gain_db = args.gain_db.unwrap_or(tuning.gain_db);
            tuning.correction_ppm = args.ppm.map_or(0.0, f64::from);
            let samples = SoapySamples::open(tuning, clock).map_err(|error| match error {
                SoapyError::Tuning(_) => CliError::input(error),
                other => CliError::failure(other),
            })?;
            Ok(Box::new(Live::new(args, samples, clock)))
        }

        impl Receiver for SoapySamples<SystemClock> {
            fn rate_hz(&self) -> f64 {
                self.tuning().sample_rate_hz
            }

            fn center_hz(&self) -> f64 {
                self.tuning().center_hz
            }

            fn rounding_noise(&self) -> f64 {
                Self::rounding_noise(self)
            }

            fn poll(&mut self, samples: &mut Vec<Complex32>) -> Result<Option<u64>, Failure> {
                Self::poll(self, samples).map_err(|error| Failure::Passing(error.to_string()))
            }

            fn losses(&self) -> SampleLosses {
                Self::losses(self)
            }
        }
    }
}
