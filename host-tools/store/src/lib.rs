//! Sessions on disk: decode, index, export.
