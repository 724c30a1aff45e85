#!/usr/bin/env bash
# Everything that must be green: lint, types, tests and doctests, and the wheel on its own.
# Usage: tests/run.sh BIN, with BIN the folder of an environment that holds the test extra.
set -euo pipefail
cd "$(dirname "$0")/.."
bin=$(cd "$1" && pwd)

"$bin/ruff" check .
"$bin/ruff" format --check .
bash tests/types.sh "$bin"

# The wheel, in an environment that has nothing else: a forgotten package or file shows here.
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
"$bin/python" -m build --wheel --outdir "$scratch" . > "$scratch/build.log" 2>&1 \
  || { cat "$scratch/build.log"; exit 1; }
"$bin/python" -m venv "$scratch/env"
"$scratch/env/bin/python" -m pip install --quiet --disable-pip-version-check "$scratch"/*.whl

# The whole job with the lowest versions that pyproject.toml allows, beside the same with the newest.
"$bin/uv" venv --quiet --python "$bin/python" "$scratch/lowest"
"$bin/uv" pip install --quiet --python "$scratch/lowest/bin/python" --resolution lowest-direct \
  "$scratch"/*.whl
job() {
  "$scratch/$1/bin/wearstate" demo --folder "$scratch/demo-$1" -j 1 > "$scratch/$1.log" 2>&1 \
    || { cat "$scratch/$1.log"; echo "demo fails with the $2 versions"; return 1; }
}
job lowest lowest & lowest=$!
job env newest
wait "$lowest"

(
  cd "$scratch"
  env/bin/wearstate --version
  env/bin/wearstate scene list
  env/bin/wearstate simulate bilge-pump --set "duration=0.4 s" -o rec.h5
  env/bin/wearstate info rec.h5
  env/bin/wearstate verify
)

# a file a process, so that what its tests share is made once
"$bin/pytest" -q -n 2 --dist loadfile --durations 15
