//! Exports and dependencies of a shared library.

use object::Object as _;
use object::elf::FileHeader64;
use object::read::elf::FileHeader as _;
use object::{Architecture, BinaryFormat, Endianness, read};

/// Format and processor of a library.
///
/// # Panics
/// If the bytes are not a library.
#[must_use]
pub fn format(library: &[u8]) -> (BinaryFormat, Architecture) {
    let file = object::File::parse(library).unwrap_or_else(|error| panic!("{error}"));
    (file.format(), file.architecture())
}

/// Names that a library exports, sorted.
///
/// # Panics
/// If the bytes are not a library.
#[must_use]
pub fn exported(library: &[u8]) -> Vec<String> {
    let file = object::File::parse(library).unwrap_or_else(|error| panic!("{error}"));
    let exports = file.exports().unwrap_or_else(|error| panic!("{error}"));
    let mut names: Vec<_> = exports.iter().map(|export| String::from_utf8_lossy(export.name()).into_owned()).collect();
    names.sort();
    names
}

/// Names of the functions that a library imports from other libraries, sorted.
///
/// # Panics
/// If the bytes are not a library.
#[must_use]
pub fn imported(library: &[u8]) -> Vec<String> {
    let file = object::File::parse(library).unwrap_or_else(|error| panic!("{error}"));
    let imports = file.imports().unwrap_or_else(|error| panic!("{error}"));
    let mut names: Vec<_> = imports.iter().map(|import| String::from_utf8_lossy(import.name()).into_owned()).collect();
    names.sort();
    names
}

/// Returns true for a function of the C library whose last digits can depend on the platform: all functions in <math.h>
/// and <complex.h>, in double and single precision, except those whose result is uniquely defined.
#[must_use]
pub fn is_inexact(function: &str) -> bool {
    const INEXACT: [&str; 36] = [
        "acos", "acosh", "asin", "asinh", "atan", "atan2", "atanh", "cbrt", "cos", "cosh", "erf", "erfc", "exp",
        "exp10", "exp2", "expm1", "hypot", "j0", "j1", "jn", "lgamma", "lgamma_r", "log", "log10", "log1p", "log2",
        "pow", "powi", "sin", "sincos", "sinh", "tan", "tanh", "tgamma", "y0", "y1",
    ];
    let function = function.trim_start_matches('_');
    let function = function.strip_suffix("_finite").unwrap_or(function).trim_end_matches('_');
    [function, function.strip_suffix(['f', 'l']).unwrap_or(function)].iter().any(|name| INEXACT.contains(name))
}

/// Names of the libraries that a Windows library requires: sorted, and in lower case because Windows ignores case.
///
/// # Panics
/// If the bytes are not a library.
#[must_use]
pub fn imported_libraries(library: &[u8]) -> Vec<String> {
    let file = object::File::parse(library).unwrap_or_else(|error| panic!("{error}"));
    let imports = file.imports().unwrap_or_else(|error| panic!("{error}"));
    let mut names: Vec<_> =
        imports.iter().map(|import| String::from_utf8_lossy(import.library()).to_lowercase()).collect();
    names.sort();
    names.dedup();
    names
}

/// The newest version of the GNU C library that a 64-bit ELF library requires, such as (2, 17); `None` if it requires
/// no version, for example because it uses another C library.
///
/// # Errors
/// The bytes are not such a library.
pub fn newest_glibc(library: &[u8]) -> read::Result<Option<(u32, u32)>> {
    let header = FileHeader64::<Endianness>::parse(library)?;
    let endian = header.endian()?;
    let sections = header.sections(endian, library)?;
    let Some((mut files, link)) = sections.gnu_verneed(endian, library)? else { return Ok(None) };
    let strings = sections.strings(endian, library, link)?;
    let mut newest = None;
    while let Some((_, mut versions)) = files.next()? {
        while let Some(version) = versions.next()? {
            let name = version.name(endian, strings)?;
            newest = newest.max(std::str::from_utf8(name).ok().and_then(glibc_version));
        }
    }
    Ok(newest)
}

/// Converts `GLIBC_2.2.5` to (2, 2); the third number is not needed.
fn glibc_version(name: &str) -> Option<(u32, u32)> {
    let mut numbers = name.strip_prefix("GLIBC_")?.split('.').map(str::parse);
    Some((numbers.next()?.ok()?, numbers.next()?.ok()?))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn inexact_functions_are_told_from_exact_ones() {
        assert!(["sin", "powf", "hypotl", "__exp_finite", "sincos", "erf", "erff"].into_iter().all(is_inexact));
        assert!(
            !["sqrt", "floor", "fmod", "fma", "trunc", "rint", "ldexp", "memcpy", "exit"].into_iter().any(is_inexact)
        );
    }

    #[test]
    fn versions_of_the_c_library_are_compared_as_numbers() {
        assert_eq!(glibc_version("GLIBC_2.2.5"), Some((2, 2)));
        assert!(glibc_version("GLIBC_2.17") > glibc_version("GLIBC_2.3.4"));
        assert_eq!(glibc_version("GCC_3.0"), None);
    }
}
