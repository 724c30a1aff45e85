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
(
  cd "$scratch"
  env/bin/wearstate --version
  env/bin/wearstate scene list
  env/bin/wearstate simulate bilge-pump --set "duration=0.4 s" -o rec.h5
  env/bin/wearstate info rec.h5
  env/bin/wearstate verify
)

"$bin/pytest" -q
