//! Journals on disk, and whole captures against the in-process rig under a paused clock.

mod bench;
mod extensions;
mod faults;
mod fly;
mod journal;
mod legs;
mod light;
mod operator;
mod parking;
mod servos;
mod suspend;
mod time;
mod whole;
