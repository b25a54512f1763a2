use rand::{SeedableRng, rngs::Xoshiro256PlusPlus};

/// One drone's random streams, one for each purpose.
///
/// Every question draws from them alike, whatever the channel's parameters are: worlds that
/// differ in a parameter share their noise.
#[derive(Clone, Debug)]
pub(crate) struct Streams {
    pub(super) pattern: Xoshiro256PlusPlus,
    pub(super) sample: Xoshiro256PlusPlus,
    pub(super) loss: Xoshiro256PlusPlus,
    pub(super) gust: Xoshiro256PlusPlus,
}

impl Streams {
    /// The next drone's streams. A drone more, or a purpose more at the end of this list, leaves
    /// the streams before it as they are.
    pub(crate) fn fork(root: &mut Xoshiro256PlusPlus) -> Self {
        let mut own = root.fork();
        Self { pattern: own.fork(), sample: own.fork(), loss: own.fork(), gust: own.fork() }
    }
}
