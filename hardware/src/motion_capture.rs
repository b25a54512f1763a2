//! Poses of a motion-capture system, for a vehicle that does not know its place.

use std::{collections::BTreeSet, fmt, io};

use foxhunt_core::{
    Pose,
    parameter::{FieldError, positive},
};
use foxhunt_wire::{ByteStream, Endpoint, motion_capture::CapturedPose};
use serde::{Deserialize, Serialize};

use crate::Finding;

/// Most datagrams that are read at once.
const DATAGRAMS: usize = 256;

/// Length in bytes of the longest datagram.
const LONGEST: usize = 65_536;

/// Time in seconds after which the system's clock may begin anew: until then a pose that is not
/// newer than the last one is late.
const RESTARTED_S: f64 = 1.0;

/// Most names of other bodies that are kept.
const NAMED: usize = 8;

/// Poses of one rigid body, as JSON lines in UDP datagrams ([`CapturedPose`]).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MotionCaptureConfig {
    /// Endpoint at which the poses arrive: `udpin:ADDRESS:PORT`.
    pub endpoint: Endpoint,
    /// Name of the drone's rigid body.
    pub body: String,
    /// σ of a position in metres, on each axis; 0.01 if absent.
    #[serde(default = "sigma_m")]
    pub sigma_m: f64,
    /// Age in seconds above which poses count as lost; 0.5 if absent.
    #[serde(default = "stale_s")]
    pub stale_s: f64,
}

fn sigma_m() -> f64 {
    0.01
}

fn stale_s() -> f64 {
    0.5
}

impl MotionCaptureConfig {
    /// The poses of a body, with the default σ and age.
    #[must_use]
    pub fn new(endpoint: Endpoint, body: impl Into<String>) -> Self {
        Self { endpoint, body: body.into(), sigma_m: sigma_m(), stale_s: stale_s() }
    }

    /// Refuses settings that are out of range.
    ///
    /// # Errors
    ///
    /// [`FieldError`] names the field, with its value.
    pub fn check(&self) -> Result<(), FieldError> {
        if !matches!(self.endpoint, Endpoint::UdpIn { .. }) {
            let requirement = "udpin:ADDRESS:PORT, the port that the poses are sent to";
            return Err(FieldError::new("endpoint", &self.endpoint, requirement));
        }
        if self.body.trim().is_empty() {
            let value = format!("{:?}", self.body);
            return Err(FieldError::new("body", value, "the name of a rigid body"));
        }
        positive("sigma_m", self.sigma_m)?;
        positive("stale_s", self.stale_s)?;
        Ok(())
    }
}

/// Text of the body, and of the endpoint at which its poses arrive.
impl fmt::Display for MotionCaptureConfig {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:?} at {}", self.body, self.endpoint)
    }
}

/// Loss of a body's poses: for how long, and why.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error(
    "no pose of {origin} for {age_s:.1} s, {poses} before{}",
    reason.as_ref().map_or(String::new(), |reason| format!(": {reason}"))
)]
pub struct PosesLost {
    /// Body and endpoint.
    pub origin: String,
    /// Time since the last pose, or since the start, in seconds.
    pub age_s: f64,
    /// Number of poses until then.
    pub poses: u64,
    /// Reason, where one is known.
    pub reason: Option<String>,
}

/// Poses of one rigid body on their way to its driver
/// ([`ArDrone::with_motion_capture`](crate::ArDrone::with_motion_capture)).
///
/// A line that is not a pose is left out and counted, and so is a pose that is not newer than the
/// last one.
pub struct MotionCapture {
    config: MotionCaptureConfig,
    stream: Box<dyn ByteStream>,
    buffer: Vec<u8>,
    began_at: Option<f64>,
    /// Arrival of the last pose by our clock, and its time by the system's clock.
    last: Option<(f64, f64)>,
    lines: u64,
    poses: u64,
    late: u64,
    bad: u64,
    /// Number and error of the last bad line.
    last_bad: Option<String>,
    /// Names of other bodies.
    others: BTreeSet<String>,
    /// Failure of the stream since the last pose.
    failure: Option<String>,
    /// True once the present loss was reported.
    is_reported: bool,
}

impl fmt::Debug for MotionCapture {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("MotionCapture")
            .field("config", &self.config)
            .field("poses", &self.poses)
            .field("bad", &self.bad)
            .finish_non_exhaustive()
    }
}

impl MotionCapture {
    /// Poses of a configuration's endpoint, which is open.
    ///
    /// # Errors
    ///
    /// [`FieldError`] names the setting that is out of range.
    pub fn new(
        config: MotionCaptureConfig,
        stream: Box<dyn ByteStream>,
    ) -> Result<Self, FieldError> {
        config.check()?;
        Ok(Self {
            config,
            stream,
            buffer: vec![0; LONGEST],
            began_at: None,
            last: None,
            lines: 0,
            poses: 0,
            late: 0,
            bad: 0,
            last_bad: None,
            others: BTreeSet::new(),
            failure: None,
            is_reported: false,
        })
    }

    /// Number of the body's poses until now.
    #[must_use]
    pub fn poses(&self) -> u64 {
        self.poses
    }

    /// Number of lines until now that were not poses.
    #[must_use]
    pub fn bad_lines(&self) -> u64 {
        self.bad
    }

    /// Number of the body's poses until now that were not newer than the one before.
    #[must_use]
    pub fn late(&self) -> u64 {
        self.late
    }

    /// σ of a position in metres.
    pub(crate) fn sigma_m(&self) -> f64 {
        self.config.sigma_m
    }

    /// Takes what has come, and returns the body's newest pose. A failure of the stream is kept as
    /// the reason of a [`loss`](Self::loss).
    pub(crate) fn poll(&mut self, now: f64) -> Option<Pose> {
        self.began_at.get_or_insert(now);
        let mut newest = None;
        let mut buffer = std::mem::take(&mut self.buffer);
        for _ in 0..DATAGRAMS {
            match self.receive(&mut buffer) {
                Ok(0) => break,
                Ok(count) => {
                    let datagram = buffer.get(..count).unwrap_or_default();
                    newest = self.take(now, datagram).or(newest);
                }
                Err(error) => {
                    self.failure = Some(error.to_string());
                    break;
                }
            }
        }
        self.buffer = buffer;
        newest
    }

    fn receive(&mut self, into: &mut [u8]) -> io::Result<usize> {
        self.stream.receive(into)
    }

    /// Takes the lines of a datagram.
    fn take(&mut self, now: f64, datagram: &[u8]) -> Option<Pose> {
        let mut newest = None;
        for line in datagram.split(|byte| *byte == b'\n') {
            if line.trim_ascii().is_empty() {
                continue;
            }
            self.lines += 1;
            match CapturedPose::parse(line) {
                Ok(pose) => newest = self.accept(now, &pose).or(newest),
                Err(error) => {
                    self.bad += 1;
                    self.last_bad = Some(format!("line {}: {error}", self.lines));
                }
            }
        }
        newest
    }

    /// Takes a pose, if it is the body's and newer than the last one.
    fn accept(&mut self, now: f64, captured: &CapturedPose) -> Option<Pose> {
        if captured.body != self.config.body {
            if self.others.len() < NAMED {
                self.others.insert(captured.body.clone());
            }
            return None;
        }
        if self.last.is_some_and(|(at, time)| captured.time_s <= time && now - at < RESTARTED_S) {
            self.late += 1;
            return None;
        }
        self.last = Some((now, captured.time_s));
        self.poses += 1;
        self.failure = None;
        Some(captured.pose())
    }

    /// Loss of the poses: the last one is older than allowed, or none has come in that time.
    #[must_use]
    pub fn loss(&self, now: f64) -> Option<PosesLost> {
        self.age_s(now).filter(|age_s| *age_s > self.config.stale_s).map(|age_s| self.lost(age_s))
    }

    /// Time since the last pose, or since the start.
    fn age_s(&self, now: f64) -> Option<f64> {
        Some(now - self.last.map(|(at, _)| at).or(self.began_at)?)
    }

    fn lost(&self, age_s: f64) -> PosesLost {
        let names = || self.others.iter().map(String::as_str).collect::<Vec<_>>().join(", ");
        let reason = match (&self.failure, &self.last_bad) {
            (Some(failure), _) => Some(failure.clone()),
            (None, Some(bad)) => {
                Some(format!("{} of {} lines are bad; {bad}", self.bad, self.lines))
            }
            (None, None) if self.late > 0 => {
                Some("its poses are not newer than the last one".into())
            }
            (None, None) if !self.others.is_empty() && self.poses == 0 => {
                Some(format!("poses of {} come", names()))
            }
            _ => None,
        };
        PosesLost { origin: self.config.to_string(), age_s, poses: self.poses, reason }
    }

    /// Returns each loss once, when it begins.
    pub(crate) fn take_loss(&mut self, now: f64) -> Option<PosesLost> {
        let loss = self.loss(now);
        let was_reported = std::mem::replace(&mut self.is_reported, loss.is_some());
        loss.filter(|_| !was_reported)
    }

    /// Finding about the poses.
    pub(crate) fn finding(&self, now: f64) -> Finding {
        let subject = "motion capture";
        let age_s = self.age_s(now).unwrap_or(0.0);
        if self.last.is_none() || age_s > self.config.stale_s {
            let remedy = if !self.others.is_empty() && self.poses == 0 {
                "set body to the name of this drone's rigid body"
            } else {
                "have the system stream to this port of this computer, and open the port in the \
                 firewall"
            };
            return Finding::bad(subject, self.lost(age_s), remedy);
        }
        let text = format!(
            "{}, {} poses, {} bad lines, {} late, the last {age_s:.2} s old",
            self.config, self.poses, self.bad, self.late
        );
        match &self.last_bad {
            Some(bad) if self.bad > self.poses / 10 => {
                Finding::bad(subject, format!("{text}; {bad}"), "mend what sends these lines")
            }
            _ => Finding::good(subject, text),
        }
    }
}

#[cfg(test)]
mod tests {
    use approx::{abs_diff_eq, assert_abs_diff_eq};
    use foxhunt_wire::UdpStream;
    use nalgebra::Vector3;

    use super::*;

    /// A receiver of `drone-1` and a sender to it, over this machine's own network.
    fn loopback(settings: &str) -> (MotionCapture, UdpStream) {
        let stream = UdpStream::listen("127.0.0.1:0").expect("a free port");
        let address = stream.local_address().expect("bound").to_string();
        let text = format!(r#"{{"endpoint":"udpin:{address}","body":"drone-1"{settings}}}"#);
        let config: MotionCaptureConfig = serde_json::from_str(&text).expect("its fields");
        let sender = UdpStream::to(&address).expect("a peer");
        (MotionCapture::new(config, Box::new(stream)).expect("in range"), sender)
    }

    fn line(time_s: f64, body: &str, east: f64) -> String {
        CapturedPose::new(time_s, body, &Pose::at(east, 2.0, 1.0)).line().expect("finite")
    }

    /// Polls until `lines` lines have come; datagrams to oneself take their time.
    fn poll(capture: &mut MotionCapture, now: f64, lines: u64) -> Option<Pose> {
        let mut newest = None;
        for _ in 0..5000 {
            newest = capture.poll(now).or(newest);
            if capture.lines >= lines {
                return newest;
            }
            std::thread::sleep(std::time::Duration::from_millis(1));
        }
        panic!("{} of {lines} lines have come", capture.lines);
    }

    #[test]
    fn the_newest_pose_of_its_body_arrives() {
        let (mut capture, mut sender) = loopback("");
        assert_eq!(capture.poll(10.0), None);
        let both = line(1.0, "drone-2", 9.0) + &line(1.0, "drone-1", 3.0);
        sender.send(both.as_bytes()).expect("loopback");
        // Without an end of its line.
        sender.send(line(1.1, "drone-1", 4.0).trim_end().as_bytes()).expect("loopback");
        let pose = poll(&mut capture, 10.1, 3).expect("two of its own");
        assert_eq!(pose.position, Vector3::new(4.0, 2.0, 1.0));
        assert_eq!((capture.poses(), capture.bad_lines(), capture.late()), (2, 0, 0));
        let finding = capture.finding(10.2);
        assert!(finding.is_good(), "{finding:?}");
    }

    #[test]
    fn bad_and_late_lines_are_counted_and_named() {
        let (mut capture, mut sender) = loopback("");
        capture.poll(0.0);
        let good = line(5.0, "drone-1", 3.0);
        let skewed = good.replacen("[1.0,", "[1.5,", 1);
        assert_ne!(skewed, good);
        let lines = format!("{good}\nnoise\n{skewed}{good}{}", line(4.9, "drone-1", 8.0));
        sender.send(lines.as_bytes()).expect("loopback");
        let pose = poll(&mut capture, 0.1, 5).expect("the first line");
        assert_abs_diff_eq!(pose.position.x, 3.0, epsilon = 1e-12);
        assert_eq!((capture.poses(), capture.bad_lines(), capture.late()), (1, 2, 2));
        let finding = format!("{:?}", capture.finding(0.2));
        assert!(finding.contains("2 bad lines, 2 late"), "{finding}");
        assert!(finding.contains("line 3: quaternion_wxyz has the norm 1.5"), "{finding}");
        // A clock that begins anew, a second later.
        sender.send(line(0.0, "drone-1", 6.0).as_bytes()).expect("loopback");
        assert!(poll(&mut capture, 1.2, 6).is_some());
    }

    #[test]
    fn a_loss_is_reported_once_with_its_reason() {
        let (mut capture, mut sender) = loopback(r#","stale_s":0.2"#);
        capture.poll(0.0);
        assert_eq!(capture.take_loss(0.1), None);
        let lost = capture.take_loss(0.3).expect("nothing has come").to_string();
        assert!(lost.starts_with("no pose of \"drone-1\" at udpin:127.0.0.1:"), "{lost}");
        assert!(lost.ends_with("for 0.3 s, 0 before"), "{lost}");
        assert_eq!(capture.take_loss(0.4), None, "it is reported");
        sender.send(line(1.0, "drone-2", 3.0).as_bytes()).expect("loopback");
        poll(&mut capture, 0.5, 1);
        let lost = capture.loss(0.5).expect("of another body").to_string();
        assert!(lost.ends_with("poses of drone-2 come"), "{lost}");
        sender.send(line(1.0, "drone-1", 3.0).as_bytes()).expect("loopback");
        poll(&mut capture, 0.6, 2);
        assert_eq!(capture.take_loss(0.7), None);
        let lost = capture.take_loss(0.9).expect("the next loss");
        assert!(lost.poses == 1 && abs_diff_eq!(lost.age_s, 0.3, epsilon = 1e-9), "{lost:?}");
    }

    #[test]
    fn settings_out_of_range_are_named() {
        let refused = |text: &str| {
            let config: MotionCaptureConfig = serde_json::from_str(text).expect(text);
            config.check().expect_err(text).to_string()
        };
        let own = r#""endpoint":"udpin:127.0.0.1:5005""#;
        for (error, named) in [
            (refused(r#"{"endpoint":"tcp:a:1","body":"a"}"#), "endpoint is tcp:a:1; it must be"),
            (refused(&format!(r#"{{{own},"body":" "}}"#)), "body is \" \""),
            (refused(&format!(r#"{{{own},"body":"a","sigma_m":0}}"#)), "sigma_m is 0"),
            (refused(&format!(r#"{{{own},"body":"a","stale_s":-1}}"#)), "stale_s is -1"),
        ] {
            assert!(error.contains(named), "{error}");
        }
        let unknown = format!(r#"{{{own},"body":"a","port":1}}"#);
        assert!(serde_json::from_str::<MotionCaptureConfig>(&unknown).is_err());
    }
}
