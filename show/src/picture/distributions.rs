//! Contenders beside each other: distributions of their errors, and ratios to a reference.

use plotters::style::{Color, RGBColor};

use super::{
    canvas::{Anchor, Canvas, EDGE, FAINT_INK, GRID, INK, PictureError, UNIT, drone_colour},
    chart::shortened,
    frame::{Pixel, Rect, whole},
};

/// The results of one contender's runs, for [`distributions_svg`](super::distributions_svg).
#[derive(Clone, Debug, PartialEq)]
pub struct Distribution {
    /// Name of the contender.
    pub name: String,
    /// From the estimates to the truth in metres, rising.
    pub errors_m: Vec<f64>,
    /// The normalised estimation errors squared, rising; as many.
    pub nees: Vec<f64>,
}

const ERRORS: Rect =
    Rect { left: 72 * UNIT, top: 96 * UNIT, right: 530 * UNIT, bottom: 600 * UNIT };
const NEES: Rect =
    Rect { left: 632 * UNIT, top: 96 * UNIT, right: 1090 * UNIT, bottom: 600 * UNIT };
const SIZE: i32 = 13 * UNIT;

/// The largest NEES that is shown: χ²₂ is below it with 99.9 %.
const MOST_NEES: f64 = 14.0;

/// Number of points of a curve.
const POINTS: u32 = 400;

/// Draws the distributions of errors and NEES: the share of runs that are below.
pub(super) fn draw(
    canvas: &Canvas<'_>,
    title: &str,
    contenders: &[Distribution],
) -> Result<(), PictureError> {
    canvas.text(title, (48 * UNIT, 36 * UNIT), 18 * UNIT, INK, Anchor::Left)?;
    let positive = || {
        let all = contenders.iter().flat_map(|one| [one.errors_m.first(), one.errors_m.last()]);
        all.flatten().copied().filter(|error| *error > 0.0 && error.is_finite())
    };
    let least = positive().fold(f64::INFINITY, f64::min).clamp(1e-3, 1.0);
    let most = positive().fold(0.0, f64::max).max(10.0 * least);
    let low = libm::log10(least).floor();
    let high = libm::log10(most).ceil();
    let errors = Panel {
        rect: ERRORS,
        title: "share of runs with an error below, in metres",
        across: |error| libm::log10(error.max(f64::MIN_POSITIVE)),
        range: [low, high],
    };
    let decades = std::iter::successors(Some(low), |at| Some(at + 1.0));
    let decades = decades.take_while(|at| *at <= high).map(|at| libm::pow(10.0_f64, at));
    errors.axes(canvas, decades)?;
    let nees = Panel {
        rect: NEES,
        title: "share of runs with a NEES below; grey: 95 % of consistent estimators",
        across: |nees| nees,
        range: [0.0, MOST_NEES],
    };
    if let Some(runs) = contenders.iter().map(|one| one.nees.len()).min() {
        band(canvas, &nees, runs)?;
    }
    nees.axes(canvas, (0..=7).map(|step| 2.0 * f64::from(step)))?;
    let quiet = (0..=POINTS).map(|i| MOST_NEES * f64::from(i) / f64::from(POINTS));
    let expected = quiet.map(|at| nees.pixel(at, chi_squared_2(at))).collect();
    canvas.line(expected, INK.to_rgba(), UNIT)?;
    for (index, one) in contenders.iter().enumerate() {
        let colour = drone_colour(index);
        errors.curve(canvas, &one.errors_m, colour)?;
        nees.curve(canvas, &one.nees, colour)?;
        let row = i32::try_from(index).unwrap_or(0);
        let y = 660 * UNIT + row * 22 * UNIT;
        let line = vec![(72 * UNIT, y), (102 * UNIT, y)];
        canvas.line(line, colour.to_rgba(), 3 * UNIT)?;
        let text = format!("{}, {} runs", one.name, one.errors_m.len());
        canvas.text(&text, (112 * UNIT, y), SIZE, INK, Anchor::Left)?;
    }
    Ok(())
}

/// Draws the band about the curve of χ²₂ that holds the shares of this number of consistent runs
/// everywhere with 95 % (Dvoretzky, Kiefer & Wolfowitz 1956 with the constant of Massart 1990).
fn band(canvas: &Canvas<'_>, panel: &Panel, runs: usize) -> Result<(), PictureError> {
    let runs = f64::from(u32::try_from(runs).unwrap_or(u32::MAX)).max(1.0);
    let reach = (libm::log(2.0_f64 / 0.05) / (2.0 * runs)).sqrt();
    let at = |i: u32| MOST_NEES * f64::from(i) / f64::from(POINTS);
    let edge =
        |i: u32, shift: f64| panel.pixel(at(i), (chi_squared_2(at(i)) + shift).clamp(0.0, 1.0));
    let above = (0..=POINTS).map(|i| edge(i, reach));
    let below = (0..=POINTS).rev().map(|i| edge(i, -reach));
    canvas.area(above.chain(below).collect(), GRID.to_rgba())
}

/// The share of χ² with two degrees of freedom that is below.
fn chi_squared_2(at: f64) -> f64 {
    -libm::expm1(-0.5 * at)
}

/// A field with the share of runs upwards.
struct Panel {
    rect: Rect,
    title: &'static str,
    /// Position of a value across.
    across: fn(f64) -> f64,
    /// Ends at the left and the right edge, in the units of `across`.
    range: [f64; 2],
}

impl Panel {
    fn pixel(&self, value: f64, share: f64) -> Pixel {
        let Rect { left, top, right, bottom } = self.rect;
        let [low, high] = self.range;
        let along = (((self.across)(value) - low) / (high - low)).clamp(0.0, 1.0);
        let between = |from: i32, to: i32, part: f64| from + whole(f64::from(to - from) * part);
        (between(left, right, along), between(bottom, top, share))
    }

    fn axes(
        &self,
        canvas: &Canvas<'_>,
        values: impl Iterator<Item = f64>,
    ) -> Result<(), PictureError> {
        let Rect { left, top, right, bottom } = self.rect;
        for tenth in [0.0, 0.25, 0.5, 0.75, 1.0] {
            let (_, y) = self.pixel(0.0, tenth);
            canvas.line(vec![(left, y), (right, y)], EDGE.mix(0.4), UNIT)?;
            let label = format!("{:.0} %", 100.0 * tenth);
            canvas.text(&label, (left - 8 * UNIT, y), SIZE, FAINT_INK, Anchor::Right)?;
        }
        for value in values {
            let (x, _) = self.pixel(value, 0.0);
            canvas.line(vec![(x, top), (x, bottom)], EDGE.mix(0.4), UNIT)?;
            let at = (x, bottom + 7 * UNIT);
            canvas.text(&format!("{value}"), at, SIZE, FAINT_INK, Anchor::Top)?;
        }
        let above = (left, top - 16 * UNIT);
        canvas.text(self.title, above, SIZE, INK, Anchor::Left)
    }

    /// The share of rising values that is below each of them.
    fn curve(
        &self,
        canvas: &Canvas<'_>,
        values: &[f64],
        colour: RGBColor,
    ) -> Result<(), PictureError> {
        let Some(last) = values.len().checked_sub(1) else { return Ok(()) };
        let point = |i: u32| {
            let index = u64::try_from(last).ok()? * u64::from(i) / u64::from(POINTS);
            let index = usize::try_from(index).ok()?;
            let share = f64::from(i) / f64::from(POINTS);
            Some((self.pixel(*values.get(index)?, share), index))
        };
        let [_, high] = self.range;
        let is_shown = |value: f64| (self.across)(value) <= high;
        let shown = values.iter().take_while(|value| is_shown(**value)).count();
        let points = (0..=POINTS).map_while(|i| point(i).filter(|(_, index)| *index < shown));
        canvas.line(points.map(|(pixel, _)| pixel).collect(), colour.to_rgba(), 2 * UNIT)
    }
}

/// Comparison of a contender with a reference, for [`ratios_svg`](super::ratios_svg).
#[derive(Clone, Debug, PartialEq)]
pub struct Ratios {
    /// Name of the contender.
    pub name: String,
    /// For each figure, in one order: its ratio over the reference's, and where that lies with
    /// 95 %; [`None`] where it is not known.
    pub ratios: Vec<Option<(f64, [f64; 2])>>,
}

const PLOT: Rect =
    Rect { left: 230 * UNIT, top: 96 * UNIT, right: 1080 * UNIT, bottom: 760 * UNIT };

/// Ratios with their intervals on a logarithmic axis, a row for each contender.
pub(super) fn draw_ratios(
    canvas: &Canvas<'_>,
    title: &str,
    figures: &[&str],
    contenders: &[Ratios],
) -> Result<(), PictureError> {
    let at = (48 * UNIT, 30 * UNIT);
    canvas.text(title, at, 17 * UNIT, INK, Anchor::Left)?;
    let positive = |value: &f64| *value > 0.0 && value.is_finite();
    let known = contenders.iter().flat_map(|one| one.ratios.iter().flatten());
    let values = known.flat_map(|(ratio, [low, high])| [*ratio, *low, *high]).filter(positive);
    let (low, high) =
        values.fold((0.8_f64, 1.25_f64), |(low, high), value| (low.min(value), high.max(value)));
    let low = libm::log(low) - 0.05;
    let high = libm::log(high) + 0.05;
    let x = |ratio: f64| {
        let share = ((libm::log(ratio) - low) / (high - low)).clamp(0.0, 1.0);
        PLOT.left + whole(f64::from(PLOT.right - PLOT.left) * share)
    };
    for tick in [0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0] {
        if (low..=high).contains(&libm::log(tick)) {
            let line = vec![(x(tick), PLOT.top), (x(tick), PLOT.bottom)];
            let (colour, width) = if tick.total_cmp(&1.0).is_eq() { (INK, 2) } else { (EDGE, 1) };
            canvas.line(line, colour.mix(0.5), width * UNIT)?;
            let at = (x(tick), PLOT.bottom + 8 * UNIT);
            canvas.text(&format!("{tick}"), at, SIZE, FAINT_INK, Anchor::Top)?;
        }
    }
    let middle = ((PLOT.left + PLOT.right) / 2, PLOT.bottom + 30 * UNIT);
    let what = "ratio over the reference with its 95 % interval; left of 1 is better";
    canvas.text(what, middle, SIZE, INK, Anchor::Top)?;
    let rows = i32::try_from(contenders.len().max(1)).unwrap_or(i32::MAX);
    let height = (PLOT.bottom - PLOT.top) / rows;
    let lines = i32::try_from(figures.len().max(1)).unwrap_or(1);
    let apart = (height / (lines + 1)).min(16 * UNIT);
    for (row, contender) in (0_i32..).zip(contenders) {
        let centre = PLOT.top + height * row + height / 2;
        let at = (PLOT.left - 12 * UNIT, centre);
        canvas.text(&shortened(&contender.name), at, SIZE, INK, Anchor::Right)?;
        for (figure, ratio) in contender.ratios.iter().enumerate() {
            let Some((ratio, [low, high])) =
                ratio.filter(|(ratio, ends)| positive(ratio) && ends.iter().all(positive))
            else {
                continue;
            };
            let colour = drone_colour(figure);
            let line = i32::try_from(figure).unwrap_or(0);
            let y = centre + apart * (2 * line - lines + 1) / 2;
            canvas.line(vec![(x(low), y), (x(high), y)], colour.to_rgba(), 2 * UNIT)?;
            canvas.dot((x(ratio), y), 4 * UNIT, colour.to_rgba())?;
        }
    }
    let mut left = PLOT.left;
    for (figure, name) in figures.iter().enumerate() {
        let y = 66 * UNIT;
        canvas.dot((left, y), 4 * UNIT, drone_colour(figure).to_rgba())?;
        canvas.text(name, (left + 10 * UNIT, y), SIZE, INK, Anchor::Left)?;
        left += 30 * UNIT + super::canvas::text_width(name, SIZE);
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use approx::assert_abs_diff_eq;

    use super::*;
    use crate::picture::{distributions_svg, ratios_svg};

    #[test]
    fn curves_rise_from_the_left_to_the_right() {
        let panel = Panel { rect: NEES, title: "", across: |nees| nees, range: [0.0, MOST_NEES] };
        assert_eq!(panel.pixel(0.0, 0.0), (NEES.left, NEES.bottom));
        assert_eq!(panel.pixel(1e9, 1.0), (NEES.right, NEES.top));
        // The 95 % quantile of χ²₂ is 5.991.
        assert_abs_diff_eq!(chi_squared_2(5.991_465), 0.95, epsilon = 1e-6);
    }

    #[test]
    fn every_contender_has_its_curves_and_its_name() {
        let one = |name: &str, scale: f64| Distribution {
            name: name.to_owned(),
            errors_m: (1..50).map(|i| scale * f64::from(i)).collect(),
            nees: (1..50).map(|i| 0.1 * scale * f64::from(i)).collect(),
        };
        let svg = distributions_svg("pritzl-6.1", &[one("first", 0.1), one("second", 1.0)]);
        let svg = svg.expect("drawn");
        for text in ["pritzl-6.1", "first, 49 runs", "second, 49 runs", "NEES"] {
            assert!(svg.contains(text), "{text}");
        }
        // χ²₂ and two curves for each.
        let curves = svg.matches("<polyline").count();
        assert!(curves >= 5 && !svg.contains("NaN"), "{curves}");
        let empty = Distribution { name: "none".into(), errors_m: vec![], nees: vec![] };
        assert!(distributions_svg("x", &[empty]).expect("drawn").contains("none, 0 runs"));
        assert!(distributions_svg("x", &[]).is_ok());
    }

    #[test]
    fn each_ratio_has_a_dot_and_an_interval() {
        let of = |name: &str, ratios: &[Option<(f64, [f64; 2])>]| Ratios {
            name: name.to_owned(),
            ratios: ratios.to_vec(),
        };
        let contenders = [
            of("<first>", &[Some((0.5, [0.4, 0.6])), Some((1.5, [1.2, 2.4]))]),
            of("second", &[None, Some((1.0, [0.0, 3.0]))]),
        ];
        let svg = ratios_svg("planners", &["steps", "error"], &contenders).expect("drawn");
        // Two in the legend; an interval that reaches 0 has no place.
        assert_eq!(svg.matches("<circle").count(), 4, "{svg}");
        for text in ["planners", "&lt;first&gt;", "second", "steps", "error", ">0.5<"] {
            assert!(svg.contains(text) || svg.contains(&text.replace(['>', '<'], "")), "{text}");
        }
        assert!(ratios_svg("none", &[], &[]).is_ok());
    }
}
