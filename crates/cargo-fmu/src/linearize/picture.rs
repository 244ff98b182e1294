//! Pictures of curves and points as SVG, for print and for browsers without JavaScript, in the colors of the page.

use std::fmt::Write as _;

const WIDTH: f64 = 760.0;
const HEIGHT: f64 = 240.0;
/// Room for numbers and titles on the left and below, px.
const LEFT: f64 = 76.0;
const BELOW: f64 = 44.0;
/// Approximate number of labels of an axis.
const TICKS: f64 = 6.0;

/// An axis: the title with the unit, the scale, and both ends. On a logarithmic scale, the ends are logarithms.
pub(super) struct Scale {
    title: String,
    log: bool,
    low: f64,
    high: f64,
}

impl Scale {
    /// A scale on which all values fit.
    pub(super) fn of(title: String, log: bool, values: &[f64]) -> Self {
        let numbers = values.iter().map(|value| if log { value.log10() } else { *value });
        let known = numbers.filter(|value| value.is_finite());
        let (low, high) = known.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), value| (a.min(value), b.max(value)));
        let (low, high) = if low <= high { (low, high) } else { (0.0, 1.0) };
        let room = if high > low { 0.06 * (high - low) } else { low.abs().max(1.0) };
        Self { title, log, low: low - room, high: high + room }
    }

    /// Relative position of a value: 0 at the low end, 1 at the high end.
    fn share(&self, value: f64) -> f64 {
        let value = if self.log { value.log10() } else { value };
        (value - self.low) / (self.high - self.low)
    }

    /// Labeled values: decades, or multiples of 1, 2 or 5 of a power of ten.
    fn ticks(&self) -> Vec<f64> {
        if self.log && self.high - self.low > 1.0 {
            let every = ((self.high - self.low) / (2.0 * TICKS)).ceil();
            let first = (self.low / every).ceil() as i32;
            let last = (self.high / every).floor() as i32;
            return (first..=last).map(|k| 10_f64.powf(f64::from(k) * every)).collect();
        }
        let (low, high) =
            if self.log { (10_f64.powf(self.low), 10_f64.powf(self.high)) } else { (self.low, self.high) };
        let rough = (high - low) / TICKS;
        let power = 10_f64.powf(rough.log10().floor());
        let step = [1.0, 2.0, 5.0, 10.0].into_iter().find(|factor| factor * power >= rough).unwrap_or(10.0) * power;
        let first = (low / step).ceil() as i64;
        let last = (high / step).floor() as i64;
        (first..=last).map(|k| k as f64 * step).collect()
    }
}

/// A number with a few digits and a true minus sign.
pub(super) fn number(value: f64) -> String {
    let size = value.abs();
    let text = if value != 0.0 && !(1e-3..1e5).contains(&size) {
        let text = format!("{value:.3e}");
        let (digits, power) = text.split_once('e').unwrap_or((&text, "0"));
        let digits = digits.trim_end_matches('0').trim_end_matches('.');
        let raised =
            |sign: char| "⁰¹²³⁴⁵⁶⁷⁸⁹".chars().nth(sign.to_digit(10).map_or(10, |digit| digit as usize)).unwrap_or('⁻');
        format!("{digits}×10{}", power.chars().map(raised).collect::<String>())
    } else {
        let decimals = if size >= 100.0 || size == 0.0 { 1.0 } else { 4.0 - size.log10().floor() };
        let text = format!("{value:.*}", decimals.clamp(0.0, 8.0) as usize);
        if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
    };
    text.replace('-', "−")
}

/// A curve, or crosses, over an abscissa. `label` describes it for screen readers.
pub(super) fn svg(label: &str, x: &Scale, y: &Scale, points: &[(f64, f64)], joined: bool) -> String {
    let (right, bottom) = (WIDTH - 12.0, HEIGHT - BELOW);
    let across = |value: f64| LEFT + x.share(value) * (right - LEFT);
    let up = |value: f64| bottom - y.share(value) * (bottom - 10.0);
    let mut out = format!(
        "<svg role=\"img\" aria-label=\"{label}\" viewBox=\"0 0 {WIDTH} {HEIGHT}\" font-size=\"12\" fill=\"var(--ink)\">\n"
    );
    let mut line = |x1: f64, y1: f64, x2: f64, y2: f64| {
        let _ =
            writeln!(out, "<line x1=\"{x1:.1}\" y1=\"{y1:.1}\" x2=\"{x2:.1}\" y2=\"{y2:.1}\" stroke=\"var(--grid)\"/>");
    };
    for tick in x.ticks() {
        line(across(tick), 10.0, across(tick), bottom);
    }
    for tick in y.ticks() {
        line(LEFT, up(tick), right, up(tick));
    }
    let mut text = |x: f64, y: f64, anchor: &str, more: &str, words: &str| {
        let _ = writeln!(out, "<text x=\"{x:.1}\" y=\"{y:.1}\" text-anchor=\"{anchor}\"{more}>{words}</text>");
    };
    for tick in x.ticks() {
        text(across(tick), bottom + 16.0, "middle", "", &number(tick));
    }
    for tick in y.ticks() {
        text(LEFT - 6.0, up(tick) + 4.0, "end", "", &number(tick));
    }
    text((LEFT + right) / 2.0, HEIGHT - 8.0, "middle", "", &x.title);
    let middle = bottom / 2.0;
    text(14.0, middle, "middle", &format!(" transform=\"rotate(-90 14 {middle:.1})\""), &y.title);
    let known = points.iter().map(|(a, b)| (across(*a), up(*b))).filter(|(a, b)| a.is_finite() && b.is_finite());
    if joined {
        let path: Vec<String> = known.map(|(a, b)| format!("{a:.1},{b:.1}")).collect();
        let path = path.join(" ");
        let _ = writeln!(
            out,
            "<polyline points=\"{path}\" fill=\"none\" stroke=\"var(--series-0)\" stroke-width=\"1.6\"/>"
        );
    } else {
        for (a, b) in known {
            let cross = format!("M{:.1} {:.1}l8 8m-8 0 8-8", a - 4.0, b - 4.0);
            let _ =
                writeln!(out, "<path d=\"{cross}\" fill=\"none\" stroke=\"var(--series-0)\" stroke-width=\"1.6\"/>");
        }
    }
    out + "</svg>\n"
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round() {
        let ticks = |log: bool, values: &[f64]| Scale::of(String::new(), log, values).ticks();
        assert_eq!(ticks(false, &[0.0, 10.0]), [0.0, 2.0, 4.0, 6.0, 8.0, 10.0]);
        assert_eq!(ticks(true, &[0.1, 1000.0]), [0.1, 1.0, 10.0, 100.0, 1000.0]);
        assert_eq!(
            ticks(true, &[1.0, 2.0]).iter().map(|v| number(*v)).collect::<Vec<_>>(),
            ["1", "1.2", "1.4", "1.6", "1.8", "2"]
        );
    }

    #[test]
    fn numbers_are_short() {
        for (value, text) in [
            (0.0, "0"),
            (-2.5, "−2.5"),
            (0.012345678, "0.012346"),
            (1234.56, "1234.6"),
            (1e-7, "1×10⁻⁷"),
            (-2.5e6, "−2.5×10⁶"),
        ] {
            assert_eq!(number(value), text);
        }
    }
}
