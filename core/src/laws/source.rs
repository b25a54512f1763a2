use crate::{BeaconId, PatternSource};

/// A pattern source's laws over one turn. `advance` lets a little time pass; the turn must
/// complete within `polls` of them.
///
/// # Panics
///
/// On a breach.
pub fn pattern_source(
    source: &mut impl PatternSource,
    beacon: BeaconId,
    polls: usize,
    mut advance: impl FnMut(),
) {
    match source.poll() {
        Ok(lent) => assert!(lent.is_none(), "a source that was not asked lent a sweep"),
        Err(error) => panic!("a source that was not asked failed: {error}"),
    }
    if let Err(error) = source.begin(beacon) {
        panic!("the turn did not begin: {error}");
    }
    for _ in 0..polls {
        advance();
        match source.poll() {
            Err(error) => panic!("the turn failed: {error}"),
            Ok(None) => {}
            Ok(Some(sweep)) => {
                assert_eq!(sweep.beacon, beacon, "the sweep is of another beacon");
                assert!(sweep.receiver.is_finite(), "the receiver's pose is not finite");
                let mut before = f64::NEG_INFINITY;
                for sample in sweep.samples {
                    assert!(sample.time >= before, "time ran back to {} s", sample.time);
                    before = sample.time;
                    assert!(sample.position < sweep.positions, "position {}", sample.position);
                    assert!(sample.boresight.is_finite() && sample.rss_dbm.is_finite());
                }
                for unheard in sweep.unheard {
                    assert!(unheard.position < sweep.positions, "position {}", unheard.position);
                    assert!(unheard.boresight.is_finite(), "boresight {}", unheard.boresight);
                }
                assert!(sweep.time >= before, "the turn ended before its last sample");
                return;
            }
        }
    }
    panic!("the turn did not end within {polls} polls");
}
