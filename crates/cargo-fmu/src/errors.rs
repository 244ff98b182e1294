//! Error reports: names and messages from an FMU cannot control the terminal.

use std::error::Error;
use std::fmt;

use fmu_import::terminal::escaped;
use miette::{Diagnostic, LabeledSpan, MietteHandler, MietteHandlerOpts, ReportHandler, SourceCode};

/// Makes miette print every report without control characters other than its own.
pub fn install() -> miette::Result<()> {
    miette::set_hook(Box::new(|_| Box::new(Handler(MietteHandlerOpts::new().build()))))?;
    Ok(())
}

struct Handler(MietteHandler);

impl ReportHandler for Handler {
    fn debug(&self, report: &dyn Diagnostic, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let report = Safe::new(report);
        if report.related.is_empty() {
            return self.0.debug(&report, f);
        }
        // A list of mistakes. miette would begin each with `Error:`, but the list has that heading already.
        writeln!(f, "{report}")?;
        for mistake in &report.related {
            writeln!(f)?;
            self.0.debug(mistake, f)?;
        }
        Ok(())
    }
}

/// A report whose text is escaped, except excerpts from files, which are the user's scenarios and studies. It has no
/// codes, addresses and severities, because reports of this program have none.
#[derive(Debug)]
struct Safe<'a> {
    report: &'a dyn Diagnostic,
    message: String,
    cause: Option<Cause>,
    source: Option<Box<Safe<'a>>>,
    related: Vec<Safe<'a>>,
}

impl<'a> Safe<'a> {
    fn new(report: &'a dyn Diagnostic) -> Self {
        Self {
            message: text(report),
            cause: report.source().map(Cause::new),
            source: report.diagnostic_source().map(|source| Box::new(Self::new(source))),
            related: report.related().into_iter().flatten().map(Self::new).collect(),
            report,
        }
    }
}

fn text(part: impl fmt::Display) -> String {
    escaped(&part.to_string()).into_owned()
}

impl fmt::Display for Safe<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.message)
    }
}

impl Error for Safe<'_> {
    fn source(&self) -> Option<&(dyn Error + 'static)> {
        self.cause.as_ref().map(|cause| cause as &dyn Error)
    }
}

impl Diagnostic for Safe<'_> {
    fn help<'a>(&'a self) -> Option<Box<dyn fmt::Display + 'a>> {
        self.report.help().map(|help| Box::new(text(help)) as Box<dyn fmt::Display>)
    }

    fn source_code(&self) -> Option<&dyn SourceCode> {
        self.report.source_code()
    }

    fn labels(&self) -> Option<Box<dyn Iterator<Item = LabeledSpan> + '_>> {
        let safe = |label: LabeledSpan| {
            let words = label.label().map(text);
            if label.primary() {
                LabeledSpan::new_primary_with_span(words, *label.inner())
            } else {
                LabeledSpan::new_with_span(words, *label.inner())
            }
        };
        self.report.labels().map(|labels| Box::new(labels.map(safe)) as Box<dyn Iterator<Item = LabeledSpan>>)
    }

    fn related<'a>(&'a self) -> Option<Box<dyn Iterator<Item = &'a dyn Diagnostic> + 'a>> {
        let related = self.related.iter().map(|related| related as &dyn Diagnostic);
        (!self.related.is_empty()).then(|| Box::new(related) as Box<dyn Iterator<Item = &'a dyn Diagnostic>>)
    }

    fn diagnostic_source(&self) -> Option<&dyn Diagnostic> {
        self.source.as_deref().map(|source| source as &dyn Diagnostic)
    }
}

#[derive(Debug)]
struct Cause {
    message: String,
    cause: Option<Box<Cause>>,
}

impl Cause {
    fn new(error: &(dyn Error + 'static)) -> Self {
        Self { message: text(error), cause: error.source().map(|cause| Box::new(Self::new(cause))) }
    }
}

impl fmt::Display for Cause {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.message)
    }
}

impl Error for Cause {
    fn source(&self) -> Option<&(dyn Error + 'static)> {
        self.cause.as_deref().map(|cause| cause as &dyn Error)
    }
}
