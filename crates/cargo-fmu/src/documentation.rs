//! `documentation/index.html` of an FMU: the README of the model and the tables of its variables.

use std::collections::BTreeMap;

use fmu_import::description::{Causality, FmiVersion, ModelDescription, Variable};
use pulldown_cmark::{Event, Options, Parser, Tag, TagEnd, html};

use crate::variables::{lengths, start};

const STYLE: &str = include_str!("documentation.css");

pub(crate) fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

/// Removes pictures and links to other files in the repository, because an FMU does not contain them. Their text stays.
fn without_relative_links<'a>(events: impl Iterator<Item = Event<'a>>) -> impl Iterator<Item = Event<'a>> {
    let is_here = |url: &str| !["https:", "http:", "mailto:", "#"].iter().any(|start| url.starts_with(start));
    let (mut in_link, mut in_picture) = (false, false);
    events.filter(move |event| match event {
        Event::Start(Tag::Link { dest_url, .. }) => {
            in_link = is_here(dest_url);
            !in_link
        }
        Event::End(TagEnd::Link) => !in_link,
        Event::Start(Tag::Image { dest_url, .. }) => {
            in_picture = is_here(dest_url);
            !in_picture
        }
        Event::End(TagEnd::Image) => !in_picture,
        _ => true,
    })
}

/// Returns the self-contained page. Icon and reference run are mentioned if they are among the files.
pub(crate) fn page(description: &ModelDescription, readme: &str, files: &BTreeMap<String, Vec<u8>>) -> String {
    let mut body = String::new();
    html::push_html(&mut body, without_relative_links(Parser::new_ext(readme, Options::ENABLE_TABLES)));
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
    let (prefix, icon, token) = match description.fmi {
        FmiVersion::V2 => ("fmi2", ICON_OF_FMI2, "GUID"),
        FmiVersion::V3 => ("fmi3", ICON, "Instantiation token"),
    };
    let icon = if files.contains_key(icon) { format!("<img src=\"../{icon}\" alt=\"\">") } else { String::new() };
    let calls = calls(description, prefix, files.contains_key(REFERENCE_RUN));
    format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n<title>{name}</title>\n<style>\n{STYLE}</style>\n\
         </head>\n<body>\n<p class=\"summary\">{icon}{summary}</p>\n{body}<h2>Variables</h2>\n{tables}\
         <h2>Calls</h2>\n{calls}<p class=\"guid\">{token} {guid}</p>\n</body>\n</html>\n"
    )
}

pub(crate) const ICON_OF_FMI2: &str = "model.png";

pub(crate) const ICON: &str = "terminalsAndIcons/icon.png";

/// Path of the reference run in an FMU. FMI 2.0 requires folder names in `extra` to begin with a reversed domain name.
pub(crate) const REFERENCE_RUN: &str = "extra/io.github.chassis-fmu/reference.csv";

/// Path in an FMU of the file that contains the commit from which the FMU was packed.
pub(crate) const COMMIT: &str = "extra/io.github.chassis-fmu/commit.txt";

/// Path of the list of components in an FMU.
pub(crate) const SBOM: &str = "extra/io.github.chassis-fmu/sbom.cdx.json";

/// Describes the call rules and capabilities of the FMU's interfaces.
fn calls(description: &ModelDescription, prefix: &str, has_reference_run: bool) -> String {
    let mut text = String::from("<p>");
    if description.co_simulation.is_some() {
        text += "In co-simulation, the communication step may have any length above 0 and may vary. A step whose result is not a \
                 finite number restores the state before the step and returns PREFIXError. ";
    }
    if description.model_exchange.is_some() {
        text += "In model exchange, a derivative or event indicator that is not a finite number returns PREFIXDiscard, so that the \
                 solver can try a shorter step. ";
    }
    if description.scheduled_execution.is_some() {
        text += "In scheduled execution, any thread may call the FMU at any time. A part runs to its end before another call begins, \
                 so parts do not preempt each other. ";
    }
    text += "The start time is free. Parameters are set before or in Initialization Mode, tunable ones also between steps and in \
             Event Mode. Any other rejected call returns PREFIXError, changes nothing and logs the variable and \
             the rule that it breaks. ";
    let mut interfaces = [&description.co_simulation, &description.model_exchange].into_iter().flatten();
    let is_serializable = interfaces.any(|unit| unit.can_serialize_fmu_state);
    text += if is_serializable {
        "The complete state can be saved, serialized and restored in another process."
    } else {
        "The complete state can be saved and restored."
    };
    text += "</p>\n";
    if has_reference_run {
        text += "<p><code>REFERENCE_RUN</code> holds a reference run in co-simulation made by an independent implementation: set \
                 the inputs of a row, and for a plant read its outputs before the step, for a discrete-time model after it.</p>\n";
    }
    text.replace("PREFIX", prefix).replace("REFERENCE_RUN", REFERENCE_RUN)
}

fn table(description: &ModelDescription, causality: Causality, title: &str) -> String {
    let rows: String = description.of(causality).map(row).collect();
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
    let kind = format!("{:?}", variable.variability).to_lowercase();
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

    /// Description with arrays, from the importer's tests.
    const DECAY: &str = include_str!("../../fmu-import/tests/data/decay3.xml");

    #[test]
    fn arrays_have_lengths_and_start_values() {
        let page = page(&ModelDescription::parse(DECAY).unwrap(), "", &BTreeMap::new());
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
    fn links_stay_only_if_they_work_in_the_fmu() {
        let readme = "[code](src/lib.rs), ![a plot](plot.svg), [site](https://example.org), [above](#tests)";
        let page = page(&ModelDescription::parse(DECAY).unwrap(), readme, &BTreeMap::new());
        let links = "<p>code, a plot, <a href=\"https://example.org\">site</a>, <a href=\"#tests\">above</a></p>";
        assert!(page.contains(links), "{page}");
    }

    #[test]
    fn files_are_named_only_if_they_are_in_the_fmu() {
        for xml in [DECAY, include_str!("../../fmu-import/tests/data/decay2.xml")] {
            let description = ModelDescription::parse(xml).unwrap();
            let icon = if description.fmi == FmiVersion::V3 { ICON } else { ICON_OF_FMI2 };
            let sets: [&[&str]; 4] = [&[], &[icon], &[REFERENCE_RUN], &[icon, REFERENCE_RUN]];
            for names in sets {
                let files = names.iter().map(|name| ((*name).to_owned(), Vec::new())).collect();
                let page = page(&description, "", &files);
                for name in [icon, REFERENCE_RUN] {
                    assert_eq!(page.contains(name), names.contains(&name), "{name}: {page}");
                }
            }
        }
    }

    #[test]
    fn the_calls_are_those_of_the_interfaces() {
        let mut description = ModelDescription::parse(DECAY).unwrap();
        let text = calls(&description, "fmi3", false);
        assert!(text.contains("communication step") && text.contains("fmi3Discard"), "{text}");
        description.co_simulation = None;
        let text = calls(&description, "fmi3", false);
        assert!(!text.contains("communication step") && text.contains("fmi3Discard"), "{text}");
    }

    #[test]
    fn the_token_has_the_name_of_the_version() {
        let token = |xml: &str| {
            let page = page(&ModelDescription::parse(xml).unwrap(), "", &BTreeMap::new());
            page.split_once("class=\"guid\">").unwrap().1.split_once('<').unwrap().0.to_owned()
        };
        assert_eq!(token(DECAY), "Instantiation token {decay}");
        assert_eq!(token(include_str!("../../fmu-import/tests/data/decay2.xml")), "GUID {decay}");
    }
}
