use std::collections::BTreeMap;

use foxhunt_core::parameter::{ParameterError, finite, not_negative, positive};
use foxhunt_wire::geodesy::LocalFrame;

use super::{Column, Mapping, North, Rover, TimeFormat, TimeZone, UtmZone, Value};

/// Settings for reading a recording. The default recognises the format by the header, puts the
/// frame's origin at the first usable position, overrides nothing, and leaves out rows that cannot
/// be believed ([`Recording::remarks`](super::Recording::remarks)).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ReadOptions {
    /// The format, instead of recognising it.
    pub format: Option<Mapping>,
    /// Names of the columns of a table without a header, from the first on; `-` is a column that
    /// is not read. Empty for a table whose header names them.
    pub columns: Vec<String>,
    /// The sheet of a spreadsheet; the first with more than one row unless given.
    pub sheet: Option<String>,
    /// The name of the levels that are read of an autopilot's log, such as `RADIO_STATUS.rssi`, or
    /// of the element with the level in a GPX track. Other files are then refused.
    pub level: Option<String>,
    /// The local frame. A file in local metres is taken to be in it.
    pub frame: Option<LocalFrame>,
    /// North from which angles are counted, instead of the format's.
    pub north: Option<North>,
    /// The day of magnetic North in recordings without `time_utc`: any of its seconds since 1970.
    pub date_s: Option<f64>,
    /// The way in which times are written, instead of recognising it.
    pub time_format: Option<TimeFormat>,
    /// The offset from UTC of dates that state none; UTC unless given.
    pub time_zone: TimeZone,
    /// The zone of UTM of places in metres, instead of the table's own column.
    pub utm_zone: Option<UtmZone>,
    /// Values that every row has, whatever the file or its mapping holds.
    pub constants: BTreeMap<Column, Value>,
    /// Path of the receiver over time, instead of the file's own places.
    pub rover: Option<Rover>,
    /// Seconds that are added to the file's times, to make them the rover's UTC.
    pub clock_offset_s: f64,
    /// Frequencies that are read from files with the power of many.
    pub band: Option<Band>,
    /// True if a row that cannot be believed refuses its file; otherwise the row is left out.
    pub strict: bool,
    /// True if levels are written without their sign: 71 stands for −71.
    pub negate_levels: bool,
}

/// Frequencies from which a level is read.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Band {
    pub(super) frequency_hz: f64,
    pub(super) bandwidth_hz: f64,
}

impl Band {
    /// The frequencies within half a bandwidth of the middle, both in hertz; the nearest bin if no
    /// bin is within.
    ///
    /// # Errors
    ///
    /// Names the frequency that is not positive, or the bandwidth that is negative.
    pub fn new(frequency_hz: f64, bandwidth_hz: f64) -> Result<Self, ParameterError> {
        let frequency_hz = positive("frequency_hz", frequency_hz)?;
        Ok(Self { frequency_hz, bandwidth_hz: not_negative("bandwidth_hz", bandwidth_hz)? })
    }
}

impl ReadOptions {
    /// Sets the format.
    #[must_use]
    pub fn with_format(mut self, format: Mapping) -> Self {
        self.format = Some(format);
        self
    }

    /// Names the columns of a table without a header; `-` is a column that is not read.
    #[must_use]
    pub fn with_columns<N: Into<String>>(mut self, names: impl IntoIterator<Item = N>) -> Self {
        self.columns = names.into_iter().map(Into::into).collect();
        self
    }

    /// Sets the sheet that is read of a spreadsheet.
    #[must_use]
    pub fn with_sheet(mut self, sheet: impl Into<String>) -> Self {
        self.sheet = Some(sheet.into());
        self
    }

    /// Sets the levels that are read of an autopilot's log.
    #[must_use]
    pub fn with_level(mut self, level: impl Into<String>) -> Self {
        self.level = Some(level.into());
        self
    }

    /// Sets the way in which times are written, where the cells leave it open.
    #[must_use]
    pub fn with_time_format(mut self, format: TimeFormat) -> Self {
        self.time_format = Some(format);
        self
    }

    /// Sets the offset from UTC of dates that state none.
    #[must_use]
    pub fn with_time_zone(mut self, zone: TimeZone) -> Self {
        self.time_zone = zone;
        self
    }

    /// Sets the zone of UTM that places in metres are of.
    #[must_use]
    pub fn with_utm_zone(mut self, zone: UtmZone) -> Self {
        self.utm_zone = Some(zone);
        self
    }

    /// Sets the local frame.
    #[must_use]
    pub fn with_frame(mut self, frame: LocalFrame) -> Self {
        self.frame = Some(frame);
        self
    }

    /// Sets the track along which the receiver was, and the seconds that are added to the file's
    /// times to make them UTC.
    ///
    /// # Errors
    ///
    /// Names the offset that is not finite.
    pub fn with_rover(self, rover: Rover, clock_offset_s: f64) -> Result<Self, ParameterError> {
        let clock_offset_s = finite("clock_offset_s", clock_offset_s)?;
        Ok(Self { rover: Some(rover), clock_offset_s, ..self })
    }

    /// Sets the frequencies that are read from files with the power of many.
    #[must_use]
    pub fn with_band(mut self, band: Band) -> Self {
        self.band = Some(band);
        self
    }

    /// Sets the North from which angles are counted.
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

    /// Refuses a file for its first row that cannot be believed: an unreadable cell, a receiver
    /// without a fix or that jumps, a clock that runs back, a row that is there twice.
    #[must_use]
    pub fn with_strict(mut self, strict: bool) -> Self {
        self.strict = strict;
        self
    }

    /// Reads levels that are written without their sign: 71 stands for −71.
    #[must_use]
    pub fn with_negated_levels(mut self, negate_levels: bool) -> Self {
        self.negate_levels = negate_levels;
        self
    }

    /// Sets one value for every row.
    #[must_use]
    pub fn with_constant(mut self, column: Column, value: impl Into<Value>) -> Self {
        self.constants.insert(column, value.into());
        self
    }
}
