//! TinyG.
