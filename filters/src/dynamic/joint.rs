use alloc::{sync::Arc, vec::Vec};
use core::{fmt, ops::Range};

use foxhunt_core::{Axis, DynamicMotion, Fixed, MotionModel};

/// The motion of a joint state: blocks that stand one after the other, and move by models of their
/// own.
///
/// ```
/// use foxhunt_core::{ConstantVelocity, RandomWalk};
/// use foxhunt_filters::JointMotion;
///
/// let stations = 3;
/// let mut motion = JointMotion::new().with::<4>(ConstantVelocity { spectral_density: 0.1 });
/// for _ in 0..stations {
///     motion = motion.with::<1>(RandomWalk::uniform(0.01));
/// }
/// assert_eq!(motion.dimension(), 7);
/// assert_eq!(motion.range(2), Some(5..6));
/// ```
#[derive(Clone, Default)]
pub struct JointMotion {
    blocks: Vec<Block>,
}

#[derive(Clone)]
struct Block {
    motion: Arc<dyn DynamicMotion + Send + Sync>,
    size: usize,
}

impl JointMotion {
    /// The motion of no components.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds a block of `N` components.
    #[must_use]
    pub fn with<const N: usize>(self, motion: impl MotionModel<N> + Send + Sync + 'static) -> Self {
        self.with_block(N, Fixed(motion))
    }

    /// Adds a block of `size` components.
    #[must_use]
    pub fn with_block(
        mut self,
        size: usize,
        motion: impl DynamicMotion + Send + Sync + 'static,
    ) -> Self {
        self.blocks.push(Block { motion: Arc::new(motion), size });
        self
    }

    /// Number of components of all blocks together.
    #[must_use]
    #[inline]
    pub fn dimension(&self) -> usize {
        self.blocks.iter().map(|block| block.size).sum()
    }

    /// Number of blocks.
    #[must_use]
    pub fn len(&self) -> usize {
        self.blocks.len()
    }

    /// Returns true if there is no block.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.blocks.is_empty()
    }

    /// The components of a block; `None` if it does not exist.
    #[must_use]
    #[inline]
    pub fn range(&self, block: usize) -> Option<Range<usize>> {
        self.blocks().nth(block).map(|(range, _)| range)
    }

    /// The blocks with their components.
    pub(super) fn blocks(
        &self,
    ) -> impl Iterator<Item = (Range<usize>, &(dyn DynamicMotion + Send + Sync))> {
        self.blocks.iter().scan(0, |begin, block| {
            let range = *begin..*begin + block.size;
            *begin = range.end;
            Some((range, &*block.motion))
        })
    }

    /// The geometry of each component.
    #[inline]
    pub(super) fn axes(&self) -> Vec<Axis> {
        self.blocks.iter().flat_map(|block| block.motion.axes(block.size)).collect()
    }

    /// Adds all blocks of another motion.
    #[inline]
    pub(super) fn append(&mut self, further: Self) {
        self.blocks.extend(further.blocks);
    }

    /// Removes a block, which exists.
    #[inline]
    pub(super) fn remove(&mut self, block: usize) {
        self.blocks.remove(block);
    }
}

impl fmt::Debug for JointMotion {
    #[inline]
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let sizes = self.blocks.iter().map(|block| block.size);
        f.write_str("JointMotion of blocks of ")?;
        f.debug_list().entries(sizes).finish()
    }
}
