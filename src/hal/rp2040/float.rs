//! Floats, by `libm`.

pub use libm::{atan2f, cosf, powf, sinf, sqrtf};
