use std::fmt;

/// Result of one check of a device, with the remedy for a fault.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Finding {
    /// Subject of the check, such as `firmware` or `RSSI now`.
    pub subject: String,
    /// The device's report, or the fault.
    pub text: String,
    /// Remedy; absent if nothing is wrong.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub remedy: Option<String>,
    /// Watcher of the subject while the drone flies.
    pub watch: Watch,
    /// Height in metres above its launch place at which a drone comes home, where that was read.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub home_up_m: Option<f64>,
    /// Borders of the autopilot's own fence, where they were read.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub own_fence: Option<OwnFence>,
}

/// Borders of an autopilot's own fence, less its margin: where goals are not refused.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct OwnFence {
    /// Launch place, East and North in metres of the common frame; `None` if it is unknown.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub centre_m: Option<[f64; 2]>,
    /// Greatest distance over ground from the launch place, in metres.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub radius_m: Option<f64>,
    /// Greatest height above the launch place, in metres.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max_up_m: Option<f64>,
    /// Least height above the launch place, in metres.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub min_up_m: Option<f64>,
    /// True if it has polygons besides, which are not read.
    pub has_polygons: bool,
}

/// Watcher of something while a drone flies, who acts when it fails.
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
            home_up_m: None,
            own_fence: None,
        }
    }

    /// Something that is wrong, with what mends it.
    #[must_use]
    pub fn bad(subject: &str, text: impl fmt::Display, remedy: &str) -> Self {
        Self { remedy: Some(remedy.into()), ..Self::good(subject, text) }
    }

    /// Replaces the watcher, which is foxhunt by default.
    #[must_use]
    pub fn watched(self, watch: Watch) -> Self {
        Self { watch, ..self }
    }

    /// Returns true if nothing is wrong.
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
