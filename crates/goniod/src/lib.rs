//! The capture daemon as a library.
