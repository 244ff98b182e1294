//! Text of a file: encoding, rows, cells.

use std::borrow::Cow;

/// Encoding of a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Encoding {
    /// UTF-8 without a byte order mark.
    Utf8,
    /// UTF-8 with a byte order mark.
    Utf8Marked,
    /// UTF-16 with a byte order mark, or little-endian without one.
    Utf16,
    /// Windows-1252.
    Windows1252,
}

/// Characters of Windows-1252 from 0x80 to 0x9f; an undefined byte is the control character of ISO 8859-1.
const WINDOWS: [char; 32] = [
    '€', '\u{81}', '‚', 'ƒ', '„', '…', '†', '‡', 'ˆ', '‰', 'Š', '‹', 'Œ', '\u{8d}', 'Ž', '\u{8f}', '\u{90}', '‘', '’',
    '“', '”', '•', '–', '—', '˜', '™', 'š', '›', 'œ', '\u{9d}', 'ž', 'Ÿ',
];

/// Decodes the text of a file. Without `encoding`, a byte order mark decides. Without a mark, the text is UTF-8 if that
/// is valid, otherwise Windows-1252.
pub(super) fn decode(bytes: &[u8], encoding: Option<Encoding>) -> Result<(Cow<'_, str>, Encoding), String> {
    let utf8 = |bytes| {
        std::str::from_utf8(bytes).map(Cow::Borrowed).map_err(|error| format!("the file is not UTF-8: {error}"))
    };
    let marked = bytes.strip_prefix(&[0xef, 0xbb, 0xbf]);
    let (little, big) = (bytes.strip_prefix(&[0xff, 0xfe]), bytes.strip_prefix(&[0xfe, 0xff]));
    match encoding {
        Some(Encoding::Utf8 | Encoding::Utf8Marked) => Ok((utf8(marked.unwrap_or(bytes))?, Encoding::Utf8)),
        Some(Encoding::Utf16) => {
            let text = big
                .map_or_else(|| utf16(little.unwrap_or(bytes), u16::from_le_bytes), |b| utf16(b, u16::from_be_bytes));
            Ok((text?, Encoding::Utf16))
        }
        Some(Encoding::Windows1252) => Ok((windows(bytes), Encoding::Windows1252)),
        None => {
            if let Some(bytes) = marked {
                return Ok((utf8(bytes)?, Encoding::Utf8Marked));
            }
            if let Some(bytes) = little {
                return Ok((utf16(bytes, u16::from_le_bytes)?, Encoding::Utf16));
            }
            if let Some(bytes) = big {
                return Ok((utf16(bytes, u16::from_be_bytes)?, Encoding::Utf16));
            }
            let text = utf8(bytes).map(|text| (text, Encoding::Utf8));
            Ok(text.unwrap_or_else(|_| (windows(bytes), Encoding::Windows1252)))
        }
    }
}

fn utf16(bytes: &[u8], number: fn([u8; 2]) -> u16) -> Result<Cow<'static, str>, String> {
    let (pairs, rest) = bytes.as_chunks::<2>();
    let text: Result<String, _> = char::decode_utf16(pairs.iter().map(|pair| number(*pair))).collect();
    text.ok().filter(|_| rest.is_empty()).map(Cow::Owned).ok_or_else(|| "the file is not UTF-16".to_owned())
}

fn windows(bytes: &[u8]) -> Cow<'static, str> {
    let char = |byte: &u8| match byte {
        0x80..=0x9f => WINDOWS[usize::from(*byte - 0x80)],
        byte => char::from(*byte),
    };
    Cow::Owned(bytes.iter().map(char).collect())
}

/// Rows of cells. Empty lines and lines that begin with `#` or `%` are skipped but counted.
#[derive(Clone)]
pub(super) struct Rows<'t> {
    rest: &'t str,
    /// Line that `rest` begins with, from 1.
    line: usize,
    pub(super) delimiter: char,
}

impl<'t> Rows<'t> {
    /// Returns the rows from the header on, and the header: the first row, or the first row from the line `header` on.
    pub(super) fn new(text: &'t str, header: Option<usize>) -> (Self, Option<&'t str>) {
        let mut rows = Self { rest: text, line: 1, delimiter: ',' };
        while header.is_some_and(|header| rows.line < header) && !rows.rest.is_empty() {
            rows.skip_line();
        }
        let first = rows.skip_to_row();
        (rows, first)
    }

    fn skip_line(&mut self) {
        let end = self.rest.find(['\n', '\r']).unwrap_or(self.rest.len());
        let rest = &self.rest[end..];
        self.rest = rest.strip_prefix("\r\n").or_else(|| rest.strip_prefix(['\n', '\r'])).unwrap_or(rest);
        self.line += 1;
    }

    fn skip_to_row(&mut self) -> Option<&'t str> {
        while !self.rest.is_empty() {
            let line = &self.rest[..self.rest.find(['\n', '\r']).unwrap_or(self.rest.len())];
            if !line.trim().is_empty() && !line.starts_with(['#', '%']) {
                return Some(line);
            }
            self.skip_line();
        }
        None
    }

    /// Reads a row and returns its line number; the error is the line of an unclosed quotation mark.
    pub(super) fn next(&mut self, cells: &mut Vec<Cow<'t, str>>) -> Option<Result<usize, usize>> {
        cells.clear();
        let line = self.skip_to_row()?;
        let at = self.line;
        if !line.contains('"') {
            cells.extend(line.split(self.delimiter).map(|cell| Cow::Borrowed(cell.trim())));
            self.skip_line();
            return Some(Ok(at));
        }
        loop {
            let blank = self.rest.len() - self.rest.trim_start_matches([' ', '\u{a0}']).len();
            let is_end = |c: char| c == self.delimiter || c == '\n' || c == '\r';
            let mut cell = String::new();
            if let Some(quoted) = self.rest[blank..].strip_prefix('"') {
                let mut rest = quoted;
                loop {
                    let Some(end) = rest.find('"') else {
                        self.rest = "";
                        return Some(Err(at));
                    };
                    cell.push_str(&rest[..end]);
                    rest = &rest[end + 1..];
                    match rest.strip_prefix('"') {
                        Some(more) => {
                            cell.push('"');
                            rest = more;
                        }
                        None => break,
                    }
                }
                self.line += cell.matches('\n').count();
                self.rest = rest;
            }
            let end = self.rest.find(is_end).unwrap_or(self.rest.len());
            cell.push_str(&self.rest[..end]);
            cells.push(Cow::Owned(cell.trim().to_owned()));
            self.rest = &self.rest[end..];
            match self.rest.strip_prefix(self.delimiter) {
                Some(rest) => self.rest = rest,
                None => {
                    self.skip_line();
                    return Some(Ok(at));
                }
            }
        }
    }
}

pub(super) enum Cell {
    Number(f64),
    Missing,
    Other,
}

/// Texts that mark a missing cell. An empty cell is missing too.
const MISSING: [&str; 8] = ["nan", "na", "n/a", "null", "none", "-", "--", "#n/a"];

pub(super) fn cell(text: &str, decimal: char) -> Cell {
    if is_number(text, decimal) {
        let value = if decimal == ',' { text.replacen(',', ".", 1).parse() } else { text.parse() };
        return value.ok().filter(|value: &f64| value.is_finite()).map_or(Cell::Other, Cell::Number);
    }
    let is = |word: &str| text.eq_ignore_ascii_case(word);
    if text.is_empty() || MISSING.into_iter().any(is) {
        Cell::Missing
    } else if is("true") {
        Cell::Number(1.0)
    } else if is("false") {
        Cell::Number(0.0)
    } else {
        Cell::Other
    }
}

/// Returns true if a cell is a number with this decimal mark, or an integer. Words such as `inf` are not numbers.
pub(super) fn is_number(text: &str, decimal: char) -> bool {
    let digits = |text: &str| text.bytes().all(|byte| byte.is_ascii_digit());
    let text = text.strip_prefix(['+', '-']).unwrap_or(text);
    let (mantissa, exponent) = match text.split_once(['e', 'E']) {
        Some((mantissa, exponent)) => (mantissa, Some(exponent.strip_prefix(['+', '-']).unwrap_or(exponent))),
        None => (text, None),
    };
    let (whole, fraction) = mantissa.split_once(decimal).unwrap_or((mantissa, ""));
    digits(whole)
        && digits(fraction)
        && !(whole.is_empty() && fraction.is_empty())
        && exponent.is_none_or(|exponent| !exponent.is_empty() && digits(exponent))
}
