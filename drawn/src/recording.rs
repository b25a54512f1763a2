use super::bound::Bound;

/// A file of a drawn recording.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DrawnFile {
    /// Its name in the folder that the command runs in.
    pub name: String,
    /// Its text.
    pub text: String,
}

/// A recording that was drawn from a seed.
#[derive(Clone, Debug, PartialEq)]
pub struct DrawnRecording {
    /// The files: first the recording, then those beside it.
    pub files: Vec<DrawnFile>,
    /// Flags of the command that reads them, beginning with `--track` where the transmitter is to
    /// be tracked; names of files in them stand for files of the folder.
    pub flags: Vec<String>,
    /// Lines of the recording up to the end of its header.
    pub header: usize,
    /// The least error, where the recording follows a law that has one.
    pub bound: Option<Bound>,
    /// True if nothing was transmitted: any place is wrong.
    pub is_empty: bool,
}

impl DrawnRecording {
    /// Returns the text of the recording.
    #[must_use]
    pub fn text(&self) -> &str {
        self.files.first().map_or("", |file| &file.text)
    }

    /// Replaces the text of the recording.
    #[must_use]
    pub fn with_text(mut self, text: String) -> Self {
        if let Some(file) = self.files.first_mut() {
            file.text = text;
        }
        self
    }

    /// Returns true if the transmitter is to be tracked.
    #[must_use]
    pub fn is_track(&self) -> bool {
        self.flags.iter().any(|flag| flag == "--track")
    }
}
