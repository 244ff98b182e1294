//! Mistakes in a file, shown with file, line, column and the marked place.

mod layout;

use miette::{Diagnostic, NamedSource, SourceSpan};
use serde::de::DeserializeOwned;
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
    #[label(collection)]
    others: Vec<SourceSpan>,
    #[help]
    help: Option<String>,
}

impl Problem {
    /// `file:line:column: message`.
    pub fn line(&self) -> String {
        let before = &self.source_code.inner()[..self.span.offset()];
        let line = before.matches('\n').count() + 1;
        let column = before.chars().rev().take_while(|c| *c != '\n').count() + 1;
        format!("{}:{line}:{column}: {}", self.source_code.name(), self.message)
    }

    /// [`Self::line`], followed by the help.
    pub fn explained(&self) -> String {
        self.help.as_ref().map_or_else(|| self.line(), |help| format!("{}; {help}", self.line()))
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

impl Problems {
    /// The mistakes, each as [`Problem::explained`].
    pub fn lines(&self) -> Vec<String> {
        self.problems.iter().map(Problem::explained).collect()
    }
}

/// Collects the mistakes in a file and in the files that it includes.
#[derive(Debug)]
pub struct Collector {
    source_code: Arc<NamedSource<String>>,
    /// Included files.
    included: Vec<Included>,
    problems: Vec<Noted>,
    warnings: Vec<Noted>,
    context: Option<Context>,
    /// Number of contexts. If a mistake is found in all contexts, its message does not name them.
    contexts: usize,
}

/// A file included by another file.
#[derive(Debug)]
struct Included {
    /// Offset at which its places begin.
    from: usize,
    source: Arc<NamedSource<String>>,
    /// In a text made from another file: places from which a part of it stems from a place in that file.
    origins: Vec<(usize, Range<usize>)>,
}

/// The case in which a mistake was found.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Context {
    /// Name in messages.
    pub(crate) label: String,
    /// True if it overrides values set elsewhere. A message then names it even if it is the only context.
    pub(crate) is_special: bool,
}

#[derive(Debug)]
struct Noted {
    problem: Problem,
    contexts: Vec<Context>,
}

impl Noted {
    /// Returns the problem; its message names the contexts if it depends on them.
    fn named(mut self, contexts: usize) -> Problem {
        let is_special = self.contexts.iter().any(|context| context.is_special);
        if is_special || (1..contexts).contains(&self.contexts.len()) {
            let labels: Vec<String> = self.contexts.into_iter().map(|context| context.label).collect();
            self.problem.message.push_str(&format!(", in {}", labels.join(" and ")));
        }
        self.problem
    }
}

impl Collector {
    /// Creates an empty collector for a text; `file` is its name in messages, `language` its language ("toml").
    pub fn new(file: &Path, text: &str, language: &str) -> Self {
        let source = NamedSource::new(file.to_string_lossy(), text.to_string()).with_language(language);
        Self {
            source_code: Arc::new(source),
            included: Vec::new(),
            problems: Vec::new(),
            warnings: Vec::new(),
            context: None,
            contexts: 0,
        }
    }

    /// Adds the text of an included file. Returns the offset at which its places begin.
    pub(crate) fn add_source(&mut self, file: &Path, text: &str, language: &str) -> usize {
        let source = NamedSource::new(file.to_string_lossy(), text.to_string()).with_language(language);
        let last = self.included.last().map(|last| (last.from, &last.source));
        let (from, last) = last.unwrap_or((0, &self.source_code));
        // One more than the length, so that the end of a file differs from the start of the next file.
        let from = from + last.inner().len() + 1;
        self.included.push(Included { from, source: Arc::new(source), origins: Vec::new() });
        from
    }

    /// Adds a text made from a file that was added before. A place in the text is shown as the last of `origins` before
    /// it: offsets in the text, and places in the file. Returns the offset at which its places begin.
    pub(crate) fn add_made(&mut self, file: &Path, text: &str, origins: Vec<(usize, Range<usize>)>) -> usize {
        let from = self.add_source(file, text, "toml");
        if let Some(included) = self.included.last_mut() {
            included.origins = origins;
        }
        from
    }

    /// The place to show for a place.
    fn origin(&self, span: &Range<usize>) -> Range<usize> {
        let of = self.included.iter().rev().find(|included| included.from <= span.start);
        let found = of.and_then(|of| of.origins.iter().rev().find(|(start, _)| of.from + start <= span.start));
        found.map_or_else(|| span.clone(), |(_, origin)| origin.clone())
    }

    /// Returns the file of a place and the offset at which it begins.
    fn source(&self, place: usize) -> (usize, &Arc<NamedSource<String>>) {
        let of_included = self.included.iter().rev().find(|included| included.from <= place);
        of_included.map_or((0, &self.source_code), |included| (included.from, &included.source))
    }

    /// The text from a place to the end of its file; `None` if the place is within a character.
    pub(crate) fn text_from(&self, place: usize) -> Option<&str> {
        let (from, source) = self.source(place);
        source.inner().get(place - from..)
    }

    pub(crate) fn expect_contexts(&mut self, contexts: usize) {
        self.contexts = contexts;
    }

    pub(crate) fn set_context(&mut self, context: Option<Context>) {
        self.context = context;
    }

    /// Adds a mistake. The same mistake at the same place in several cases counts once.
    pub fn add(&mut self, span: Range<usize>, message: impl Into<String>) {
        self.add_with_help(span, message, None);
    }

    /// As [`Self::add`] with a hint.
    pub fn add_with_help(&mut self, span: Range<usize>, message: impl Into<String>, help: Option<String>) {
        self.add_at(&[span], message, help);
    }

    /// As [`Self::add_with_help`] for a mistake with several places. A message in one line uses the first place.
    pub(crate) fn add_at(&mut self, spans: &[Range<usize>], message: impl Into<String>, help: Option<String>) {
        let problem = self.problem(spans, message.into(), help);
        note(&mut self.problems, problem, self.context.as_ref());
    }

    /// Adds a warning about something that is allowed but probably unintended.
    pub(crate) fn warn(&mut self, span: Range<usize>, message: impl Into<String>, help: Option<String>) {
        let problem = self.problem(&[span], message.into(), help);
        note(&mut self.warnings, problem, self.context.as_ref());
    }

    fn problem(&self, spans: &[Range<usize>], message: String, help: Option<String>) -> Problem {
        let spans: Vec<Range<usize>> = spans.iter().map(|span| self.origin(span)).collect();
        let first = spans.first().cloned().unwrap_or(0..0);
        let (from, source) = self.source(first.start);
        let length = source.inner().len();
        let inside = |span: &Range<usize>| {
            let start = (span.start - from).min(length);
            SourceSpan::from(start..span.end.saturating_sub(from).clamp(start, length))
        };
        // Only places in the same file can be shown together.
        let others = spans.iter().skip(1).filter(|span| self.source(span.start).0 == from).map(inside).collect();
        Problem { message, span: inside(&first), others, source_code: Arc::clone(source), help }
    }

    pub(crate) fn file(&self) -> &str {
        self.source_code.name()
    }

    /// Parses the text of the file. If it does not have the layout of `T`, adds the mistake; for an unknown key or
    /// word, the hint is the nearest known key or word.
    pub fn parse<T: DeserializeOwned>(&mut self, text: &str) -> Option<T> {
        self.parse_from(text, 0)
    }

    /// As [`Self::parse`] for the included file at the place `from`; its text is padded with blanks up to there.
    pub(crate) fn parse_from<T: DeserializeOwned>(&mut self, text: &str, from: usize) -> Option<T> {
        let explain = |error: toml::de::Error| {
            let (message, help) = layout::explain(&error, text);
            self.add_with_help(error.span().unwrap_or(from..from), message, help);
        };
        toml::from_str(text).map_err(explain).ok()
    }

    /// `file:line:column` of a place.
    pub(crate) fn place(&self, span: Range<usize>) -> String {
        let line = self.problem(&[span], String::new(), None).line();
        line.trim_end_matches(": ").to_string()
    }

    /// Returns true if there are no mistakes.
    pub fn is_empty(&self) -> bool {
        self.problems.is_empty()
    }

    /// Ends the collection.
    pub fn finish(self) -> Result<(), Problems> {
        if self.problems.is_empty() { Ok(()) } else { Err(self.fail()) }
    }

    /// Returns the mistakes as an error.
    pub fn fail(self) -> Problems {
        let contexts = self.contexts;
        let problems = self.problems.into_iter().map(|noted| noted.named(contexts)).collect();
        Problems { file: self.source_code.name().to_string(), problems }
    }

    /// Takes the warnings, each as `file:line:column: message; hint`.
    pub(crate) fn take_warnings(&mut self) -> Vec<String> {
        let contexts = self.contexts;
        std::mem::take(&mut self.warnings).into_iter().map(|noted| noted.named(contexts).explained()).collect()
    }
}

/// Adds a problem, or only its context if the problem is already there.
fn note(noted: &mut Vec<Noted>, problem: Problem, context: Option<&Context>) {
    let is_same = |n: &&mut Noted| {
        let known = &n.problem;
        let is_same_file = Arc::ptr_eq(&known.source_code, &problem.source_code);
        is_same_file && known.span == problem.span && known.message == problem.message
    };
    match noted.iter_mut().find(is_same) {
        Some(known) => known.contexts.extend(context.filter(|c| !known.contexts.contains(c)).cloned()),
        None => noted.push(Noted { problem, contexts: context.into_iter().cloned().collect() }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unknown_keys_and_words_of_a_layout_have_suggestions() {
        #[derive(Debug, serde::Deserialize)]
        #[serde(deny_unknown_fields)]
        struct Layout {
            #[serde(rename = "title")]
            _title: String,
            #[serde(rename = "order")]
            _order: crate::run::Order,
        }
        let help = |text: &str| {
            let mut collector = Collector::new(Path::new("a.toml"), text, "toml");
            assert!(collector.parse::<Layout>(text).is_none());
            collector.fail().problems.remove(0).help
        };
        assert_eq!(help("titel = 'a'").unwrap(), "did you mean `title`?");
        assert_eq!(help("title = 'a'\norder = 'sequental'").unwrap(), "did you mean `sequential`?");
        assert_eq!(help("title = 'a'\norder = 'random'"), None);
        assert_eq!(help("title = 'a'"), None);
        assert_eq!(help("title = `a`"), None);
    }

    /// A message names the cases with the mistake, unless all cases have it. A special context is always named.
    #[test]
    fn contexts_are_named() {
        let context = |label: &str, is_special| Some(Context { label: label.to_string(), is_special });
        let mut collector = Collector::new(Path::new("a.toml"), "x = 1\n", "toml");
        collector.expect_contexts(3);
        for (number, label) in ["case `a`", "case `b`", "case `c`"].into_iter().enumerate() {
            collector.set_context(context(label, number == 2));
            collector.add(0..1, "everywhere but special");
            if number < 2 {
                collector.add(0..1, "in two");
                collector.warn(0..1, "careful", Some("do not".into()));
            }
        }
        collector.set_context(None);
        collector.add(0..1, "without");
        assert_eq!(collector.take_warnings(), ["a.toml:1:1: careful, in case `a` and case `b`; do not"]);
        let lines: Vec<String> = collector.fail().problems.iter().map(Problem::line).collect();
        assert_eq!(
            lines,
            [
                "a.toml:1:1: everywhere but special, in case `a` and case `b` and case `c`",
                "a.toml:1:1: in two, in case `a` and case `b`",
                "a.toml:1:1: without",
            ]
        );
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
