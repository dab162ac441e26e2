//! A simulated Dynamixel bus on a pseudo-terminal.

fn main() -> std::process::ExitCode {
    firmware_sim::main()
}
