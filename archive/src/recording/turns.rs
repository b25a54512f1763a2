use std::f64::consts::TAU;

use foxhunt_core::angle;

use super::{Record, Turns};

/// A level along a boresight, with the row that it is from and the time of its sample.
#[derive(Clone, Copy)]
pub(super) struct LevelRow<'r> {
    pub(super) record: &'r Record,
    pub(super) boresight: f64,
    pub(super) rss_dbm: f64,
    pub(super) time: f64,
}

impl Turns {
    /// Cuts one drone's readings of one beacon, in the order in which they were taken, into
    /// turns of positions `step` radians apart.
    pub(super) fn cut<'h, 'r>(
        self,
        levels: &'h [LevelRow<'r>],
        step: f64,
    ) -> Vec<&'h [LevelRow<'r>]> {
        let mut turns = Vec::new();
        let mut begin = 0;
        let mut gone = 0.0_f64;
        for (index, pair) in levels.windows(2).enumerate() {
            let [before, after] = pair else { continue };
            gone += angle::wrap(after.boresight - before.boresight);
            let ends = match self {
                Self::File => false,
                // Half a step short: the first position of the next turn, as well as it was met.
                Self::Circle => gone.abs() >= TAU - 0.5 * step,
                Self::GapS(gap) => after.time - before.time > gap,
            };
            if ends {
                turns.extend(levels.get(begin..=index));
                begin = index + 1;
                gone = 0.0;
            }
        }
        turns.extend(levels.get(begin..).filter(|rest| !rest.is_empty()));
        turns
    }
}
