use std::collections::BTreeMap;

use foxhunt_core::Stage;
use foxhunt_formation::{Phase, Phases};
use plotters::style::Color;

use super::{
    canvas::{Anchor, BELIEF, Canvas, EDGE, FAINT_INK, INK, PAPER, PictureError, UNIT, text_width},
    frame::{Pixel, Rect, whole},
};

const HALF_WIDTH: i32 = 82 * UNIT;
const HALF_HEIGHT: i32 = 30 * UNIT;
const SIZE: i32 = 13 * UNIT;
/// Distance of the lines of a label.
const LINE: i32 = 17 * UNIT;

/// Bend of an arrow beside another one the other way, as a share of its length.
const BESIDE: f64 = 0.3;
/// Bends of arrows around the boxes between their ends: of those to the right, and of those back,
/// which pass above them.
const AROUND: [f64; 2] = [0.294, 0.42];

/// Box of a phase; all outcomes share one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Node {
    Idle,
    Start,
    MovingSearching,
    MeasuringSearching,
    MovingFinishing,
    MeasuringFinishing,
    Finished,
}

impl Node {
    const ALL: [Self; 7] = [
        Self::Idle,
        Self::Start,
        Self::MovingSearching,
        Self::MeasuringSearching,
        Self::MovingFinishing,
        Self::MeasuringFinishing,
        Self::Finished,
    ];

    fn of(phase: Phase) -> Self {
        match phase {
            Phase::Idle => Self::Idle,
            Phase::Start => Self::Start,
            Phase::Moving(Stage::Searching) => Self::MovingSearching,
            Phase::Moving(Stage::Finishing) => Self::MovingFinishing,
            Phase::Measuring(Stage::Searching) => Self::MeasuringSearching,
            Phase::Measuring(Stage::Finishing) => Self::MeasuringFinishing,
            Phase::Finished(_) => Self::Finished,
        }
    }

    fn name(self) -> &'static str {
        match self {
            Self::Idle => "idle",
            Self::Start => "forming up",
            Self::MovingSearching => "moving, searching",
            Self::MeasuringSearching => "measuring, searching",
            Self::MovingFinishing => "moving, finishing",
            Self::MeasuringFinishing => "measuring, finishing",
            Self::Finished => "finished",
        }
    }

    /// The middle of its box.
    fn middle(self) -> Pixel {
        let (x, y) = match self {
            Self::Idle => (110, 660),
            Self::Start => (110, 380),
            Self::MovingSearching => (400, 660),
            Self::MeasuringSearching => (400, 380),
            Self::MovingFinishing => (720, 660),
            Self::MeasuringFinishing => (720, 380),
            Self::Finished => (1010, 380),
        };
        (x * UNIT, y * UNIT)
    }
}

impl Node {
    fn rect(self, margin: i32) -> Rect {
        let (x, y) = self.middle();
        Rect {
            left: x - HALF_WIDTH + margin,
            top: y - HALF_HEIGHT + margin,
            right: x + HALF_WIDTH - margin,
            bottom: y + HALF_HEIGHT - margin,
        }
    }
}

/// Arrow between two boxes, with its signals.
struct Arrow {
    ends: [Node; 2],
    /// Lines of its label.
    label: Vec<String>,
    /// Number of times that a hunt went this way; `None` without a hunt.
    taken: Option<usize>,
}

/// Draws the state machine; with the `phases` of a hunt, in their order, how often it went each
/// way.
pub(super) fn draw(
    canvas: &Canvas<'_>,
    title: &str,
    phases: Option<&[Phase]>,
) -> Result<(), PictureError> {
    canvas.text(title, (48 * UNIT, 36 * UNIT), 18 * UNIT, INK, Anchor::Left)?;
    let arrows = arrows(phases);
    for arrow in &arrows {
        arrow.draw(canvas, &arrows)?;
    }
    let mut occupied = Vec::new();
    for node in Node::ALL {
        let (x, y) = node.middle();
        occupied.push(node.rect(0));
        for (margin, colour) in [(0, EDGE), (UNIT, PAPER)] {
            canvas.cover(node.rect(margin), colour.to_rgba())?;
        }
        let at = (x, y - SIZE / 2);
        canvas.text(node.name(), at, SIZE, INK, Anchor::Top)?;
    }
    // Labels above all lines.
    arrows.iter().try_for_each(|arrow| arrow.write(canvas, &arrows, &mut occupied))
}

/// One arrow for each pair of boxes, whatever the number of signals between them.
fn arrows(phases: Option<&[Phase]>) -> Vec<Arrow> {
    let taken = |ends: [Node; 2]| {
        let mut before = Node::Idle;
        let mut count = 0;
        for phase in phases? {
            let now = Node::of(*phase);
            count += usize::from([before, now] == ends);
            before = now;
        }
        Some(count)
    };
    let mut labels: BTreeMap<[Node; 2], Vec<String>> = BTreeMap::new();
    for step in Phases::transitions() {
        let ends = [step.from, step.to].map(Node::of);
        labels.entry(ends).or_default().push(step.signal.to_string());
    }
    let arrow = |(ends, signals): ([Node; 2], Vec<String>)| {
        let taken = taken(ends);
        let mut label = signals;
        if let (Some(taken), Some(last)) = (taken, label.last_mut()) {
            last.push_str(&format!(" ({taken})"));
        }
        Arrow { ends, label, taken }
    };
    labels.into_iter().map(arrow).collect()
}

impl Arrow {
    fn colour(&self) -> plotters::style::RGBColor {
        if self.taken == Some(0) { EDGE } else { BELIEF }
    }

    /// The middle of a quadratic Bézier curve between the boxes' middles.
    fn control(&self, others: &[Self]) -> [f64; 2] {
        let [from, to] = self.middles();
        let [from_node, to_node] = self.ends;
        let back = others.iter().any(|other| other.ends == [to_node, from_node]);
        let along = [to[0] - from[0], to[1] - from[1]];
        // Another box is in the way.
        let far = along[1].abs() < 1.0 && along[0].abs() > f64::from(400 * UNIT);
        let bend = if far {
            AROUND[usize::from(to[0] < from[0])]
        } else if back {
            BESIDE
        } else {
            0.0
        };
        // Far arrows pass above the boxes, whichever way they point.
        let side = if far && to[0] < from[0] { -1.0 } else { 1.0 };
        [
            0.5 * (from[0] + to[0]) + side * bend * along[1],
            0.5 * (from[1] + to[1]) - side * bend * along[0],
        ]
    }

    fn middles(&self) -> [[f64; 2]; 2] {
        self.ends.map(|node| {
            let (x, y) = node.middle();
            [f64::from(x), f64::from(y)]
        })
    }

    /// The place at a share of the way.
    fn at(&self, control: [f64; 2], t: f64) -> [f64; 2] {
        let [from, to] = self.middles();
        [0, 1].map(|i| {
            (1.0 - t) * ((1.0 - t) * from[i] + t * control[i])
                + t * ((1.0 - t) * control[i] + t * to[i])
        })
    }

    /// The shares of the way at which the curve leaves its first box and reaches its last.
    fn outside(&self, control: [f64; 2]) -> [f64; 2] {
        let is_in = |node: Node, t: f64| {
            let [x, y] = self.at(control, t);
            let (middle_x, middle_y) = node.middle();
            (x - f64::from(middle_x)).abs() <= f64::from(HALF_WIDTH)
                && (y - f64::from(middle_y)).abs() <= f64::from(HALF_HEIGHT)
        };
        let steps = || (0..=400_u16).map(|step| f64::from(step) / 400.0);
        let [from, to] = self.ends;
        let leaves = steps().find(|t| !is_in(from, *t)).unwrap_or(0.0);
        let reaches = steps().find(|t| is_in(to, *t)).unwrap_or(1.0);
        [leaves, reaches]
    }

    fn draw(&self, canvas: &Canvas<'_>, others: &[Self]) -> Result<(), PictureError> {
        let control = self.control(others);
        let [leaves, reaches] = self.outside(control);
        let pixel = |[x, y]: [f64; 2]| (whole(x), whole(y));
        let share = |step: u16| leaves + (reaches - leaves) * f64::from(step) / 40.0;
        let points = (0..=40).map(|step| pixel(self.at(control, share(step)))).collect();
        canvas.line(points, self.colour().to_rgba(), 2 * UNIT)?;
        let [[x, y], [back_x, back_y]] = [reaches, reaches - 0.02].map(|t| self.at(control, t));
        let length = libm::hypot(x - back_x, y - back_y).max(1.0);
        let [along_x, along_y] =
            [x - back_x, y - back_y].map(|way| way / length * f64::from(10 * UNIT));
        let head = [
            [x, y],
            [x - along_x - 0.45 * along_y, y - along_y + 0.45 * along_x],
            [x - along_x + 0.45 * along_y, y - along_y - 0.45 * along_x],
        ];
        canvas.area(head.map(pixel).to_vec(), self.colour().to_rgba())
    }

    /// Writes the label where most room is left, and takes that room.
    fn write(
        &self,
        canvas: &Canvas<'_>,
        others: &[Self],
        occupied: &mut Vec<Rect>,
    ) -> Result<(), PictureError> {
        let control = self.control(others);
        let [leaves, reaches] = self.outside(control);
        let widths = self.label.iter().map(|line| text_width(line, SIZE));
        let half_width = widths.max().unwrap_or(0) / 2;
        let lines = i32::try_from(self.label.len()).unwrap_or(1);
        let half_height = LINE * lines / 2;
        let at = |percent: i32| {
            let share = f64::from(percent) / 100.0;
            let [x, y] = self.at(control, leaves + share * (reaches - leaves)).map(whole);
            Rect {
                left: x - half_width,
                top: y - half_height,
                right: x + half_width,
                bottom: y + half_height,
            }
        };
        let covered = |rect: &Rect| -> i64 { occupied.iter().map(|o| overlap(o, rect)).sum() };
        let places = [45, 40, 50, 35, 55, 30, 60, 25, 65, 20, 70].map(at);
        let Some(best) = places.into_iter().min_by_key(covered) else { return Ok(()) };
        canvas.cover(best, PAPER.mix(0.85))?;
        occupied.push(best);
        let mut top = best.top;
        for line in &self.label {
            let at = ((best.left + best.right) / 2, top + (LINE - SIZE) / 2);
            canvas.text(line, at, SIZE, FAINT_INK, Anchor::Top)?;
            top += LINE;
        }
        Ok(())
    }
}

/// The area that two rectangles share.
fn overlap(a: &Rect, b: &Rect) -> i64 {
    let width = a.right.min(b.right) - a.left.max(b.left);
    let height = a.bottom.min(b.bottom) - a.top.max(b.top);
    i64::from(width.max(0)) * i64::from(height.max(0))
}
