//! Error against run time, and the paper's evaluation.
