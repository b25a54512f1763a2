use std::{cell::Cell, rc::Rc};

use foxhunt_core::{BeaconId, Radio};
use foxhunt_wire::receivers::{SikStatus, sik_dbm};

use crate::Finding;

/// Reports of an autopilot's SiK radio, which its link puts here; copies share them.
#[derive(Clone, Debug, Default)]
pub struct SikFeed(Rc<Cell<(u64, SikStatus)>>);

impl SikFeed {
    /// A `RADIO_STATUS` has come.
    pub fn push(&self, status: SikStatus) {
        let (count, _) = self.0.get();
        self.0.set((count + 1, status));
    }
}

/// A SiK telemetry radio as a receiver of the radio at its other end, which is the only beacon
/// there is.
///
/// No query goes over the air: such radios send all the time. An answer is the first power that is
/// reported after the question.
#[derive(Debug)]
pub struct SikRadio {
    feed: SikFeed,
    /// Number of reports at the question.
    requested_after: Option<u64>,
}

/// There is no such beacon.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("there is no beacon {beacon}: a SiK radio receives the one at its other end, beacon 0")]
pub struct SikError {
    /// Requested beacon.
    pub beacon: u16,
}

impl SikRadio {
    /// A radio whose reports come through `feed`.
    #[must_use]
    pub fn new(feed: SikFeed) -> Self {
        Self { feed, requested_after: None }
    }

    /// Returns findings from the radio's last report.
    #[must_use]
    pub fn examine(&self) -> Vec<Finding> {
        let (count, status) = self.feed.0.get();
        let finding = match (count, sik_dbm(status.rssi), sik_dbm(status.noise)) {
            (0, ..) => Finding::bad(
                "SiK radio",
                "the autopilot's link has reported no RADIO_STATUS",
                "set the radio's parameter MAVLINK to 1, and check that it is a SiK radio",
            ),
            (_, Some(level), Some(noise)) => Finding::good(
                "SiK radio",
                format_args!("RSSI now: {level:.1} dBm, noise {noise:.1} dBm"),
            ),
            _ => Finding::bad(
                "SiK radio",
                "it receives nothing",
                "switch the radio at the other end on, and check NETID on both",
            ),
        };
        vec![finding]
    }
}

impl Radio for SikRadio {
    type Error = SikError;

    fn request(&mut self, beacon: BeaconId) -> Result<(), SikError> {
        if beacon.0 > 0 {
            return Err(SikError { beacon: beacon.0 });
        }
        self.requested_after = Some(self.feed.0.get().0);
        Ok(())
    }

    fn poll(&mut self) -> Result<Option<f64>, SikError> {
        let (count, status) = self.feed.0.get();
        let new = self.requested_after.is_some_and(|requested_after| count > requested_after);
        let level = sik_dbm(status.rssi).filter(|_| new);
        if level.is_some() {
            self.requested_after = None;
        }
        Ok(level)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_answer_is_reported_after_its_question() {
        let feed = SikFeed::default();
        let mut radio = SikRadio::new(feed.clone());
        let push = |rssi| feed.push(SikStatus { rssi, ..SikStatus::default() });
        assert!(radio.examine()[0].to_string().contains("no RADIO_STATUS"));
        push(100);
        radio.request(BeaconId(0)).expect("it exists");
        assert_eq!(radio.poll(), Ok(None), "that was before");
        push(255);
        assert_eq!(radio.poll(), Ok(None), "nothing is received");
        push(19);
        assert_eq!(radio.poll(), Ok(Some(19.0 / 1.9 - 127.0)));
        assert!(radio.examine()[0].to_string().contains("-117.0 dBm"));
        assert_eq!(radio.poll(), Ok(None), "once");
        assert_eq!(radio.request(BeaconId(1)), Err(SikError { beacon: 1 }));
    }
}
