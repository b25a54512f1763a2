use foxhunt_core::Remark;

use super::{
    super::{
        Located,
        clocks::{Clocks, ClocksUnknown, FoundOffset},
    },
    law::gain,
    paths::{Fit, Hypotheses, MOST_OF_BEST, MOST_OFFSET_S, MOST_PER_HYPOTHESIS, MOST_SHARE, least},
};

/// Number of offsets on either side at first.
const OFFSETS: i32 = 12;

/// Rounds about the best offset, each twice as fine.
const FINER: u32 = 5;

/// χ² with one degree of freedom that a true value exceeds with 5 %.
const LIKELY_1D: f64 = 3.84;

/// Twice the logarithm of the likelihood ratio from which on the clocks differ. χ² with one
/// degree of freedom exceeds it once in 100,000; some twenty offsets are tried, and shadowing makes
/// more levels alike than neighbours show.
const DIFFER: f64 = 20.0;

/// Twice the logarithm of the likelihood ratio from which on the search for the clocks of two files
/// looks closer: it asks for more, and knows shadows.
const LOOKS_OFF: f64 = 8.0;

/// Offset at which the levels fit the receiver's path far better, as a remark, and as it may be
/// taken off where the levels show it well.
pub(super) struct Offset {
    pub remark: Remark,
    pub found: Option<FoundOffset>,
}

/// Looks whether the levels fit the path of the receiver far better where it was some time earlier
/// or later.
pub(super) fn differ(located: &Located, hypotheses: &Hypotheses<'_>) -> Option<Offset> {
    let duration_s = hypotheses.duration_s;
    let at = |offset_s: f64, most: usize| hypotheses.delayed(offset_s, most);
    let step_s = (MOST_SHARE * duration_s).min(MOST_OFFSET_S) / f64::from(OFFSETS);
    let offsets = (-OFFSETS..=OFFSETS).map(|number| f64::from(number) * step_s);
    let coarse: Vec<Fit<f64>> =
        offsets.filter_map(|offset_s| at(offset_s, MOST_PER_HYPOTHESIS)).collect();
    let now = coarse.iter().find(|own| own.hypothesis.abs() <= 0.0)?;
    let best = least(&coarse)?;
    let gained = gain(&best.residuals, &now.residuals, best.sigma_db).1;
    if gained < LOOKS_OFF {
        return None;
    }
    match hypotheses.clocks() {
        Some(Clocks::Differ(found)) => {
            let place = at(found.offset_s, MOST_OF_BEST).map_or(best.place, |own| own.place);
            let apart_m = (place - located.estimate.mean).norm();
            return Some(Offset { remark: remark(&found, apart_m), found: Some(found) });
        }
        // The levels exclude 0, which the few here may not.
        Some(Clocks::Unknown(
            why @ (ClocksUnknown::NotZero { .. } | ClocksUnknown::AtTheEnd { .. }),
        )) if gained < DIFFER => return Some(Offset::unknown(&why)),
        Some(Clocks::Agree { .. }) => return None,
        Some(Clocks::Unknown(_)) | None if gained < DIFFER => return None,
        Some(Clocks::Unknown(_)) | None => {}
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
    let offset_s = best.hypothesis;
    let likely = tried
        .iter()
        .filter(|own| gain(&best.residuals, &own.residuals, best.sigma_db).1 < LIKELY_1D);
    let interval_s = likely.fold([offset_s, offset_s], |[from, to], own| {
        [from.min(own.hypothesis), to.max(own.hypothesis)]
    });
    let apart_m = (best.place - located.estimate.mean).norm();
    Some(Offset { remark: remark(&FoundOffset { offset_s, interval_s }, apart_m), found: None })
}

/// Returns the remark on an offset that would move the place by some metres.
fn remark(offset: &FoundOffset, apart_m: f64) -> Remark {
    let text = format!(
        "{}: the clocks of levels and places seem to differ; add {:.1} to --clock-offset-s (0 \
         unless given), which would move the place by some {apart_m:.0} m",
        offset.finding(),
        offset.offset_s,
    );
    Remark::new("clocks-differ", text)
}

impl Offset {
    /// An offset that the levels do not show.
    fn unknown(why: &ClocksUnknown) -> Self {
        let text = format!(
            "{why}; the times are taken as they are. State the right offset with --clock-offset-s"
        );
        Self { remark: Remark::new("clocks-differ", text), found: None }
    }
}
