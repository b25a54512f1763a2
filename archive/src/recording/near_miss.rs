/// Least Jaro similarity of two names, from 0 to 1, for one to be suggested for the other.
const ALIKE: f64 = 0.8;

/// The known name that a wrong one is most like, if there is one.
pub(crate) fn near_miss<'k>(
    wrong: &str,
    known: impl IntoIterator<Item = &'k str>,
) -> Option<&'k str> {
    let alike = |name: &'k str| (strsim::jaro(&name.to_lowercase(), &wrong.to_lowercase()), name);
    let scored = known.into_iter().map(alike).filter(|(score, _)| *score >= ALIKE);
    let best = scored.reduce(|best, next| if next.0 > best.0 { next } else { best });
    best.map(|(_, name)| name)
}

/// The known name that a name of a stranger's own is but a typing error away from: a letter or two
/// too many, too few, wrong or exchanged.
pub(crate) fn typing_error<'k>(
    name: &str,
    known: impl IntoIterator<Item = &'k str>,
) -> Option<&'k str> {
    let lower = name.to_lowercase();
    let far = |known: &str| strsim::osa_distance(&lower, known);
    let near = |known: &&str| far(known) * LETTERS_PER_ERROR <= known.len();
    known.into_iter().filter(near).min_by_key(|known| far(known))
}

/// Letters of a name to each error of typing in it, at least.
const LETTERS_PER_ERROR: usize = 6;

/// The end of a message about a wrong name: a question, or empty if no known name is like it.
pub(crate) fn did_you_mean<'k>(wrong: &str, known: impl IntoIterator<Item = &'k str>) -> String {
    let question = |name| format!("; did you mean {name:?}?");
    near_miss(wrong, known).map_or_else(String::new, question)
}

/// The end of a message about a missing name: asks if `found`, a name in the file, is a slip for
/// it; empty without `found`.
pub(crate) fn slip_for(found: Option<&str>, missing: &str) -> String {
    found.map_or_else(String::new, |found| format!("; is {found:?} meant to be {missing:?}?"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slips_find_the_name_that_was_meant() {
        let known = ["rss_dbm", "rss_db", "lat_deg", "lon_deg", "bearing_deg_compass"];
        for (wrong, meant) in [
            ("rss_dmb", Some("rss_dbm")),
            ("LAT_DEG", Some("lat_deg")),
            ("bearing_compass", Some("bearing_deg_compass")),
            ("n", None),
            ("quality", None),
        ] {
            assert_eq!(near_miss(wrong, known), meant, "{wrong}");
        }
        for (wrong, meant) in [
            ("bearing_sigm_deg", Some("bearing_sigma_deg")),
            ("Bearing_simga_deg", Some("bearing_sigma_deg")),
            ("bearing_quality", None),
            ("range_km", None),
            ("east", None),
        ] {
            let known = ["bearing_sigma_deg", "range_sigma_m", "east_m"];
            assert_eq!(typing_error(wrong, known), meant, "{wrong}");
        }
        assert_eq!(did_you_mean("lat", ["lat_deg"]), "; did you mean \"lat_deg\"?");
        assert_eq!(did_you_mean("x", known), "");
        assert_eq!(slip_for(Some("lat"), "lat_deg"), "; is \"lat\" meant to be \"lat_deg\"?");
        assert_eq!(slip_for(None, "lat_deg"), "");
    }
}
