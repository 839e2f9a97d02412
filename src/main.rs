//! The `unscatter` command.

fn main() -> ! {
    unscatter::cli::main()
}
