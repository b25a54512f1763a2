//! Graphs of searches over their steps.

use foxhunt_core::Estimate;
use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::graph::{Axis, Band, Curve, Graph, Mark, Scale, Tint};
use crate::overview::{Believed, Knot, SearchOverview};

/// A search, and what it is called in a legend.
#[derive(Clone, Debug)]
pub struct NamedSearch<'a> {
    /// Name of the search in a legend.
    pub name: String,
    /// The search.
    pub search: &'a SearchOverview,
}

/// The distance from the estimate to the truth after each reception.
#[must_use]
pub fn error_over_steps(title: &str, searches: &[NamedSearch<'_>]) -> Graph {
    let curve = |(number, named): (usize, &NamedSearch<'_>)| {
        let error = |believed: &Believed| Some([f64::from(believed.steps), believed.error_m?]);
        Curve {
            name: named.name.clone(),
            points: named.search.beliefs.iter().filter_map(error).collect(),
            mark: Mark::Line,
            tint: Tint::Number(number),
        }
    };
    Graph {
        title: title.to_owned(),
        across: steps(),
        up: Axis { label: "error in metres".to_owned(), scale: Scale::FromZero },
        bands: Vec::new(),
        curves: searches.iter().enumerate().map(curve).collect(),
    }
}

/// The semi-axes of the 95 % ellipse after each reception: the longer one as a line, the shorter
/// one dashed.
#[must_use]
pub fn axes_over_steps(title: &str, searches: &[NamedSearch<'_>]) -> Graph {
    let mut curves = Vec::new();
    for (number, NamedSearch { name, search }) in searches.iter().enumerate() {
        let axes = |believed: &Believed| {
            let ellipse = believed.ellipse_95?;
            Some((f64::from(believed.steps), ellipse.semi_major, ellipse.semi_minor))
        };
        let axes: Vec<_> = search.beliefs.iter().filter_map(axes).collect();
        let tint = Tint::Number(number);
        curves.push(Curve {
            name: name.clone(),
            points: axes.iter().map(|(steps, major, _)| [*steps, *major]).collect(),
            mark: Mark::Line,
            tint,
        });
        curves.push(Curve {
            name: String::new(),
            points: axes.iter().map(|(steps, _, minor)| [*steps, *minor]).collect(),
            mark: Mark::Dashes,
            tint,
        });
    }
    let label = "semi-axes of the 95 % ellipse in metres: longer, and dashed the shorter";
    Graph {
        title: title.to_owned(),
        across: steps(),
        up: Axis { label: label.to_owned(), scale: Scale::Logarithmic },
        bands: Vec::new(),
        curves,
    }
}

/// The normalised estimation error squared after each reception, averaged over the searches of one
/// beacon: for a consistent estimator the averages lie in the band of χ² with 95 % at each step
/// (Bar-Shalom, Li & Kirubarajan 2001, §5.4.2). Searches without a truth are left out.
#[must_use]
pub fn nees_over_steps(title: &str, searches: &[NamedSearch<'_>]) -> Graph {
    let of_each = searches.iter().filter_map(|named| nees(named.search));
    let runs: Vec<Vec<(u32, f64)>> = of_each.collect();
    let last = runs.iter().filter_map(|run| run.last()).map(|(steps, _)| *steps).max();
    let mut average = Vec::new();
    let mut band = Vec::new();
    for step in 0..=last.unwrap_or(0) {
        let at = runs.iter().filter_map(|run| {
            let index = run.partition_point(|(steps, _)| *steps < step);
            run.get(index).filter(|(steps, _)| *steps == step).map(|(_, nees)| *nees)
        });
        let (sum, count) = at.fold((0.0, 0.0), |(sum, count), nees| (sum + nees, count + 1.0));
        let Ok(chi_squared) = ChiSquared::new(2.0 * count) else { continue };
        let end = |share: f64| chi_squared.inverse_cdf(share) / count;
        average.push([f64::from(step), sum / count]);
        band.push([f64::from(step), end(0.025), end(0.975)]);
    }
    let what = match runs.len() {
        1 => "NEES".to_owned(),
        count => format!("average of {count} runs"),
    };
    let curve = |name: String, points, mark, tint| Curve { name, points, mark, tint };
    let expected = average.iter().map(|[step, _]| [*step, 2.0]).collect();
    Graph {
        title: title.to_owned(),
        across: steps(),
        up: Axis {
            label: "normalised estimation error squared".to_owned(),
            scale: Scale::Logarithmic,
        },
        bands: vec![Band { name: "χ², 95 %".to_owned(), points: band }],
        curves: vec![
            curve("expected".to_owned(), expected, Mark::Dashes, Tint::Truth),
            curve(what, average, Mark::Line, Tint::Belief),
        ],
    }
}

fn steps() -> Axis {
    Axis { label: "receptions".to_owned(), scale: Scale::Linear }
}

/// The NEES of a search after each reception, by rising steps; [`None`] without a truth.
fn nees(search: &SearchOverview) -> Option<Vec<(u32, f64)>> {
    let of = |believed: &Believed| {
        let estimate: &Estimate<2> = &believed.estimate;
        let nees = estimate.nees(&truth_at(&search.truth, believed.time)?)?;
        Some((believed.steps, nees))
    };
    let mut run: Vec<(u32, f64)> = Vec::new();
    for (steps, nees) in search.beliefs.iter().filter_map(of) {
        if run.last().is_none_or(|(last, _)| *last < steps) {
            run.push((steps, nees));
        }
    }
    (!run.is_empty()).then_some(run)
}

/// Place of a beacon at a time; on straight lines between the knots of its way.
fn truth_at(way: &[Knot], time: f64) -> Option<nalgebra::Vector2<f64>> {
    let after = way.partition_point(|knot| knot.time < time);
    let before = after.checked_sub(1).and_then(|i| way.get(i));
    let next = way.get(after);
    let (before, next) = (before.or(next)?, next.or(before)?);
    let span = next.time - before.time;
    let share = if span > 0.0 { ((time - before.time) / span).clamp(0.0, 1.0) } else { 0.0 };
    Some(before.place.lerp(&next.place, share).xy())
}

#[cfg(test)]
mod tests {
    use approx::assert_abs_diff_eq;
    use nalgebra::{Vector2, Vector3};

    use super::*;

    /// A search whose error is `error_m` to the East, with a σ of 2 m, in each of some steps.
    fn search(error_m: f64, steps: u32) -> SearchOverview {
        let believed = |step: u32| {
            let estimate = Estimate::isotropic(Vector2::new(10.0 + error_m, 5.0), 2.0);
            Believed {
                time: f64::from(step),
                steps: step,
                ellipse_95: estimate.ellipse(0.95),
                estimate,
                error_m: Some(error_m),
                cloud: Vec::new(),
            }
        };
        SearchOverview {
            truth: vec![Knot { time: 0.0, place: Vector3::new(10.0, 5.0, 0.0) }],
            beliefs: (0..steps).map(believed).collect(),
            ..SearchOverview::default()
        }
    }

    fn named(search: &SearchOverview) -> NamedSearch<'_> {
        NamedSearch { name: "fox".to_owned(), search }
    }

    #[test]
    fn errors_and_axes_are_those_of_the_beliefs() {
        let search = search(3.0, 4);
        let graph = error_over_steps("", &[named(&search)]);
        assert_eq!(graph.curves[0].points, [[0.0, 3.0], [1.0, 3.0], [2.0, 3.0], [3.0, 3.0]]);
        let graph = axes_over_steps("", &[named(&search)]);
        // χ²₂ at 95 % is 5.991.
        for curve in &graph.curves {
            assert_abs_diff_eq!(curve.points[2][1], 2.0 * 5.991_465_f64.sqrt(), epsilon = 1e-5);
        }
    }

    #[test]
    fn nees_are_averaged_and_held_against_their_band() {
        let near = search(2.0, 5);
        let far = search(6.0, 3);
        let graph = nees_over_steps("", &[named(&near), named(&far)]);
        let average = &graph.curves[1].points;
        // (2/2)² and (6/2)².
        assert_eq!(average[..4], [[0.0, 5.0], [1.0, 5.0], [2.0, 5.0], [3.0, 1.0]]);
        let [_, low, high] = graph.bands[0].points[0];
        // χ²₄ at 2.5 % and 97.5 %, halved.
        assert_abs_diff_eq!(low, 0.4844 / 2.0, epsilon = 1e-3);
        assert_abs_diff_eq!(high, 11.143 / 2.0, epsilon = 1e-3);
        let [_, low, high] = graph.bands[0].points[4];
        assert!((low - 0.0506).abs() < 1e-3 && (high - 7.378).abs() < 1e-3, "one run");
        let unknown = SearchOverview { truth: Vec::new(), ..search(1.0, 3) };
        assert!(nees_over_steps("", &[named(&unknown)]).curves[1].points.is_empty());
    }

    #[test]
    fn the_truth_moves_between_its_knots() {
        let knot = |time: f64, east: f64| Knot { time, place: Vector3::new(east, 0.0, 0.0) };
        let way = [knot(10.0, 0.0), knot(20.0, 4.0)];
        for (time, east) in [(5.0, 0.0), (15.0, 2.0), (20.0, 4.0), (99.0, 4.0)] {
            assert_eq!(truth_at(&way, time).map(|place| place.x), Some(east), "{time}");
        }
        assert_eq!(truth_at(&[], 1.0), None);
    }
}
