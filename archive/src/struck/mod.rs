//! Receptions that were struck out by hand, in a file of JSON lines: a header, then one reception a
//! line.
//!
//! Those of a log have its numbers of drones and beacons, from 0, and the time of the reception
//! with all of its digits:
//!
//! ```json
//! {"foxhunt_struck":1}
//! {"drone":0,"beacon":1,"time":11.4899999999998}
//! ```
//!
//! Those of a recording have the name of its file, the line of the row, or of the first one of a
//! turn, and the beacon where the recording names beacons:
//!
//! ```json
//! {"foxhunt_struck":1}
//! {"file":"walk.csv","line":7}
//! {"file":"collars.csv","line":12,"beacon":"fox"}
//! ```

mod error;
mod format;
mod list;
mod logged;
mod rows;

pub use error::StruckError;
pub use format::{ReceptionId, ReceptionKey, RowId, STRUCK_VERSION};
pub use logged::Struck;
pub use rows::{StruckRows, file_names};
