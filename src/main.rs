//! The `unscatter` command.

fn main() -> std::process::ExitCode {
    unscatter::cli::main()
}
