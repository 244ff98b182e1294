//! Serializes the state of stateful models.

/// Converts a simulation to bytes.
pub fn to_bytes<S: ::serde::Serialize>(simulation: &S) -> Result<Vec<u8>, String> {
    postcard::to_allocvec(simulation).map_err(|error| error.to_string())
}

/// Converts bytes to a simulation. Fails if the bytes come from another type or version.
pub fn from_bytes<S: for<'de> ::serde::Deserialize<'de>>(bytes: &[u8]) -> Result<S, String> {
    postcard::from_bytes(bytes).map_err(|error| error.to_string())
}
