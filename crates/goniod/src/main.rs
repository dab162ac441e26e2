//! The daemon.

fn main() -> std::process::ExitCode {
    goniod::main()
}
