#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# What each way to differentiate costs the compiler: processor seconds of its translation unit (the
# least of RUNS, 3 by default) and bytes of its code, as a table. The first row is the headers alone.
# Usage: bench/derivatives/cost.sh [BUILD_DIR], a build directory with DRIFTLIGHT_BUILD_BENCH=ON.
set -euo pipefail
root=$(cd "$(dirname "$0")/../.." && pwd)
build=${1:-$root/build/release}
runs=${RUNS:-3}
commands=$build/compile_commands.json
[[ -f $commands ]] || {
  echo "cost.sh: there is no '$commands'" >&2
  exit 2
}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

# The compiler's command for a source, without ccache and without its output.
command_for() {
  grep -B1 -F "\"file\": \"$root/$1\"" "$commands" | sed -n 's/^ *"command": "\(.*\)",$/\1/p' |
    sed -e 's/\\\(.\)/\1/g' -e 's/^.*ccache //' -e 's/ -o [^ ]*//'
}

# row NAME SOURCE [TEXT]: a row for the source, or for TEXT compiled in its stead.
row() {
  local name=$1 source=$2 command best=1e9 seconds i
  command=$(command_for "$source")
  [[ -n $command ]] || {
    echo "cost.sh: '$source' is not part of '$build'" >&2
    exit 2
  }
  if [[ $# -gt 2 ]]; then
    printf '%s\n' "$3" >"$work/text.cpp"
    command=${command% -c *}" -c $work/text.cpp"
  fi
  TIMEFORMAT='%U %S'
  for ((i = 0; i < runs; ++i)); do
    seconds=$({ time eval "$command -o $work/object.o"; } 2>&1 | awk 'END { print $1 + $2 }')
    best=$(awk -v a="$seconds" -v b="$best" 'BEGIN { print a < b ? a : b }')
  done
  printf '| %s | %.1f | %d |\n' "$name" "$best" \
    "$(size -A "$work/object.o" | awk '$1 ~ /^\.text/ { sum += $2 } END { print sum + 0 }')"
}

echo "| unit | compile, s | code, bytes |"
echo "| --- | ---: | ---: |"
row "headers alone" bench/derivatives/gradient_wide.cpp '#include "derivatives/passes.h"'
row "value" src/contribution.cpp
row "gradient, wide" bench/derivatives/gradient_wide.cpp
row "gradient, stride 4" bench/derivatives/gradient_stride4.cpp
row "gradient, stride 8" bench/derivatives/gradient_stride8.cpp
row "gradient, wide, float" bench/derivatives/gradient_wide_float.cpp
row "gradient, stride 4, float" bench/derivatives/gradient_stride4_float.cpp
row "gradient, stride 8, float" bench/derivatives/gradient_stride8_float.cpp
row "gradient, central differences" bench/derivatives/gradient_differences.cpp
row "gradient + Q, wide" bench/derivatives/gradient_q_wide.cpp
row "gradient + Q, widths 4 and 8, three requests" src/gradient.cpp
row "gradient + Q, stage jets, three requests" src/linearization_jet.cpp
row "gradient + Q, by hand" src/linearization_hand.cpp
row "factors" src/factor.cpp
row "divergence, differences" src/divergence.cpp
row "divergence, nested jets" src/exact_divergence.cpp
