use nalgebra::Vector2;

/// A place on the canvas: right and down, in its units.
pub(super) type Pixel = (i32, i32);

/// A rectangle on the canvas.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Rect {
    pub left: i32,
    pub top: i32,
    pub right: i32,
    pub bottom: i32,
}

/// A rectangle in the field, in metres East and North; empty at first.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Extent(Option<(Vector2<f64>, Vector2<f64>)>);

impl Extent {
    /// Makes room for a place.
    pub(super) fn add(&mut self, place: &Vector2<f64>) {
        self.0 = Some(match self.0 {
            None => (*place, *place),
            Some((low, high)) => (low.inf(place), high.sup(place)),
        });
    }

    /// With this share of the longer side added on every side.
    pub(super) fn grown(&self, share: f64) -> Self {
        Self(self.0.map(|(low, high)| {
            let margin = Vector2::repeat((high - low).max() * share);
            (low - margin, high + margin)
        }))
    }

    /// The nearest place within.
    pub(super) fn clamp(&self, place: &Vector2<f64>) -> Vector2<f64> {
        self.0.map_or(*place, |(low, high)| place.sup(&low).inf(&high))
    }
}

/// Projection of the field on the canvas: a metre is as long in both directions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Frame {
    rect: Rect,
    centre: Vector2<f64>,
    /// Canvas units in a metre.
    scale: f64,
}

/// The smallest field that is drawn, in metres: below it one place would fill the picture.
const LEAST_SPAN: f64 = 4.0;

impl Frame {
    /// The frame that shows all of `extent`, with some room about it, in `rect`.
    pub(super) fn around(extent: &Extent, rect: Rect) -> Self {
        let (low, high) = extent.0.unwrap_or((Vector2::repeat(-10.0), Vector2::repeat(10.0)));
        let span = (high - low).sup(&Vector2::repeat(LEAST_SPAN)) * 1.1;
        let size = |from: i32, to: i32| f64::from(to - from);
        let scale =
            f64::min(size(rect.left, rect.right) / span.x, size(rect.top, rect.bottom) / span.y);
        Self { rect, centre: (low + high) * 0.5, scale }
    }

    /// Returns the rectangle of the field.
    pub(super) fn rect(&self) -> Rect {
        self.rect
    }

    /// Returns the pixel of a place of the field.
    pub(super) fn pixel(&self, place: &Vector2<f64>) -> Pixel {
        let offset = (place - self.centre) * self.scale;
        let middle = |a: i32, b: i32| 0.5 * (f64::from(a) + f64::from(b));
        (
            whole(middle(self.rect.left, self.rect.right) + offset.x),
            whole(middle(self.rect.top, self.rect.bottom) - offset.y),
        )
    }

    /// The corners of the field that is shown, South-West and North-East.
    pub(super) fn corners(&self) -> (Vector2<f64>, Vector2<f64>) {
        let half = Vector2::new(
            f64::from(self.rect.right - self.rect.left),
            f64::from(self.rect.bottom - self.rect.top),
        ) / (2.0 * self.scale);
        (self.centre - half, self.centre + half)
    }

    /// The part of a line that is shown (Liang & Barsky 1984).
    pub(super) fn clip(
        &self,
        from: &Vector2<f64>,
        to: &Vector2<f64>,
    ) -> Option<(Vector2<f64>, Vector2<f64>)> {
        let (low, high) = self.corners();
        let way = to - from;
        let mut enter = 0.0_f64;
        let mut leave = 1.0_f64;
        for axis in 0..2 {
            for (rate, room) in
                [(-way[axis], from[axis] - low[axis]), (way[axis], high[axis] - from[axis])]
            {
                if rate < 0.0 {
                    enter = enter.max(room / rate);
                } else if rate > 0.0 {
                    leave = leave.min(room / rate);
                } else if room < 0.0 {
                    return None;
                }
            }
        }
        (enter < leave).then(|| (from + way * enter, from + way * leave))
    }

    /// Coordinates of the grid's lines, East and North, the same distance apart on both axes, and
    /// the number of decimals that distinguish them.
    pub(super) fn grid(&self) -> ([Vec<f64>; 2], usize) {
        let (low, high) = self.corners();
        let step = round_step((high - low).max() / 9.0);
        let lines = |low: f64, high: f64| {
            let first = (low / step).ceil();
            // At most 24 even where rounding eats the step.
            (0..24)
                .map(|i| (first + f64::from(i)) * step)
                .take_while(|line| *line <= high)
                .collect()
        };
        let decimals = if step < 1.0 { 1 } else { 0 };
        ([lines(low.x, high.x), lines(low.y, high.y)], decimals)
    }
}

/// The smallest of 1, 2, 5 times a power of ten that is not below `least`.
pub(super) fn round_step(least: f64) -> f64 {
    let power = libm::pow(10.0_f64, libm::log10(least).floor());
    [1.0, 2.0, 5.0, 10.0].map(|f| f * power).into_iter().find(|s| *s >= least).unwrap_or(power)
}

/// The nearest place on the canvas.
#[expect(clippy::cast_possible_truncation, reason = "it is clamped to the range before")]
pub(super) fn whole(value: f64) -> i32 {
    value.round().clamp(-1e9, 1e9) as i32
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_abs_diff_eq;

    const RECT: Rect = Rect { left: 100, top: 0, right: 1100, bottom: 400 };

    fn frame() -> Frame {
        let mut extent = Extent::default();
        extent.add(&Vector2::new(-10.0, -5.0));
        extent.add(&Vector2::new(30.0, 5.0));
        Frame::around(&extent, RECT)
    }

    #[test]
    fn a_metre_is_as_long_in_both_directions() {
        let frame = frame();
        let (x0, y0) = frame.pixel(&Vector2::new(0.0, 0.0));
        let (x1, y1) = frame.pixel(&Vector2::new(8.0, 8.0));
        assert_eq!(x1 - x0, y0 - y1);
        assert!(x1 > x0, "East is to the right");
        for corner in [Vector2::new(-10.0, -5.0), Vector2::new(30.0, 5.0)] {
            let (x, y) = frame.pixel(&corner);
            assert!((RECT.left..RECT.right).contains(&x) && (RECT.top..RECT.bottom).contains(&y));
        }
    }

    #[test]
    fn lines_end_at_the_edge() {
        let frame = frame();
        let (low, high) = frame.corners();
        let (from, to) = frame
            .clip(&Vector2::new(0.0, 0.0), &Vector2::new(1000.0, 0.0))
            .expect("it begins inside");
        assert_eq!(from, Vector2::zeros());
        assert_abs_diff_eq!(to.x, high.x, epsilon = 1e-9);
        assert_abs_diff_eq!(to.y, 0.0, epsilon = 1e-9);
        let (from, to) = frame
            .clip(&Vector2::new(-1000.0, -1000.0), &Vector2::new(1000.0, 1000.0))
            .expect("it crosses");
        assert_abs_diff_eq!(from.y, low.y, epsilon = 1e-9);
        assert_abs_diff_eq!(to.y, high.y, epsilon = 1e-9);
        assert_eq!(frame.clip(&Vector2::new(0.0, 90.0), &Vector2::new(5.0, 90.0)), None);
        assert_eq!(frame.clip(&Vector2::new(90.0, 0.0), &Vector2::new(80.0, 90.0)), None);
    }

    #[test]
    fn the_grid_is_square_and_round() {
        let ([east, north], decimals) = frame().grid();
        assert_eq!(decimals, 0);
        assert_eq!(east, [-10.0, -5.0, 0.0, 5.0, 10.0, 15.0, 20.0, 25.0, 30.0]);
        assert_eq!(north, [-5.0, 0.0, 5.0]);
        assert_abs_diff_eq!(round_step(0.3), 0.5, epsilon = 1e-12);
        assert_abs_diff_eq!(round_step(60.0), 100.0, epsilon = 1e-12);
    }

    #[test]
    fn one_place_has_a_field_about_it() {
        let mut extent = Extent::default();
        extent.add(&Vector2::new(7.0, 7.0));
        let (low, high) = Frame::around(&extent, RECT).corners();
        assert!((high - low).min() >= LEAST_SPAN);
    }
}
