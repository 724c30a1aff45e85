#!/usr/bin/env bash
# mypy takes a package's name from its folder, so it checks a link that is named right.
# What it knows stays in .mypy_cache. Usage: tests/types.sh BIN
set -euo pipefail
cd "$(dirname "$0")/.."
bin=$(cd "$1" && pwd)
root=$PWD
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
mkdir "$scratch/wearstate"
for part in __*.py align.py contact.py crank.py film.py shaft.py py.typed sim features datasets diagnose; do
  ln -s "$PWD/$part" "$scratch/wearstate/$part"
done
cp pyproject.toml "$scratch"
cd "$scratch"
"$bin/mypy" --config-file pyproject.toml --cache-dir "$root/.mypy_cache" -p wearstate
