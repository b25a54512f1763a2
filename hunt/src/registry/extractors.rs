use foxhunt_sensors::{AntennaConfig, MaximumLikelihoodConfig, Pritzl2018};

use super::{ExtractorEntry, Recipe};
use crate::config::{ExtractorConfig, LobeConfig};

/// The extractor that is best wherever the antenna is known.
pub const RECOMMENDED_EXTRACTOR: &str = "maximum-likelihood-reflection";

/// Every extractor that has a name.
pub(super) fn builtin() -> Vec<ExtractorEntry> {
    let lobe = LobeConfig::default();
    let known = MaximumLikelihoodConfig::default;
    let named = |name: &'static str, about: &'static str, source: &'static str, config| {
        let recipe = Recipe::Settings(config);
        ExtractorEntry { name: name.into(), about: about.into(), source: source.into(), recipe }
    };
    vec![
        named(
            "pritzl2018",
            "maximum of the moving mean over 7 positions; σ is its 2 dB width",
            "Pritzl 2018, §4.1–4.2",
            ExtractorConfig::Pritzl2018(Pritzl2018::default()),
        ),
        named(
            "maximum",
            "strongest boresight; σ from the strongest twentieth",
            "Isaacs et al. 2014, §II",
            ExtractorConfig::Maximum(lobe),
        ),
        named(
            "first-harmonic",
            "vector sum of the boresights weighted with the power",
            "Mardia & Jupp 2000, §2.2",
            ExtractorConfig::FirstHarmonic(lobe),
        ),
        named(
            "first-harmonic-db",
            "the same weighted with the level in dB",
            "Mardia & Jupp 2000, §2.2",
            ExtractorConfig::FirstHarmonicDb(lobe),
        ),
        named(
            "main-lobe",
            "parabola in dB about the maximum",
            "least squares",
            ExtractorConfig::MainLobe(lobe),
        ),
        named(
            "cross-correlation",
            "correlation with the known antenna's gain in dB",
            "cited in Isaacs et al. 2014, §II",
            ExtractorConfig::CrossCorrelation(Default::default()),
        ),
        named(
            "maximum-likelihood",
            "known antenna, free level, Gaussian residuals; σ grows with misfit and its \
             correlation",
            "Mardia & Jupp 2000; Tobin 1958",
            ExtractorConfig::MaximumLikelihood(known()),
        ),
        named(
            "maximum-likelihood-t",
            "the same with residuals as Student's t with 4 degrees of freedom has them",
            "Lange, Little & Taylor 1989",
            ExtractorConfig::MaximumLikelihoodT(known()),
        ),
        named(
            RECOMMENDED_EXTRACTOR,
            "the same with one reflection of unknown direction, strength and phase integrated out",
            "Laplace 1774; Rice 1945; Marquardt 1963",
            ExtractorConfig::MaximumLikelihoodReflection(known()),
        ),
        named(
            "maximum-likelihood-several",
            "Gaussian residuals about the sum of up to four transmitters on one frequency",
            "Marquardt 1963; Schwarz 1978",
            ExtractorConfig::MaximumLikelihoodSeveral(known()),
        ),
    ]
}

/// The antenna of a name, or else of a file.
#[must_use]
pub fn antenna_named(name_or_file: &str) -> AntennaConfig {
    match name_or_file {
        "reference-patch" => AntennaConfig::ReferencePatch,
        "isotropic" => AntennaConfig::Isotropic,
        "dipole" => AntennaConfig::Dipole,
        "cardioid" => AntennaConfig::Cardioid(Default::default()),
        "patch" => AntennaConfig::Patch(Default::default()),
        "yagi" => AntennaConfig::Yagi(Default::default()),
        file => AntennaConfig::File(file.into()),
    }
}
