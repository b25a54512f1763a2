use foxhunt_core::Remark;

use super::{
    super::Located,
    law::gain,
    paths::{Fit, Hypotheses, LIKELY_1D, MOST_OF_BEST, MOST_PER_HYPOTHESIS, least},
};

/// Largest offset that is looked for, in seconds, and its share of all that was recorded.
const MOST_S: f64 = 120.0;
const MOST_SHARE: f64 = 0.25;

/// Number of offsets on either side at first.
const OFFSETS: i32 = 12;

/// Rounds about the best offset, each twice as fine.
const FINER: u32 = 5;

/// Twice the logarithm of the likelihood ratio from which on the clocks differ. χ² with one
/// degree of freedom exceeds it once in 100,000; some twenty offsets are tried, and shadowing makes
/// more levels alike than neighbours show.
const DIFFER: f64 = 20.0;

/// Returns a remark if the levels fit the path of the receiver far better where it was some time
/// earlier or later.
pub(super) fn differ(located: &Located, hypotheses: &Hypotheses<'_>) -> Option<Remark> {
    let duration_s = hypotheses.duration_s;
    let at = |offset_s: f64, most: usize| hypotheses.delayed(offset_s, most);
    let step_s = (MOST_SHARE * duration_s).min(MOST_S) / f64::from(OFFSETS);
    let offsets = (-OFFSETS..=OFFSETS).map(|number| f64::from(number) * step_s);
    let coarse: Vec<Fit<f64>> =
        offsets.filter_map(|offset_s| at(offset_s, MOST_PER_HYPOTHESIS)).collect();
    let now = coarse.iter().find(|own| own.hypothesis.abs() <= 0.0)?;
    let best = least(&coarse)?;
    if gain(&best.residuals, &now.residuals, best.sigma_db).1 < DIFFER {
        return None;
    }
    // By more levels from here on.
    let finely = |offset_s: f64| at(offset_s, MOST_OF_BEST);
    let about = [-1.0, -0.5, 0.0, 0.5, 1.0].map(|share| best.hypothesis + share * step_s);
    let mut tried: Vec<Fit<f64>> = about.into_iter().filter_map(finely).collect();
    let mut finer_s = 0.25 * step_s;
    for _ in 0..FINER {
        let about_s = least(&tried)?.hypothesis;
        tried.extend([-1.0, 1.0].iter().filter_map(|side| finely(about_s + side * finer_s)));
        finer_s *= 0.5;
    }
    let best = least(&tried)?;
    let best_s = best.hypothesis;
    let likely = tried
        .iter()
        .filter(|own| gain(&best.residuals, &own.residuals, best.sigma_db).1 < LIKELY_1D);
    let [from_s, to_s] = likely.fold([best_s, best_s], |[from, to], own| {
        [from.min(own.hypothesis), to.max(own.hypothesis)]
    });
    let apart_m = (best.place - located.estimate.mean).norm();
    Some(Remark::new(
        "clocks-differ",
        format!(
            "the levels fit the receiver's path far better where it was {:.1} s {} ({from_s:.1} to \
             {to_s:.1} s): the clocks of levels and places seem to differ; add {best_s:.1} to \
             --clock-offset-s (0 unless given), which would move the place by some {apart_m:.0} m",
            best_s.abs(),
            if best_s > 0.0 { "later" } else { "earlier" },
        ),
    ))
}
