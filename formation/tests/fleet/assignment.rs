use foxhunt_formation::assign;
use nalgebra::Vector2;
use proptest::{collection::vec, prelude::*};

fn place() -> impl Strategy<Value = Vector2<f64>> {
    (-100.0..100.0, -100.0..100.0).prop_map(|(x, y)| Vector2::new(x, y))
}

/// As many drones as places.
fn as_many(most: usize) -> impl Strategy<Value = (Vec<Vector2<f64>>, Vec<Vector2<f64>>)> {
    (1..=most).prop_flat_map(|n| (vec(place(), n), vec(place(), n)))
}

/// The least total of those `to` that `from` can be assigned to, by trying all of them.
fn brute_force(from: &[Vector2<f64>], to: &mut Vec<Vector2<f64>>) -> f64 {
    let Some((first, rest)) = from.split_first() else { return 0.0 };
    let mut least = f64::INFINITY;
    for index in 0..to.len() {
        let place = to.swap_remove(index);
        least = least.min((place - first).norm() + brute_force(rest, to));
        to.push(place);
        let last = to.len() - 1;
        to.swap(index, last);
    }
    least
}

fn cross(a: &[Vector2<f64>; 2], b: &[Vector2<f64>; 2]) -> bool {
    let side = |line: &[Vector2<f64>; 2], place: &Vector2<f64>| {
        (line[1] - line[0]).perp(&(place - line[0])).signum()
    };
    let parted = |line: &[Vector2<f64>; 2], other: &[Vector2<f64>; 2]| {
        side(line, &other[0]) * side(line, &other[1]) < 0.0
    };
    parted(a, b) && parted(b, a)
}

proptest! {
    #[test]
    fn nobody_could_travel_less((from, to) in as_many(7)) {
        let places = assign(&from, &to);
        let mut taken: Vec<usize> = places.iter().flatten().copied().collect();
        let total: f64 =
            places.iter().zip(&from).map(|(p, f)| (to[p.expect("one each")] - f).norm()).sum();
        taken.sort_unstable();
        prop_assert_eq!(taken, (0..from.len()).collect::<Vec<_>>());
        // Lengths are rounded to whole micrometres.
        prop_assert!(total <= brute_force(&from, &mut to.clone()) + 1e-6 * 7.0);
    }

    #[test]
    fn straight_ways_do_not_cross((from, to) in as_many(12)) {
        let places = assign(&from, &to);
        let way = |d: usize| [from[d], to[places[d].expect("one each")]];
        for one in 0..from.len() {
            for other in 0..one {
                prop_assert!(!cross(&way(one), &way(other)), "{one} and {other}");
            }
        }
    }

    #[test]
    fn some_are_left_over(from in vec(place(), 0..8), to in vec(place(), 0..8)) {
        let places = assign(&from, &to);
        prop_assert_eq!(places.len(), from.len());
        prop_assert_eq!(places.iter().flatten().count(), from.len().min(to.len()));
    }
}

/// The test of crossing can fail.
#[test]
fn the_other_way_round_would_cross() {
    let at = Vector2::new;
    assert!(cross(&[at(0.0, 0.0), at(1.0, 1.0)], &[at(1.0, 0.0), at(0.0, 1.0)]));
    let ways = assign(&[at(0.0, 0.0), at(1.0, 0.0)], &[at(1.0, 1.0), at(0.0, 1.0)]);
    assert_eq!(ways, [Some(1), Some(0)]);
}
