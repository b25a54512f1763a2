use std::{
    collections::BTreeMap,
    sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError},
    time::Duration,
};

/// Largest number of names whose last message is kept.
const MOST_NAMES: usize = 2_000;

/// Largest number of remarks about a connection that wait to be taken.
const MOST_REMARKS: usize = 20;

/// A message with the name of the thing that it is about.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Parcel<'a> {
    /// Name of the thing: a message replaces an earlier one of the same name.
    pub name: &'a str,
    pub bytes: &'a [u8],
    /// UNIX time from which on the message is not sent any more, in seconds.
    pub stale_unix_s: f64,
}

/// Messages of one address that wait for its thread.
#[derive(Debug, Default)]
pub(crate) struct Outbox {
    state: Mutex<State>,
    changed: Condvar,
}

#[derive(Debug, Default)]
struct State {
    kept: BTreeMap<String, Kept>,
    /// Number of names so far.
    names: u64,
    /// True once nothing more will be put.
    is_closed: bool,
    /// True once the thread has ended.
    has_ended: bool,
    /// Last failure of the connection, if it is not there.
    failure: Option<String>,
    /// Failure of the end of a connection that had taken everything.
    unclosed: Option<String>,
    remarks: Vec<String>,
}

#[derive(Debug)]
struct Kept {
    bytes: Arc<[u8]>,
    stale_unix_s: f64,
    is_sent: bool,
    /// Place in the order in which names came: receivers go before what they have found.
    number: u64,
}

impl Outbox {
    fn state(&self) -> MutexGuard<'_, State> {
        // A thread that panicked has left whole messages behind.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Puts messages; one that is as it was is not sent again.
    pub(crate) fn put<'a>(&self, messages: impl IntoIterator<Item = Parcel<'a>>, now_unix_s: f64) {
        let mut state = self.state();
        state.kept.retain(|_, kept| kept.stale_unix_s > now_unix_s);
        for Parcel { name, bytes, stale_unix_s } in messages {
            if stale_unix_s <= now_unix_s || state.is_closed {
                continue;
            }
            let number = match state.kept.get(name) {
                Some(kept) if *kept.bytes == *bytes => continue,
                Some(kept) => kept.number,
                None if state.kept.len() >= MOST_NAMES => {
                    state.remark(format!(
                        "more than {MOST_NAMES} things at once; the new ones are not sent"
                    ));
                    continue;
                }
                None => {
                    state.names += 1;
                    state.names
                }
            };
            let kept = Kept { bytes: Arc::from(bytes), stale_unix_s, is_sent: false, number };
            let _ = state.kept.insert(name.to_owned(), kept);
        }
        drop(state);
        self.changed.notify_all();
    }

    /// Returns the messages that were not sent; waits for one for a while.
    pub(crate) fn take(&self, wait: Duration, now_unix_s: f64) -> Vec<(String, Arc<[u8]>)> {
        let waits =
            |state: &mut State| !state.is_closed && state.kept.values().all(|kept| kept.is_sent);
        let waited = self.changed.wait_timeout_while(self.state(), wait, waits);
        let (mut state, _) = waited.unwrap_or_else(PoisonError::into_inner);
        state.kept.retain(|_, kept| kept.stale_unix_s > now_unix_s);
        let unsent = state.kept.iter().filter(|(_, kept)| !kept.is_sent);
        let mut unsent: Vec<_> = unsent
            .map(|(name, kept)| (kept.number, name.clone(), Arc::clone(&kept.bytes)))
            .collect();
        unsent.sort_unstable_by_key(|(number, ..)| *number);
        unsent.into_iter().map(|(_, name, bytes)| (name, bytes)).collect()
    }

    /// Notes that a message was written, unless a later one has replaced it.
    pub(crate) fn sent(&self, name: &str, bytes: &Arc<[u8]>) {
        if let Some(kept) = self.state().kept.get_mut(name)
            && Arc::ptr_eq(&kept.bytes, bytes)
        {
            kept.is_sent = true;
        }
    }

    /// Sends everything again: what the lost connection had taken may not have arrived.
    pub(crate) fn lost(&self, failure: String) {
        let mut state = self.state();
        state.kept.values_mut().for_each(|kept| kept.is_sent = false);
        // A server that stays away is reported once.
        if state.failure.is_none() && !state.is_closed {
            state.remark(format!("{failure}; it is tried again"));
        }
        state.failure = Some(failure);
    }

    /// Notes that the connection is there.
    pub(crate) fn connected(&self, remark: String) {
        let mut state = self.state();
        state.failure = None;
        state.remark(remark);
    }

    /// Notes that the connection broke behind the last message.
    #[cfg(feature = "cot")]
    pub(crate) fn unclosed(&self, error: &std::io::Error) {
        self.state().unclosed = Some(error.to_string());
    }

    #[cfg(feature = "cot")]
    pub(crate) fn remark(&self, remark: String) {
        self.state().remark(remark);
    }

    pub(crate) fn take_remarks(&self) -> Vec<String> {
        std::mem::take(&mut self.state().remarks)
    }

    /// Waits until a pause is over, or nothing more will be put.
    pub(crate) fn pause(&self, pause: Duration) {
        let waited = self.changed.wait_timeout_while(self.state(), pause, |state| !state.is_closed);
        drop(waited);
    }

    /// Nothing more will be put.
    pub(crate) fn close(&self) {
        self.state().is_closed = true;
        self.changed.notify_all();
    }

    pub(crate) fn is_closed(&self) -> bool {
        self.state().is_closed
    }

    /// Notes that the thread has ended.
    pub(crate) fn end(&self) {
        self.state().has_ended = true;
        self.changed.notify_all();
    }

    /// Waits until the thread has ended. Returns the failure, if messages are left or may be lost.
    pub(crate) fn ended(&self, wait: Duration) -> Option<String> {
        let waits = |state: &mut State| !state.has_ended;
        let waited = self.changed.wait_timeout_while(self.state(), wait, waits);
        let (state, _) = waited.unwrap_or_else(PoisonError::into_inner);
        if let Some(error) = &state.unclosed {
            return Some(format!(
                "the last messages may not have arrived: the connection broke as it was closed: \
                 {error}"
            ));
        }
        let unsent = state.kept.values().filter(|kept| !kept.is_sent).count();
        let is_lost = state.failure.is_some() || !state.has_ended;
        let reason = state.failure.clone().unwrap_or_else(|| "it takes too long".to_owned());
        (is_lost && unsent > 0).then(|| format!("{unsent} messages were not sent: {reason}"))
    }
}

impl State {
    fn remark(&mut self, remark: String) {
        if self.remarks.len() < MOST_REMARKS && self.remarks.last() != Some(&remark) {
            self.remarks.push(remark);
        }
    }
}
