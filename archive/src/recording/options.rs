use std::collections::BTreeMap;

use foxhunt_wire::geodesy::LocalFrame;

use super::{Column, Mapping, North, Value};

/// How a recording is to be read. The default recognises the format by the header, puts the
/// frame's origin at the first usable position and overrides nothing.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ReadOptions {
    /// The format, instead of recognising it.
    pub format: Option<Mapping>,
    /// The local frame. A file in local metres is taken to be in it.
    pub frame: Option<LocalFrame>,
    /// What angles are counted from, instead of what the format has.
    pub north: Option<North>,
    /// The day of magnetic North in recordings without `time_utc`: any of its seconds since 1970.
    pub date_s: Option<f64>,
    /// Values that every row has, whatever the file or its mapping holds.
    pub constants: BTreeMap<Column, Value>,
}

impl ReadOptions {
    /// Sets the format.
    #[must_use]
    pub fn with_format(mut self, format: Mapping) -> Self {
        self.format = Some(format);
        self
    }

    /// Sets the local frame.
    #[must_use]
    pub fn with_frame(mut self, frame: LocalFrame) -> Self {
        self.frame = Some(frame);
        self
    }

    /// Sets what angles are counted from.
    #[must_use]
    pub fn with_north(mut self, north: North) -> Self {
        self.north = Some(north);
        self
    }

    /// Sets the day of magnetic North, by any of its seconds since 1970.
    #[must_use]
    pub fn with_date(mut self, unix_s: f64) -> Self {
        self.date_s = Some(unix_s);
        self
    }

    /// Sets one value for every row.
    #[must_use]
    pub fn with_constant(mut self, column: Column, value: impl Into<Value>) -> Self {
        self.constants.insert(column, value.into());
        self
    }
}
