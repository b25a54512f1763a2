use super::{Address16, Address64, AtCommand};

/// Takes a frame's data apart, front to back.
pub(super) struct Fields<'a>(pub(super) &'a [u8]);

impl Fields<'_> {
    fn take<const N: usize>(&mut self) -> Option<[u8; N]> {
        let (head, rest) = self.0.split_first_chunk()?;
        self.0 = rest;
        Some(*head)
    }

    pub(super) fn byte(&mut self) -> Option<u8> {
        self.take().map(|[byte]| byte)
    }

    pub(super) fn word(&mut self) -> Option<u16> {
        self.take().map(u16::from_be_bytes)
    }

    pub(super) fn address64(&mut self) -> Option<Address64> {
        self.take().map(|bytes| Address64(u64::from_be_bytes(bytes)))
    }

    pub(super) fn address16(&mut self) -> Option<Address16> {
        self.word().map(Address16)
    }

    pub(super) fn command(&mut self) -> Option<AtCommand> {
        self.take().map(AtCommand)
    }

    /// Takes the remaining bytes.
    pub(super) fn rest(&mut self) -> Vec<u8> {
        core::mem::take(&mut self.0).to_vec()
    }
}
