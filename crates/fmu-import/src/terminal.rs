//! Makes text from FMUs safe for terminals: names, descriptions and messages must not control the terminal.
//!
//! An escape sequence can hide or fake lines, set the title, or inject input as if the user had typed it. Bidirectional
//! marks change the order in which the characters of a name are displayed. Such characters are escaped as in JSON, for
//! example `\u001b`; JSON text therefore keeps its meaning.

use std::borrow::Cow;
use std::fmt::Write as _;

/// Returns true if a terminal may act on this character instead of displaying it, or may reorder other characters.
fn is_control(c: char) -> bool {
    c.is_control()
        || matches!(
            c,
            // Bidirectional marks, embeddings, overrides and isolates; line and paragraph separators.
            '\u{61c}' | '\u{200e}' | '\u{200f}' | '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}' | '\u{2028}' | '\u{2029}'
        )
}

fn replaced(text: &str, is_replaced: impl Fn(char) -> bool) -> Cow<'_, str> {
    if !text.contains(&is_replaced) {
        return Cow::Borrowed(text);
    }
    let mut shown = String::with_capacity(text.len() + 16);
    for c in text.chars() {
        match c {
            '\n' if is_replaced(c) => shown.push_str("\\n"),
            '\t' if is_replaced(c) => shown.push_str("\\t"),
            _ if is_replaced(c) => drop(write!(shown, "\\u{:04x}", u32::from(c))),
            _ => shown.push(c),
        }
    }
    Cow::Owned(shown)
}

/// Escapes all control characters except line feeds and tabs.
pub fn escaped(text: &str) -> Cow<'_, str> {
    replaced(text, |c| is_control(c) && !matches!(c, '\n' | '\t'))
}

/// Escapes all control characters, including line feeds and tabs.
pub fn line(text: &str) -> Cow<'_, str> {
    replaced(text, is_control)
}

/// Like [`escaped`], and indents all lines after the first, because they must not look like lines from this program.
pub fn indented<'a>(text: &'a str, by: &str) -> Cow<'a, str> {
    match escaped(text) {
        Cow::Borrowed(text) if !text.contains('\n') => Cow::Borrowed(text),
        text => Cow::Owned(text.replace('\n', &format!("\n{by}"))),
    }
}

/// Returns true if the text contains control characters.
pub fn is_unsafe(text: &str) -> bool {
    text.contains(is_control)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// ECMA-48 (C0, C1 and sequences that begin with ESC or CSI), Unicode Standard Annex 9 (bidirectional text).
    #[test]
    fn nothing_that_controls_a_terminal_is_left() {
        for (text, expected) in [
            ("a\u{1b}[2Jb", "a\\u001b[2Jb"),
            ("\u{9b}31m", "\\u009b31m"),
            ("a\rb\u{8}\u{7f}\0", "a\\u000db\\u0008\\u007f\\u0000"),
            ("\u{202e}fdp.\u{202c}", "\\u202efdp.\\u202c"),
            ("a\u{2028}b", "a\\u2028b"),
        ] {
            assert_eq!(escaped(text), expected);
            assert_eq!(line(text), expected);
            assert!(is_unsafe(text));
            assert_eq!(escaped(expected), expected, "escaping twice changes nothing");
        }
        for c in (0..0x300).chain(0x2000..0x2100).filter_map(char::from_u32) {
            let shown = line(&c.to_string()).into_owned();
            assert!(!shown.chars().any(is_control), "{shown:?}");
        }
    }

    #[test]
    fn ordinary_text_is_unchanged() {
        for text in ["body.roll (rad/s²)", "Fahrzeug, größer", "車", "שלום", "a\u{200d}b", ""] {
            assert!(matches!(escaped(text), Cow::Borrowed(shown) if shown == text));
            assert!(!is_unsafe(text));
        }
    }

    #[test]
    fn line_breaks_and_tabs_are_kept() {
        assert_eq!(escaped("a\n\tb"), "a\n\tb");
        assert_eq!(line("a\n\tb"), "a\\n\\tb");
        assert_eq!(indented("a\nerror: \u{1b}", "  "), "a\n  error: \\u001b");
        assert!(matches!(indented("one line", "  "), Cow::Borrowed("one line")));
    }
}
