//! Values of Binary variables as text: hexadecimal (XML, JSON) and Base64 (files of users).
//!
//! Source: XML Schema 1.0, part 2, section 3.2.15 (`hexBinary`); RFC 4648, section 4 (Base64).

use serde::{Deserialize, Serialize};

/// Encoding of the bytes of a Binary as text.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum BinaryText {
    /// Four characters for three bytes, with padding (RFC 4648).
    #[default]
    Base64,
    /// Two lowercase digits for each byte.
    Hex,
}

const BASE64: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";

impl BinaryText {
    /// Appends the text of some bytes.
    pub fn push(self, text: &mut Vec<u8>, bytes: &[u8]) {
        match self {
            Self::Base64 => {
                for part in bytes.chunks(3) {
                    let group = part.iter().fold(0, |group: u32, byte| group << 8 | u32::from(*byte));
                    let group = group << (8 * (3 - part.len()));
                    let digit = |at: usize| BASE64[(group >> (18 - 6 * at)) as usize % 64];
                    text.extend((0..4).map(|at| if at <= part.len() { digit(at) } else { b'=' }));
                }
            }
            Self::Hex => text.extend(bytes.iter().flat_map(|byte| [byte >> 4, byte % 16]).map(hex_digit)),
        }
    }

    /// The text of some bytes.
    pub fn encode(self, bytes: &[u8]) -> String {
        let mut text = Vec::new();
        self.push(&mut text, bytes);
        text.into_iter().map(char::from).collect()
    }

    /// Parses a text; `None` if it is not in this encoding. Both cases of hexadecimal digits are accepted.
    pub fn decode(self, text: &str) -> Option<Vec<u8>> {
        match self {
            Self::Base64 => from_base64(text.as_bytes()),
            Self::Hex => {
                let digits = text.bytes().map(|digit| char::from(digit).to_digit(16)).collect::<Option<Vec<u32>>>()?;
                let pairs = digits.chunks_exact(2);
                pairs.remainder().is_empty().then(|| pairs.map(|pair| (pair[0] << 4 | pair[1]) as u8).collect())
            }
        }
    }
}

fn hex_digit(value: u8) -> u8 {
    value + if value < 10 { b'0' } else { b'a' - 10 }
}

fn from_base64(text: &[u8]) -> Option<Vec<u8>> {
    let mut bytes = Vec::with_capacity(text.len() / 4 * 3);
    let groups = text.chunks_exact(4);
    if !groups.remainder().is_empty() {
        return None;
    }
    let last = groups.len().saturating_sub(1);
    for (index, group) in groups.enumerate() {
        let padding = if index == last { group.iter().rev().take_while(|digit| **digit == b'=').count() } else { 0 };
        let digits = group.get(..4 - padding).filter(|digits| digits.len() >= 2)?;
        let value = digits.iter().try_fold(0, |value: u32, digit| {
            Some(value << 6 | u32::try_from(BASE64.iter().position(|other| other == digit)?).ok()?)
        })?;
        let [_, of_group @ ..] = (value << (6 * padding)).to_be_bytes();
        let (kept, dropped) = of_group.split_at(3 - padding);
        // Bits behind the last byte must be 0 (RFC 4648, section 3.5).
        if dropped.iter().any(|byte| *byte != 0) {
            return None;
        }
        bytes.extend_from_slice(kept);
    }
    Some(bytes)
}

/// Bytes as a hexadecimal string in JSON.
pub(crate) mod hex {
    use super::BinaryText;
    use serde::{Deserialize, Deserializer, Serializer, de::Error};

    pub(crate) fn serialize<S: Serializer>(bytes: &[u8], serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(&BinaryText::Hex.encode(bytes))
    }

    pub(crate) fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<u8>, D::Error> {
        let text = String::deserialize(deserializer)?;
        BinaryText::Hex.decode(&text).ok_or_else(|| D::Error::custom("expected hexadecimal digits in pairs"))
    }
}

#[cfg(test)]
mod tests {
    use super::BinaryText::{self, Base64, Hex};

    /// Reference: RFC 4648, section 10.
    #[test]
    fn texts_are_those_of_the_rfc() {
        let cases = [
            ("", "", ""),
            ("f", "Zg==", "66"),
            ("fo", "Zm8=", "666f"),
            ("foo", "Zm9v", "666f6f"),
            ("foob", "Zm9vYg==", "666f6f62"),
            ("fooba", "Zm9vYmE=", "666f6f6261"),
            ("foobar", "Zm9vYmFy", "666f6f626172"),
        ];
        for (bytes, base64, hex) in cases {
            for (encoding, text) in [(Base64, base64), (Hex, hex)] {
                assert_eq!(encoding.encode(bytes.as_bytes()), text);
                assert_eq!(encoding.decode(text).as_deref(), Some(bytes.as_bytes()), "{text}");
            }
        }
        assert_eq!(Hex.decode("0AfF"), Some(vec![0x0a, 0xff]));
        assert_eq!(Base64.encode(&[0xfb, 0xff, 0xfe]), "+//+");
    }

    #[test]
    fn every_byte_at_every_place_reads_back() {
        let all: Vec<u8> = (0..=255).chain(0..=255).collect();
        for encoding in [Base64, Hex] {
            for length in 254..=all.len() {
                let text = encoding.encode(&all[..length]);
                assert_eq!(encoding.decode(&text).as_deref(), Some(&all[..length]));
            }
        }
    }

    #[test]
    fn other_texts_are_rejected() {
        let wrong = |encoding: BinaryText, texts: &[&str]| {
            for text in texts {
                assert_eq!(encoding.decode(text), None, "{text}");
            }
        };
        wrong(Hex, &["6", "666", "6g", "0x66", "66 6f", "é"]);
        // The last two have bits behind the last byte.
        wrong(Base64, &["Zg", "Zg=", "Z===", "====", "Zg==Zg==", "Zm9v\n", "Zm-_", "Zh==", "Zm9="]);
    }
}
