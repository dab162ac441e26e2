//! One program for all targets: `FUZZ_TARGET` says which. `fuzz/run` builds and runs them.

#![no_main]

mod bodies;

use std::sync::OnceLock;

use libfuzzer_sys::fuzz_target;

static BODY: OnceLock<bodies::Body> = OnceLock::new();

fuzz_target!(|bytes: &[u8]| BODY.get_or_init(chosen)(bytes));

/// The target that is asked for. A panic ends the process, except where the rig survives it as well: in `dynamixel2`.
fn chosen() -> bodies::Body {
    let inner = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |panic| {
        if !panic
            .location()
            .is_some_and(|place| place.file().contains("dynamixel2"))
        {
            inner(panic);
        }
    }));
    let name = std::env::var("FUZZ_TARGET").unwrap_or_default();
    let known = bodies::TARGETS.iter().find(|(known, _)| *known == name);
    let names = bodies::TARGETS.map(|(known, _)| known).join(", ");
    known
        .unwrap_or_else(|| panic!("FUZZ_TARGET is \"{name}\", allowed: {names}"))
        .1
}
