use super::{
    canvas::UNIT,
    frame::{Pixel, Rect},
};

/// Finds places for labels where they hide least.
#[derive(Debug)]
pub(super) struct Labels {
    /// Rectangle that labels may use.
    room: Rect,
    /// Points that are better not hidden.
    points: Vec<Pixel>,
    /// Labels that are placed already.
    taken: Vec<Rect>,
}

impl Labels {
    pub(super) fn new(room: Rect, points: Vec<Pixel>) -> Self {
        Self { room, points, taken: Vec::new() }
    }

    /// The rectangle for a label of this size beside `anchor`: of sixteen places about it the
    /// one that hides fewest points, and of these the nearest.
    pub(super) fn place(&mut self, anchor: Pixel, width: i32, height: i32) -> Rect {
        let beside = |gap: i32| {
            let right = anchor.0 + gap;
            let left = anchor.0 - gap - width;
            let below = anchor.1 + gap;
            let above = anchor.1 - gap - height;
            let middle = anchor.0 - width / 2;
            let level = anchor.1 - height / 2;
            [
                (right, level),
                (left, level),
                (middle, above),
                (middle, below),
                (right, above),
                (right, below),
                (left, above),
                (left, below),
            ]
        };
        let rect =
            |(left, top): Pixel| Rect { left, top, right: left + width, bottom: top + height };
        let near = rect(beside(10 * UNIT)[0]);
        let places = [10, 26].into_iter().flat_map(|gap| beside(gap * UNIT)).map(rect);
        let best = places.min_by_key(|place| self.cost(place)).unwrap_or(near);
        self.taken.push(best);
        best
    }

    fn cost(&self, place: &Rect) -> usize {
        let outside = place.left < self.room.left
            || place.right > self.room.right
            || place.top < self.room.top
            || place.bottom > self.room.bottom;
        let overlaps = |other: &Rect| {
            place.left < other.right
                && other.left < place.right
                && place.top < other.bottom
                && other.top < place.bottom
        };
        let margin = 3 * UNIT;
        let hides = |point: &&Pixel| {
            (place.left - margin..place.right + margin).contains(&point.0)
                && (place.top - margin..place.bottom + margin).contains(&point.1)
        };
        let hidden = self.points.iter().filter(hides).count();
        let taken = self.taken.iter().filter(|other| overlaps(other)).count();
        hidden + 1000 * taken + 1_000_000 * usize::from(outside)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ROOM: Rect = Rect { left: 0, top: 0, right: 1000, bottom: 1000 };

    #[test]
    fn labels_keep_apart_and_inside() {
        let mut labels = Labels::new(ROOM, vec![(560, 500)]);
        let first = labels.place((500, 500), 100, 40);
        assert!(first.right <= 500, "the point is to the right of it: {first:?}");
        let second = labels.place((500, 500), 100, 40);
        assert!(labels.taken.iter().filter(|r| **r == second).count() == 1);
        assert!(second.bottom <= first.top || second.top >= first.bottom || second.left >= 500);
        let cornered = labels.place((990, 5), 100, 40);
        assert!(cornered.right <= 1000 && cornered.top >= 0);
    }
}
