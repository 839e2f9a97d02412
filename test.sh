#!/usr/bin/env bash
# Installs what the tests need on a bare Debian or Ubuntu machine with Rust, then runs them all.
set -euo pipefail
cd "$(dirname "$0")"
export CARGO_TERM_COLOR="${CARGO_TERM_COLOR:-auto}"

say() { printf '\n== %s\n' "$*"; }

# A linker is all that Rust itself does not bring.
if ! command -v cc >/dev/null; then
  say "installing a C compiler for linking"
  as_root=""
  [ "$(id -u)" -eq 0 ] || as_root="sudo"
  $as_root apt-get update -q
  $as_root apt-get install -qy --no-install-recommends gcc libc6-dev
fi
for part in rustfmt clippy; do
  cargo "${part/rustfmt/fmt}" --version >/dev/null 2>&1 || rustup component add "$part"
done

say "format"
cargo fmt --all --check

say "lints"
cargo clippy --all-targets --locked --release -- -D warnings

say "tests"
cargo test --locked --release --lib --bins --test suite

say "documentation"
RUSTDOCFLAGS="-D warnings" cargo doc --locked --release --no-deps --quiet
cargo test --locked --release --doc

say "examples"
out="$(mktemp -d)"
trap 'rm -rf "$out"' EXIT
for example in examples/*; do
  name="$(basename "$example" .rs)"
  printf -- '-- %s\n' "$name"
  cargo run --locked --release --quiet --example "$name" -- "$out/$name" >/dev/null
done

say "the demo scenes are what their generator makes"
for file in strokes/*; do
  cmp "$file" "$out/03_demo_scenes/$(basename "$file")"
done

say "all tests passed"
