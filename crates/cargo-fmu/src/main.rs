//! `cargo fmu`, see the library of this package.

fn main() -> miette::Result<()> {
    cargo_fmu::main()
}
