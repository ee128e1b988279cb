//! Values as bytes, for stores and other processes.

use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::error::Error;

/// The bytes of a value.
pub(super) fn to_bytes(value: &impl Serialize) -> Vec<u8> {
    postcard::to_allocvec(value).unwrap_or_else(|_| unreachable!("a vector takes any bytes"))
}

/// The value of these bytes, which are those of `what`. An error says that they are not: where postcard stopped in
/// them tells a user nothing.
pub(super) fn from_bytes<T: DeserializeOwned>(
    what: &'static str,
    bytes: &[u8],
) -> Result<T, Error> {
    postcard::from_bytes(bytes).map_err(|_| Error::Stored { what })
}
