use foxhunt_sensors::Antenna;
use plotters::style::Color;

use super::{
    canvas::{Anchor, Canvas, PictureError, UNIT},
    frame::{Pixel, whole},
    palette,
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
    /// What is written at the top, on the left, at the bottom and on the right.
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
    canvas.text(name, at, 18 * UNIT, palette::INK, Anchor::Left)?;
    let scale =
        format!("{:.1} dBi at the outer ring, {RING_DB:.0} dB from ring to ring", lobe.gain_dbi);
    canvas.text(&scale, (48 * UNIT, 62 * UNIT), SIZE, palette::FAINT_INK, Anchor::Left)?;
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
        let over = (90.0 + angle.to_degrees()).rem_euclid(360.0);
        let (turned, elevation) = match over {
            ..=90.0 => (0.0, over),
            ..=270.0 => (std::f64::consts::PI, 180.0 - over),
            _ => (0.0, over - 360.0),
        };
        antenna.gain_dbi(lobe.azimuth + turned, elevation.to_radians()) - lobe.gain_dbi
    })
}

impl Circle<'_> {
    fn draw(
        &self,
        canvas: &Canvas<'_>,
        relative_db: impl Fn(f64) -> f64,
    ) -> Result<(), PictureError> {
        let turn = |share: &dyn Fn(f64) -> f64| -> Vec<Pixel> {
            let angle = |half: u16| f64::to_radians(0.5 * f64::from(half));
            (0..=720).map(|half| self.pixel(angle(half), share(angle(half)))).collect()
        };
        let mut below = 0.0;
        while below < RANGE_DB {
            let ring = turn(&|_| 1.0 - below / RANGE_DB);
            canvas.line(ring, palette::GRID.to_rgba(), UNIT)?;
            below += RING_DB;
        }
        for spoke in 0..6_u8 {
            let angle = f64::from(spoke) * std::f64::consts::PI / 6.0;
            let ends = [self.pixel(angle, 1.0), self.pixel(angle, -1.0)];
            canvas.line(ends.to_vec(), palette::GRID.to_rgba(), UNIT)?;
        }
        let curve = turn(&|angle| (1.0 + relative_db(angle) / RANGE_DB).clamp(0.0, 1.0));
        canvas.line(curve, palette::BELIEF.to_rgba(), 2 * UNIT)?;
        let (x, y) = self.centre;
        let gap = 12 * UNIT;
        let [top, left, bottom, right] = self.sides;
        for (text, at, anchor) in [
            (top, (x, y - RADIUS - gap - SIZE), Anchor::Top),
            (bottom, (x, y + RADIUS + gap), Anchor::Top),
            (self.title, (x, y + RADIUS + 3 * gap), Anchor::Top),
        ] {
            canvas.text(text, at, SIZE, palette::INK, anchor)?;
        }
        // Beside the circle there is no room for more than a word.
        for (text, side) in [(left, -1), (right, 1)] {
            let at = (x + side * (RADIUS - 40 * UNIT), y - 8 * UNIT);
            canvas.text(text, at, SIZE, palette::FAINT_INK, Anchor::Top)?;
        }
        Ok(())
    }

    /// The place at an angle from the top, counter-clockwise, and a share of the radius.
    fn pixel(&self, angle: f64, share: f64) -> Pixel {
        let reach = share * f64::from(RADIUS);
        (self.centre.0 - whole(reach * angle.sin()), self.centre.1 - whole(reach * angle.cos()))
    }
}
