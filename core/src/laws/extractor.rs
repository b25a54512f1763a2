use crate::{BearingExtractor, NoReading, Sample, Sweep, angle};

/// A bearing extractor's laws on one sweep; `room` holds at least as many samples as it. Questions
/// without an answer are left out.
///
/// # Panics
///
/// On a breach, and when `room` is too small.
pub fn bearing_extractor(
    extractor: &impl BearingExtractor,
    sweep: &Sweep<'_>,
    room: &mut [Sample],
) {
    let sweep = &Sweep { unanswered: &[], ..*sweep };
    let nothing = extractor.extract(&Sweep { samples: &[], ..*sweep });
    assert_eq!(nothing, Err(NoReading::Empty), "a sweep without samples was read");
    let Ok(reading) = extractor.extract(sweep) else { return };

    // Whole decibels and whole positions, so that rounding and binning turn along.
    const LOUDER: f64 = 7.0;
    const TURNED: u16 = 3;
    let turn = core::f64::consts::TAU * f64::from(TURNED) / f64::from(sweep.positions);
    let samples = &mut room[..sweep.samples.len()];
    for (copy, sample) in samples.iter_mut().zip(sweep.samples) {
        *copy = *sample;
        copy.rss_dbm += LOUDER;
        copy.boresight = angle::wrap(sample.boresight + turn);
        copy.position = (sample.position + TURNED) % sweep.positions;
    }
    let changed = extractor.extract(&Sweep { samples, ..*sweep }).expect("as good as before");
    let rise = changed.rss_dbm - reading.rss_dbm - LOUDER;
    assert!(rise.abs() < 1e-6, "{LOUDER} dB more raised the level by {rise} dB more than that");
    match (reading.bearing, changed.bearing) {
        (Ok(before), Ok(after)) => {
            let error = angle::distance(after.angle, before.angle + turn);
            assert!(error < 1e-6, "a turned sweep's bearing is off by {error} rad");
            let change = (after.sigma - before.sigma).abs();
            assert!(change < 1e-6, "a turned sweep's σ changed by {change} rad");
            assert!(before.sigma > 0.0, "the bearing's σ is {} rad", before.sigma);
            assert!((0.0..=1.0).contains(&before.confidence), "confidence {}", before.confidence);
        }
        (Err(_), Err(_)) => {}
        (before, after) => panic!("the turned sweep has {after:?}, the other {before:?}"),
    }
}
