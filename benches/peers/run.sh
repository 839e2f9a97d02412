#!/usr/bin/env bash
# Times unscatter and what users would take instead on the same problems, and prints a table.
# Needs Rust, Python 3 with venv, and the packages that it installs: SciPy, Mitsuba and ASTRA by pip; LLVM for Mitsuba by apt.
set -euo pipefail
here="$(cd "$(dirname "$0")" && pwd)"
cd "$here/../.."
folder="$(mkdir -p "${1:-target/peers}" && cd "${1:-target/peers}" && pwd)"

python="$folder/venv/bin/python"
[ -x "$python" ] || python3 -m venv "$folder/venv"
"$python" -m pip install --quiet numpy scipy mitsuba astra-toolbox
llvm() { find /usr/lib -name 'libLLVM*.so*' 2>/dev/null | grep -E 'LLVM(-|\.so\.)(1[6-9]|2[0-9])' | sort | tail -n 1; }
if [ -z "$(llvm)" ] && command -v apt-get >/dev/null; then
  as_root=""
  [ "$(id -u)" -eq 0 ] || as_root="sudo"
  $as_root apt-get install -qy --no-install-recommends libllvm19
fi
DRJIT_LIBLLVM_PATH="${DRJIT_LIBLLVM_PATH:-$(llvm)}"
export DRJIT_LIBLLVM_PATH

cargo build --release --quiet
cargo bench --quiet --bench peers -- "$folder"
unscatter=target/release/unscatter
"$unscatter" matrix strokes/citadel.json --quiet -o "$folder/matrix" >/dev/null
"$unscatter" light-map strokes/citadel.json --quiet --json --backend cpu --solver lsqr --iterations 32 --tolerance 0 \
  --set solve.tikhonov=0 -o "$folder/light_map" >"$folder/light_map.json"

printf '%s, %s cores, %s\n\n' "$(sed -n 's/^model name[^:]*: //p' /proc/cpuinfo | head -n 1)" "$(nproc)" "$(date +%F)"
"$python" "$here/compare.py" "$folder" 2>"$folder/errors" || { cat "$folder/errors" >&2; exit 1; }
