use alloc::{collections::BinaryHeap, vec, vec::Vec};
use core::{cmp::Ordering, ops::Range};

use nalgebra::{Vector2, Vector3};

/// Bits of a place on each axis: the finest cells are the extent over 2²¹.
const BITS: u32 = 21;

/// Places in the order of a cube's octants and their octants (Morton 1966): places of a cell follow
/// each other.
#[derive(Clone, Debug)]
pub(super) struct Cells {
    /// Key and index of each place, by the key.
    keys: Vec<(u64, u32)>,
    corner: Vector3<f64>,
    side_m: f64,
}

/// Cell that may be divided.
#[derive(Debug)]
struct Node {
    /// Side over the length wanted there.
    stretch: f64,
    /// Number of divisions that made it.
    depth: u32,
    places: Range<usize>,
}

impl Node {
    /// The longest first, then the one of the most places, then the first.
    fn order(&self, other: &Self) -> Ordering {
        let by_places = self.places.len().cmp(&other.places.len());
        let by_stretch = self.stretch.total_cmp(&other.stretch);
        by_stretch.then(by_places).then(other.places.start.cmp(&self.places.start))
    }
}

impl PartialEq for Node {
    fn eq(&self, other: &Self) -> bool {
        self.order(other) == Ordering::Equal
    }
}

impl Eq for Node {}

impl PartialOrd for Node {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Node {
    fn cmp(&self, other: &Self) -> Ordering {
        self.order(other)
    }
}

impl Cells {
    /// Orders places; those beyond the 2³² first are left out.
    pub(super) fn new(places: impl Iterator<Item = Vector3<f64>> + Clone) -> Self {
        let nowhere = Vector3::repeat(f64::INFINITY);
        let (corner, far) = (places.clone())
            .fold((nowhere, -nowhere), |(low, high), place| (low.inf(&place), high.sup(&place)));
        let side_m = (far - corner).max().max(f64::MIN_POSITIVE);
        let steps = f64::from(1_u32 << BITS);
        let key = |place: Vector3<f64>| {
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "casts saturate, and the corner is the least place"
            )]
            let step = |along: f64| ((along / side_m * steps) as u64).min((1 << BITS) - 1);
            let [east, north, up] = (place - corner).map(step).into();
            spread(east) | spread(north) << 1 | spread(up) << 2
        };
        let mut keys: Vec<(u64, u32)> = places.map(key).zip(0..=u32::MAX).collect();
        keys.sort_unstable();
        Self { keys, corner, side_m }
    }

    /// Divides the cube as far as lengths want and `most` cells allow: the cell that is longest for
    /// its place goes first. Returns the places of each cell that holds any, and the largest side
    /// over its length, 1 where all are short enough.
    pub(super) fn leaves(
        &self,
        length_m: impl Fn(&Vector2<f64>) -> f64,
        most: usize,
    ) -> (Vec<Range<usize>>, f64) {
        let node = |depth: u32, places: Range<usize>| {
            let side_m = self.side_m / f64::from(1_u32 << depth);
            let key = self.keys.get(places.start).map_or(0, |(key, _)| *key);
            let step = self.side_m / f64::from(1_u32 << BITS);
            let low = [gather(key), gather(key >> 1)].map(|axis| {
                let cell = axis >> (BITS - depth) << (BITS - depth);
                f64::from(cell) * step
            });
            let middle = self.corner.xy() + Vector2::from(low) + Vector2::repeat(0.5 * side_m);
            Node { stretch: side_m / length_m(&middle), depth, places }
        };
        let mut open = BinaryHeap::from([node(0, 0..self.keys.len())]);
        let mut done: Vec<Range<usize>> = Vec::new();
        let mut largest = 1.0;
        while let Some(longest) = open.pop() {
            let parts = self.divided(&longest);
            let count = done.len() + open.len() + parts.len();
            if longest.stretch <= 1.0 || longest.depth >= BITS || count > most {
                largest = longest.stretch.max(1.0);
                done.push(longest.places);
                done.extend(open.into_iter().map(|node| node.places));
                break;
            }
            open.extend(parts.into_iter().map(|part| node(longest.depth + 1, part)));
        }
        done.sort_unstable_by_key(|places| places.start);
        (done, largest)
    }

    /// The indices of the places of a cell, as [`leaves`](Self::leaves) has it, in their order.
    pub(super) fn indices(&self, places: Range<usize>) -> Vec<usize> {
        let held = self.keys.get(places).unwrap_or_default();
        let mut indices: Vec<usize> = held.iter().map(|(_, index)| *index as usize).collect();
        indices.sort_unstable();
        indices
    }

    /// The parts of a cell that hold places.
    fn divided(&self, node: &Node) -> Vec<Range<usize>> {
        let held = self.keys.get(node.places.clone()).unwrap_or_default();
        let Some(shift) = (BITS - node.depth).checked_sub(1).map(|shift| 3 * shift) else {
            return vec![node.places.clone()];
        };
        let mut parts = Vec::new();
        let mut begin = 0;
        while let Some((first, _)) = held.get(begin) {
            let rest = held.get(begin..).unwrap_or_default();
            let end = begin + rest.partition_point(|(key, _)| key >> shift == first >> shift);
            parts.push(node.places.start + begin..node.places.start + end);
            begin = end;
        }
        parts
    }
}

/// Puts two zero bits behind each of the lowest 21 bits.
fn spread(axis: u64) -> u64 {
    let steps = [
        (32, 0x001f_0000_0000_ffff),
        (16, 0x001f_0000_ff00_00ff),
        (8, 0x100f_00f0_0f00_f00f),
        (4, 0x10c3_0c30_c30c_30c3),
        (2, 0x1249_2492_4924_9249),
    ];
    steps.iter().fold(axis & 0x001f_ffff, |bits, (shift, mask)| (bits | bits << shift) & mask)
}

/// Gathers every third bit, the lowest first.
fn gather(key: u64) -> u32 {
    (0..BITS).fold(0, |axis, bit| axis | u32::from(key >> (3 * bit) & 1 == 1) << bit)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Places of a square lawnmower, 1 m apart, 100 × 100.
    fn lanes() -> Vec<Vector3<f64>> {
        let at = |i: u32| f64::from(i);
        (0..100)
            .flat_map(|lane| (0..100).map(move |i| Vector3::new(at(i), at(lane), 20.0)))
            .collect()
    }

    #[test]
    fn bits_of_an_axis_are_gathered_again() {
        for axis in [0, 1, 0b1011, 0x1f_ffff, 0x15_5555] {
            assert_eq!(u64::from(gather(spread(axis))), axis);
        }
    }

    #[test]
    fn cells_are_as_short_as_their_number_allows() {
        let places = lanes();
        let cells = Cells::new(places.iter().copied());
        let (leaves, stretch) = cells.leaves(|_| 10.0, 400);
        // 99 m over 16 is 6.2 m, which is short enough; 256 of them.
        assert_eq!((leaves.len(), stretch), (256, 1.0));
        let (leaves, stretch) = cells.leaves(|_| 10.0, 60);
        assert!((40..=60).contains(&leaves.len()) && (1.2..2.5).contains(&stretch), "{stretch}");
        // Every place is in one cell, and near all others of it.
        let mut seen = vec![0; places.len()];
        for leaf in leaves {
            let indices = cells.indices(leaf);
            let first = places[indices[0]];
            assert!(indices.iter().all(|i| (places[*i] - first).amax() <= 10.0 * stretch));
            indices.iter().for_each(|i| seen[*i] += 1);
        }
        assert!(seen.iter().all(|count| *count == 1));
    }

    #[test]
    fn cells_are_short_where_short_ones_are_wanted() {
        let cells = Cells::new(lanes().into_iter());
        let near = Vector2::new(70.0, 30.0);
        let (leaves, stretch) = cells.leaves(|place| 0.3 * (place - near).norm() + 1.0, 400);
        assert!(stretch <= 1.0 + 1e-9 && leaves.len() > 100, "{stretch} {}", leaves.len());
        let sizes: Vec<usize> = leaves.iter().map(Range::len).collect();
        assert!(sizes.contains(&1) && sizes.iter().any(|size| *size > 36), "{sizes:?}");
    }

    #[test]
    fn one_place_is_one_cell() {
        let cells = Cells::new([Vector3::zeros(); 7].into_iter());
        let (leaves, _) = cells.leaves(|_| 0.0, 4);
        let all = 0..7;
        assert_eq!(leaves, [all]);
        assert_eq!(cells.indices(0..7), [0, 1, 2, 3, 4, 5, 6]);
    }
}
