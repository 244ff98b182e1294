//! Mistakes in a file, shown with file, line, column and the marked place.

use miette::{Diagnostic, NamedSource, SourceSpan};
use std::ops::Range;
use std::path::Path;
use std::sync::Arc;

/// A mistake in a file.
#[derive(Debug, Clone, thiserror::Error, Diagnostic)]
#[error("{message}")]
pub struct Problem {
    message: String,
    #[source_code]
    source_code: Arc<NamedSource<String>>,
    #[label]
    span: SourceSpan,
    #[help]
    help: Option<String>,
}

impl Problem {
    /// `file:line:column: message`.
    #[must_use]
    pub fn line(&self) -> String {
        let before = &self.source_code.inner()[..self.span.offset()];
        let line = before.matches('\n').count() + 1;
        let column = before.chars().rev().take_while(|c| *c != '\n').count() + 1;
        format!("{}:{line}:{column}: {}", self.source_code.name(), self.message)
    }
}

/// All mistakes found in a file.
#[derive(Debug, thiserror::Error, Diagnostic)]
#[error("{file}: {}", if problems.len() == 1 { "1 mistake".to_string() } else { format!("{} mistakes", problems.len()) })]
pub struct Problems {
    file: String,
    /// The mistakes in the order in which they were found.
    #[related]
    pub problems: Vec<Problem>,
}

/// Collects mistakes of one file.
#[derive(Debug)]
pub struct Collector {
    source_code: Arc<NamedSource<String>>,
    problems: Vec<Problem>,
}

impl Collector {
    /// No mistakes yet in this text; `file` names it in messages, `language` is that of the text ("toml").
    #[must_use]
    pub fn new(file: &Path, text: &str, language: &str) -> Self {
        let source = NamedSource::new(file.to_string_lossy(), text.to_string()).with_language(language);
        Self { source_code: Arc::new(source), problems: Vec::new() }
    }

    /// Notes a mistake. The same one at the same place, met again in another case, counts once.
    pub fn add(&mut self, span: Range<usize>, message: impl Into<String>) {
        self.add_with_help(span, message, None);
    }

    /// As [`Self::add`] with a hint.
    pub fn add_with_help(&mut self, span: Range<usize>, message: impl Into<String>, help: Option<String>) {
        let length = self.source_code.inner().len();
        let start = span.start.min(length);
        let span = SourceSpan::from(start..span.end.clamp(start, length));
        let message = message.into();
        let known = |p: &Problem| p.span == span && p.message == message;
        if !self.problems.iter().any(known) {
            self.problems.push(Problem { message, source_code: Arc::clone(&self.source_code), span, help });
        }
    }

    /// Notes why a text does not have the layout of its file. For an unknown key or word, the nearest known one is the hint.
    pub fn add_layout(&mut self, error: &toml::de::Error) {
        let message = error.message().replace('\n', ", ");
        // serde writes "unknown field `a`, expected one of `b`, `c`".
        let mut quoted = message.split('`').skip(1).step_by(2);
        let unknown = quoted.next().filter(|_| message.starts_with("unknown "));
        let help = unknown.and_then(|name| suggestion(name, quoted));
        self.add_with_help(error.span().unwrap_or(0..0), message, help);
    }

    /// Whether nothing was noted.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.problems.is_empty()
    }

    /// Ends the collection.
    ///
    /// # Errors
    /// The mistakes, if there are any.
    pub fn finish(self) -> Result<(), Problems> {
        if self.problems.is_empty() { Ok(()) } else { Err(self.fail()) }
    }

    /// What was noted, as an error.
    #[must_use]
    pub fn fail(self) -> Problems {
        Problems { file: self.source_code.name().to_string(), problems: self.problems }
    }
}

/// "did you mean" for the nearest of some names, if one is near.
#[must_use]
pub fn suggestion<'a>(name: &str, candidates: impl IntoIterator<Item = &'a str>) -> Option<String> {
    // A third of the letters may be wrong: enough for slips, too little for chance hits.
    let limit = (name.chars().count() / 3).max(1);
    candidates
        .into_iter()
        .map(|c| (strsim::damerau_levenshtein(name, c), c))
        .filter(|(distance, _)| *distance <= limit)
        .min()
        .map(|(_, nearest)| format!("did you mean `{nearest}`?"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn near_names_are_suggested_and_far_ones_not() {
        let names = ["body.roll", "body.roll_rate", "vehicle.speed"];
        let near = suggestion("body.rol", names).unwrap();
        assert_eq!(near, "did you mean `body.roll`?");
        assert_eq!(suggestion("wheel_height.fl", names), None);
    }

    #[test]
    fn unknown_keys_and_words_of_a_layout_have_suggestions() {
        #[derive(Debug, serde::Deserialize)]
        #[serde(deny_unknown_fields)]
        struct Layout {
            #[serde(rename = "title")]
            _title: String,
            #[serde(rename = "order")]
            _order: crate::plan::Order,
        }
        let help = |text: &str| {
            let mut collector = Collector::new(Path::new("a.toml"), text, "toml");
            collector.add_layout(&toml::from_str::<Layout>(text).unwrap_err());
            collector.fail().problems.remove(0).help
        };
        assert_eq!(help("titel = 'a'").unwrap(), "did you mean `title`?");
        assert_eq!(help("title = 'a'\norder = 'sequental'").unwrap(), "did you mean `sequential`?");
        assert_eq!(help("title = 'a'\norder = 'random'"), None);
        assert_eq!(help("title = 'a'"), None);
        assert_eq!(help("title = `a`"), None);
    }

    #[test]
    fn a_mistake_is_noted_once_with_its_place() {
        let mut collector = Collector::new(Path::new("a.toml"), "x\nyz = 1\n", "toml");
        collector.add(3..4, "bad");
        collector.add(3..4, "bad");
        collector.add(900..901, "beyond the end");
        let problems = collector.finish().unwrap_err();
        assert_eq!(problems.to_string(), "a.toml: 2 mistakes");
        assert_eq!(problems.problems[0].line(), "a.toml:2:2: bad");
        assert_eq!(problems.problems[1].line(), "a.toml:3:1: beyond the end");
    }
}
