//! Clock of a recording of levels beside the clock of its receiver's path.

use std::collections::BTreeMap;

use foxhunt_hunt::locate::{ClockSearch, Clocks, HeardLevel};

use super::{Recording, Rover};

impl Recording {
    /// Compares the clocks of a recording and of the rover's path that it was read with, by the
    /// levels of the named beacon, or else of the beacon with most levels. `None` for a recording
    /// without places on Earth or without such levels, and for one with bearings or boresights,
    /// whose antenna turns.
    #[must_use]
    pub fn compare_clocks(
        &self,
        rover: &Rover,
        beacon: Option<&str>,
        search: &ClockSearch,
    ) -> Option<Clocks> {
        let frame = self.frame?;
        let mut beacons: BTreeMap<Option<&str>, Vec<HeardLevel>> = BTreeMap::new();
        for record in self.records() {
            if record.boresight.is_some() || record.bearing.is_some() {
                return None;
            }
            let own = record.beacon.as_deref();
            if beacon.is_some() && own != beacon {
                continue;
            }
            let Some((time_s, level_db)) = record.time.zip(record.rss_dbm) else { continue };
            beacons.entry(own).or_default().push(HeardLevel { time_s, level_db });
        }
        // The first of several with as many.
        let mut heard: Vec<HeardLevel> = Vec::new();
        for levels in beacons.into_values() {
            if levels.len() > heard.len() {
                heard = levels;
            }
        }
        if heard.is_empty() {
            return None;
        }
        heard.sort_by(|a, b| a.time_s.total_cmp(&b.time_s));
        let place = |time_s: f64| Some(frame.to_local(&rover.place(time_s)?));
        Some(search.compare(&heard, &place))
    }
}
