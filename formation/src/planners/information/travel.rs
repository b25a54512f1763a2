use alloc::vec::Vec;

use nalgebra::Vector3;

/// Farthest distances that any drone flies, in metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Farthest {
    pub(super) over_ground_m: f64,
    pub(super) height_m: f64,
}

/// The farthest flight between places in the same order.
pub(super) fn farthest(from: &[Vector3<f64>], to: &[Vector3<f64>]) -> Farthest {
    from.iter().zip(to).fold(Farthest { over_ground_m: 0.0, height_m: 0.0 }, |far, (a, b)| {
        let off = b - a;
        Farthest {
            over_ground_m: far.over_ground_m.max(off.xy().norm()),
            height_m: far.height_m.max(off.z.abs()),
        }
    })
}

/// The places in an order in which no two drones would make the sum of squared distances over
/// ground smaller by exchanging theirs. Squares keep the longest way short, which is what a plan
/// waits for.
///
/// An estimate of how long a move takes, for hundreds of formations per decision: no drone is
/// assigned by it. Which drone flies where is decided by the fleet, over the ways that are
/// permitted.
pub(super) fn exchanged(from: &[Vector3<f64>], to: &[Vector3<f64>]) -> Vec<Vector3<f64>> {
    let mut to = to.to_vec();
    // Σ |a − b|² differs by the mixed products only.
    let saving = |from: &[Vector3<f64>], to: &[Vector3<f64>], i: usize, j: usize| {
        (from[i].xy() - from[j].xy()).dot(&(to[j].xy() - to[i].xy()))
    };
    let count = from.len().min(to.len());
    for _ in 0..count * count {
        let mut exchanged = false;
        for i in 0..count {
            for j in 0..i {
                if saving(from, &to, i, j) > 1e-9 {
                    to.swap(i, j);
                    exchanged = true;
                }
            }
        }
        if !exchanged {
            break;
        }
    }
    to
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn neighbours_keep_their_sides() {
        let from: Vec<_> = [0.0, 10.0, 20.0].map(|east| Vector3::new(east, 0.0, 2.0)).to_vec();
        let to: Vec<_> = [21.0, 1.0, 11.0].map(|east| Vector3::new(east, 0.0, 4.0)).to_vec();
        let assigned = exchanged(&from, &to);
        assert_eq!(assigned.iter().map(|place| place.x).collect::<Vec<_>>(), [1.0, 11.0, 21.0]);
        let far = farthest(&from, &assigned);
        assert_eq!(far, Farthest { over_ground_m: 1.0, height_m: 2.0 });
    }
}
