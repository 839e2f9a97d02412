#!/usr/bin/env bash
# The whole truth about a graphics card, in five minutes, from one folder that needs nothing but a driver.
#
#   benches/card.sh prepare [FOLDER]        builds the folder, here; target/card by default
#   FOLDER/card.sh run [--adapter NAME] OUT measures and tests a card, there; OUT gets card.md, card.json and logs
#   FOLDER/card.sh run --dry OUT            shows in seconds that everything runs, on a software adapter
set -euo pipefail

# All that is brought along may take so many MiB.
most=55
# Vulkan's loader, and what NVIDIA's driver needs of a desktop where there is none.
packages=(libvulkan1 libglvnd0 libegl1 libgl1 libglx0 libopengl0 libgles2 libx11-6 libxext6 libxcb1 libxau6 libxdmcp6 libbsd0 libmd0)

here="${BASH_SOURCE[0]%/*}"
[ "$here" != "${BASH_SOURCE[0]}" ] || here=.
here="$(cd "$here" && pwd)"

usage() {
  printf '%s\n' "usage: card.sh prepare [FOLDER]" "       card.sh run [--dry] [--adapter NAME] OUT" >&2
  exit 2
}

# Builds the programs, and says where each lies.
programs() {
  local told
  told="$(cargo build --locked --release --bin unscatter --bench kernels --bench card --message-format=json)"
  told+=$'\n'"$(cargo test --locked --release --test suite --no-run --message-format=json)"
  sed -n 's/.*"executable":"\([^"]*\)".*/\1/p' <<<"$told" | sort -u
}

# The libraries of some Debian packages, each under the name that programs ask for.
libraries() {
  local into="$1" work file
  work="$(mktemp -d)"
  if (cd "$work" && apt-get download -q "${packages[@]}") >"$work/told" 2>&1; then
    for file in "$work"/*.deb; do dpkg -x "$file" "$work/all"; done
    while IFS= read -r file; do
      cp -L "$file" "$into/"
    done < <(find "$work/all" -name '*.so.[0-9]*' | grep -E '\.so\.[0-9]+$')
  else
    echo "warning: apt-get brings no libraries; taking Vulkan's loader from this system" >&2
    for file in /usr/lib/*-linux-gnu /usr/lib64 /usr/lib; do
      [ ! -e "$file/libvulkan.so.1" ] || { cp -L "$file/libvulkan.so.1" "$into/"; break; }
    done
    [ -e "$into/libvulkan.so.1" ] || echo "warning: no Vulkan loader here; the card's machine needs its own" >&2
  fi
  rm -rf "$work"
}

prepare() {
  cd "$here/.."
  local folder="${1:-target/card}" path name size glibc
  mkdir -p "$folder"
  folder="$(cd "$folder" && pwd)"
  rm -rf "${folder:?}"/{bin,faulty,loader,strokes,card.sh}
  mkdir -p "$folder"/{bin,faulty,loader}
  while IFS= read -r path; do
    name="${path##*/}"
    case "$name" in
      unscatter) ;;
      kernels-* | card-* | suite-*) name="${name%-*}" ;;
      *) continue ;;
    esac
    strip -o "$folder/bin/$name" "$path" 2>/dev/null || cp "$path" "$folder/bin/$name"
  done < <(programs)
  for name in unscatter kernels card suite; do
    [ -x "$folder/bin/$name" ] || { echo "$name was not built" >&2; exit 1; }
  done
  glibc="$(grep -aoh 'GLIBC_2\.[0-9]*' "$folder"/bin/* | sort -uV | tail -n 1)"
  glibc="${glibc#GLIBC_}"
  # All but the runner, which unpacks them.
  gzip -9 "$folder"/bin/{unscatter,kernels,suite}
  # A loader that fails as drivers do, for the tests.
  cc -shared -fPIC -o "$folder/faulty/libvulkan.so.1" tests/faulty_vulkan.c -ldl
  cp -r strokes benches/card.sh "$folder/"
  libraries "$folder/loader"
  size="$(du -sm "$folder" | cut -f1)"
  echo "$folder: $size MiB; the programs need glibc $glibc or newer, and a Vulkan driver"
  [ "$size" -le "$most" ] || { echo "that is more than $most MiB" >&2; exit 1; }
}

case "${1:-}" in
  prepare)
    [ $# -le 2 ] || usage
    prepare "${2:-}"
    ;;
  run)
    [ -x "$here/bin/card" ] || { echo "this is no bundle: benches/card.sh prepare makes one" >&2; exit 2; }
    CARD_DATE="$(TZ=UTC printf '%(%Y-%m-%dT%H:%M:%SZ)T' -1)" exec "$here/bin/card" "$@"
    ;;
  *) usage ;;
esac
