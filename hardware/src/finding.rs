use std::fmt;

/// What was found about one thing when a device was looked at, and how to mend it.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize)]
pub struct Finding {
    /// What was looked at, such as `firmware` or `RSSI now`.
    pub subject: String,
    /// What it reported, or what is wrong.
    pub text: String,
    /// What to do about it; absent where nothing is wrong.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub remedy: Option<String>,
    /// Who watches it while the drone flies.
    pub watch: Watch,
}

/// Who watches something while a drone flies, and acts when it fails.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Watch {
    /// foxhunt itself.
    #[default]
    Foxhunt,
    /// The autopilot, without foxhunt.
    Autopilot,
    /// The pilot, with the remote control in hand.
    Pilot,
}

impl fmt::Display for Watch {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Foxhunt => "foxhunt",
            Self::Autopilot => "autopilot",
            Self::Pilot => "pilot",
        })
    }
}

impl Finding {
    /// Something that is as it should be.
    #[must_use]
    pub fn good(subject: &str, text: impl fmt::Display) -> Self {
        Self {
            subject: subject.into(),
            text: text.to_string(),
            remedy: None,
            watch: Watch::Foxhunt,
        }
    }

    /// Something that is wrong, with what mends it.
    #[must_use]
    pub fn bad(subject: &str, text: impl fmt::Display, remedy: &str) -> Self {
        Self { remedy: Some(remedy.into()), ..Self::good(subject, text) }
    }

    /// The same, watched by somebody else than foxhunt.
    #[must_use]
    pub fn watched(self, watch: Watch) -> Self {
        Self { watch, ..self }
    }

    /// Whether it is as it should be.
    #[must_use]
    pub fn is_good(&self) -> bool {
        self.remedy.is_none()
    }
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.subject, self.text)?;
        self.remedy.as_ref().map_or(Ok(()), |remedy| write!(f, " ({remedy})"))
    }
}
