//! Strings and URIs for C.

use std::ffi::{CStr, CString, c_char};

/// `file:` URI of a folder. All characters except unreserved ones are percent-encoded (RFC 3986).
pub(super) fn file_uri(path: &std::path::Path) -> CString {
    let text = path.to_string_lossy().replace('\\', "/");
    // A Windows path starts with a drive letter, the path in a URI with a slash.
    let root = if text.starts_with('/') { "" } else { "/" };
    let mut uri = format!("file://{root}");
    for byte in text.bytes() {
        if byte.is_ascii_alphanumeric() || b"-._~/:".contains(&byte) {
            uri.push(char::from(byte));
        } else {
            uri.push_str(&format!("%{byte:02X}"));
        }
    }
    // Cannot fail: zero bytes were encoded above.
    CString::new(uri).unwrap_or_default()
}

/// Path of a folder with a separator at its end.
pub(super) fn folder_path(path: &std::path::Path) -> CString {
    let text = format!("{}{}", path.to_string_lossy(), std::path::MAIN_SEPARATOR);
    CString::new(text).unwrap_or_default()
}

/// Copies a C string; empty for null. Replaces invalid UTF-8.
///
/// # Safety
/// `text` must be null or point to a string that ends with a zero byte.
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
