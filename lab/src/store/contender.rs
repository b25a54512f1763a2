use std::fmt::Write as _;

use foxhunt_hunt::{
    config::EstimatorConfig, document, registry::EstimatorEntry, scenario::Scenario,
};
use serde::Serialize;
use sha2::{Digest, Sha256};

use super::StoreError;

/// A campaign as it stands in a store: what all of its contenders have in common.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct StoredCampaign {
    /// Its number in the file.
    #[serde(skip)]
    pub id: i64,
    /// The SHA-256 of its definition, in hexadecimal digits.
    pub digest: String,
    /// The program that flew it, and its version.
    pub program: String,
    /// The scenario's name.
    pub scenario: String,
    /// The planner's name, or that it is the scenario's own.
    pub planner: String,
    /// Its definition, as TOML: program, planner and the scenario as it was flown.
    #[serde(skip)]
    pub definition: String,
    /// The names of the beacons, in their order.
    pub beacons: Vec<String>,
}

/// An estimator that a campaign compares.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Contender {
    /// Its number in the file.
    #[serde(skip)]
    pub id: i64,
    /// The number of its campaign.
    #[serde(skip)]
    pub campaign: i64,
    /// The SHA-256 of the campaign's digest and its own definition, in hexadecimal digits.
    pub digest: String,
    /// The estimator's name.
    pub estimator: String,
    /// Its definition, as TOML: name and settings of the estimator.
    #[serde(skip)]
    pub definition: String,
}

#[derive(Serialize)]
struct CampaignText<'a> {
    program: &'a str,
    planner: &'a str,
    scenario: &'a Scenario,
}

#[derive(Serialize)]
struct ContenderText<'a> {
    estimator: &'a str,
    /// Absent for code of a user's own, which is known by its name alone.
    #[serde(skip_serializing_if = "Option::is_none")]
    settings: Option<&'a EstimatorConfig>,
}

impl StoredCampaign {
    pub(super) fn new(
        program: &str,
        planner: &str,
        scenario: &Scenario,
        beacons: Vec<String>,
    ) -> Result<Self, StoreError> {
        let definition = document::to_toml(&CampaignText { program, planner, scenario })?;
        Ok(Self {
            id: 0,
            digest: digest(&[&definition]),
            program: program.to_owned(),
            scenario: scenario.name.clone(),
            planner: planner.to_owned(),
            definition,
            beacons,
        })
    }
}

impl Contender {
    pub(super) fn new(
        campaign: &StoredCampaign,
        estimator: &EstimatorEntry,
    ) -> Result<Self, StoreError> {
        let text = ContenderText { estimator: &estimator.name, settings: estimator.settings() };
        let definition = document::to_toml(&text)?;
        Ok(Self {
            id: 0,
            campaign: campaign.id,
            digest: digest(&[&campaign.digest, "\n", &definition]),
            estimator: estimator.name.clone().into_owned(),
            definition,
        })
    }

    /// Its name, with the beginning of its digest: `ekf@1a2b3c4d`.
    #[must_use]
    pub fn full_name(&self) -> String {
        let digest = self.digest.get(..8).unwrap_or(&self.digest);
        format!("{}@{digest}", self.estimator)
    }

    /// Returns true if this is its name, with or without the beginning of its digest.
    #[must_use]
    pub fn is(&self, name: &str) -> bool {
        match name.rsplit_once('@') {
            Some((estimator, digest)) if !digest.is_empty() => {
                estimator == self.estimator && self.digest.starts_with(digest)
            }
            _ => name == self.estimator,
        }
    }
}

/// The SHA-256 of texts one after the other, in hexadecimal digits.
fn digest(texts: &[&str]) -> String {
    let mut hash = Sha256::new();
    texts.iter().for_each(|text| hash.update(text.as_bytes()));
    hash.finalize().iter().fold(String::new(), |mut digits, byte| {
        // Writing to a string does not fail.
        let _ = write!(digits, "{byte:02x}");
        digits
    })
}

#[cfg(test)]
mod tests {
    use foxhunt_hunt::registry::Registry;

    use super::*;

    #[test]
    fn digests_are_those_of_the_standard() {
        // FIPS 180-4: "abc".
        let known = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";
        assert_eq!(digest(&["a", "bc"]), known);
    }

    #[test]
    fn whatever_changes_a_run_changes_the_digest() {
        let scenario = Scenario::find("pritzl-6.1").expect("it is built in");
        let of = |program: &str, planner: &str, scenario: &Scenario| {
            StoredCampaign::new(program, planner, scenario, Vec::new()).expect("plain fields")
        };
        let campaign = of("foxhunt 1", "own", &scenario);
        assert_eq!(campaign, of("foxhunt 1", "own", &scenario.clone()));
        let mut other = scenario.clone();
        other.world.channel.sample_sigma_db += 1e-9;
        let others = [
            of("foxhunt 2", "own", &scenario),
            of("foxhunt 1", "hold", &scenario),
            of("foxhunt 1", "own", &other),
        ];
        assert!(others.iter().all(|other| other.digest != campaign.digest));
        // The scenario may be flown again from its text.
        let text: toml::Table = campaign.definition.parse().expect("TOML");
        let text = toml::to_string(&text["scenario"]).expect("TOML");
        assert_eq!(Scenario::parse(&text, "kept").expect("in order"), scenario);

        let registry = Registry::builtin();
        let ekf = registry.estimator("ekf").expect("it is built in");
        let wide = ekf.with_settings("prior", |settings| settings.prior_sigma_m = Some(9.0));
        let of = |entry: &EstimatorEntry| Contender::new(&campaign, entry).expect("plain fields");
        let ekf = of(ekf);
        let wide = of(&wide.expect("it has settings"));
        assert_ne!(ekf.digest, wide.digest);
        assert!(ekf.is("ekf") && wide.is("ekf") && ekf.is(&ekf.full_name()));
        assert!(!wide.is(&ekf.full_name()) && !ekf.is("ukf") && !ekf.is("ekf@"));
    }
}
