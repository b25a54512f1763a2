use std::{
    cell::RefCell,
    collections::VecDeque,
    io,
    rc::{Rc, Weak},
};

use super::{ByteStream, byte_stream::ended};

/// One end of a pair in memory: bytes are there as soon as they are sent.
#[derive(Debug)]
pub struct MemoryStream {
    inbox: Rc<RefCell<VecDeque<u8>>>,
    /// Gone when the other end is dropped: a pulled cable.
    outbox: Weak<RefCell<VecDeque<u8>>>,
}

/// Two ends, each of which receives the bytes sent at the other.
#[must_use]
pub fn memory_pair() -> (MemoryStream, MemoryStream) {
    let a = Rc::default();
    let b = Rc::default();
    let to_a = Rc::downgrade(&a);
    let to_b = Rc::downgrade(&b);
    (MemoryStream { inbox: a, outbox: to_b }, MemoryStream { inbox: b, outbox: to_a })
}

impl ByteStream for MemoryStream {
    fn receive(&mut self, into: &mut [u8]) -> io::Result<usize> {
        let mut inbox = self.inbox.borrow_mut();
        let count = into.len().min(inbox.len());
        if count == 0 && self.outbox.strong_count() == 0 {
            return Err(ended("the pair"));
        }
        for (to, from) in into.iter_mut().zip(inbox.drain(..count)) {
            *to = from;
        }
        Ok(count)
    }

    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        let outbox = self.outbox.upgrade().ok_or_else(|| ended("the pair"))?;
        outbox.borrow_mut().extend(bytes);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_sent_is_received_once_and_a_pulled_end_is_reported() {
        let (mut here, mut there) = memory_pair();
        let mut into = [0; 2];
        assert_eq!(there.receive(&mut into).expect("it works"), 0);
        here.send(&[1, 2, 3]).expect("it works");
        assert_eq!((there.receive(&mut into).expect("it works"), into), (2, [1, 2]));
        assert_eq!((there.receive(&mut into).expect("it works"), into[0]), (1, 3));
        here.send(&[4]).expect("it works");
        drop(here);
        assert_eq!(
            (there.receive(&mut into).expect("it works"), into[0]),
            (1, 4),
            "it was delivered"
        );
        assert_eq!(
            there.receive(&mut into).expect_err("it is refused").kind(),
            io::ErrorKind::UnexpectedEof
        );
        assert!(there.send(&[5]).is_err());
    }
}
