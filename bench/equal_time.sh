#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# Errors of the integrators at equal time, as a table: for each scene the median over runs of
# relMSE, and in brackets without the worst 0.1 % of pixels.
#
#   bench/equal_time.sh SECONDS RUNS THREADS REFERENCES SCENE.xml...
#
# REFERENCES is a folder of images NAME.exr, NAME as in NAME.xml, or the folder's name of a
# scene.xml. What it lacks is rendered into it, for twenty times SECONDS.
set -euo pipefail

if [[ $# -lt 5 ]]; then
  sed -n '3,9p' "$0" | sed 's/^# \{0,1\}//' >&2
  exit 2
fi
seconds=$1 runs=$2 threads=$3 references=$4
shift 4
driftlight=$(dirname "$0")/../build/release/driftlight
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

names=(path bdpt chain redistribution splitting)
options_of() {
  case $1 in
    path | bdpt) echo "--integrator $1" ;;
    *) echo "--set mode=$1" ;;
  esac
}

# error NAME SCENE REFERENCE: one line a run, relMSE and trimmed.
errors() {
  local run
  for ((run = 1; run <= runs; ++run)); do
    # shellcheck disable=SC2046
    "$driftlight" render "$2" $(options_of "$1") --time "$seconds" --threads "$threads" \
      --seed "$run" -q -o "$work/image.exr" 2>/dev/null
    "$driftlight" diff "$work/image.exr" "$3" |
      awk '/^relMSE  /{a=$2} /^relMSE trimmed/{t=$3} END{print a, t}'
  done
}

median() { sort -g | sed -n "$(((runs + 1) / 2))p"; }

mkdir -p "$references"
printf '| scene |'
printf ' %s |' "${names[@]}"
printf '\n| --- | ---: | ---: | ---: | ---: | ---: |\n'
for scene in "$@"; do
  name=$(basename "$scene" .xml)
  [[ $name == scene ]] && name=$(basename "$(dirname "$scene")")
  reference=$references/$name.exr
  [[ -e $reference ]] ||
    "$driftlight" render "$scene" --time $((20 * seconds)) --threads "$threads" --seed 1000 -q \
      -o "$reference" 2>/dev/null
  row="| $name |"
  for integrator in "${names[@]}"; do
    errors "$integrator" "$scene" "$reference" >"$work/errors"
    row+=" $(awk '{print $1}' "$work/errors" | median)"
    row+=" ($(awk '{print $2}' "$work/errors" | median)) |"
  done
  echo "$row"
done
