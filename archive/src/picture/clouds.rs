use nalgebra::Vector2;
use plotters::style::Color;

use super::{
    canvas::{Anchor, BELIEF, Canvas, FAINT_INK, INK, PictureError, UNIT, drone_colour},
    chart::grid,
    frame::{Extent, Frame, Rect},
    scene::{drawable, outline},
};
use crate::overview::{Believed, SearchOverview};

/// Maximum number of drawn places of a cloud: more make no other picture, but a larger file.
const MOST_PLACES: usize = 250;

/// Number of moments that are shown.
const PANELS: usize = 6;

/// Number of them side by side.
const COLUMNS: usize = 3;

/// The cloud of a search at six moments from its beginning to its end, each in a frame of its own:
/// a cloud ends up a hundred times smaller than it began.
pub(super) fn draw(
    canvas: &Canvas<'_>,
    title: &str,
    search: &SearchOverview,
) -> Result<(), PictureError> {
    let at = (48 * UNIT, 22 * UNIT);
    canvas.text(title, at, 17 * UNIT, INK, Anchor::Left)?;
    let key = "dots: the cloud; red: its 95 % ellipse; star: the truth; each at a scale of its own";
    canvas.text(key, (48 * UNIT, 44 * UNIT), 12 * UNIT, FAINT_INK, Anchor::Left)?;
    let shown = moments(&search.beliefs);
    let truth = search.truth.last().map(|knot| knot.place.xy()).filter(drawable);
    for (panel, believed) in (0_i32..).zip(&shown) {
        let columns = i32::try_from(COLUMNS).unwrap_or(1);
        let column = panel % columns;
        let row = panel / columns;
        let left = (64 + column * 356) * UNIT;
        let top = (92 + row * 392) * UNIT;
        let rect = Rect { left, top, right: left + 300 * UNIT, bottom: top + 300 * UNIT };
        let mut extent = Extent::default();
        for place in believed.cloud.iter().chain(&truth).filter(|place| drawable(place)) {
            extent.add(place);
        }
        let frame = Frame::around(&extent, rect);
        let text = format!("after {} receptions, {:.0} s", believed.steps, believed.time);
        moment(canvas, &frame, believed, truth.as_ref(), &text)?;
    }
    Ok(())
}

/// The moments that are shown: the first with a cloud, the last, and others evenly between.
fn moments(beliefs: &[Believed]) -> Vec<&Believed> {
    let with_cloud: Vec<&Believed> = beliefs.iter().filter(|b| !b.cloud.is_empty()).collect();
    let Some(last) = with_cloud.len().checked_sub(1) else { return Vec::new() };
    let mut indices: Vec<usize> = (0..PANELS).map(|part| last * part / (PANELS - 1)).collect();
    indices.dedup();
    indices.into_iter().filter_map(|index| with_cloud.get(index).copied()).collect()
}

fn moment(
    canvas: &Canvas<'_>,
    frame: &Frame,
    believed: &Believed,
    truth: Option<&Vector2<f64>>,
    text: &str,
) -> Result<(), PictureError> {
    grid(canvas, frame)?;
    let (low, high) = frame.corners();
    let apart = believed.cloud.len().div_ceil(MOST_PLACES).max(1);
    let places = believed.cloud.iter().step_by(apart);
    for place in places.filter(|place| **place >= low && **place <= high) {
        canvas.dot(frame.pixel(place), UNIT, drone_colour(0).mix(0.6))?;
    }
    if let Some(outline) = outline(&believed.estimate) {
        let inside = outline.iter().map(|place| frame.pixel(&place.sup(&low).inf(&high)));
        canvas.line(inside.collect(), BELIEF.to_rgba(), 2 * UNIT)?;
    }
    if let Some(truth) = truth {
        canvas.star(frame.pixel(truth), 8 * UNIT, INK.to_rgba())?;
    }
    let rect = frame.rect();
    let above = (rect.left - 50 * UNIT, rect.top - 32 * UNIT);
    canvas.text(text, above, 13 * UNIT, INK, Anchor::Left)
}

#[cfg(test)]
mod tests {
    use foxhunt_core::Estimate;

    use super::*;
    use crate::{overview::Knot, picture::clouds_svg};

    fn believed(steps: u32, places: u16) -> Believed {
        let place = |i: u16| Vector2::new(f64::from(i), f64::from(steps));
        Believed {
            time: f64::from(steps),
            steps,
            estimate: Estimate::isotropic(Vector2::new(1.0, 2.0), 1.0),
            ellipse_95: None,
            error_m: None,
            cloud: (0..places).map(place).collect(),
        }
    }

    #[test]
    fn six_moments_from_the_first_to_the_last() {
        let mut beliefs: Vec<Believed> = (0..31).map(|step| believed(step, 10)).collect();
        beliefs.insert(0, believed(99, 0));
        let steps: Vec<u32> = moments(&beliefs).iter().map(|b| b.steps).collect();
        assert_eq!(steps, [0, 6, 12, 18, 24, 30]);
        assert_eq!(moments(&beliefs[..3]).len(), 2, "each once");
        assert!(moments(&beliefs[..1]).is_empty());

        let truth = vec![Knot { time: 0.0, place: Vector2::new(3.0, 3.0).push(0.0) }];
        let search = SearchOverview { truth, beliefs, ..SearchOverview::default() };
        let svg = clouds_svg("a search", &search).expect("drawn");
        assert_eq!(svg.matches("<circle").count(), 60);
        for text in ["a search", "after 0 receptions, 0 s", "after 30 receptions, 30 s"] {
            assert!(svg.contains(text), "{text}");
        }
    }
}
