use foxhunt_core::BearingExtractor;
use foxhunt_sensors::Pritzl2018;
use serde::{Deserialize, Serialize};

/// A bearing extractor chosen at run time.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case")]
#[non_exhaustive]
pub enum ExtractorConfig {
    /// The maximum of the moving mean, with its 2 dB width as σ (Pritzl 2018, §4.1–4.2).
    Pritzl2018(Pritzl2018),
}

impl ExtractorConfig {
    /// Builds the extractor.
    #[must_use]
    pub fn build(&self) -> Box<dyn BearingExtractor> {
        match *self {
            Self::Pritzl2018(extractor) => Box::new(extractor),
        }
    }
}

impl Default for ExtractorConfig {
    /// The reference's.
    fn default() -> Self {
        Self::Pritzl2018(Pritzl2018::default())
    }
}
