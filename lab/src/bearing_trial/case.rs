use foxhunt_sim::ScatteringConfig;

/// The disturbances of the turns in a campaign of bearings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BearingCase {
    /// Its name, as `foxhunt compare extractors` takes it.
    pub name: &'static str,
    /// Its description, in a line.
    pub about: &'static str,
    /// The number of distinct boresights of a turn, equally spaced.
    pub boresights: u16,
    /// The share of boresights without a reading, each by chance.
    pub lost: f64,
    /// The share of the circle, in one piece, without a reading.
    pub blocked: f64,
    /// The amplitude of a reflection over that of the direct wave.
    pub reflected: f64,
    /// The waves that surroundings scatter beside the direct one; none if absent.
    pub scattering: Option<ScatteringConfig>,
}

impl BearingCase {
    /// The number of positions of a turn that the boresights are sorted into.
    pub const POSITIONS: u16 = 128;

    /// The number of readings of each boresight.
    pub const READINGS: u16 = 6;

    /// σ of a reading in dB.
    pub const SIGMA_DB: f64 = 2.0;
}

/// Every case that has a name.
#[must_use]
pub fn bearing_cases() -> [BearingCase; 6] {
    let clean = BearingCase {
        name: "bearing-clean",
        about: "turns of 128 × 6 readings with nothing but noise",
        boresights: BearingCase::POSITIONS,
        lost: 0.0,
        blocked: 0.0,
        reflected: 0.0,
        scattering: None,
    };
    [
        clean,
        BearingCase {
            name: "bearing-lost",
            about: "turns with 30 % of the positions lost, each by chance",
            lost: 0.3,
            ..clean
        },
        BearingCase {
            name: "bearing-reflector",
            about: "turns with a reflection at half amplitude, its direction and phase by chance",
            reflected: 0.5,
            ..clean
        },
        BearingCase {
            name: "bearing-scattered",
            about: "turns between houses: K of 5 dB with a σ of 5 dB, six waves by chance",
            scattering: Some(ScatteringConfig {
                k_db: 5.0,
                k_sigma_db: 5.0,
                waves: 6,
                elevation_sigma_deg: 0.0,
            }),
            ..clean
        },
        BearingCase {
            name: "bearing-65",
            about: "turns of a body: 65 × 6 readings sorted into 128 positions",
            boresights: 65,
            ..clean
        },
        BearingCase {
            name: "bearing-block",
            about: "turns with 30 % of the circle missing in one piece, anywhere",
            blocked: 0.3,
            ..clean
        },
    ]
}

/// The case of a name.
#[must_use]
pub fn bearing_case_named(name: &str) -> Option<BearingCase> {
    bearing_cases().into_iter().find(|case| case.name == name)
}
