#!/usr/bin/env bash
# Kills runs of every command at random moments and runs them again: the results must have the same bits as without a kill, nothing may be
# left behind, and a folder never holds results of two runs unless it says so. Then ten runs want one folder at once.
#
# usage: tests/kills.sh [KILLS [SEED]]      500 kills when not given, about ten minutes; UNSCATTER names the program
set -euo pipefail
cd "$(dirname "$0")/.."
kills="${1:-500}"
RANDOM="${2:-1}"
program="$(realpath "${UNSCATTER:-target/release/unscatter}")"
work="$(mktemp -d)"
trap 'rm -rf "$work"' EXIT
cd "$work"

fail() {
  printf 'FAILED: %s\n' "$*"
  exit 1
}

cat >hall.json <<'S'
{"version": 1, "light": {"direction": [0.45, -1, -0.1], "radiance": 4}, "medium": {"sigma_t": 0.08, "g": 0.3},
 "occluders": [{"box": {"center": [0, -0.1, 0], "size": [14, 0.2, 20]}}, {"box": {"center": [-4, 6, 0], "size": [6, 0.2, 20]}},
               {"box": {"center": [3.5, 6, 0], "size": [7, 0.2, 20]}}],
 "views": [{"name": "hall", "camera": {"to_world": {"look_at": {"origin": [1.5, 1.7, 9.5], "target": [0.5, 2.6, 0]}}, "fov": 55,
                                       "size": [96, 64]},
            "strokes": [{"points": [[52, 33], [57, 41]], "radius": 10, "color": "#ff8020"}]}],
 "light_map": {"size": 32}, "shadow_map": {"size": 128}, "solve": {"tolerance": 0, "iterations": 200}}
S
cat >cloud.json <<'S'
{"version": 1, "find": "joint", "environment": {"radiance": 1, "directions": 16}, "lights": [{"direction": [-1, -1, -0.5], "radiance": 3}],
 "volume": {"size": 12, "to_world": {"translate": [-1, -1, -1], "scale": 2}, "albedo": 0.8,
            "extinction": {"made": {"shapes": [{"sphere": {"center": [0, 0, 0], "radius": 0.7}}], "inside": 8, "edge": 0.2}}},
 "background": 0.02,
 "views": [{"name": "front", "camera": {"to_world": {"look_at": {"origin": [0, 0, 4], "target": [0, 0, 0]}}, "fov": 35, "size": [32, 32]},
            "strokes": [{"points": [[15, 15], [20, 18]], "radius": 5, "color": "#ff3020"}]}],
 "solve": {"tolerance": 0, "iterations": 200}}
S
sed 's/"solve".*/"animation": {"frames": 5, "keys": [{"frame": 0}, {"frame": 4, "albedo": 0.6}]}, "solve": {"tolerance": 0, "iterations": 60}}/' \
  cloud.json >smoke.json

# Name, whether it can go on from a checkpoint, and arguments.
cases=(
  "light-map yes light-map hall.json --checkpoint-every 0.02 --preview-every 50"
  "volume yes volume cloud.json --checkpoint-every 0.02 --preview-every 50"
  "animate yes animate smoke.json --checkpoint-every 0.02 --preview-every 50"
  "render no render cloud.json --turntable 6"
  "matrix no matrix hall.json"
)

# What has seconds in it, or says whose the results are, is not compared.
results() {
  (cd "$1" && find . -type f ! -name 'report.*' ! -name '*checkpoint' ! -path '*/.unscatter-*' ! -path './preview/*' -exec cksum {} + | sort -k3)
}
milliseconds() { echo $(($(date +%s%N) / 1000000)); }
run() { "$program" -q --threads 1 "$@" >/dev/null 2>told; }

declare -A times
for case in "${cases[@]}"; do
  read -r name _ arguments <<<"$case"
  # Twice, for the first run of a program is slower.
  for folder in "whole-$name" "whole-$name"; do
    begun=$(milliseconds)
    run $arguments -o "$folder" || fail "$name: $(cat told)"
    times[$name]=$(($(milliseconds) - begun))
  done
  run $arguments -o "old-$name" --set background=0.5 || run $arguments -o "old-$name" --set light.radiance=3 || fail "$name: $(cat told)"
  results "whole-$name" >"whole-$name.sum"
  results "old-$name" >"old-$name.sum"
  cmp -s "whole-$name.sum" "old-$name.sum" && fail "$name: the old results are the new ones"
  printf '%s: %s ms, %s files\n' "$name" "${times[$name]}" "$(wc -l <"whole-$name.sum")"
done

declare -A count=([old]=0 [new]=0 [marked]=0 [resumed]=0 [again]=0 [over]=0)
for ((kill = 1; kill <= kills; kill++)); do
  read -r name resumes arguments <<<"${cases[$((RANDOM % ${#cases[@]}))]}"
  folder="run"
  rm -rf "$folder"
  cp -r "old-$name" "$folder"
  # Every other one while results are written, or just before or after.
  span=${times[$name]}
  if ((kill % 2)); then wait=$((RANDOM * span / 32768)); else wait=$((span * 85 / 100 + RANDOM * (span * 25 / 100 + 20) / 32768)); fi
  "$program" -q --threads 1 $arguments -o "$folder" >/dev/null 2>&1 &
  process=$!
  sleep "$(printf '%d.%03d' $((wait / 1000)) $((wait % 1000)))"
  kill -9 $process 2>/dev/null || count[over]=$((count[over] + 1))
  wait $process 2>/dev/null || true
  results "$folder" >sum
  if cmp -s sum "old-$name.sum"; then
    count[old]=$((count[old] + 1))
  elif cmp -s sum "whole-$name.sum"; then
    count[new]=$((count[new] + 1))
  elif ls "$folder"/.unscatter-*/.unscatter-results >/dev/null 2>&1; then
    count[marked]=$((count[marked] + 1))
  elif [ "$name" != animate ]; then
    # Frames of an animation are written one by one.
    diff sum "whole-$name.sum" || true
    fail "kill $kill of $name after $wait ms: results of two runs, and nothing says so"
  fi
  if [ "$resumes" = yes ] && run $arguments -o "$folder" --resume; then
    count[resumed]=$((count[resumed] + 1))
  else
    run $arguments -o "$folder" || fail "kill $kill of $name after $wait ms: $(cat told)"
    count[again]=$((count[again] + 1))
  fi
  results "$folder" >sum
  cmp -s sum "whole-$name.sum" || { diff sum "whole-$name.sum"; fail "kill $kill of $name after $wait ms: other results"; }
  left="$(find "$folder" -name '.unscatter-*' ! -name .unscatter-results; find "$folder" -name preview)"
  [ -z "$left" ] || fail "kill $kill of $name after $wait ms leaves $left"
done
printf '%s kills: the results were the old ones %s times, the new ones %s, marked as moving %s; %s runs were over already\n' \
  "$kills" "${count[old]}" "${count[new]}" "${count[marked]}" "${count[over]}"
printf 'then %s went on from a checkpoint and %s began anew: all with the same bits, nothing left behind\n' "${count[resumed]}" "${count[again]}"

rm -rf run
for ((i = 0; i < 10; i++)); do
  (code=0; "$program" -q --threads 1 light-map hall.json -o run >/dev/null 2>&1 || code=$?; echo $code >code-$i) &
done
wait
codes="$(cat code-* | sort | uniq -c | awk '{print $2 "x" $1}' | xargs)"
[ "$codes" = "0x1 3x9" ] || fail "ten runs into one folder: exit codes $codes"
results run | cmp -s - whole-light-map.sum || fail "ten runs into one folder: other results"
echo "ten runs into one folder: one wins, nine are refused"
