//! Values of Binary variables as text: hexadecimal (XML, JSON) and Base64 (files of users).
//!
//! Source: XML Schema 1.0, part 2, section 3.2.15 (`hexBinary`); RFC 4648, section 4 (Base64).

use data_encoding::{BASE64, Encoding, HEXLOWER_PERMISSIVE};
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

impl BinaryText {
    fn encoding(self) -> Encoding {
        match self {
            Self::Base64 => BASE64,
            Self::Hex => HEXLOWER_PERMISSIVE,
        }
    }

    /// Appends the text of some bytes.
    pub fn push(self, text: &mut Vec<u8>, bytes: &[u8]) {
        text.extend(self.encode(bytes).into_bytes());
    }

    /// The text of some bytes.
    pub fn encode(self, bytes: &[u8]) -> String {
        self.encoding().encode(bytes)
    }

    /// Parses a text; `None` if it is not in this encoding. Both cases of hexadecimal digits are accepted.
    pub fn decode(self, text: &str) -> Option<Vec<u8>> {
        // The crate also reads several padded texts behind each other.
        let single = !text.trim_end_matches('=').contains('=');
        self.encoding().decode(text.as_bytes()).ok().filter(|_| single)
    }
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
