#[cfg(feature = "batch")]
use foxhunt_core::Quantity;
#[cfg(feature = "batch")]
use foxhunt_filters::BearingWeights;

use super::{EstimatorEntry, Need, Needs};
use crate::locate::{CorrelatedShadowing, Strongest, WeightedCentroid};

/// Residual at which the paper's weights begin to fall (Lenth 1981, table 2).
#[cfg(feature = "batch")]
const C: f64 = 1.5;

/// The estimators that take all receptions at once.
pub(super) fn builtin() -> Vec<EstimatorEntry> {
    let needs = |level, bearing| Needs {
        level,
        bearing,
        others: Vec::new(),
        moving: false,
        all_at_once: true,
    };
    #[cfg_attr(not(feature = "batch"), expect(unused_mut, reason = "more follow with batch"))]
    let mut entries = vec![
        EstimatorEntry::at_once(
            "shadowing-grid",
            "all levels, and bearings where there are any, at once on a grid: an average over \
             exponents, antennas and correlations of shadowing, by their evidence",
            "Gudmundson 1991; Handcock & Stein 1993; Hoeting et al. 1999",
            needs(Need::Required, if cfg!(feature = "batch") { Need::Used } else { Need::Unused }),
            CorrelatedShadowing,
        )
        .without_outliers(),
        EstimatorEntry::at_once(
            "strongest",
            "the place of the strongest level: a baseline that needs no law of propagation",
            "",
            needs(Need::Required, Need::Unused),
            Strongest,
        ),
        EstimatorEntry::at_once(
            "weighted-centroid",
            "the mean of the receivers' places, weighed by amplitude: a baseline that needs no law \
             of propagation",
            "Blumenthal et al. 2007",
            needs(Need::Required, Need::Unused),
            WeightedCentroid,
        ),
    ];
    #[cfg(feature = "maps")]
    entries.push(EstimatorEntry::at_once(
        "field-map",
        "where the level is highest on a map of it (Gaussian process, no law of propagation)",
        "Rasmussen & Williams 2006; Handcock & Stein 1993",
        needs(Need::Required, Need::Unused),
        crate::locate::HighestOnMap,
    ));
    #[cfg(feature = "batch")]
    {
        use crate::locate::{
            ClosedForm, LeastAbsolute, Lenth, MultiStart, Multilateration, Posterior,
            RangeDifferences, RepeatedMedian,
        };
        let bearings = needs(Need::Unused, Need::Required);
        let lenth = |name: &'static str, weights, about: &'static str| {
            EstimatorEntry::at_once(name, about, "Lenth 1981", bearings.clone(), Lenth(weights))
        };
        let closed = |name: &'static str, about: &'static str, source: &'static str, form| {
            EstimatorEntry::at_once(name, about, source, bearings.clone(), form)
        };
        let others = vec![Quantity::RANGE_DIFFERENCE];
        entries.extend([
            EstimatorEntry::at_once(
                "least-absolute",
                "the log-distance law with the least absolute residuals: a baseline that takes \
                 levels for independent",
                "Koenker & Bassett 1978; Hooke & Jeeves 1961",
                needs(Need::Required, Need::Unused),
                LeastAbsolute,
            ),
            EstimatorEntry::at_once(
                "batch-multistart",
                "the most probable place from nine starts, Student's t, with its rivals",
                "Levenberg 1944; Marquardt 1963; Lange, Little & Taylor 1989",
                needs(Need::Used, Need::Used),
                MultiStart,
            ),
            EstimatorEntry::at_once(
                "bearing-grid",
                "the posterior over bearings whose σ is known up to a factor, with its regions",
                "Gelman et al. 2013",
                bearings.clone(),
                Posterior,
            )
            .without_outliers(),
            lenth(
                "lenth1981",
                BearingWeights::Even,
                "where three or more bearings meet, maximum likelihood; their σ from how they \
                 scatter",
            ),
            lenth(
                "lenth1981-huber",
                BearingWeights::Huber { c: C },
                "where bearings meet with Huber's weights: bearings that stray count less",
            ),
            lenth(
                "lenth1981-andrews",
                BearingWeights::Andrews { c: C },
                "where bearings meet with Andrews's weights: bearings that stray far do not count",
            ),
            EstimatorEntry::at_once(
                "repeated-median",
                "where four or more bearings meet by medians, whatever half of them do",
                "Siegel 1982; Lenth 1981",
                bearings.clone(),
                RepeatedMedian,
            ),
            closed(
                "pseudolinear",
                "where bearings meet by linear least squares on the distances from their lines",
                "Lingren & Gong 1978; Nardone, Lindgren & Gong 1984",
                ClosedForm::Pseudolinear,
            ),
            closed(
                "stansfield",
                "where bearings meet by linear least squares, near ones weighing more",
                "Stansfield 1947",
                ClosedForm::Stansfield,
            ),
            closed(
                "instrumental-variables",
                "where bearings meet by linear least squares without the bias towards the \
                 receivers",
                "Doğançay 2004",
                ClosedForm::InstrumentalVariables,
            ),
            EstimatorEntry::at_once(
                "multilateration",
                "least squares on ranges, measured or from levels by a known law of propagation",
                "Caffery 2000; Levenberg 1944; Marquardt 1963",
                needs(Need::Used, Need::Unused),
                Multilateration,
            )
            .without_outliers(),
            EstimatorEntry::at_once(
                "range-differences",
                "spherical intersection of range differences to a reference, then least squares",
                "Schau & Robinson 1987; Smith & Abel 1987",
                Needs { others, ..needs(Need::Unused, Need::Unused) },
                RangeDifferences,
            )
            .without_outliers(),
        ]);
    }
    entries
}
