use std::str::FromStr;

use foxhunt_wire::{
    declination::declination_deg,
    geodesy::{LocalFrame, grid_convergence_deg},
};
use nalgebra::Vector3;
use serde::Deserialize;

use super::{Column, FieldProblem, RecordingError, Value, row::Reader};

/// What the angles of a recording are counted from: bearings, headings and boresights.
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize)]
#[serde(try_from = "Value")]
#[non_exhaustive]
pub enum North {
    /// True North, that of the meridian; North of the frame for places in metres.
    #[default]
    True,
    /// Where a compass points to, by the World Magnetic Model of place and day
    /// ([`foxhunt_wire::declination`]).
    Magnetic,
    /// North of the UTM grid, as on maps; North of the frame for places in metres.
    Grid,
    /// So many degrees east of true North: a declination that is known otherwise.
    Stated(f64),
}

impl TryFrom<Value> for North {
    type Error = String;

    fn try_from(value: Value) -> Result<Self, String> {
        match value {
            Value::Number(deg) if deg.abs() <= 180.0 => Ok(Self::Stated(deg)),
            Value::Text(text) if text == "true" => Ok(Self::True),
            Value::Text(text) if text == "magnetic" => Ok(Self::Magnetic),
            Value::Text(text) if text == "grid" => Ok(Self::Grid),
            value => Err(format!(
                "{value} is no North: true, magnetic, grid, or degrees east of true North from \
                 -180 to 180"
            )),
        }
    }
}

impl FromStr for North {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        text.parse().map_or_else(|_| Value::from(text), Value::Number).try_into()
    }
}

impl Reader<'_> {
    /// How far east of the frame's North the angles of this row are counted from, in degrees, for
    /// a receiver at `position` of the frame; `column` is the angle that needs it.
    pub(super) fn north_deg(
        &self,
        column: Column,
        frame: Option<LocalFrame>,
        position: Option<Vector3<f64>>,
    ) -> Result<f64, RecordingError> {
        let in_metres = self.plan.has(Column::EastM);
        let place = || match (frame, position) {
            (Some(frame), Some(position)) => Ok(frame.to_geodetic(&position)),
            _ => Err(FieldProblem::NoPlace),
        };
        // Only a time in UTC is one of a known day.
        let unix_s = if self.plan.has(Column::TimeUtc) { self.time()? } else { None };
        let turned = match self.north {
            North::True => Ok(0.0),
            North::Stated(deg) => Ok(deg),
            North::Grid if in_metres => Ok(0.0),
            North::Grid => place().map(|place| grid_convergence_deg(&place)),
            North::Magnetic => place().and_then(|place| {
                let unix_s = unix_s.or(self.date_s).ok_or(FieldProblem::NoDate)?;
                declination_deg(&place, unix_s).map_err(FieldProblem::NoDeclination)
            }),
        };
        turned.map_err(|problem| self.wrong(column, problem))
    }
}
