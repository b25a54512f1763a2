//! Tables of extractors.

use foxhunt::{config::ExtractorConfig, registry::Registry, sensors::AntennaConfig};

#[test]
fn what_is_written_is_read_back_and_built() {
    for named in Registry::builtin().extractors() {
        let config = named.config();
        let text = toml::to_string(&config).expect("plain data");
        assert!(text.contains(&format!("kind = \"{}\"", named.name)), "{text}");
        assert_eq!(toml::from_str::<ExtractorConfig>(&text), Ok(config.clone()));
        let bare = format!("kind = \"{}\"", named.name);
        assert_eq!(toml::from_str::<ExtractorConfig>(&bare), Ok(config.clone()));
        assert!(config.build().is_ok(), "{}", named.name);
        let other = config.clone().with_antenna(&AntennaConfig::Isotropic);
        let known = other.as_ref().and_then(ExtractorConfig::known_antenna);
        assert_eq!(known.is_some(), config.known_antenna().is_some(), "{}", named.name);
        assert!(known.is_none_or(|(antenna, _)| *antenna == AntennaConfig::Isotropic));
    }
}

#[test]
fn mistakes_are_named() {
    for (text, expected) in [
        ("kind = 'maximum'\nwindow = 7", "window"),
        ("kind = 'maximum-likelihood'\nantena = 'dipole'", "antena"),
        ("kind = 'magic'", "magic"),
    ] {
        let error = toml::from_str::<ExtractorConfig>(text).expect_err(text).to_string();
        assert!(error.contains(expected), "{text}: {error}");
    }
    for (text, expected) in [
        ("kind = 'maximum'\nrss_sigma_db = 0", "rss_sigma_db is 0"),
        ("kind = 'maximum-likelihood'\nmin_positions = 2", "min_positions is 2"),
        ("kind = 'cross-correlation'\nantenna = { file = 'no.msi' }", "no.msi"),
        ("kind = 'maximum-likelihood-t'\nelevation_deg = 100", "elevation"),
        ("kind = 'maximum-likelihood'\nsteepest_deg = -95", "steepest"),
        ("kind = 'maximum-likelihood-t'\nsteepest_deg = -40", "steepest_deg is -40"),
        ("kind = 'cross-correlation'\ndegrees = -7", "degrees is -7; it must be left out"),
        ("kind = 'cross-correlation'\nmin_positions = 9", "min_positions is 9"),
        ("kind = 'maximum-likelihood'\ndegrees = 1000", "degrees is 1000"),
    ] {
        let config = toml::from_str::<ExtractorConfig>(text).expect(text);
        let error = config.build().map(|_| ()).expect_err(text).to_string();
        assert!(error.contains(expected), "{text}: {error}");
    }
}
