use alloc::{borrow::Cow, string::String};
use core::fmt;

/// A doubt about an answer, or about the recording that it was made from, for the person who
/// reads the answer.
#[derive(Clone, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Remark {
    /// A stable name of the kind, for programs: `rows-left-out`.
    pub code: Cow<'static, str>,
    /// A sentence that says what was found, with its figures, and what to do about it.
    pub text: String,
}

impl Remark {
    /// Returns a remark with a code of this program.
    pub fn new(code: &'static str, text: impl Into<String>) -> Self {
        Self { code: Cow::Borrowed(code), text: text.into() }
    }
}

impl fmt::Display for Remark {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} ({})", self.text, self.code)
    }
}
