//! Clock of a recording of levels beside the clock of its receiver's path.

use std::collections::BTreeMap;

use foxhunt_hunt::locate::{ClockSearch, Clocks, HeardLevel};

use super::{Recording, Rover};

impl Recording {
    /// Compares the clock of a recording that was read with a rover's path with that of the path,
    /// by the levels of the beacon that has most. `None` for a recording without places on Earth,
    /// or with bearings or boresights, whose levels are those of an antenna that turns.
    #[must_use]
    pub fn compare_clocks(&self, rover: &Rover, search: &ClockSearch) -> Option<Clocks> {
        let frame = self.frame?;
        let mut beacons: BTreeMap<Option<&str>, Vec<HeardLevel>> = BTreeMap::new();
        for record in self.records() {
            if record.boresight.is_some() || record.bearing.is_some() {
                return None;
            }
            let Some((time_s, level_db)) = record.time.zip(record.rss_dbm) else { continue };
            let heard = HeardLevel { time_s, level_db };
            beacons.entry(record.beacon.as_deref()).or_default().push(heard);
        }
        // The first of several with as many.
        let mut heard: Vec<HeardLevel> = Vec::new();
        for levels in beacons.into_values() {
            if levels.len() > heard.len() {
                heard = levels;
            }
        }
        heard.sort_by(|a, b| a.time_s.total_cmp(&b.time_s));
        let place = |time_s: f64| Some(frame.to_local(&rover.place(time_s)?));
        Some(search.compare(&heard, &place))
    }
}
