use super::EstimatorEntry;

/// Estimators that a newcomer chooses from, in the order of the list, each with when to use it.
///
/// Every estimator that a scenario, a trial or `locate` takes by itself is here, and one for each
/// kind of recording. The others are variants, baselines and forms from the literature.
const MENU: [(&str, &str); 22] = [
    (
        "default",
        "levels and bearings of a still beacon; the power and σ of the level need not be known",
    ),
    (
        "team",
        "hunts by receivers of different makes: learns what each one's levels and compass are off",
    ),
    (
        "several",
        "hunts for an unknown number of transmitters on one frequency, with the extractor \
         `maximum-likelihood-several`",
    ),
    (
        "grid",
        "levels and bearings of a still beacon, with a known power and a known σ of the level; \
         some 15 times faster than `default`",
    ),
    (
        "particle",
        "the cases of `grid`, with 5000 particles; recordings: the default of `locate` for turns \
         at fewer than three places",
    ),
    (
        "iterated-posterior-linearisation",
        "levels and bearings on a microcontroller: it allocates nothing after it has started",
    ),
    ("ukf", "the common unscented Kalman filter, to compare with"),
    ("ekf", "the common extended Kalman filter, to compare with; over-confident near a beacon"),
    ("imm", "levels and bearings of a beacon that stands and walks by turns"),
    (
        "gaussian-sum",
        "measurements that two places fit; bearings alone, in a room or from one moving receiver",
    ),
    ("particle-bearing", "bearings alone of a still beacon in a room; ignores the level"),
    ("particle-bearing-moving", "bearings alone of a moving beacon in a room; ignores the level"),
    (
        "batch",
        "a still beacon and little computing time; solves for all receptions again after each one",
    ),
    ("batch-robust", "the cases of `batch`, with outliers"),
    ("range-difference", "range differences to a reference receiver"),
    ("magnetic-dipole", "the magnetic field of an avalanche beacon"),
    ("pulses", "single pulses of a tag, in a hunt or a recording; the antenna must be known"),
    (
        "shadowing-grid",
        "recordings: the default of `locate` for levels, and for turns at three places or more",
    ),
    ("bearing-grid", "recordings: the default of `locate` for bearings alone"),
    ("multilateration", "recordings: the default for ranges alone, of Wi-Fi or ultra-wideband"),
    ("range-differences", "recordings: the default for range differences alone (--reference-m)"),
    ("ukf-pritzl2018", "the reference system's filter, to compare with"),
];

/// Adds to each entry of the menu when to use it.
pub(super) fn with_menu(entries: Vec<EstimatorEntry>) -> Vec<EstimatorEntry> {
    let with = |entry: EstimatorEntry| match MENU.iter().find(|(name, _)| entry.name == *name) {
        Some((_, when)) => entry.recommended_for(*when),
        None => entry,
    };
    entries.into_iter().map(with).collect()
}

/// Returns the place of a name in the menu; names of a user's own come last.
pub(super) fn place(name: &str) -> usize {
    MENU.iter().position(|(listed, _)| *listed == name).unwrap_or(MENU.len())
}
