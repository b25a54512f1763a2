use std::sync::Arc;

use foxhunt_core::{ConstantVelocity, Estimator, RandomWalk};
use foxhunt_sensors::{BearingOnly, DifferentialRss, RangeDifference, Stacked};

use crate::{AnyModel, AnyMotion, RecalledGrid};

/// A model, a motion or an estimator behind a pointer `P`. Its methods are compiled in this
/// package, with optimisation, and not where the pointer is made.
pub trait IntoDyn<P> {
    /// The pointer.
    fn into_dyn(self) -> P;
}

macro_rules! into_dyn {
    ($pointer:ident: $($part:ty => $kind:ty,)*) => {$(
        impl IntoDyn<$kind> for $part {
            fn into_dyn(self) -> $kind {
                $pointer::new(self)
            }
        }
    )*};
}

into_dyn! {
    Arc:
    BearingOnly => AnyModel<2, 1>,
    BearingOnly => AnyModel<4, 1>,
    DifferentialRss => AnyModel<2, 1>,
    RangeDifference => AnyModel<2, 1>,
    RangeDifference => AnyModel<4, 1>,
    Stacked<DifferentialRss, BearingOnly, 1, 1> => AnyModel<2, 2>,
    Stacked<RangeDifference, BearingOnly, 1, 1> => AnyModel<2, 2>,
    ConstantVelocity => AnyMotion<4>,
    RandomWalk<2> => AnyMotion<2>,
}

into_dyn! {
    Box:
    RecalledGrid<1> => Box<dyn Estimator<2, 1>>,
    RecalledGrid<2> => Box<dyn Estimator<2, 2>>,
}
