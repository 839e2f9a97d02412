#!/usr/bin/env bash
# Installs what the tests need on a bare Debian or Ubuntu machine with Rust, then runs them all.
set -euo pipefail
cd "$(dirname "$0")"
export CARGO_TERM_COLOR="${CARGO_TERM_COLOR:-auto}"

say() { printf '\n== %s\n' "$*"; }

install() {
  local as_root=""
  [ "$(id -u)" -eq 0 ] || as_root="sudo"
  $as_root apt-get update -q
  $as_root apt-get install -qy --no-install-recommends "$@"
}

# A linker is all that Rust itself does not bring.
if ! command -v cc >/dev/null; then
  say "installing a C compiler for linking"
  install gcc libc6-dev
fi
for part in rustfmt clippy; do
  cargo "${part/rustfmt/fmt}" --version >/dev/null 2>&1 || rustup component add "$part"
done

# Tests that draw their cases by lot draw the same ones every time. To hunt for others: PROPTEST_RNG_SEED=$RANDOM ./test.sh
export PROPTEST_RNG_SEED="${PROPTEST_RNG_SEED:-2015}"

out="$(mktemp -d)"
trap 'rm -rf "$out"' EXIT
# Where there is no session, Mesa complains about it on standard error.
export XDG_RUNTIME_DIR="${XDG_RUNTIME_DIR:-$out}"

say "format"
cargo fmt --all --check
cargo fmt --manifest-path fuzz/Cargo.toml --check

say "lints"
cargo clippy --all-targets --locked --release -- -D warnings
cargo clippy --all-targets --locked --release --no-default-features --features cli -- -D warnings

say "graphics adapters"
has_adapter() { cargo run --locked --release --quiet -- doctor | grep -q '  answers   right'; }
if ! has_adapter && command -v apt-get >/dev/null; then
  say "installing Mesa's software adapter"
  install mesa-vulkan-drivers || true
fi
cargo run --locked --release --quiet -- doctor
ignored=()
if has_adapter; then ignored=(--include-ignored); else say "no adapter: the tests that need one are ignored"; fi

say "OpenVDB"
has_openvdb() { /usr/bin/python3 -c 'import pyopenvdb' 2>/dev/null; }
if ! has_openvdb && command -v apt-get >/dev/null; then
  say "installing OpenVDB for Python"
  install python3-openvdb || true
fi

say "tests"
cargo test --locked --release --lib --bins --test march --test suite -- --skip vdb_peer "${ignored[@]}"
if has_openvdb; then
  cargo test --locked --release --test suite -- --include-ignored vdb_peer
else
  say "no OpenVDB: the tests that need it are ignored"
fi

if has_adapter; then
  say "the bundle for a graphics card, dry"
  benches/card.sh prepare "$out/card"
  "$out/card/card.sh" run --dry "$out/card-figures" || { tail -n 40 "$out"/card-figures/logs/*; exit 1; }
  cat "$out/card-figures/card.md"
  code=0
  VK_DRIVER_FILES=none VK_ICD_FILENAMES=none "$out/card/card.sh" run "$out/no-card" 2>"$out/told" || code=$?
  [ "$code" -eq 3 ] && grep -q "there is no graphics card" "$out/told" || { cat "$out/told"; exit 1; }
fi

say "the studio in a browser"
browser() { command -v chromium || command -v chromium-browser || command -v google-chrome; }
if ! browser >/dev/null && command -v apt-get >/dev/null; then
  say "installing Chromium"
  install chromium || true
fi
has_playwright() { python3 -m venv "$out/venv" && "$out/venv/bin/pip" install --quiet playwright; }
if browser >/dev/null && { has_playwright || { install python3-venv && has_playwright; }; }; then
  cargo build --locked --release --quiet
  "$out/venv/bin/python" tests/studio/drive.py "${CARGO_TARGET_DIR:-target}/release/unscatter"
else
  say "no Chromium or no Playwright: the studio is not seen in a browser"
fi

say "tests without the GPU backend"
cargo test --locked --release --no-default-features --features cli --lib --bins --test march --test suite

say "the library alone"
cargo clippy --locked --release --lib --no-default-features -- -D warnings
cargo tree --locked -e normal --no-default-features --depth 1 --prefix none | tail -n +2 | cut -d' ' -f1 >"$out/crates"
sed -n '/^```text$/,/^```$/p' docs/library.md | grep -v '^```' | diff - "$out/crates"

say "documentation"
RUSTDOCFLAGS="-D warnings" cargo doc --locked --release --no-deps --quiet
cargo test --locked --release --doc

say "examples"
for example in examples/*; do
  name="$(basename "$example" .rs)"
  printf -- '-- %s\n' "$name"
  cargo run --locked --release --quiet --example "$name" -- "$out/$name" >/dev/null
done

say "numerical stability, in short"
cargo run --locked --release --quiet -- stress --quick >"$out/stress" || { cat "$out/stress"; exit 1; }
tail -n 1 "$out/stress"

say "benchmark, in short"
cargo run --locked --release --quiet -- bench --quick --backend cpu -q --counts benches/counts.csv -o "$out/bench"

say "the demo scenes are what their generator makes"
for file in strokes/*.*; do
  cmp "$file" "$out/03_demo_scenes/$(basename "$file")"
done

say "all tests passed"
