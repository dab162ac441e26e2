//! `goniod` under a name that does not clash with the real one, so that tests find it beside them.

fn main() -> std::process::ExitCode {
    goniod::main()
}
