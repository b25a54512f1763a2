use crate::{BeaconId, PatternSource, Sweep};

/// A pattern source's laws over one turn that listens for `beacons`. `advance` lets a little time
/// pass; the turn must complete within `polls` of them.
///
/// # Panics
///
/// On a breach.
pub fn pattern_source(
    source: &mut impl PatternSource,
    beacons: &[BeaconId],
    polls: usize,
    mut advance: impl FnMut(),
) {
    lends_nothing(source, "a source before `begin`");
    if let Err(error) = source.begin(beacons) {
        panic!("the turn did not begin: {error}");
    }
    let mut left = beacons;
    for _ in 0..polls {
        let Some((beacon, others)) = left.split_first() else { break };
        match source.poll() {
            Err(error) => panic!("the turn failed: {error}"),
            // Further sweeps need no time.
            Ok(None) => {
                assert_eq!(left.len(), beacons.len(), "the sweep of {beacon:?} came late");
                advance();
            }
            Ok(Some(sweep)) => {
                assert_eq!(sweep.beacon, *beacon, "the sweep is of another beacon");
                keeps_order(&sweep);
                left = others;
            }
        }
    }
    assert!(left.is_empty(), "the turn did not end within {polls} polls");
    lends_nothing(source, "a source whose turn is over");
    if let Err(error) = source.begin(&[]) {
        panic!("a turn for no beacon failed: {error}");
    }
    lends_nothing(source, "a source with no beacon to measure");
}

fn lends_nothing(source: &mut impl PatternSource, which: &str) {
    match source.poll() {
        Ok(lent) => assert!(lent.is_none(), "{which} lent a sweep"),
        Err(error) => panic!("{which} failed: {error}"),
    }
}

fn keeps_order(sweep: &Sweep<'_>) {
    assert!(sweep.receiver.is_finite(), "the receiver's pose is not finite");
    let mut before = f64::NEG_INFINITY;
    for sample in sweep.samples {
        assert!(sample.time >= before, "time ran back to {} s", sample.time);
        before = sample.time;
        assert!(sample.position < sweep.positions, "position {}", sample.position);
        assert!(sample.boresight.is_finite() && sample.rss_dbm.is_finite());
    }
    for unanswered in sweep.unanswered {
        assert!(unanswered.position < sweep.positions, "position {}", unanswered.position);
        assert!(unanswered.boresight.is_finite(), "boresight {}", unanswered.boresight);
    }
    assert!(sweep.time >= before, "the turn ended before its last sample");
}
