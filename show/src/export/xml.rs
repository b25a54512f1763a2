use std::io;

use quick_xml::{
    Writer,
    events::{BytesDecl, BytesEnd, BytesStart, BytesText, Event},
};

use super::ExportError;

/// Writes elements one after the other; texts and attributes are escaped.
pub(super) struct Xml {
    writer: Writer<Vec<u8>>,
}

impl Xml {
    /// A text without anything in it.
    pub(super) fn new() -> Self {
        Self { writer: Writer::new(Vec::new()) }
    }

    /// A document, which begins with its declaration.
    pub(super) fn document() -> Result<Self, ExportError> {
        let mut xml = Self::new();
        xml.put(Event::Decl(BytesDecl::new("1.0", Some("UTF-8"), None)))?;
        Ok(xml)
    }

    fn put(&mut self, event: Event<'_>) -> Result<(), ExportError> {
        self.writer.write_event(event).map_err(|error: io::Error| ExportError::write(error))
    }

    /// An element with what is in it.
    pub(super) fn element(
        &mut self,
        name: &str,
        attributes: &[(&str, &str)],
        within: impl FnOnce(&mut Self) -> Result<(), ExportError>,
    ) -> Result<(), ExportError> {
        let start = BytesStart::new(name).with_attributes(attributes.iter().copied());
        self.put(Event::Start(start))?;
        within(self)?;
        self.put(Event::End(BytesEnd::new(name)))
    }

    /// An element without anything in it.
    pub(super) fn empty(
        &mut self,
        name: &str,
        attributes: &[(&str, &str)],
    ) -> Result<(), ExportError> {
        let start = BytesStart::new(name).with_attributes(attributes.iter().copied());
        self.put(Event::Empty(start))
    }

    /// An element that holds a text; characters that XML has no way to write are left out.
    pub(super) fn text(&mut self, name: &str, text: &str) -> Result<(), ExportError> {
        let clean = printable(text);
        self.element(name, &[], |xml| xml.put(Event::Text(BytesText::new(&clean))))
    }

    /// A line's end.
    pub(super) fn line(&mut self) -> Result<(), ExportError> {
        self.put(Event::Text(BytesText::new("\n")))
    }

    pub(super) fn into_bytes(self) -> Vec<u8> {
        self.writer.into_inner()
    }
}

/// The text without the control characters that XML 1.0 forbids (section 2.2).
pub(super) fn printable(text: &str) -> String {
    let allowed = |c: &char| {
        matches!(c, '\t' | '\n' | '\r' | ' '..='\u{d7ff}' | '\u{e000}'..='\u{fffd}')
            || *c >= '\u{10000}'
    };
    text.chars().filter(allowed).collect()
}
