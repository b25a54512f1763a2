use plotters::style::Color;

use super::{
    canvas::{Anchor, Canvas, EDGE, FAINT_INK, INK, PictureError, UNIT, drone_colour},
    chart::shortened,
    frame::{Rect, whole},
};

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
const SIZE: i32 = 13 * UNIT;

/// Ratios with their intervals on a logarithmic axis, a row for each contender.
pub(super) fn draw(
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
    use super::*;
    use crate::picture::ratios_svg;

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
