use std::f64::consts::TAU;

use foxhunt_core::angle;

use super::{Record, Turns};

/// A record with the boresight, the level and the time that its sample will have.
#[derive(Clone, Copy)]
pub(super) struct Heard<'r> {
    pub(super) record: &'r Record,
    pub(super) boresight: f64,
    pub(super) rss_dbm: f64,
    pub(super) time: f64,
}

impl Turns {
    /// Cuts one drone's readings of one beacon, in the order in which they were taken, into
    /// turns of positions `step` radians apart.
    pub(super) fn cut<'h, 'r>(self, heard: &'h [Heard<'r>], step: f64) -> Vec<&'h [Heard<'r>]> {
        let (mut turns, mut begin, mut gone) = (Vec::new(), 0, 0.0_f64);
        for (index, pair) in heard.windows(2).enumerate() {
            let [before, after] = pair else { continue };
            gone += angle::wrap(after.boresight - before.boresight);
            let ends = match self {
                Self::File => false,
                // Half a step short: the first position of the next turn, as well as it was met.
                Self::Circle => gone.abs() >= TAU - 0.5 * step,
                Self::GapS(gap) => after.time - before.time > gap,
            };
            if ends {
                turns.extend(heard.get(begin..=index));
                (begin, gone) = (index + 1, 0.0);
            }
        }
        turns.extend(heard.get(begin..).filter(|rest| !rest.is_empty()));
        turns
    }
}
