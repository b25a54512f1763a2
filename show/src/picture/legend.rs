use plotters::style::Color;

use super::{
    canvas::{
        Anchor, BELIEF, CLOUD, Canvas, FAINT_INK, INK, LEGEND, PLOT, PictureError, UNIT,
        drone_colour,
    },
    chart::{CLOUD_DOT, COURSE_WIDTH, PATH_WIDTH, shortened},
    frame::Pixel,
    scene::{Scene, Search},
};
use foxhunt_hunt::log::LogHeader;

/// Maximum numbers of drones and of beacons: the legend has no room for more.
const MOST_DRONES: usize = 8;
const MOST_BEACONS: usize = 6;

const SIZE: i32 = 13 * UNIT;
const ROW: i32 = 22 * UNIT;

/// Writes the title above the field, and beside it what the marks mean and what was found.
pub(super) fn draw(
    canvas: &Canvas<'_>,
    header: &LogHeader,
    scene: &Scene,
) -> Result<(), PictureError> {
    let title = format!(
        "{} · {} · seed {}",
        shortened(&header.scenario),
        shortened(&header.estimator_name),
        header.seed
    );
    let at = (PLOT.left, 20 * UNIT);
    canvas.text(&title, at, 18 * UNIT, INK, Anchor::Left)?;
    let mut rows = Rows { canvas, y: LEGEND.top + ROW / 2 };
    marks(&mut rows, scene)?;
    for search in scene.searches.iter().take(MOST_BEACONS) {
        found(&mut rows, search)?;
    }
    match scene.searches.len().saturating_sub(MOST_BEACONS) {
        0 => Ok(()),
        more => rows.text(&format!("and {more} more beacons")),
    }
}

/// Writes one row below the other.
struct Rows<'a, 'b> {
    canvas: &'a Canvas<'b>,
    y: i32,
}

impl Rows<'_, '_> {
    /// A mark, drawn about the pixel that it is given, and what it means.
    fn mark(
        &mut self,
        meaning: &str,
        mark: impl FnOnce(&Canvas<'_>, Pixel) -> Result<(), PictureError>,
    ) -> Result<(), PictureError> {
        mark(self.canvas, (LEGEND.left + 14 * UNIT, self.y))?;
        let at = (LEGEND.left + 36 * UNIT, self.y);
        self.canvas.text(meaning, at, SIZE, INK, Anchor::Left)?;
        self.y += ROW;
        Ok(())
    }

    fn text(&mut self, text: &str) -> Result<(), PictureError> {
        let at = (LEGEND.left, self.y);
        self.canvas.text(text, at, SIZE, FAINT_INK, Anchor::Left)?;
        self.y += ROW * 9 / 10;
        Ok(())
    }

    fn heading(&mut self, text: &str) -> Result<(), PictureError> {
        self.y += ROW / 2;
        let at = (LEGEND.left, self.y);
        self.canvas.text(text, at, 14 * UNIT, INK, Anchor::Left)?;
        self.y += ROW;
        Ok(())
    }
}

fn marks(rows: &mut Rows<'_, '_>, scene: &Scene) -> Result<(), PictureError> {
    const HALF: i32 = 12 * UNIT;
    let ends = |(x, y): Pixel| [(x - HALF, y), (x + HALF, y)];
    for drone in scene.drones.keys().take(MOST_DRONES) {
        let colour = drone_colour(*drone);
        // People count from one.
        let meaning = format!("drone {} listened here", drone.saturating_add(1));
        rows.mark(&meaning, |canvas, at| {
            canvas.line(ends(at).to_vec(), colour.mix(0.2), PATH_WIDTH)?;
            canvas.dot(at, 4 * UNIT, colour.mix(0.9))
        })?;
    }
    match scene.drones.len().saturating_sub(MOST_DRONES) {
        0 => {}
        more => rows.text(&format!("and {more} more drones"))?,
    }
    let grey = FAINT_INK;
    rows.mark("bearing", |canvas, at| canvas.line(ends(at).to_vec(), grey.mix(0.6), 5))?;
    rows.mark("bearing, not used", |canvas, at| {
        canvas.dashes(ends(at).to_vec(), grey.mix(0.6), 5)
    })?;
    rows.mark("estimate, step by step", |canvas, at| {
        canvas.line(ends(at).to_vec(), BELIEF.mix(0.7), 5)?;
        ends(at).into_iter().try_for_each(|end| canvas.dot(end, 9, BELIEF.mix(0.8)))
    })?;
    rows.mark("last estimate, 95 % ellipse", |canvas, at| {
        let corner = |i: u32| {
            let (sin, cos) = libm::sincos(std::f64::consts::TAU * f64::from(i) / 40.0);
            let reach = |radius: i32, share: f64| super::frame::whole(f64::from(radius) * share);
            (at.0 + reach(HALF, cos), at.1 + reach(8 * UNIT, sin))
        };
        let outline: Vec<Pixel> = (0..=40).map(corner).collect();
        canvas.area(outline.clone(), BELIEF.mix(0.10))?;
        canvas.line(outline, BELIEF.to_rgba(), 6)?;
        canvas.dot(at, 4 * UNIT, BELIEF.to_rgba())
    })?;
    if scene.searches.iter().any(|search| !search.cloud.is_empty()) {
        rows.mark("belief in the end, its cloud", |canvas, at| {
            let places = [(-9, 2), (-4, -4), (0, 3), (3, -1), (6, 4), (10, -3)];
            places.into_iter().try_for_each(|(x, y)| {
                let place = (at.0 + x * UNIT, at.1 + y * UNIT);
                canvas.dot(place, CLOUD_DOT, CLOUD.mix(0.45))
            })
        })?;
    }
    if !scene.courses.is_empty() {
        rows.mark("where the beacon went", |canvas, at| {
            canvas.line(ends(at).to_vec(), INK.mix(0.45), COURSE_WIDTH)
        })?;
    }
    if !scene.beacons.is_empty() {
        let truly = if scene.courses.is_empty() { "where it truly is" } else { "truly in the end" };
        rows.mark(&format!("beacon, {truly}"), |canvas, at| {
            canvas.star(at, 9 * UNIT, INK.to_rgba())
        })?;
    }
    Ok(())
}

fn found(rows: &mut Rows<'_, '_>, search: &Search) -> Result<(), PictureError> {
    rows.heading(&shortened(&search.name))?;
    match &search.fix {
        Some(fix) => rows.text(&format!("{}, {} steps", fix.outcome, fix.steps))?,
        None => rows.text("the search was broken off")?,
    }
    let Some(estimate) = &search.estimate else { return Ok(()) };
    let mean = &estimate.mean;
    let place = format!("east {:.2} m, north {:.2} m", mean.x, mean.y).replace('-', "\u{2212}");
    rows.text(&place)?;
    if let Some(ellipse) = estimate.ellipse(0.95) {
        rows.text(&format!(
            "95 % ellipse ±{:.2} m, ±{:.2} m",
            ellipse.semi_major, ellipse.semi_minor
        ))?;
    }
    match search.truth {
        Some(truth) => rows.text(&format!("{:.2} m off", (estimate.mean - truth).norm())),
        None => Ok(()),
    }
}
