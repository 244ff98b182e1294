//! Strings and URIs that pass between Rust and C.

use std::ffi::{CStr, CString, c_char};

/// `file:` URI of a folder, everything but plain characters percent-encoded (RFC 3986).
pub(super) fn file_uri(path: &std::path::Path) -> CString {
    let text = path.to_string_lossy().replace('\\', "/");
    // A Windows path starts with a drive letter, the path of a URI with a slash.
    let root = if text.starts_with('/') { "" } else { "/" };
    let mut uri = format!("file://{root}");
    for byte in text.bytes() {
        if byte.is_ascii_alphanumeric() || b"-._~/:".contains(&byte) {
            uri.push(char::from(byte));
        } else {
            uri.push_str(&format!("%{byte:02X}"));
        }
    }
    // Control characters were encoded above, so there is no zero byte left to fail on.
    CString::new(uri).unwrap_or_default()
}

/// Path of a folder with a separator at its end.
pub(super) fn folder_path(path: &std::path::Path) -> CString {
    let text = format!("{}{}", path.to_string_lossy(), std::path::MAIN_SEPARATOR);
    CString::new(text).unwrap_or_default()
}

/// Owned text of a C string; empty for null, faulty UTF-8 replaced.
///
/// # Safety
/// `text` is null or points to a string that ends with a zero byte.
pub(super) unsafe fn text(text: *const c_char) -> String {
    if text.is_null() {
        return String::new();
    }
    // SAFETY: not null, the rest is promised by the caller.
    unsafe { CStr::from_ptr(text) }.to_string_lossy().into_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn resource_uri_is_encoded() {
        let uri = file_uri(std::path::Path::new("/a b%ü/resources"));
        assert_eq!(uri.to_str().unwrap(), "file:///a%20b%25%C3%BC/resources");
    }
}
