//! What can go wrong, each as one sentence that says what to do.

use std::path::PathBuf;

/// Why an evaluation, or its report, could not be made.
#[derive(Debug, thiserror::Error)]
pub enum ReportError {
    /// The session holds no frames.
    #[error("{session}: there are no frames in it, so there is nothing to evaluate")]
    NoFrames {
        /// Name of the session.
        session: String,
    },
    /// No frame has a pose.
    #[error(
        "{session}: none of its {frames} frames has a pose ({waiting} waited for the rest pose, which takes at least 10 frames at rest with the targets in sight); its events say what was lost"
    )]
    NoPose {
        /// Name of the session.
        session: String,
        /// Frames in all.
        frames: usize,
        /// Those of them that waited.
        waiting: usize,
    },
    /// No frame with a pose has a truth.
    #[error(
        "no frame of {session} that has a pose is in {reference}: measured are frames {} to {}, {reference} has {} to {}; are both of the same ride?",
        measured.0, measured.1, given.0, given.1
    )]
    NoOverlap {
        /// Name of the session.
        session: String,
        /// Name of the reference.
        reference: String,
        /// First and last frame with a pose.
        measured: (u32, u32),
        /// First and last frame of the reference.
        given: (u32, u32),
    },
    /// The reference cannot be read.
    #[error("{name}: cannot be read: {why}")]
    ReadReference {
        /// Its name.
        name: String,
        /// What the system said.
        why: std::io::Error,
    },
    /// The reference's first line lacks a column, or has it twice.
    #[error("{name}, line {line}: {what}")]
    Header {
        /// Name of the reference.
        name: String,
        /// Line of the header.
        line: u64,
        /// What is wrong, and what is allowed.
        what: String,
    },
    /// A cell of the reference is wrong.
    #[error("{name}, line {line}, column {column}: {what}")]
    Cell {
        /// Name of the reference.
        name: String,
        /// Its line, from 1.
        line: u64,
        /// Name of the column, as the file gives it.
        column: String,
        /// What is wrong, and what is allowed.
        what: String,
    },
    /// The reference has a header and no rows.
    #[error("{name}: there is no truth in it, only a header; expected is one row a frame")]
    EmptyReference {
        /// Its name.
        name: String,
    },
    /// A recorder's file has too few rows to be aligned, or times that do not rise.
    #[error(
        "{name}: {rows} rows with rising times and all six values; {least} are the fewest that can be aligned"
    )]
    FewRows {
        /// Its name.
        name: String,
        /// Rows with values.
        rows: usize,
        /// Fewest that do.
        least: usize,
    },
    /// A session has too few poses to be aligned.
    #[error(
        "{session}: {frames} frames with a pose; {least} are the fewest that can be aligned with a recorder"
    )]
    FewFrames {
        /// Name of the session.
        session: String,
        /// Frames with a pose.
        frames: usize,
        /// Fewest that do.
        least: usize,
    },
    /// The motions of session and recorder do not belong together.
    #[error(
        "{session} cannot be aligned with {reference}: at best their motions correlate by {correlation:.2}, and 0.7 is the least that is believed; are both of the same ride, with x forward, y left, z up?"
    )]
    NoAlignment {
        /// Name of the session.
        session: String,
        /// Name of the reference.
        reference: String,
        /// The best correlation found.
        correlation: f64,
    },
    /// A file of the report cannot be written.
    #[error("{}: cannot be written: {why}; give another folder with --out", path.display())]
    Write {
        /// Its path.
        path: PathBuf,
        /// What the system said.
        why: std::io::Error,
    },
    /// A picture cannot be drawn.
    #[error("the picture cannot be drawn: {what}")]
    Draw {
        /// What the renderer said.
        what: String,
    },
}
