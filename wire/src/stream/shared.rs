use std::{
    cell::RefCell,
    collections::{BTreeMap, VecDeque},
    io,
    net::SocketAddr,
    rc::{Rc, Weak},
};

use super::ByteStream;

/// Maximum number of receipts kept for a user that does not take them; the oldest are dropped.
const KEPT: usize = 1024;

/// The longest receipt.
const LONGEST: usize = 65_536;

/// One stream for several drivers: each receives all that comes, and all send. For vehicles behind
/// one radio or router, whose drivers pick out their own messages.
///
/// A listening port is pinned to one peer, the router, by the first driver that hears its vehicle,
/// and opened to others when none hears its own any more.
pub struct SharedStream {
    port: Rc<RefCell<Port>>,
    /// Number of the stream among the users of the port.
    index: u32,
    /// The number and the sender of the receipt that it took last.
    taken: u64,
    sender: Option<SocketAddr>,
}

/// Something that was received: its number, its sender where anybody may send, its bytes.
type Receipt = (u64, Option<SocketAddr>, Vec<u8>);

struct Port {
    stream: Box<dyn ByteStream>,
    /// Bytes that the users of the port have not taken yet.
    waiting: BTreeMap<u32, VecDeque<Receipt>>,
    /// Indices of the users that have pinned the port to their peer.
    pinned: Vec<u32>,
    receipts: u64,
    next: u32,
    buffer: Vec<u8>,
}

impl SharedStream {
    /// The first user of a shared stream.
    #[must_use]
    pub fn new(stream: Box<dyn ByteStream>) -> Self {
        let port = Port {
            stream,
            waiting: BTreeMap::new(),
            pinned: Vec::new(),
            receipts: 0,
            next: 0,
            buffer: vec![0; LONGEST],
        };
        Self::of(Rc::new(RefCell::new(port)))
    }

    /// Another user, who receives all that comes from now on.
    #[must_use]
    pub fn share(&self) -> Self {
        Self::of(Rc::clone(&self.port))
    }

    /// The shared stream, which closes with its last user.
    #[must_use]
    pub fn port(&self) -> SharedPort {
        SharedPort(Rc::downgrade(&self.port))
    }

    fn of(port: Rc<RefCell<Port>>) -> Self {
        let index = {
            let mut port = port.borrow_mut();
            let index = port.next;
            port.next += 1;
            port.waiting.insert(index, VecDeque::new());
            index
        };
        Self { port, index, taken: 0, sender: None }
    }
}

/// A stream that is shared, for whoever wants to share it later; it does not keep it open.
pub struct SharedPort(Weak<RefCell<Port>>);

impl SharedPort {
    /// One more user; `None` once the stream is closed.
    #[must_use]
    pub fn share(&self) -> Option<SharedStream> {
        self.0.upgrade().map(SharedStream::of)
    }
}

impl std::fmt::Debug for SharedPort {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_tuple("SharedPort").finish_non_exhaustive()
    }
}

impl Drop for SharedStream {
    fn drop(&mut self) {
        let mut port = self.port.borrow_mut();
        port.waiting.remove(&self.index);
        port.pinned.retain(|of| *of != self.index);
    }
}

impl std::fmt::Debug for SharedStream {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("SharedStream").field("index", &self.index).finish_non_exhaustive()
    }
}

impl Port {
    /// Receives once, for all.
    fn receive(&mut self) -> io::Result<()> {
        let count = self.stream.receive(&mut self.buffer)?;
        let Some(bytes) = self.buffer.get(..count).filter(|bytes| !bytes.is_empty()) else {
            return Ok(());
        };
        self.receipts += 1;
        let sender = self.stream.sender();
        for queue in self.waiting.values_mut() {
            if queue.len() >= KEPT {
                queue.pop_front();
            }
            queue.push_back((self.receipts, sender, bytes.to_vec()));
        }
        Ok(())
    }
}

impl ByteStream for SharedStream {
    fn receive(&mut self, into: &mut [u8]) -> io::Result<usize> {
        let port = &mut *self.port.borrow_mut();
        if port.waiting.get(&self.index).is_none_or(VecDeque::is_empty) {
            port.receive()?;
        }
        let is_datagram = port.stream.is_open();
        let Some(queue) = port.waiting.get_mut(&self.index) else { return Ok(0) };
        let Some((number, sender, mut bytes)) = queue.pop_front() else { return Ok(0) };
        (self.taken, self.sender) = (number, sender);
        let count = bytes.len().min(into.len());
        let rest = bytes.split_off(count);
        into.iter_mut().zip(&bytes).for_each(|(to, from)| *to = *from);
        if !rest.is_empty() && !is_datagram {
            queue.push_front((number, sender, rest));
        }
        Ok(count)
    }

    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.port.borrow_mut().stream.send(bytes)
    }

    fn connections(&self) -> u32 {
        self.port.borrow().stream.connections()
    }

    fn renew(&mut self) {
        self.port.borrow_mut().stream.renew();
    }

    fn is_open(&self) -> bool {
        self.port.borrow().stream.is_open()
    }

    fn pin(&mut self) -> io::Result<()> {
        let port = &mut *self.port.borrow_mut();
        if !port.pinned.contains(&self.index) {
            port.pinned.push(self.index);
        }
        // What was received since then may be of another sender: the next one of ours pins it.
        if self.taken == port.receipts { port.stream.pin() } else { Ok(()) }
    }

    fn unpin(&mut self) -> io::Result<()> {
        let port = &mut *self.port.borrow_mut();
        port.pinned.retain(|of| *of != self.index);
        if port.pinned.is_empty() { port.stream.unpin() } else { Ok(()) }
    }

    fn peer(&self) -> Option<SocketAddr> {
        self.port.borrow().stream.peer()
    }

    fn sender(&self) -> Option<SocketAddr> {
        self.sender.filter(|_| self.is_open())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stream::{UdpStream, memory_pair};

    fn received(stream: &mut impl ByteStream, most: usize) -> Vec<u8> {
        let mut into = vec![0; most];
        let count = stream.receive(&mut into).expect("it works");
        into.truncate(count);
        into
    }

    #[test]
    fn all_receive_all_and_all_send() {
        let (near, mut far) = memory_pair();
        let mut first = SharedStream::new(Box::new(near));
        let mut second = first.share();
        far.send(b"hello").expect("it works");
        assert_eq!(received(&mut second, 3), b"hel");
        assert_eq!(received(&mut second, 3), b"lo");
        assert_eq!(received(&mut first, 9), b"hello");
        assert!(received(&mut first, 9).is_empty() && received(&mut second, 9).is_empty());
        first.send(b"a").expect("it works");
        second.send(b"b").expect("it works");
        assert_eq!(received(&mut far, 9), b"ab");
        // One who has gone keeps nothing, and a port without anybody is closed.
        let shared = first.port();
        drop(first);
        far.send(b"again").expect("it works");
        assert_eq!(received(&mut second, 9), b"again");
        assert_eq!(second.port.borrow().waiting.len(), 1);
        assert!(shared.share().is_some());
        drop(second);
        assert!(shared.share().is_none());
    }

    #[test]
    fn a_port_is_pinned_to_the_sender_that_was_meant() {
        let server = UdpStream::listen("127.0.0.1:0").expect("it works");
        let address = server.local_address().expect("it works").to_string();
        let [mut router, mut stranger] = [0; 2].map(|_| UdpStream::to(&address).expect("it works"));
        let mut first = SharedStream::new(Box::new(server));
        let mut second = first.share();
        router.send(b"for the second").expect("it works");
        assert_eq!(received(&mut first, 99), b"for the second");
        stranger.send(b"x").expect("it works");
        assert_eq!(received(&mut first, 99), b"x");
        // The port has heard the stranger last, whom this must not pin.
        assert_eq!(received(&mut second, 99), b"for the second");
        second.pin().expect("it works");
        assert!(second.is_open());
        assert_eq!(received(&mut second, 99), b"x");
        router.send(b"again").expect("it works");
        assert_eq!(received(&mut second, 99), b"again");
        second.pin().expect("it works");
        assert!(!first.is_open() && !second.is_open());
        stranger.send(b"y").expect("it works");
        assert_eq!(received(&mut first, 99), b"again");
        assert!(received(&mut first, 99).is_empty());
        first.send(b"to the router").expect("it works");
        assert_eq!(received(&mut router, 99), b"to the router");
        // One that hears nothing of its own leaves the port to the other.
        first.pin().expect("it works");
        first.unpin().expect("it works");
        assert!(!second.is_open());
        second.unpin().expect("it works");
        assert!(first.is_open());
    }
}
