//! WebAssembly modules as binaries of FMUs: their path in an archive, and the names that they import and export.
//!
//! The folder is a convention of this project; the draft FMI-LS-WASM covers only FMI 3.0 and WASI components.

/// Folder in `binaries/`, for FMI 2.0 and 3.0.
pub const FOLDER: &str = "wasm32-unknown-unknown";

/// Path of the module in an archive.
pub fn entry(model_identifier: &str) -> String {
    format!("binaries/{FOLDER}/{model_identifier}.wasm")
}

/// Magic number and version of a module.
const HEADER: &[u8] = b"\0asm\x01\0\0\0";
/// Section numbers.
const IMPORTS: u8 = 2;
const EXPORTS: u8 = 7;
/// Kinds of imports and exports.
const FUNCTION: u8 = 0;
const TABLE: u8 = 1;
const MEMORY: u8 = 2;
const GLOBAL: u8 = 3;
const TAG: u8 = 4;

/// Imports and exports of a module.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Names {
    /// `module.name` of each import.
    pub imports: Vec<String>,
    /// Names of exported functions.
    pub functions: Vec<String>,
}

impl Names {
    /// Reads the names; `None` if the bytes are not a module.
    pub fn read(module: &[u8]) -> Option<Self> {
        let mut rest = Bytes(module.strip_prefix(HEADER)?);
        let mut names = Self::default();
        while !rest.0.is_empty() {
            let (section, length) = (rest.byte()?, rest.number()?);
            let mut content = Bytes(rest.take(length)?);
            match section {
                IMPORTS => {
                    for _ in 0..content.number()? {
                        let (module, name) = (content.text()?, content.text()?);
                        content.import()?;
                        names.imports.push(format!("{module}.{name}"));
                    }
                }
                EXPORTS => {
                    for _ in 0..content.number()? {
                        let (name, kind) = (content.text()?.to_owned(), content.byte()?);
                        content.number()?;
                        names.functions.extend((kind == FUNCTION).then_some(name));
                    }
                }
                _ => {}
            }
        }
        Some(names)
    }
}

struct Bytes<'a>(&'a [u8]);

impl<'a> Bytes<'a> {
    fn take(&mut self, length: usize) -> Option<&'a [u8]> {
        let (taken, rest) = self.0.split_at_checked(length)?;
        self.0 = rest;
        Some(taken)
    }

    fn byte(&mut self) -> Option<u8> {
        self.take(1).map(|byte| byte[0])
    }

    /// An unsigned number in LEB128.
    fn number(&mut self) -> Option<usize> {
        let mut number = 0_u64;
        for shift in (0..35).step_by(7) {
            let byte = self.byte()?;
            number |= u64::from(byte & 0x7f) << shift;
            if byte & 0x80 == 0 {
                return usize::try_from(number).ok();
            }
        }
        None
    }

    fn text(&mut self) -> Option<&'a str> {
        let length = self.number()?;
        std::str::from_utf8(self.take(length)?).ok()
    }

    /// Skips the type of an import.
    fn import(&mut self) -> Option<()> {
        match self.byte()? {
            FUNCTION => drop(self.number()?),
            TABLE => {
                self.byte()?;
                self.limits()?;
            }
            MEMORY => self.limits()?,
            GLOBAL => drop(self.take(2)?),
            TAG => {
                self.byte()?;
                self.number()?;
            }
            _ => return None,
        }
        Some(())
    }

    fn limits(&mut self) -> Option<()> {
        let flags = self.byte()?;
        self.number()?;
        if flags & 1 == 1 {
            self.number()?;
        }
        Some(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The module is written by hand, following the WebAssembly 2.0 specification, section 5.5.
    #[test]
    fn names_of_a_module_are_read() {
        let mut module = HEADER.to_vec();
        let mut section = |number: u8, content: &[u8]| {
            module.extend([number, content.len() as u8]);
            module.extend(content);
        };
        section(1, b"\x01\x60\0\0");
        section(IMPORTS, b"\x02\x03env\x03log\0\0\x03env\x01m\x02\x01\x01\x02");
        section(EXPORTS, b"\x02\x06memory\x02\0\x01f\0\0");
        let names = Names::read(&module).unwrap();
        assert_eq!(names.imports, ["env.log", "env.m"]);
        assert_eq!(names.functions, ["f"], "not the memory");
        assert_eq!(Names::read(&module[..module.len() - 1]), None, "cut off");
        assert_eq!(Names::read(b"\x7fELF"), None);
    }
}
