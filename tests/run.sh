#!/usr/bin/env bash
# Everything that must be green: lint, types, tests and doctests, and the wheel on its own.
# Usage: tests/run.sh BIN [JOBS], with BIN the folder of an environment that holds the test extra and
# JOBS the number of test processes, 2 unless told otherwise: one a core, 1.5 GB each.
set -euo pipefail
cd "$(dirname "$0")/.."
bin=$(cd "$1" && pwd)
jobs=${2:-2}
unset PYTHONDONTWRITEBYTECODE  # every process would compile every module that it imports

"$bin/ruff" check .
"$bin/ruff" format --check .

scratch=$(mktemp -d)
trap 'kill $(jobs -p) 2> /dev/null || true; wait; rm -rf "$scratch"' EXIT

ended() {  # NAME PROCESS: what a process in the background said, where it failed
  wait "$2" || { cat "$scratch/$1.log"; echo "$1 fails"; return 1; }
}
bash tests/types.sh "$bin" > "$scratch/types.log" 2>&1 & types=$!

# every kernel compiled once: test processes that begin together would each compile them all
warm() {
  for scene in bilge-pump journal-bearing propulsion-shaft; do
    "$bin/wearstate" simulate "$scene" --set "duration=0.4 s" -o "$scratch/warm.h5" --force || return
  done
  "$bin/wearstate" generate bilge-pump-small -n 24 -o "$scratch/warm-set.h5" -j 1 || return
  "$bin/wearstate" stability journal-bearing --map relaxation-mesh --size 3 -o "$scratch/warm.svg" \
    || return
  "$bin/wearstate" verify
}
warm > "$scratch/warm.log" 2>&1 & warm=$!

# The wheel, in environments that have nothing else: a forgotten package or file shows here. One has
# the lowest versions that pyproject.toml allows, the other the newest; each does the whole job.
"$bin/python" -m build --wheel --outdir "$scratch" . > "$scratch/build.log" 2>&1 \
  || { cat "$scratch/build.log"; exit 1; }
whole_job() {  # NAME RESOLUTION; lowest-direct makes low what -r names, and not what a wheel needs
  "$bin/uv" venv --quiet --python "$bin/python" "$scratch/$1" \
    && "$bin/uv" pip install --quiet --python "$scratch/$1/bin/python" --resolution "$2" \
      "$scratch"/*.whl -r pyproject.toml \
    && exec "$scratch/$1/bin/wearstate" demo --folder "$scratch/demo-$1" -j 1
}
whole_job lowest lowest-direct > "$scratch/lowest.log" 2>&1 & lowest=$!
ended types "$types"
ended warm "$warm"  # its kernels are those of the newest libraries: not compiled a second time
newest_job() {
  (whole_job newest highest) || return
  cd "$scratch"
  newest/bin/wearstate --version \
    && newest/bin/wearstate scene list \
    && newest/bin/wearstate simulate bilge-pump --set "duration=0.4 s" -o rec.h5 \
    && newest/bin/wearstate info rec.h5 \
    && newest/bin/wearstate simulate journal-bearing --set "duration=0.1 s" -o journal.h5 \
    && newest/bin/wearstate verify
}
newest_job > "$scratch/newest.log" 2>&1 & newest=$!

# every process has a core already: threads would only wait for each other
export OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1
# a file a process, so that what its tests share is made once; dear files first (tests/conftest.py)
"$bin/pytest" -q -n "$jobs" --dist loadfile --no-loadscope-reorder --durations 15

ended newest "$newest"
ended lowest "$lowest"
versions() {  # NAME
  "$bin/uv" pip freeze --quiet --python "$scratch/$1/bin/python" | grep -i '^num'
}
[ "$(versions lowest)" != "$(versions newest)" ] \
  || { echo "lowest and newest have the same libraries: $(versions lowest)"; exit 1; }
