//! The technician's command line.

fn main() -> std::process::ExitCode {
    gonioctl::main()
}
