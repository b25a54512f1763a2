use plotters::style::{Color, RGBColor};

use super::{
    canvas::{
        Anchor, BELIEF, Canvas, EDGE, FAINT_INK, INK, LEGEND, PLOT, PictureError, UNIT,
        drone_colour,
    },
    chart::shortened,
    frame::{Pixel, Rect, round_step, whole},
};

/// Curves over one axis, for [`graph_svg`](super::graph_svg).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Graph {
    /// Title above the graph.
    pub title: String,
    /// The axis to the right.
    pub across: Axis,
    /// The axis upwards.
    pub up: Axis,
    /// Ranges behind the curves.
    pub bands: Vec<Band>,
    /// The curves.
    pub curves: Vec<Curve>,
}

/// An axis; its range is that of what is shown.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Axis {
    /// Quantity on the axis, with its unit.
    pub label: String,
    /// Division of the axis.
    pub scale: Scale,
}

/// Division of an axis.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Scale {
    /// Evenly.
    #[default]
    Linear,
    /// Evenly, and 0 is shown.
    FromZero,
    /// By ratios; what is not positive is left out.
    Logarithmic,
}

/// Points of one kind.
#[derive(Clone, Debug, PartialEq)]
pub struct Curve {
    /// Name of the curve in the legend; without one the curve has no line there.
    pub name: String,
    /// Points of the curve: to the right, and upwards. A point that is not finite divides a line.
    pub points: Vec<[f64; 2]>,
    /// Style of the points.
    pub mark: Mark,
    /// Colour of the curve.
    pub tint: Tint,
}

/// Style of points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Mark {
    /// As a line from each to the next.
    Line,
    /// As a dashed line.
    Dashes,
    /// As dots.
    Dots,
    /// As bars from 0 of this width.
    Bars(f64),
}

/// A colour by its meaning.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Tint {
    /// The colour of a contender, a drone or a beacon, from 0.
    Number(usize),
    /// A belief or a fit.
    Belief,
    /// The truth, or a reference.
    Truth,
}

/// A range for each value across: what is expected there.
#[derive(Clone, Debug, PartialEq)]
pub struct Band {
    /// Name of the band in the legend.
    pub name: String,
    /// The value across, and the range upwards.
    pub points: Vec<[f64; 3]>,
}

impl Tint {
    fn colour(self) -> RGBColor {
        match self {
            Self::Number(index) => drone_colour(index),
            Self::Belief => BELIEF,
            Self::Truth => INK,
        }
    }
}

const SIZE: i32 = 13 * UNIT;

/// Room about the points, as a share of the range.
const MARGIN: f64 = 0.04;

pub(super) fn draw(canvas: &Canvas<'_>, graph: &Graph) -> Result<(), PictureError> {
    canvas.text(&graph.title, (PLOT.left, 16 * UNIT), 17 * UNIT, INK, Anchor::Left)?;
    let curves = graph.curves.iter().flat_map(|curve| &curve.points).copied();
    let bands = graph.bands.iter().flat_map(|band| &band.points);
    let all: Vec<[f64; 2]> =
        curves.chain(bands.flat_map(|[at, low, high]| [[*at, *low], [*at, *high]])).collect();
    let plot = Plot {
        rect: PLOT,
        across: Ruler::new(graph.across.scale, all.iter().map(|point| point[0])),
        up: Ruler::new(graph.up.scale, all.iter().map(|point| point[1])),
    };
    for band in &graph.bands {
        plot.band(canvas, band)?;
    }
    plot.axes(canvas, &graph.across.label, &graph.up.label)?;
    for curve in &graph.curves {
        plot.curve(canvas, curve)?;
    }
    legend(canvas, graph)
}

/// One axis: how values lie along it.
struct Ruler {
    scale: Scale,
    /// Values at its ends, as the scale counts.
    ends: [f64; 2],
}

impl Ruler {
    fn new(scale: Scale, values: impl Iterator<Item = f64>) -> Self {
        let mut ends = [f64::INFINITY, f64::NEG_INFINITY];
        let zero = (scale == Scale::FromZero).then_some(0.0);
        let counted = values.filter_map(|value| counted(scale, value));
        for value in counted.chain(zero) {
            ends = [ends[0].min(value), ends[1].max(value)];
        }
        let [low, high] = ends;
        if !(low.is_finite() && high.is_finite()) {
            return Self { scale, ends: [0.0, 1.0] };
        }
        let room = if high > low { MARGIN * (high - low) } else { 0.5 };
        let below = if scale == Scale::FromZero && low >= 0.0 { 0.0 } else { room };
        Self { scale, ends: [low - below, high + room] }
    }

    /// Position of a value, from 0 to 1; [`None`] if it has no place.
    fn share(&self, value: f64) -> Option<f64> {
        let [low, high] = self.ends;
        let share = (counted(self.scale, value)? - low) / (high - low);
        Some(share.clamp(0.0, 1.0))
    }

    /// The values that are written beside the axis, with their texts.
    fn ticks(&self) -> Vec<(f64, String)> {
        let [low, high] = self.ends;
        if self.scale == Scale::Logarithmic {
            return decades(low, high);
        }
        let step = round_step((high - low) / 8.0);
        let decimals = (-libm::log10(step).floor()).clamp(0.0, 12.0);
        let decimals = usize::try_from(whole(decimals)).unwrap_or(0);
        let first = (low / step).ceil();
        let ticks = (0..24_u8).map(|tick| (first + f64::from(tick)) * step);
        let within = ticks.take_while(|value| *value <= high);
        within.map(|value| (value, number(value, decimals))).collect()
    }
}

/// A value as a scale counts.
fn counted(scale: Scale, value: f64) -> Option<f64> {
    let value = match scale {
        Scale::Logarithmic if value <= 0.0 => return None,
        Scale::Logarithmic => libm::log10(value),
        Scale::Linear | Scale::FromZero => value,
    };
    value.is_finite().then_some(value)
}

/// 1, 2 and 5 times the powers of ten between two exponents; the powers alone where those are many.
fn decades(low: f64, high: f64) -> Vec<(f64, String)> {
    let factors: &[f64] = if high - low < 2.5 { &[1.0, 2.0, 5.0] } else { &[1.0] };
    let first = low.floor();
    let powers = (0..30_u8).map(|up| first + f64::from(up)).take_while(|power| *power <= high);
    let mut ticks = Vec::new();
    for power in powers {
        let decimals = usize::try_from(whole((-power).max(0.0))).unwrap_or(0);
        for factor in factors {
            let value = factor * libm::pow(10.0_f64, power);
            if (low..=high).contains(&libm::log10(value)) {
                ticks.push((value, number(value, decimals)));
            }
        }
    }
    ticks
}

/// A number as axes have it, with the sign of typesetting.
fn number(value: f64, decimals: usize) -> String {
    // A zero that rounding left below zero is no minus zero.
    let value = if value.abs() < 1e-12 { 0.0 } else { value };
    format!("{value:.decimals$}").replace('-', "\u{2212}")
}

/// A graph's rectangle and axes.
struct Plot {
    rect: Rect,
    across: Ruler,
    up: Ruler,
}

impl Plot {
    fn pixel(&self, [across, up]: [f64; 2]) -> Option<Pixel> {
        let Rect { left, top, right, bottom } = self.rect;
        let between = |from: i32, to: i32, share: f64| from + whole(f64::from(to - from) * share);
        Some((
            between(left, right, self.across.share(across)?),
            between(bottom, top, self.up.share(up)?),
        ))
    }

    fn axes(&self, canvas: &Canvas<'_>, across: &str, up: &str) -> Result<(), PictureError> {
        let Rect { left, top, right, bottom } = self.rect;
        let grid = EDGE.mix(0.4);
        for (value, label) in self.across.ticks() {
            let Some(share) = self.across.share(value) else { continue };
            let x = left + whole(f64::from(right - left) * share);
            canvas.line(vec![(x, top), (x, bottom)], grid, UNIT)?;
            let at = (x, bottom + 7 * UNIT);
            canvas.text(&label, at, SIZE, FAINT_INK, Anchor::Top)?;
        }
        for (value, label) in self.up.ticks() {
            let Some(share) = self.up.share(value) else { continue };
            let y = bottom - whole(f64::from(bottom - top) * share);
            canvas.line(vec![(left, y), (right, y)], grid, UNIT)?;
            let at = (left - 8 * UNIT, y);
            canvas.text(&label, at, SIZE, FAINT_INK, Anchor::Right)?;
        }
        let corners = [(left, top), (right, top), (right, bottom), (left, bottom), (left, top)];
        canvas.line(corners.to_vec(), EDGE.to_rgba(), UNIT)?;
        let middle = ((left + right) / 2, bottom + 28 * UNIT);
        canvas.text(across, middle, SIZE, INK, Anchor::Top)?;
        canvas.text(up, (14 * UNIT, top - 14 * UNIT), SIZE, INK, Anchor::Left)
    }

    fn band(&self, canvas: &Canvas<'_>, band: &Band) -> Result<(), PictureError> {
        let low = band.points.iter().filter_map(|[at, low, _]| self.pixel([*at, *low]));
        let high = band.points.iter().rev().filter_map(|[at, _, high]| self.pixel([*at, *high]));
        canvas.area(low.chain(high).collect(), EDGE.mix(0.3))
    }

    fn curve(&self, canvas: &Canvas<'_>, curve: &Curve) -> Result<(), PictureError> {
        let colour = curve.tint.colour();
        match curve.mark {
            Mark::Dots => {
                for at in curve.points.iter().filter_map(|point| self.pixel(*point)) {
                    canvas.dot(at, DOT, colour.mix(0.6))?;
                }
            }
            Mark::Bars(width) => {
                let bar = |[at, up]: [f64; 2]| {
                    let (left, top) = self.pixel([at - 0.5 * width, up])?;
                    let (right, bottom) = self.pixel([at + 0.5 * width, 0.0])?;
                    Some(Rect { left, top, right: right - UNIT, bottom })
                };
                for rect in curve.points.iter().filter_map(|point| bar(*point)) {
                    canvas.cover(rect, colour.mix(0.45))?;
                }
            }
            Mark::Line | Mark::Dashes => {
                for piece in curve.points.split(|point| self.pixel(*point).is_none()) {
                    let line: Vec<Pixel> =
                        piece.iter().filter_map(|point| self.pixel(*point)).collect();
                    stroke(canvas, curve.mark, line, colour)?;
                }
            }
        }
        Ok(())
    }
}

/// Radius of a dot.
const DOT: i32 = 3 * UNIT;

fn stroke(
    canvas: &Canvas<'_>,
    mark: Mark,
    line: Vec<Pixel>,
    colour: RGBColor,
) -> Result<(), PictureError> {
    match mark {
        Mark::Dashes => canvas.dashes(line, colour.to_rgba(), 2 * UNIT),
        _ => canvas.line(line, colour.to_rgba(), 2 * UNIT),
    }
}

fn legend(canvas: &Canvas<'_>, graph: &Graph) -> Result<(), PictureError> {
    /// Maximum number of lines; there is no room for more.
    const MOST: usize = 32;
    let left = LEGEND.left;
    let right = LEGEND.left + 30 * UNIT;
    let mut y = LEGEND.top + 8 * UNIT;
    let name = |name: &str, y: i32| {
        let at = (right + 8 * UNIT, y);
        canvas.text(&shortened(name), at, SIZE, INK, Anchor::Left)
    };
    for band in &graph.bands {
        let rect = Rect { left, top: y - 6 * UNIT, right, bottom: y + 6 * UNIT };
        canvas.cover(rect, EDGE.mix(0.3))?;
        name(&band.name, y)?;
        y += 22 * UNIT;
    }
    for curve in graph.curves.iter().filter(|curve| !curve.name.is_empty()).take(MOST) {
        let colour = curve.tint.colour();
        match curve.mark {
            Mark::Dots => canvas.dot(((left + right) / 2, y), DOT, colour.mix(0.6))?,
            Mark::Bars(_) => {
                let rect = Rect { left, top: y - 6 * UNIT, right, bottom: y + 6 * UNIT };
                canvas.cover(rect, colour.mix(0.45))?;
            }
            mark => stroke(canvas, mark, vec![(left, y), (right, y)], colour)?,
        }
        name(&curve.name, y)?;
        y += 22 * UNIT;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::picture::graph_svg;

    #[test]
    fn ticks_are_round_and_within() {
        let ruler = Ruler::new(Scale::Linear, [0.12, 0.47].into_iter());
        let ticks = ruler.ticks();
        assert!(ticks.len() >= 5, "{ticks:?}");
        assert!(ticks.iter().all(|(value, _)| ruler.share(*value).is_some()));
        assert!(ticks.iter().any(|(_, text)| text == "0.30"), "{ticks:?}");
        let texts = |low: f64, high: f64| -> Vec<String> {
            decades(low.log10(), high.log10()).into_iter().map(|(_, text)| text).collect()
        };
        assert_eq!(texts(0.04, 6.0), ["0.05", "0.1", "0.2", "0.5", "1", "2", "5"]);
        assert_eq!(texts(1e-3, 1e3).len(), 7);
        let zero = Ruler::new(Scale::FromZero, [3.0, 9.0].into_iter());
        assert_eq!(zero.share(0.0), Some(0.0));
        assert_eq!(Ruler::new(Scale::Logarithmic, [1.0, 10.0].into_iter()).share(-1.0), None);
    }

    #[test]
    fn values_grow_to_the_right_and_upwards() {
        let plot = Plot {
            rect: PLOT,
            across: Ruler::new(Scale::Linear, [0.0, 10.0].into_iter()),
            up: Ruler::new(Scale::Logarithmic, [0.1, 10.0].into_iter()),
        };
        let [low, high] = [[0.0, 0.1], [10.0, 10.0]].map(|at| plot.pixel(at).expect("inside"));
        assert!(low.0 < high.0 && low.1 > high.1);
        let middle = plot.pixel([5.0, 1.0]).expect("inside");
        assert_eq!(middle.0, (PLOT.left + PLOT.right) / 2);
        assert_eq!(middle.1, (PLOT.top + PLOT.bottom) / 2);
    }

    #[test]
    fn what_has_no_place_divides_a_line_and_draws_nothing() {
        let curve = |points: &[[f64; 2]], mark| Curve {
            name: "<one>".to_owned(),
            points: points.to_vec(),
            mark,
            tint: Tint::Number(0),
        };
        let points = [[0.0, 1.0], [1.0, 2.0], [2.0, f64::NAN], [3.0, 2.0], [4.0, 1.0]];
        let draw = |mark| {
            let graph = Graph { curves: vec![curve(&points, mark)], ..Graph::default() };
            graph_svg(&graph).expect("drawn")
        };
        let colour = "#0072B2";
        let lines = |svg: &str| {
            let lines = svg.lines().filter(|l| l.starts_with("<polyline") && l.contains(colour));
            lines.count()
        };
        let line = draw(Mark::Line);
        // Two pieces, and the legend's.
        assert_eq!(lines(&line), 3, "{line}");
        assert!(!line.contains("NaN") && line.contains("&lt;one&gt;"));
        assert!(lines(&draw(Mark::Dashes)) > 20, "dashes");
        assert_eq!(draw(Mark::Dots).matches("<circle").count(), 5);
        assert!(graph_svg(&Graph::default()).is_ok());
    }
}
