use foxhunt_core::{Reception, ReceptionView, Receptions};
use nalgebra::Vector3;

/// Speed between two receptions above which they are of different paths, in metres per second; less
/// than a second apart, their distance in metres.
const MOST_SPEED_MPS: f64 = 300.0;

/// Distance of two places that count as one, as a share of the receivers' extent.
const SAME_PLACE: f64 = 0.02;

/// Distance of places of a network, as a share of the extent: half of the steps are longer.
const FAR_APART: f64 = 0.1;

/// Number of places that make a network.
const LEAST_PLACES: usize = 3;

/// Returns true if a network received: receivers that stay at their places, three or more, at the
/// same time. Receptions are one receiver after the other, so that time stands or goes back from
/// each place to the next. Of a path whose times are too coarse the places are close together.
pub(crate) fn is_of_network(receptions: &Receptions, extent_m: f64) -> bool {
    let mut views = receptions.views();
    let Some(first) = views.next() else { return false };
    let mut here = first.position;
    let mut last_s = first.time;
    let mut places = vec![here];
    let mut steps = 0_usize;
    let mut far_steps = 0_usize;
    for view in views {
        let step_m = (view.position - here).norm();
        if step_m > SAME_PLACE * extent_m {
            if view.time > last_s {
                return false;
            }
            steps += 1;
            far_steps += usize::from(step_m > FAR_APART * extent_m);
            here = view.position;
            let is_new = |place: &Vector3<f64>| (place - here).norm() > SAME_PLACE * extent_m;
            if places.len() < LEAST_PLACES && places.iter().all(is_new) {
                places.push(here);
            }
        }
        last_s = view.time;
    }
    places.len() >= LEAST_PLACES && 2 * far_steps >= steps
}

/// Longest time between two receptions over which a place between them is that of the path, in
/// seconds.
const LONGEST_GAP_S: f64 = 30.0;

/// Receptions whose receiver was not on its path at a time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AtEnds {
    /// At the end of the path.
    There,
    /// At the end of the path, without their level: nobody knows where it was measured.
    Without,
}

/// Paths of the receivers through their receptions, each in the order of time.
#[derive(Clone, Debug)]
pub struct Paths<'a> {
    receptions: &'a Receptions,
    /// Index behind the last reception of each path.
    ends: Vec<usize>,
}

impl<'a> Paths<'a> {
    /// Cuts receptions, one receiver after the other, where time goes back or a receiver jumps.
    pub fn new(receptions: &'a Receptions) -> Self {
        let pairs = receptions.views().zip(receptions.views().skip(1)).enumerate();
        let is_cut = |(before, after): &(ReceptionView<'_>, ReceptionView<'_>)| {
            let seconds = after.time - before.time;
            let way = after.position - before.position;
            !(seconds >= 0.0 && way.norm() <= MOST_SPEED_MPS * seconds.max(1.0))
        };
        let ends = pairs.filter(|(_, pair)| is_cut(pair)).map(|(index, _)| index + 1);
        let ends = ends.chain([receptions.len()]).collect();
        Self { receptions, ends }
    }

    /// Returns the indices of the first reception of each path, and behind the last.
    fn each(&self) -> impl Iterator<Item = [usize; 2]> {
        let begins = std::iter::once(0).chain(self.ends.iter().copied());
        begins.zip(self.ends.iter().copied()).map(|(begin, end)| [begin, end])
    }

    /// Receptions of all paths.
    pub(crate) fn receptions(&self) -> &'a Receptions {
        self.receptions
    }

    /// Length of all paths together, in metres.
    pub(crate) fn length_m(&self) -> f64 {
        let of = |[begin, end]: [usize; 2]| -> f64 {
            let path = self.receptions.view_range(begin, end);
            let pairs = path.clone().zip(path.skip(1));
            pairs.map(|(a, b)| (b.position - a.position).norm()).sum()
        };
        self.each().map(of).sum()
    }

    /// Returns one reception in `stride`, with its receiver where it was `offset_s` later.
    pub fn shifted(&self, offset_s: f64, stride: usize, at_ends: AtEnds) -> Receptions {
        let stride = stride.max(1);
        let mut shifted = Receptions::with_capacity(self.receptions.len() / stride + 1);
        for [begin, end] in self.each() {
            let first = begin.next_multiple_of(stride);
            for mut own in self.receptions.range(first, end).step_by(stride) {
                let time = own.time + offset_s;
                if let Some(position) = self.at([begin, end], time) {
                    own.receiver.position = position;
                }
                if at_ends == AtEnds::Without && !self.is_on([begin, end], time) {
                    own = Reception { level: None, silence: None, saturation: None, ..own };
                }
                shifted.push(own);
            }
        }
        shifted
    }

    /// Returns the place at a time of the one receiver on the one path that there is; `None` before
    /// and behind it, in its gaps, and where there are several.
    pub(crate) fn place_of_one(&self, time: f64) -> Option<Vector3<f64>> {
        let [end] = self.ends[..] else { return None };
        let next = self.receptions.not_before([0, end], time);
        let after = self.receptions.view_range(next, end).next()?;
        let before = self.receptions.view_range(next.saturating_sub(1), end).next()?;
        let is_near = after.time - before.time <= LONGEST_GAP_S;
        (is_near && self.is_on([0, end], time)).then(|| self.at([0, end], time)).flatten()
    }

    /// Returns true if a path has begun at a time and is not over.
    fn is_on(&self, [begin, end]: [usize; 2], time: f64) -> bool {
        let time_of = |index| self.receptions.get(index).map(|reception| reception.time);
        let ends = time_of(begin).zip(end.checked_sub(1).and_then(time_of));
        ends.is_some_and(|(first, last)| (first..=last).contains(&time))
    }

    /// Returns the place of the receiver of a path at a time; `None` without a path.
    fn at(&self, [begin, end]: [usize; 2], time: f64) -> Option<Vector3<f64>> {
        let next = self.receptions.not_before([begin, end], time);
        let last = end.checked_sub(1)?;
        let after = self.receptions.get(next.min(last))?;
        let before = self.receptions.get(next.saturating_sub(1).max(begin))?;
        let seconds = after.time - before.time;
        let share =
            if seconds > 0.0 { ((time - before.time) / seconds).clamp(0.0, 1.0) } else { 0.0 };
        Some(before.receiver.position.lerp(&after.receiver.position, share))
    }
}

#[cfg(test)]
mod tests {
    use approx::assert_abs_diff_eq;
    use foxhunt_core::{Level, Pose};
    use proptest::{collection::vec, prelude::*};

    use super::*;

    fn reception(time: f64, east: f64) -> Reception {
        Reception { time, receiver: Pose::at(east, 0.0, 5.0), ..Reception::default() }
    }

    proptest! {
        /// At a constant speed an offset moves every place alike, as far as the path goes.
        #[test]
        fn an_offset_moves_places_along_the_path(
            steps in vec(0.01..10.0_f64, 1..50),
            speed_mps in 0.1..30.0_f64,
            offset_s in -50.0..50.0_f64,
        ) {
            let mut time = 0.0;
            let mut walk = Receptions::default();
            for step in steps {
                walk.push(reception(time, speed_mps * time));
                time += step;
            }
            let last = walk.get(walk.len() - 1).expect("one at least").time;
            let shifted = Paths::new(&walk).shifted(offset_s, 1, AtEnds::There);
            prop_assert_eq!(shifted.len(), walk.len());
            for (before, after) in walk.iter().zip(&shifted) {
                let expected = speed_mps * (before.time + offset_s).clamp(0.0, last);
                let off = (after.receiver.position.x - expected).abs();
                prop_assert!(off < 1e-6 * (1.0 + expected));
                prop_assert_eq!(before.time.to_bits(), after.time.to_bits());
            }
        }
    }

    #[test]
    fn nodes_make_a_network_and_walks_make_none() {
        // One node after the other, each at the times of all; then one row of each at one time.
        let of = |nodes: u8, rows: u8| -> Receptions {
            let each = |node| (0..rows).map(move |row| (node, row));
            let rows = (0..nodes).flat_map(each);
            rows.map(|(node, row)| reception(f64::from(row), 8.0 * f64::from(node))).collect()
        };
        assert!(is_of_network(&of(4, 30), 24.0));
        assert!(is_of_network(&of(3, 1), 16.0));
        assert!(!is_of_network(&of(2, 30), 8.0), "two nodes");
        assert!(!is_of_network(&of(4, 30), 4000.0), "one place");
        // A walk, slow enough for a step to be no place of its own, and one with stops.
        for (step_m, rows) in [(0.01, 1), (1.0, 1), (5.0, 20)] {
            let walk: Receptions = (0..200_u16)
                .map(|row| reception(f64::from(row), step_m * f64::from(row / rows)))
                .collect();
            assert!(!is_of_network(&walk, step_m * 200.0 / f64::from(rows)), "{step_m} m");
        }
        // One that walks beside three that stay.
        let mut team = of(3, 30);
        team.extend((0..30_u8).map(|row| reception(f64::from(row), 20.0 + f64::from(row))));
        assert!(!is_of_network(&team, 50.0));
        // Walks whose times are those of the minute, or the newest of which comes first.
        let times: [fn(u8) -> f64; 3] =
            [|_| 0.0, |row| 60.0 * f64::from(row / 60), |row| -f64::from(row)];
        for time in times {
            let walk: Receptions =
                (0..60_u8).map(|row| reception(time(row), f64::from(row))).collect();
            assert!(!is_of_network(&walk, 59.0));
        }
        // A drive without times, whose rows are counted.
        let drive: Receptions =
            (0..60_u8).map(|row| reception(f64::from(row), 900.0 * f64::from(row))).collect();
        assert!(!is_of_network(&drive, 53_100.0));
        assert!(!is_of_network(&Receptions::default(), 0.0));
    }

    #[test]
    fn a_receiver_is_where_it_was_later() {
        let walks: Receptions =
            (0..5_u8).map(|i| reception(f64::from(i), 2.0 * f64::from(i))).collect();
        let east = |receptions: &Receptions, offset_s| -> Vec<f64> {
            let shifted = Paths::new(receptions).shifted(offset_s, 1, AtEnds::There);
            shifted.iter().map(|own| own.receiver.position.x).collect()
        };
        assert_eq!(east(&walks, 0.0), [0.0, 2.0, 4.0, 6.0, 8.0]);
        assert_eq!(east(&walks, 1.5), [3.0, 5.0, 7.0, 8.0, 8.0]);
        assert_eq!(east(&walks, -1.0), [0.0, 0.0, 2.0, 4.0, 6.0]);
        // A second receiver has a path of its own.
        let both: Receptions = walks.iter().chain([reception(0.0, 50.0)]).collect();
        assert_eq!(east(&both, 1.0), [2.0, 4.0, 6.0, 8.0, 8.0, 50.0]);
        assert_abs_diff_eq!(Paths::new(&both).length_m(), 8.0, epsilon = 1e-12);
        let apart: Receptions = [reception(0.0, 0.0), reception(1.0, 5000.0)].into_iter().collect();
        assert_eq!(east(&apart, 0.5), [0.0, 5000.0]);
        assert!(Paths::new(&Receptions::default()).shifted(1.0, 1, AtEnds::There).is_empty());
        assert_eq!(Paths::new(&walks).shifted(0.0, 2, AtEnds::There).len(), 3);
    }

    #[test]
    fn nobody_knows_where_a_receiver_was_off_its_path() {
        let level = Some(Level { rss_dbm: -70.0, sigma_db: 3.0 });
        let walk: Receptions = (0..5_u8)
            .map(|i| Reception { level, ..reception(f64::from(i), 2.0 * f64::from(i)) })
            .collect();
        let shifted = Paths::new(&walk).shifted(1.5, 1, AtEnds::Without);
        let levels: Vec<bool> = shifted.iter().map(|own| own.level.is_some()).collect();
        assert_eq!(levels, [true, true, true, false, false]);
        let east = |receptions: &Receptions, time| {
            Paths::new(receptions).place_of_one(time).map(|place| place.x)
        };
        let of_walk = [-0.1, 0.0, 2.5, 4.0, 4.1].map(|time| east(&walk, time));
        assert_eq!(of_walk, [None, Some(0.0), Some(5.0), Some(8.0), None]);
        // A gap, and a second receiver.
        let gap: Receptions = walk.iter().chain([reception(100.0, 20.0)]).collect();
        assert_eq!([2.5, 50.0].map(|time| east(&gap, time)), [Some(5.0), None]);
        let both: Receptions = walk.iter().chain([reception(0.0, 50.0)]).collect();
        assert_eq!(east(&both, 2.5), None);
        assert_eq!(east(&Receptions::default(), 0.0), None);
    }
}
