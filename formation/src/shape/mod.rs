mod line;
mod offsets;
mod polygon;
mod scaled;
mod shaped;

pub use line::Line;
pub use offsets::Offsets;
pub use polygon::Polygon;
pub use scaled::Scaled;
pub use shaped::{Shape, ShapeFn, shape_fn};
pub(crate) use shaped::{arrange, arrange_or_centre, number};
