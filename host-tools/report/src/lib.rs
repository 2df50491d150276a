//! Evaluation against a reference, statistics and plots.
