//! `documentation/index.html` of an FMU: the README of the model and the tables of its variables.

use fmu_import::description::{Causality, FmiVersion, ModelDescription, Variability, Variable};
use pulldown_cmark::{Options, Parser, html};

use crate::variables::{lengths, start};

const STYLE: &str = include_str!("documentation.css");

/// Text in HTML.
fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

/// The page, complete in itself.
pub(crate) fn page(description: &ModelDescription, readme: &str) -> String {
    let mut body = String::new();
    html::push_html(&mut body, Parser::new_ext(readme, Options::ENABLE_TABLES));
    let name = escape(&description.model_name);
    let summary = escape(description.description.as_deref().unwrap_or_default());
    let tables: String = [
        (Causality::Input, "Inputs"),
        (Causality::Output, "Outputs"),
        (Causality::Parameter, "Parameters"),
        (Causality::CalculatedParameter, "Calculated parameters"),
        (Causality::Local, "Local variables"),
    ]
    .into_iter()
    .map(|(causality, title)| table(description, causality, title))
    .collect();
    let guid = escape(&description.guid);
    let (calls, icon, token) = match description.fmi {
        FmiVersion::V2 => (CALLS.to_owned(), "model.png", "GUID"),
        FmiVersion::V3 => (CALLS.replace("fmi2", "fmi3"), ICON, "Instantiation token"),
    };
    let calls = calls.replace("REFERENCE_RUN", REFERENCE_RUN);
    format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n<title>{name}</title>\n<style>\n{STYLE}</style>\n\
         </head>\n<body>\n<p class=\"summary\"><img src=\"../{icon}\" alt=\"\">{summary}</p>\n{body}<h2>Variables</h2>\n{tables}\
         <h2>Calls</h2>\n{calls}<p class=\"guid\">{token} {guid}</p>\n</body>\n</html>\n"
    )
}

/// Entry of the icon in FMI 3.0.
pub(crate) const ICON: &str = "terminalsAndIcons/icon.png";

/// Entry of the reference run. FMI 2.0 asks for names of folders in `extra` that begin with a reversed domain.
pub(crate) const REFERENCE_RUN: &str = "extra/io.github.chassis-fmu/reference.csv";

const CALLS: &str = "<p>The communication step may have any length above 0 and may vary; the start time is free. Parameters \
are set before or in Initialization Mode, tunable ones also between steps. A rejected call returns fmi2Error, changes nothing \
and says in the log what, where and what was expected. A step whose result is not a finite number restores what was before it \
and returns fmi2Error. The complete state can be saved, serialized and restored in another process.</p>\n\
<p><code>REFERENCE_RUN</code>, where it exists, holds a reference run made by an independent implementation: \
set the inputs of a row, and for a plant read its outputs before the step, for a discrete-time model after it.</p>\n";

/// The variables of one causality.
fn table(description: &ModelDescription, causality: Causality, title: &str) -> String {
    let rows: String =
        description.variables.iter().filter(|variable| variable.causality == causality).map(row).collect();
    if rows.is_empty() {
        return String::new();
    }
    format!(
        "<h3>{title}</h3>\n<table>\n<thead><tr><th>name</th><th>unit</th><th>start</th><th>limits</th><th>kind</th>\
         <th>description</th></tr></thead>\n<tbody>\n{rows}</tbody>\n</table>\n"
    )
}

fn row(variable: &Variable) -> String {
    let unit = variable.unit.as_deref().unwrap_or_default();
    let bound = |value: Option<f64>| value.map_or_else(String::new, |v| format!("{v}"));
    let (min, max) = (bound(variable.min), bound(variable.max));
    let limits = if min.is_empty() && max.is_empty() { String::new() } else { format!("{min} … {max}") };
    let kind = match variable.variability {
        Variability::Tunable => "tunable",
        Variability::Fixed => "fixed",
        Variability::Discrete => "sampled",
        Variability::Continuous => "continuous",
        Variability::Constant => "constant",
    };
    format!(
        "<tr><td><code>{}</code>{}</td><td>{}</td><td>{}</td><td>{limits}</td><td>{kind}</td><td>{}</td></tr>\n",
        escape(&variable.name),
        lengths(variable),
        escape(unit),
        escape(&start(variable)),
        escape(variable.description.as_deref().unwrap_or_default()),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The description with arrays that the importer is tested with.
    const DECAY: &str = include_str!("../../fmu-import/tests/data/decay3.xml");

    #[test]
    fn arrays_have_lengths_and_start_values() {
        let page = page(&ModelDescription::parse(DECAY).unwrap(), "");
        for row in [
            "<code>v</code> (3)</td><td></td><td>1 2 3</td>",
            "<code>bits</code> (2)</td><td></td><td>true false</td>",
            "<code>k</code></td><td>1/s</td><td>2</td><td>0 … </td>",
            "<code>label</code></td><td></td><td>&quot;&quot;</td>",
        ] {
            assert!(page.contains(row), "{row}: {page}");
        }
    }

    #[test]
    fn the_token_has_the_name_of_the_version() {
        let token = |xml: &str| {
            let page = page(&ModelDescription::parse(xml).unwrap(), "");
            page.split_once("class=\"guid\">").unwrap().1.split_once('<').unwrap().0.to_owned()
        };
        assert_eq!(token(DECAY), "Instantiation token {decay}");
        assert_eq!(token(include_str!("../../fmu-import/tests/data/decay2.xml")), "GUID {decay}");
    }
}
