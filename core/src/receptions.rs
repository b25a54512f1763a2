//! Many receptions in little memory.

use alloc::vec::Vec;
use core::iter::FusedIterator;

use nalgebra::Vector3;

use crate::Reception;

/// Kinds of receptions that are compared with the next one before it makes a kind of its own.
const RECENT_KINDS: usize = 64;

/// Receptions in their order, of which a recording may have millions. Each takes 56 bytes for its
/// time, its receiver's place and heading, and its level. Everything else stands once for all
/// receptions that have it in common, as most receptions of a recording have. What comes out equals
/// what was put in; a zero may have another sign.
///
/// ```
/// use foxhunt_core::{Level, Pose, Reception, Receptions};
///
/// let at = |east: f64| Reception {
///     time: east,
///     receiver: Pose::at(east, 0.0, 1.5),
///     level: Some(Level { rss_dbm: -60.0 - east, sigma_db: 4.0 }),
///     ..Reception::default()
/// };
/// let receptions: Receptions = (0..3_u8).map(|east| at(f64::from(east))).collect();
/// assert_eq!(receptions.get(1), Some(at(1.0)));
/// let levels: Vec<f64> = receptions.iter().filter_map(|r| Some(r.level?.rss_dbm)).collect();
/// assert_eq!(levels, [-60.0, -61.0, -62.0]);
/// ```
#[derive(Clone, Debug, Default)]
pub struct Receptions {
    rows: Vec<Row>,
    kinds: Vec<Reception>,
}

/// View of a reception among many, to be looked at without a copy of what it has in common with
/// others.
#[derive(Clone, Copy, Debug)]
pub struct ReceptionView<'r> {
    /// Time of the reception in seconds.
    pub time: f64,
    /// East, North and Up of the receiver, in metres.
    pub position: Vector3<f64>,
    /// Everything that it has in common with others. Time, place and heading in it are 0, and so is
    /// the first of level, floor, ceiling and bearing that it holds, whose number is its own.
    pub kind: &'r Reception,
    number: f64,
}

impl ReceptionView<'_> {
    /// The received level in dBm.
    #[must_use]
    pub fn level_dbm(&self) -> Option<f64> {
        self.kind.level.map(|_| self.number)
    }

    /// The received level, the floor that it was below or the ceiling that it was at, in dBm.
    #[must_use]
    pub fn any_level_dbm(&self) -> Option<f64> {
        self.kind.any_level().map(|_| self.number)
    }
}

/// The values of a reception that differ from one to the next.
#[derive(Clone, Copy, Debug)]
struct Row {
    time: f64,
    position: Vector3<f64>,
    heading: f64,
    /// The number that [`number`] finds, or 0.
    number: f64,
    /// Index of the kind.
    kind: u32,
}

/// The level, the floor, the ceiling, or else the bearing of a reception.
#[inline]
fn number(reception: &mut Reception) -> Option<&mut f64> {
    let Reception { level, silence, saturation, bearing, .. } = reception;
    let level = level.as_mut().or(silence.as_mut()).or(saturation.as_mut());
    level.map(|level| &mut level.rss_dbm).or(bearing.as_mut().map(|bearing| &mut bearing.angle))
}

impl Receptions {
    /// No receptions, with room for this many.
    #[must_use]
    pub fn with_capacity(count: usize) -> Self {
        Self { rows: Vec::with_capacity(count), kinds: Vec::new() }
    }

    /// Adds a reception behind the others.
    pub fn push(&mut self, reception: Reception) {
        let mut kind = reception;
        let row = Row {
            time: core::mem::take(&mut kind.time),
            position: core::mem::take(&mut kind.receiver.position),
            heading: core::mem::take(&mut kind.receiver.heading),
            number: number(&mut kind).map_or(0.0, core::mem::take),
            kind: self.index_of(kind),
        };
        self.rows.push(row);
    }

    /// Returns the index of a kind, which is added if it is new.
    fn index_of(&mut self, kind: Reception) -> u32 {
        let recent = self.kinds.iter().enumerate().rev().take(RECENT_KINDS);
        let known = recent.into_iter().find(|(_, known)| **known == kind);
        let index = known.map_or(self.kinds.len(), |(index, _)| index);
        if index == self.kinds.len() {
            self.kinds.push(kind);
        }
        u32::try_from(index).unwrap_or(u32::MAX)
    }

    /// Returns the number of receptions.
    #[must_use]
    pub fn len(&self) -> usize {
        self.rows.len()
    }

    /// Returns true for an empty list.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    /// Returns a reception by its index; `None` behind the last.
    #[inline]
    #[must_use]
    pub fn get(&self, index: usize) -> Option<Reception> {
        self.rows.get(index).map(|row| self.whole(row))
    }

    /// Returns the receptions in their order.
    #[must_use]
    pub fn iter(&self) -> Iter<'_> {
        self.range(0, self.rows.len())
    }

    /// Returns the places of the receivers: East, North and Up in metres.
    pub fn places(&self) -> impl Iterator<Item = Vector3<f64>> {
        self.rows.iter().map(|row| row.position)
    }

    /// Returns everything that receptions have in common, once each, as
    /// [`kind`](ReceptionView::kind) of a view is.
    #[must_use]
    pub fn kinds(&self) -> &[Reception] {
        &self.kinds
    }

    /// Returns the receptions in their order, without a copy of what they have in common.
    pub fn views(&self) -> impl Iterator<Item = ReceptionView<'_>> + Clone {
        self.view_range(0, self.rows.len())
    }

    /// Returns the receptions from an index to before another one, as far as they exist, without a
    /// copy of what they have in common.
    pub fn view_range(
        &self,
        begin: usize,
        end: usize,
    ) -> impl Iterator<Item = ReceptionView<'_>> + Clone {
        let end = end.min(self.rows.len());
        let rows = self.rows.get(begin.min(end)..end).unwrap_or_default();
        let view = |row: &Row| Some((*row, self.kinds.get(row.kind as usize)?));
        rows.iter().filter_map(view).map(|(Row { time, position, number, .. }, kind)| {
            ReceptionView { time, position, number, kind }
        })
    }

    /// Returns the receptions from an index to before another one, as far as they exist.
    #[must_use]
    pub fn range(&self, begin: usize, end: usize) -> Iter<'_> {
        let end = end.min(self.rows.len());
        let rows = self.rows.get(begin.min(end)..end).unwrap_or_default();
        Iter { receptions: self, rows: rows.iter() }
    }

    /// Returns the receptions in the order of time, each with its index; of equal times the first
    /// goes first.
    pub fn in_time(&self) -> impl Iterator<Item = (usize, Reception)> {
        let mut rows: Vec<(usize, &Row)> = self.rows.iter().enumerate().collect();
        rows.sort_by(|(_, a), (_, b)| a.time.total_cmp(&b.time));
        rows.into_iter().map(|(index, row)| (index, self.whole(row)))
    }

    /// Returns the index of the first reception of a path in the order of time, from an index to
    /// before another one, that is not before a time, or else the latter index.
    #[must_use]
    pub fn not_before(&self, [begin, end]: [usize; 2], time: f64) -> usize {
        let path = self.rows.get(begin..end).unwrap_or_default();
        begin + path.partition_point(|row| row.time < time)
    }

    /// A reception with everything that its kind has.
    #[inline]
    fn whole(&self, row: &Row) -> Reception {
        let mut reception = self.kinds.get(row.kind as usize).copied().unwrap_or_default();
        reception.time = row.time;
        reception.receiver.position = row.position;
        reception.receiver.heading = row.heading;
        if let Some(number) = number(&mut reception) {
            *number = row.number;
        }
        reception
    }
}

impl Extend<Reception> for Receptions {
    fn extend<I: IntoIterator<Item = Reception>>(&mut self, receptions: I) {
        let receptions = receptions.into_iter();
        self.rows.reserve(receptions.size_hint().0);
        receptions.for_each(|reception| self.push(reception));
    }
}

impl<'r> Extend<&'r Reception> for Receptions {
    fn extend<I: IntoIterator<Item = &'r Reception>>(&mut self, receptions: I) {
        self.extend(receptions.into_iter().copied());
    }
}

impl FromIterator<Reception> for Receptions {
    fn from_iter<I: IntoIterator<Item = Reception>>(receptions: I) -> Self {
        let mut list = Self::default();
        list.extend(receptions);
        list
    }
}

impl From<&[Reception]> for Receptions {
    fn from(receptions: &[Reception]) -> Self {
        receptions.iter().copied().collect()
    }
}

impl<'r> IntoIterator for &'r Receptions {
    type Item = Reception;
    type IntoIter = Iter<'r>;

    fn into_iter(self) -> Iter<'r> {
        self.iter()
    }
}

/// Receptions of a list, one after the other.
#[derive(Clone, Debug)]
pub struct Iter<'r> {
    receptions: &'r Receptions,
    rows: core::slice::Iter<'r, Row>,
}

impl Iterator for Iter<'_> {
    type Item = Reception;

    #[inline]
    fn next(&mut self) -> Option<Reception> {
        self.rows.next().map(|row| self.receptions.whole(row))
    }

    #[inline]
    fn nth(&mut self, n: usize) -> Option<Reception> {
        self.rows.nth(n).map(|row| self.receptions.whole(row))
    }

    fn size_hint(&self) -> (usize, Option<usize>) {
        self.rows.size_hint()
    }
}

impl DoubleEndedIterator for Iter<'_> {
    #[inline]
    fn next_back(&mut self) -> Option<Reception> {
        self.rows.next_back().map(|row| self.receptions.whole(row))
    }
}

impl ExactSizeIterator for Iter<'_> {}

impl FusedIterator for Iter<'_> {}

#[cfg(test)]
mod tests {
    use alloc::vec;

    use proptest::{
        collection::vec as list_of,
        num::f64::{NORMAL, ZERO},
        option::of as maybe,
        prelude::*,
    };

    use super::*;
    use crate::{BeaconId, Bearing, Level, Pose};

    fn levels() -> impl Iterator<Item = Reception> {
        (0..1000_u16).map(|i| {
            let time = f64::from(i);
            let level = Some(Level { rss_dbm: -60.0 - 0.01 * time, sigma_db: 4.0 });
            let receiver = Pose { heading: 0.1 * time, ..Pose::at(3.0 * time, -time, 1.5) };
            Reception { time, receiver, level, ..Reception::default() }
        })
    }

    /// A view has the numbers of its reception, and is made of the same kind.
    #[test]
    fn views_show_the_receptions() {
        let silent = |dbm| Reception {
            silence: Some(Level { rss_dbm: dbm, sigma_db: 4.0 }),
            ..Reception::default()
        };
        let list: Receptions = levels().take(20).chain([silent(-110.0), silent(-111.0)]).collect();
        assert_eq!(list.kinds().len(), 2);
        assert!(list.kinds()[0].level.is_some_and(|level| level.rss_dbm.to_bits() == 0));
        assert_eq!(list.views().count(), list.len());
        for (view, reception) in list.views().zip(list.iter()) {
            assert_eq!(view.time.to_bits(), reception.time.to_bits());
            assert_eq!(view.position, reception.receiver.position);
            assert_eq!(view.level_dbm(), reception.level.map(|level| level.rss_dbm));
            let any = reception.any_level().map(|level| level.rss_dbm);
            assert_eq!(view.any_level_dbm(), any);
            assert_eq!(view.kind.silence.is_some(), reception.silence.is_some());
        }
        let some: Vec<f64> =
            list.view_range(19, 99).filter_map(|view| view.any_level_dbm()).collect();
        assert_eq!(some, [-60.19, -110.0, -111.0]);
    }

    #[test]
    fn receptions_come_back_as_they_were() {
        let level = |rss_dbm| Some(Level { rss_dbm, sigma_db: 4.0 });
        let bearing = Some(Bearing { angle: 1.0, sigma: 0.1, confidence: 1.0 });
        let velocity = Some(Vector3::new(1.0, 2.0, 3.0));
        let pose =
            Pose { heading: 0.5, pitch: 0.1, roll: -0.2, velocity, ..Pose::at(1.0, 2.0, 3.0) };
        let list = vec![
            Reception { time: 1.0, receiver: pose, level: level(-60.0), ..Reception::default() },
            Reception { time: 0.5, silence: level(-90.0), bearing, ..Reception::default() },
            Reception { time: 2.0, saturation: level(-20.0), ..Reception::default() },
            Reception { time: 3.0, bearing, beacon: BeaconId(3), ..Reception::default() },
            Reception { time: -1.0, level: level(-61.0), bearing, ..Reception::default() },
            Reception::default(),
        ];
        let receptions = Receptions::from(&*list);
        assert!(receptions.iter().eq(list.iter().copied()));
        assert!(receptions.iter().rev().eq(list.iter().rev().copied()));
        assert!(receptions.range(1, 3).eq(list[1..3].iter().copied()));
        assert_eq!(receptions.range(4, 99).count(), 2);
        assert_eq!(receptions.range(99, 100).count(), 0);
        assert_eq!(receptions.iter().nth(3), Some(list[3]));
        assert_eq!(receptions.get(list.len()), None);
        let in_time: Vec<usize> = receptions.in_time().map(|(index, _)| index).collect();
        assert_eq!(in_time, [4, 5, 1, 0, 2, 3]);
    }

    proptest! {
        /// Every number comes back, whatever stands beside it.
        #[test]
        fn any_receptions_come_back(
            rows in list_of(
                (0..3_u16, [NORMAL | ZERO; 5], maybe(NORMAL | ZERO), 0..4_u8, maybe(NORMAL)),
                0..100,
            ),
        ) {
            let one = |(beacon, numbers, level, kind, angle)| {
                let [time, east, north, heading, up]: [f64; 5] = numbers;
                let level = Option::map(level, |rss_dbm| Level { rss_dbm, sigma_db: 4.0 });
                let of_kind = |wanted| level.filter(|_| kind == wanted);
                Reception {
                    beacon: BeaconId(beacon),
                    time,
                    receiver: Pose { heading, ..Pose::at(east, north, up) },
                    level: of_kind(0),
                    silence: of_kind(1),
                    saturation: of_kind(2),
                    bearing: Option::map(angle, |angle| Bearing {
                        angle,
                        sigma: 0.1,
                        confidence: 1.0,
                    }),
                    ..Reception::default()
                }
            };
            let given: Vec<Reception> = rows.into_iter().map(one).collect();
            let kept = Receptions::from(&*given);
            prop_assert_eq!(kept.iter().collect::<Vec<_>>(), given);
        }
    }

    #[test]
    fn a_level_along_a_path_takes_56_bytes() {
        assert_eq!(size_of::<Row>(), 56);
        let receptions: Receptions = levels().collect();
        assert_eq!(receptions.len(), 1000);
        assert_eq!(receptions.kinds.len(), 1);
        assert!(receptions.iter().eq(levels()));
        // Two beacons that take turns are two kinds.
        let both = levels().zip([0, 1].into_iter().cycle());
        let both = both.map(|(r, beacon)| Reception { beacon: BeaconId(beacon), ..r });
        assert_eq!(both.collect::<Receptions>().kinds.len(), 2);
    }
}
