//! Conditions that have to hold before a flight, and who watches them.

use foxhunt::fly::{Check, CheckState};

use crate::table::list;

/// The checklist as a table, and the number of its checks that do not hold. A finding that several
/// drones share stands there once.
pub(super) fn checklist(checks: &[Check]) -> String {
    let mut lines: Vec<(&Check, Vec<&str>)> = Vec::new();
    for check in checks {
        let is_same = |(line, _): &&mut (&Check, Vec<&str>)| {
            line.finding == check.finding
                && line.state == check.state
                && line.drone.is_some() == check.drone.is_some()
        };
        match lines.iter_mut().find(is_same) {
            Some((_, drones)) => drones.extend(check.drone.as_deref()),
            None => lines.push((check, check.drone.as_deref().into_iter().collect())),
        }
    }
    let mut all: Vec<&str> = checks.iter().filter_map(|check| check.drone.as_deref()).collect();
    all.sort_unstable();
    all.dedup();
    let mut rows = list(&["who", "drone", "check", "", "found", "what to do"]);
    let mut before = None;
    for (Check { state, finding, .. }, drones) in &lines {
        // Whoever watches is named once.
        let watch = finding.watch;
        let is_new = before.replace(watch) != Some(watch);
        let mark = match state {
            CheckState::Good => "ok",
            CheckState::Bad => "NO",
            CheckState::Open => "look",
        };
        rows.add_row([
            if is_new { watch.to_string() } else { String::new() },
            match drones.len() {
                0 => "-".to_owned(),
                count if count > 1 && count == all.len() => "each".to_owned(),
                _ => drones.join(", "),
            },
            finding.subject.clone(),
            mark.to_owned(),
            finding.text.clone(),
            finding.remedy.clone().unwrap_or_default(),
        ]);
    }
    let count = |state| checks.iter().filter(|check| check.state == state).count();
    let bad = count(CheckState::Bad);
    let open = count(CheckState::Open);
    format!(
        "{rows}\nWho watches it while the drones fly. {bad} not as they should be, {open} for the \
         pilot to look at."
    )
}
