use std::f64::consts::{FRAC_PI_2, TAU};

use foxhunt_sensors::Antenna;
use plotters::style::Color;

use crate::overview::Turn;

use super::{
    canvas::{Anchor, BELIEF, Canvas, FAINT_INK, GRID, INK, PictureError, UNIT, drone_colour},
    frame::{Pixel, whole},
};

/// Below the maximum by this much the centre is reached, in dB.
const RANGE_DB: f64 = 40.0;

/// From ring to ring, in dB.
const RING_DB: f64 = 10.0;

const RADIUS: i32 = 235 * UNIT;
const SIZE: i32 = 13 * UNIT;

/// One cut of an antenna's pattern on a circle; angle 0 is at the top and angles grow to the left.
struct Circle<'a> {
    centre: Pixel,
    title: &'a str,
    /// Texts at the top, on the left, at the bottom and on the right.
    sides: [&'a str; 4],
}

/// The two cuts through the main lobe.
pub(super) fn draw(
    canvas: &Canvas<'_>,
    name: &str,
    antenna: &dyn Antenna,
) -> Result<(), PictureError> {
    let lobe = antenna.main_lobe();
    let at = (48 * UNIT, 36 * UNIT);
    canvas.text(name, at, 18 * UNIT, INK, Anchor::Left)?;
    let scale =
        format!("{:.1} dBi at the outer ring, {RING_DB:.0} dB from ring to ring", lobe.gain_dbi);
    canvas.text(&scale, (48 * UNIT, 62 * UNIT), SIZE, FAINT_INK, Anchor::Left)?;
    let level =
        format!("azimuth, at {:.0}° of elevation, viewed from above", lobe.elevation.to_degrees());
    let across = Circle {
        centre: (290 * UNIT, 430 * UNIT),
        title: &level,
        sides: ["0°", "90° left", "180°", "90° right"],
    };
    across.draw(canvas, |angle| antenna.gain_dbi(angle, lobe.elevation) - lobe.gain_dbi)?;
    let upright = Circle {
        centre: (830 * UNIT, 430 * UNIT),
        title: "elevation, through the main lobe, viewed from the right",
        sides: ["up", "behind", "down", "ahead"],
    };
    upright.draw(canvas, |angle| {
        // From the zenith over the back: 90° before it is straight ahead.
        let over = 90.0 + angle.to_degrees();
        let (turned, elevation) = match over {
            ..=90.0 => (0.0, over),
            ..=270.0 => (std::f64::consts::PI, 180.0 - over),
            _ => (0.0, over - 360.0),
        };
        antenna.gain_dbi(lobe.azimuth + turned, elevation.to_radians()) - lobe.gain_dbi
    })
}

/// A turn of the antenna: its samples on the left, its preprocessed pattern on the right with the
/// known antenna and the bearing, viewed from above.
pub(super) fn draw_turn(
    canvas: &Canvas<'_>,
    title: &str,
    turn: &Turn,
    bearing: Option<f64>,
) -> Result<(), PictureError> {
    let at = (48 * UNIT, 36 * UNIT);
    canvas.text(title, at, 18 * UNIT, INK, Anchor::Left)?;
    let levels = turn.samples.iter().chain(&turn.smoothed).map(|[_, level]| *level);
    let most = levels.filter(|level| level.is_finite()).fold(f64::NEG_INFINITY, f64::max);
    if !most.is_finite() {
        return Ok(());
    }
    let most = most.ceil();
    let scale =
        format!("{most:.0} dBm at the outer ring, {RING_DB:.0} dB from ring to ring, North up")
            .replace('-', "\u{2212}");
    canvas.text(&scale, (48 * UNIT, 62 * UNIT), SIZE, FAINT_INK, Anchor::Left)?;
    let sides = ["N", "W", "S", "E"];
    let raw =
        Circle { centre: (290 * UNIT, 430 * UNIT), title: "samples as they were received", sides };
    let made = Circle {
        centre: (830 * UNIT, 430 * UNIT),
        title: "preprocessed; dashed: the known antenna at the bearing",
        sides,
    };
    // Boresights count from East, circles from the top.
    let pixel = |circle: &Circle<'_>, [boresight, level]: &[f64; 2]| {
        let share = (1.0 + (level - most) / RANGE_DB).clamp(0.0, 1.0);
        circle.pixel(boresight - FRAC_PI_2, share)
    };
    raw.axes(canvas)?;
    made.axes(canvas)?;
    for sample in turn.samples.iter().filter(|sample| sample.iter().all(|v| v.is_finite())) {
        canvas.dot(pixel(&raw, sample), 2 * UNIT, drone_colour(0).mix(0.5))?;
    }
    if let Some(bearing) = bearing.filter(|bearing| bearing.is_finite()) {
        for circle in [&raw, &made] {
            let ray = vec![circle.centre, circle.pixel(bearing - FRAC_PI_2, 1.0)];
            canvas.line(ray, INK.to_rgba(), UNIT)?;
        }
    }
    let closed = |points: &[[f64; 2]]| -> Vec<Pixel> {
        points.iter().chain(points.first()).map(|point| pixel(&made, point)).collect()
    };
    canvas.dashes(closed(&turn.fitted), INK.mix(0.7), UNIT)?;
    canvas.line(closed(&turn.smoothed), BELIEF.to_rgba(), 2 * UNIT)
}

impl Circle<'_> {
    fn draw(
        &self,
        canvas: &Canvas<'_>,
        relative_db: impl Fn(f64) -> f64,
    ) -> Result<(), PictureError> {
        self.axes(canvas)?;
        let share = |angle: f64| (1.0 + relative_db(angle) / RANGE_DB).clamp(0.0, 1.0);
        canvas.line(self.turn(720, &share), BELIEF.to_rgba(), 2 * UNIT)
    }

    /// A closed curve of shares of the radius over the angle, in so many `steps`.
    fn turn(&self, steps: u16, share: &dyn Fn(f64) -> f64) -> Vec<Pixel> {
        let angle = |step: u16| TAU * f64::from(step) / f64::from(steps);
        (0..=steps).map(|step| self.pixel(angle(step), share(angle(step)))).collect()
    }

    /// Rings, spokes and texts.
    fn axes(&self, canvas: &Canvas<'_>) -> Result<(), PictureError> {
        let mut below = 0.0;
        while below < RANGE_DB {
            // Steps of 3° are a ring to the eye, and a sixth of the bytes of a curve.
            let ring = self.turn(120, &|_| 1.0 - below / RANGE_DB);
            canvas.line(ring, GRID.to_rgba(), UNIT)?;
            below += RING_DB;
        }
        for spoke in 0..6_u8 {
            let angle = f64::from(spoke) * std::f64::consts::PI / 6.0;
            let ends = [self.pixel(angle, 1.0), self.pixel(angle, -1.0)];
            canvas.line(ends.to_vec(), GRID.to_rgba(), UNIT)?;
        }
        let (x, y) = self.centre;
        let gap = 12 * UNIT;
        let [top, left, bottom, right] = self.sides;
        for (text, at, anchor) in [
            (top, (x, y - RADIUS - gap - SIZE), Anchor::Top),
            (bottom, (x, y + RADIUS + gap), Anchor::Top),
            (self.title, (x, y + RADIUS + 3 * gap), Anchor::Top),
        ] {
            canvas.text(text, at, SIZE, INK, anchor)?;
        }
        // Beside the circle there is no room for more than a word.
        for (text, side) in [(left, -1), (right, 1)] {
            let at = (x + side * (RADIUS - 40 * UNIT), y - 8 * UNIT);
            canvas.text(text, at, SIZE, FAINT_INK, Anchor::Top)?;
        }
        Ok(())
    }

    /// The place at an angle from the top, counter-clockwise, and a share of the radius.
    fn pixel(&self, angle: f64, share: f64) -> Pixel {
        let reach = share * f64::from(RADIUS);
        (
            self.centre.0 - whole(reach * libm::sin(angle)),
            self.centre.1 - whole(reach * libm::cos(angle)),
        )
    }
}
