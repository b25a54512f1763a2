use alloc::vec::Vec;

use foxhunt_core::{BeaconId, Reception};
use nalgebra::{Vector2, Vector3};

use super::{TurnInformation, cells::Cells};

/// Where a beacon was heard: what is known of its power comes from there.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Heard {
    of: Vec<(BeaconId, Vec<Vector3<f64>>)>,
    /// Who was heard first since the search for a target began: whose search it is.
    pub(super) first: Option<BeaconId>,
}

impl Heard {
    pub(super) fn hear(&mut self, reception: &Reception) {
        let (beacon, place) = (reception.beacon, reception.receiver.position);
        self.first.get_or_insert(beacon);
        match self.of.iter_mut().find(|(known, _)| *known == beacon) {
            Some((_, places)) => places.push(place),
            None => self.of.push((beacon, alloc::vec![place])),
        }
    }

    /// Forgets a beacon's levels, because what is believed of it begins anew.
    pub(super) fn begin(&mut self) {
        self.first = None;
    }

    /// From where a beacon was heard.
    pub(super) fn places(&self, beacon: Option<BeaconId>) -> &[Vector3<f64>] {
        let of = self.of.iter().find(|(known, _)| Some(*known) == beacon);
        of.map_or(&[], |(_, places)| places)
    }
}

/// What the levels heard so far say of the power if the target is in a cell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct PowerIn {
    /// The mean level that is expected of the places where it was heard, weighted with how much
    /// they say, and its gradient over the target's place.
    pub(super) level_db: f64,
    pub(super) level_gradient: Vector2<f64>,
    /// The variance of the power that is left, in dB².
    pub(super) variance: f64,
}

/// The same for each cell.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Power {
    cells: Vec<PowerIn>,
}

impl Power {
    /// Given the place, the power is the prior and the mean of what was heard over what was
    /// expected, weighted by their information.
    pub(super) fn of<S: TurnInformation + ?Sized>(
        turn: &S,
        belief: &Cells,
        heard: &[Vector3<f64>],
        sigma_db: f64,
    ) -> Self {
        let known = PowerIn { level_db: 0.0, level_gradient: Vector2::zeros(), variance: 0.0 };
        let cells = belief.cells.iter().map(|cell| {
            if sigma_db <= 0.0 {
                return known;
            }
            let mut sum = PowerIn { variance: 1.0 / (sigma_db * sigma_db), ..known };
            for place in heard {
                let fisher = turn.fisher(&cell.mean, place);
                let level = turn.expected(&cell.mean, place).level_db;
                sum.level_db += level * fisher.level_information;
                sum.level_gradient += fisher.level_gradient * fisher.level_information;
                sum.variance += fisher.level_information;
            }
            PowerIn {
                level_db: sum.level_db / sum.variance,
                level_gradient: sum.level_gradient / sum.variance,
                variance: 1.0 / sum.variance,
            }
        });
        Self { cells: cells.collect() }
    }

    pub(super) fn at(&self, cell: usize) -> &PowerIn {
        &self.cells[cell]
    }
}
