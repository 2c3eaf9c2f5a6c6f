#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# Integrators at equal time on scenes, as a table: relMSE by the spread of independent runs, in
# brackets without the worst 0.1 % of pixels. The folder OUT keeps the comparison of each scene; what
# is in it is not rendered again, so that a table of many hours can be made in parts.
# Usage: [TIME=60] [RUNS=3] [THREADS=2] [INTEGRATORS=a,b,..] bench/equal_time.sh OUT [SCENE.xml..]
set -euo pipefail
root=$(cd "$(dirname "$0")/.." && pwd)
program=$root/build/release/driftlight
integrators=${INTEGRATORS:-langevin,bdpt,path,light,langevin:mode=chain,mmlt,pssmlt,lmc,h2mc,mlt,erpt}
[[ $# -gt 0 ]] || {
  sed -n 's/^# \(Usage.*\)/\1/p' "$0" >&2
  exit 2
}
[[ -x $program ]] || {
  echo "equal_time.sh: there is no '$program'" >&2
  exit 2
}
out=$1
shift
[[ $# -gt 0 ]] || set -- "$root"/scenes/*.xml
mkdir -p "$out"

echo "| scene | \`${integrators//,/\` | \`}\` |"
echo "| --- |$(tr ',' '\n' <<<"$integrators" | sed 's/.*/ ---: |/' | tr -d '\n')"
for scene in "$@"; do
  name=$(basename "$scene" .xml)
  # Scenes of others are often folders with a scene.xml.
  [[ $name != scene ]] || name=$(basename "$(dirname "$(realpath "$scene")")")
  [[ -d $out/$name ]] ||
    "$program" compare "$scene" --integrators "$integrators" --time "${TIME:-60}" \
      --runs "${RUNS:-3}" --threads "${THREADS:-2}" --out "$out/$name" >"$out/$name.log" 2>&1
  awk -F, -v name="$name" -v wanted="$integrators" '
    function digits(x) { return sprintf(x == 0 || (x >= 1e-4 && x < 100) ? "%.2g" : "%.1e", x) }
    $2 == 1 { cell[$1] = digits($11) " (" digits($12) ")" }
    END {
      printf "| `%s` |", name
      count = split(wanted, names, ",")
      for (i = 1; i <= count; ++i) printf " %s |", cell[names[i]]
      print ""
    }' "$out/$name/results.csv"
done
