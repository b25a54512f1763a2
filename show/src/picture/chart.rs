//! Maps of a hunt: its paths, bearings and beliefs with their names, and beliefs over time.

use nalgebra::Vector2;
use plotters::style::{Color, RGBAColor};

use super::{
    canvas::{
        Anchor, BELIEF, CLOUD, Canvas, EDGE, FAINT_INK, GRID, INK, PAPER, PictureError, UNIT,
        drone_colour, text_width,
    },
    frame::{Extent, Frame, Pixel, Rect, whole},
    scene::{Scene, Search, drawable, outline},
};
use crate::overview::{Believed, SearchOverview};

/// Draws the field: the grid, then what was measured, then what is believed, then what is true.
pub(super) fn draw(canvas: &Canvas<'_>, frame: &Frame, scene: &Scene) -> Result<(), PictureError> {
    grid(canvas, frame)?;
    paths(canvas, frame, scene)?;
    rays(canvas, frame, scene)?;
    places(canvas, frame, scene)?;
    for search in &scene.searches {
        cloud(canvas, frame, search)?;
    }
    for course in &scene.courses {
        clipped(canvas, frame, course, INK.mix(0.45), COURSE_WIDTH)?;
    }
    for search in &scene.searches {
        belief(canvas, frame, search)?;
    }
    // The last estimates are smaller than the stars and lie on them: so both are visible.
    for (_, truth) in &scene.beacons {
        canvas.star(frame.pixel(truth), 10 * UNIT, INK.to_rgba())?;
    }
    for estimate in scene.searches.iter().filter_map(|search| search.estimate) {
        let at = frame.pixel(&estimate.mean);
        canvas.dot(at, 5 * UNIT, PAPER.to_rgba())?;
        canvas.dot(at, 4 * UNIT, BELIEF.to_rgba())?;
    }
    names(canvas, frame, scene)
}

/// The lines of the grid, with their metres.
fn grid(canvas: &Canvas<'_>, frame: &Frame) -> Result<(), PictureError> {
    const SIZE: i32 = 13 * UNIT;
    let rect = frame.rect();
    let ([east, north], decimals) = frame.grid();
    let colour = GRID.to_rgba();
    let label = |metres: f64| {
        // A zero that rounding left below zero is no minus zero.
        let metres = if metres.abs() < 1e-9 { 0.0 } else { metres };
        format!("{metres:.decimals$}").replace('-', "\u{2212}")
    };
    for metres in east {
        let x = frame.pixel(&Vector2::new(metres, 0.0)).0;
        canvas.line(vec![(x, rect.top), (x, rect.bottom)], colour, UNIT)?;
        let at = (x, rect.bottom + 7 * UNIT);
        canvas.text(&label(metres), at, SIZE, FAINT_INK, Anchor::Top)?;
    }
    for metres in north {
        let y = frame.pixel(&Vector2::new(0.0, metres)).1;
        canvas.line(vec![(rect.left, y), (rect.right, y)], colour, UNIT)?;
        let at = (rect.left - 8 * UNIT, y);
        canvas.text(&label(metres), at, SIZE, FAINT_INK, Anchor::Right)?;
    }
    let corners = [
        (rect.left, rect.top),
        (rect.right, rect.top),
        (rect.right, rect.bottom),
        (rect.left, rect.bottom),
        (rect.left, rect.top),
    ];
    canvas.line(corners.to_vec(), EDGE.to_rgba(), UNIT)?;
    let middle = (rect.left + rect.right) / 2;
    let below = rect.bottom + 28 * UNIT;
    canvas.text("East in metres", (middle, below), SIZE, INK, Anchor::Top)?;
    let above = (rect.left - 50 * UNIT, rect.top - 14 * UNIT);
    canvas.text("North in metres", above, SIZE, INK, Anchor::Left)
}

/// Length of drawn bearings, as a share of the field: the estimates show what is at their ends.
const RAY_SHARE: f64 = 0.16;

fn rays(canvas: &Canvas<'_>, frame: &Frame, scene: &Scene) -> Result<(), PictureError> {
    let (low, high) = frame.corners();
    let length = (high - low).norm() * RAY_SHARE;
    for ray in &scene.rays {
        let Some((from, to)) = frame.clip(&ray.from, &ray.end(length)) else { continue };
        let ends = [frame.pixel(&from), frame.pixel(&to)];
        let colour = drone_colour(ray.drone);
        if ray.fused {
            canvas.line(ends.to_vec(), colour.mix(0.55), 4)?;
        } else {
            canvas.dashes(ends.to_vec(), colour.mix(0.4), 4)?;
        }
    }
    Ok(())
}

/// Paths are broad and pale, bearings narrow: so they differ.
pub(super) const PATH_WIDTH: i32 = 5 * UNIT;

fn paths(canvas: &Canvas<'_>, frame: &Frame, scene: &Scene) -> Result<(), PictureError> {
    for (drone, places) in &scene.drones {
        let points = pixels(frame, places);
        canvas.line(points, drone_colour(*drone).mix(0.2), PATH_WIDTH)?;
    }
    Ok(())
}

fn places(canvas: &Canvas<'_>, frame: &Frame, scene: &Scene) -> Result<(), PictureError> {
    for (drone, places) in &scene.drones {
        for at in pixels(frame, places) {
            canvas.dot(at, 5 * UNIT, PAPER.to_rgba())?;
            canvas.dot(at, 4 * UNIT, drone_colour(*drone).mix(0.9))?;
        }
    }
    Ok(())
}

/// Width of the drawn way of a beacon that moves.
pub(super) const COURSE_WIDTH: i32 = 2 * UNIT;

/// Radius of a drawn place of a cloud.
pub(super) const CLOUD_DOT: i32 = 2 * UNIT;

fn cloud(canvas: &Canvas<'_>, frame: &Frame, search: &Search) -> Result<(), PictureError> {
    let (low, high) = frame.corners();
    let shown = |place: &&Vector2<f64>| **place >= low && **place <= high;
    for place in search.cloud.iter().filter(shown) {
        canvas.dot(frame.pixel(place), CLOUD_DOT, CLOUD.mix(0.45))?;
    }
    Ok(())
}

fn belief(canvas: &Canvas<'_>, frame: &Frame, search: &Search) -> Result<(), PictureError> {
    let colour = BELIEF;
    if let Some(outline) = search.outline() {
        let inside: Vec<_> = {
            let (low, high) = frame.corners();
            outline.iter().map(|place| place.sup(&low).inf(&high)).collect()
        };
        canvas.area(pixels(frame, &inside), colour.mix(0.10))?;
        clipped(canvas, frame, &outline, colour.to_rgba(), 7)?;
    }
    canvas.line(pixels(frame, &search.track), colour.mix(0.7), 5)?;
    for at in pixels(frame, &search.track) {
        canvas.dot(at, 9, colour.mix(0.8))?;
    }
    Ok(())
}

/// Draws the parts of a line that lie within the field, each in one piece.
fn clipped(
    canvas: &Canvas<'_>,
    frame: &Frame,
    line: &[Vector2<f64>],
    colour: RGBAColor,
    width: i32,
) -> Result<(), PictureError> {
    let mut piece: Vec<Pixel> = Vec::new();
    for ends in line.windows(2) {
        let [from, to] = ends else { continue };
        let Some((from, to)) = frame.clip(from, to) else { continue };
        let from = frame.pixel(&from);
        let to = frame.pixel(&to);
        if piece.last() != Some(&from) {
            canvas.line(std::mem::take(&mut piece), colour, width)?;
            piece.push(from);
        }
        piece.push(to);
    }
    canvas.line(piece, colour, width)
}

/// Writes each beacon's name beside it, or beside its estimate where its place is not known.
fn names(canvas: &Canvas<'_>, frame: &Frame, scene: &Scene) -> Result<(), PictureError> {
    const SIZE: i32 = 14 * UNIT;
    let tracks = scene.searches.iter().map(|search| &search.track);
    let outlines: Vec<_> = scene.searches.iter().filter_map(Search::outline).collect();
    let stars: Vec<_> = scene.beacons.iter().map(|(_, truth)| *truth).collect();
    let places = scene.drones.values().chain(tracks).chain(&outlines).chain([&stars]);
    let points = places.flat_map(|places| pixels(frame, places)).collect();
    let mut labels = Labels::new(frame.rect(), points);

    let unknown = scene.searches.iter().filter(|search| search.truth.is_none());
    let believed = unknown.filter_map(|s| Some((&s.name, s.estimate?.mean)));
    let named = scene.beacons.iter().map(|(name, truth)| (name, *truth)).chain(believed);
    for (name, place) in named {
        let name = shortened(name);
        let height = whole(1.25 * f64::from(SIZE));
        let width = text_width(&name, SIZE) + 4 * UNIT;
        let rect = labels.place(frame.pixel(&place), width, height);
        canvas.cover(rect, PAPER.mix(0.75))?;
        let at = (rect.left + 2 * UNIT, (rect.top + rect.bottom) / 2);
        canvas.text(&name, at, SIZE, INK, Anchor::Left)?;
    }
    Ok(())
}

/// A name that has room beside its beacon and in the legend.
pub(super) fn shortened(name: &str) -> String {
    const MOST: usize = 22;
    if name.chars().count() <= MOST {
        return name.to_owned();
    }
    name.chars().take(MOST - 1).chain(['…']).collect()
}

fn pixels(frame: &Frame, places: &[Vector2<f64>]) -> Vec<Pixel> {
    places.iter().map(|place| frame.pixel(place)).collect()
}

/// Finds places for labels where they hide least.
#[derive(Debug)]
struct Labels {
    /// Rectangle that labels may use.
    room: Rect,
    /// Points that are better not hidden.
    points: Vec<Pixel>,
    /// Labels that are placed already.
    taken: Vec<Rect>,
}

impl Labels {
    fn new(room: Rect, points: Vec<Pixel>) -> Self {
        Self { room, points, taken: Vec::new() }
    }

    /// The rectangle for a label of this size beside `anchor`: of sixteen places about it the
    /// one that hides fewest points, and of these the nearest.
    fn place(&mut self, anchor: Pixel, width: i32, height: i32) -> Rect {
        let beside = |gap: i32| {
            let right = anchor.0 + gap;
            let left = anchor.0 - gap - width;
            let below = anchor.1 + gap;
            let above = anchor.1 - gap - height;
            let middle = anchor.0 - width / 2;
            let level = anchor.1 - height / 2;
            [
                (right, level),
                (left, level),
                (middle, above),
                (middle, below),
                (right, above),
                (right, below),
                (left, above),
                (left, below),
            ]
        };
        let rect =
            |(left, top): Pixel| Rect { left, top, right: left + width, bottom: top + height };
        let near = rect(beside(10 * UNIT)[0]);
        let places = [10, 26].into_iter().flat_map(|gap| beside(gap * UNIT)).map(rect);
        let best = places.min_by_key(|place| self.cost(place)).unwrap_or(near);
        self.taken.push(best);
        best
    }

    fn cost(&self, place: &Rect) -> usize {
        let outside = place.left < self.room.left
            || place.right > self.room.right
            || place.top < self.room.top
            || place.bottom > self.room.bottom;
        let overlaps = |other: &Rect| {
            place.left < other.right
                && other.left < place.right
                && place.top < other.bottom
                && other.top < place.bottom
        };
        let margin = 3 * UNIT;
        let hides = |point: &&Pixel| {
            (place.left - margin..place.right + margin).contains(&point.0)
                && (place.top - margin..place.bottom + margin).contains(&point.1)
        };
        let hidden = self.points.iter().filter(hides).count();
        let taken = self.taken.iter().filter(|other| overlaps(other)).count();
        hidden + 1000 * taken + 1_000_000 * usize::from(outside)
    }
}

/// Maximum number of drawn places of a cloud: more make no other picture, but a larger file.
const MOST_PLACES: usize = 250;

/// Number of moments that are shown.
const PANELS: usize = 6;

/// Number of them side by side.
const COLUMNS: usize = 3;

/// The cloud of a search at six moments from its beginning to its end, each in a frame of its own:
/// a cloud ends up a hundred times smaller than it began.
pub(super) fn draw_clouds(
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

    const ROOM: Rect = Rect { left: 0, top: 0, right: 1000, bottom: 1000 };

    #[test]
    fn labels_keep_apart_and_inside() {
        let mut labels = Labels::new(ROOM, vec![(560, 500)]);
        let first = labels.place((500, 500), 100, 40);
        assert!(first.right <= 500, "the point is to the right of it: {first:?}");
        let second = labels.place((500, 500), 100, 40);
        assert!(labels.taken.iter().filter(|r| **r == second).count() == 1);
        assert!(second.bottom <= first.top || second.top >= first.bottom || second.left >= 500);
        let cornered = labels.place((990, 5), 100, 40);
        assert!(cornered.right <= 1000 && cornered.top >= 0);
    }

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
