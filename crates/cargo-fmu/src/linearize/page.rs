//! The page of a linear model: modes, poles in the complex plane, Bode plots.

use std::f64::consts::PI;
use std::fmt::Write as _;

use miette::{IntoDiagnostic, Result, miette};
use nalgebra::Complex;

use super::model::{LinearModel, Signal};
use super::page_data::{Block, panel};
use super::picture::{Scale, number, svg};
use crate::documentation::escape;

// These are symbolic links to files of the Python package. A published crate contains the contents of these files.
const STYLE: &str = include_str!("../../templates/page.css.link");
const INTERACTIVE_STYLE: &str = include_str!("../../templates/interactive.css.link");
const CODE: &str = include_str!("../../templates/page.js.link");

/// Number of Bode plots on a page if the user has not selected any.
const FEW: usize = 3;

/// An input and an output, by their indices.
pub(super) type Pair = (usize, usize);

/// Parses the pairs `INPUT:OUTPUT`. If there are none, returns the first few pairs that are connected.
pub(super) fn pairs(model: &LinearModel, chosen: &[String]) -> Result<Vec<Pair>> {
    if chosen.is_empty() {
        let all = (0..model.inputs.len()).flat_map(|input| (0..model.outputs.len()).map(move |output| (input, output)));
        return Ok(all.filter(|(input, output)| model.acts(*input, *output)).take(FEW).collect());
    }
    let find = |what: &str, name: &str, signals: &[Signal]| {
        let names = signals.iter().map(|signal| signal.name.as_str());
        let hint = fmu_import::names::suggestion(name, names).map_or_else(String::new, |hint| format!("; {hint}"));
        let found = signals.iter().position(|signal| signal.name == name);
        found.ok_or_else(|| miette!("{} has no {what} `{name}`{hint}", model.fmu))
    };
    let pair = |text: &String| {
        let (input, output) = text
            .split_once(':')
            .ok_or_else(|| miette!("--bode {text}: expected INPUT:OUTPUT, as in steer.front:vehicle.yaw_rate"))?;
        Ok((find("input", input, &model.inputs)?, find("output", output, &model.outputs)?))
    };
    chosen.iter().map(pair).collect()
}

/// The phase in degrees, without jumps.
fn phase(response: &[Complex<f64>]) -> Vec<f64> {
    let mut before = 0.0;
    let unwrapped = response.iter().map(|g| {
        let angle = g.arg();
        if angle.is_finite() {
            before = angle - 2.0 * PI * ((angle - before) / (2.0 * PI)).round();
            before * 180.0 / PI
        } else {
            f64::NAN
        }
    });
    unwrapped.collect()
}

/// The unit of a gain; empty for a gain without a unit.
fn ratio(to: Option<&str>, from: Option<&str>) -> String {
    let bracketed = |unit: &str| if unit.contains('/') { format!("({unit})") } else { unit.to_owned() };
    match (to, from) {
        (to, from) if to == from => String::new(),
        (to, None) => to.unwrap_or_default().to_owned(),
        (to, Some(from)) => format!("{}/{}", bracketed(to.unwrap_or("1")), bracketed(from)),
    }
}

/// A panel for the page, and its picture.
struct Plot<'a> {
    title: &'a str,
    x: (&'a str, &'a str, bool),
    y: (&'a str, &'a str, bool),
    points: Vec<(f64, f64)>,
    joined: bool,
}

impl Plot<'_> {
    fn panel(&self, block: &mut Block) -> serde_json::Value {
        let (across, up): (Vec<f64>, Vec<f64>) = self.points.iter().copied().unzip();
        let columns = [block.column(&across, self.x.2), block.column(&up, self.y.2)];
        panel(self.title, [self.x, self.y], columns, self.joined)
    }

    fn picture(&self) -> String {
        let (across, up): (Vec<f64>, Vec<f64>) = self.points.iter().copied().unzip();
        let titled = |(title, unit, _): (&str, &str, bool)| {
            escape(&format!("{title} ({})", if unit.is_empty() { "–" } else { unit }))
        };
        let (x, y) = (Scale::of(titled(self.x), self.x.2, &across), Scale::of(titled(self.y), self.y.2, &up));
        svg(&escape(self.title), &x, &y, &self.points, self.joined)
    }
}

pub(super) fn page(model: &LinearModel, pairs: &[Pair], command: &str) -> Result<String> {
    let mut block = Block::default();
    let mut figures = Vec::new();
    let mut html = String::new();
    let mut add = |name: &str, caption: &str, plots: &[Plot<'_>]| {
        figures.push((name.to_owned(), plots.iter().map(|plot| plot.panel(&mut block)).collect()));
        let pictures: String = plots.iter().map(Plot::picture).collect();
        let _ =
            writeln!(html, "<figure id=\"{name}\">\n<figcaption><b>{caption}</b></figcaption>\n{pictures}</figure>");
    };
    let poles = model.poles.iter().map(|pole| (pole.re, pole.im)).collect();
    let (real, imaginary) = (("Real part", "1/s", false), ("Imaginary part", "1/s", false));
    let plane = Plot { title: "Poles in the complex plane", x: real, y: imaginary, points: poles, joined: false };
    add("poles", "Poles", &[plane]);
    let frequencies = model.frequencies();
    for (k, (input, output)) in pairs.iter().enumerate() {
        let (from, to) = (&model.inputs[*input], &model.outputs[*output]);
        let response = model.response(*input, *output, &frequencies);
        let ratio = ratio(to.unit.as_deref(), from.unit.as_deref());
        let over = |values: Vec<f64>| frequencies.iter().copied().zip(values).collect();
        let x = ("Frequency", "Hz", true);
        let gain = over(response.iter().map(|g| g.norm()).collect());
        let plots = [
            Plot { title: "Gain", x, y: ("Gain", &ratio, true), points: gain, joined: true },
            Plot { title: "Phase", x, y: ("Phase", "°", false), points: over(phase(&response)), joined: true },
        ];
        let caption = format!("Bode plot from {} to {}", escape(&from.name), escape(&to.name));
        add(&format!("bode_{}", k + 1), &caption, &plots);
    }
    let data = block.page(&figures).into_diagnostic()?;
    let name = escape(&model.fmu);
    let settings: Vec<String> = model.settings.iter().map(|(name, value)| format!("{name} = {value}")).collect();
    let point = if settings.is_empty() { "the start values of the FMU".to_owned() } else { settings.join(", ") };
    let choose = if pairs.is_empty() {
        "No input acts on an output."
    } else {
        "<code>--bode INPUT:OUTPUT</code> chooses the pairs."
    };
    Ok(format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <meta name=\"color-scheme\" content=\"light dark\">\n<title>{name}, linearized – Chassis FMU</title>\n\
         <style>\n{STYLE}</style>\n<style>\n{INTERACTIVE_STYLE}</style>\n</head>\n<body>\n<header>\n\
         <p class=\"overline\">Chassis FMU <span>linearize</span></p>\n<h1>{name}, linearized</h1>\n\
         <p class=\"lead\">x' = A x + B u, y = C x + D u at {point}.</p>\n<ul class=\"facts\">\
         <li><b>{}</b> states</li><li><b>{}</b> inputs</li><li><b>{}</b> outputs</li><li><b>{}</b></li></ul>\n</header>\n<main>\n\
         <section>\n<h2>Modes</h2>\n<div class=\"scroll\" tabindex=\"0\">\n{}</div>\n\
         <p class=\"note\">Damping is minus the real part of a pole over its magnitude. A pole at 0 has none. The time constant is \
         that of the decay.</p>\n</section>\n\
         <section>\n<h2>Poles and frequency response</h2>\n{html}<p class=\"note\">{choose}</p>\n</section>\n\
         <section>\n<h2>How it was made</h2>\n<dl>\n<dt>Command</dt><dd><code>{}</code></dd>\n\
         <dt>FMU</dt><dd>{name}, <code>{}</code>, SHA-256 of the file <code>{}</code></dd>\n<dt>cargo-fmu</dt><dd>{}</dd>\n</dl>\n</section>\n</main>\n\
         <script type=\"application/json\" id=\"page-data\">{data}</script>\n<script>\n{CODE}\n</script>\n</body>\n</html>\n",
        model.states.len(),
        model.inputs.len(),
        model.outputs.len(),
        model.stability(),
        modes(model),
        escape(command),
        escape(&model.guid),
        model.sha256,
        env!("CARGO_PKG_VERSION"),
        point = escape(&point),
    ))
}

fn modes(model: &LinearModel) -> String {
    let heads = ["Pole (1/s)", "Frequency (Hz)", "Damping", "Time constant (s)"];
    let heads: String = heads.iter().map(|head| format!("<th class=\"number\">{head}</th>")).collect();
    let mut rows = String::new();
    for mode in model.modes() {
        let text = |value: Option<f64>| value.map_or_else(|| "–".to_owned(), number);
        let pair = if mode.imaginary > 0.0 { format!(" ± {}i", number(mode.imaginary)) } else { String::new() };
        let cells = [
            format!("{}{pair}", number(mode.real)),
            number(mode.frequency),
            text(mode.damping),
            text(mode.time_constant),
        ];
        let cells: String = cells.iter().map(|cell| format!("<td class=\"number\">{cell}</td>")).collect();
        let _ = writeln!(rows, "<tr>{cells}</tr>");
    }
    format!("<table class=\"results\">\n<thead><tr>{heads}</tr></thead>\n<tbody>\n{rows}</tbody>\n</table>\n")
}

#[cfg(test)]
mod tests {
    use super::super::tests::oscillator;
    use super::*;

    #[test]
    fn phases_have_no_jumps() {
        let turns: Vec<_> = (0..40).map(|k| Complex::from_polar(1.0, -0.3 * f64::from(k))).collect();
        let found = phase(&turns);
        assert!((found[39] + 0.3 * 39.0 * 180.0 / PI).abs() < 1e-9, "{found:?}");
    }

    #[test]
    fn the_unit_of_a_gain_is_a_ratio() {
        assert_eq!(ratio(Some("rad/s"), Some("rad")), "(rad/s)/rad");
        assert_eq!(ratio(Some("m/s"), Some("m/s")), "");
        assert_eq!((ratio(None, Some("N")), ratio(Some("N"), None)), ("1/N".to_owned(), "N".to_owned()));
    }

    #[test]
    fn pairs_are_named_or_the_first_ones() {
        let model = oscillator();
        assert_eq!(pairs(&model, &[]).unwrap(), [(0, 0)]);
        assert_eq!(pairs(&model, &["f:y".to_owned()]).unwrap(), [(0, 0)]);
        let message = |text: &str| pairs(&model, &[text.to_owned()]).unwrap_err().to_string();
        assert!(message("f").contains("expected INPUT:OUTPUT"));
        assert!(message("g:y").contains("has no input `g`"));
    }

    #[test]
    fn the_page_has_its_figures_and_how_to_repeat_it() {
        let text = page(&oscillator(), &[(0, 0)], "cargo fmu linearize <x>").unwrap();
        for part in ["id=\"poles\"", "id=\"bode_1\"", "k = 200", "&lt;x&gt;", "1 pole at 0", "id=\"page-data\""] {
            assert!(text.contains(part), "{part}");
        }
        assert_eq!(text.matches("<svg role=\"img\"").count(), 3);
    }
}
