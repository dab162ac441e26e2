//! Journals on disk, and whole captures against the in-process rig under a paused clock.

mod journal;
