# Every target makes .venv by itself and reuses it. PYTHON picks the interpreter (>= 3.11).
PYTHON ?= python3
BIN := .venv/bin
JOBS ?= 2
STAMP := .venv/.ready

.PHONY: demo test check lint types benchmark docs clean

demo: $(STAMP)
	$(BIN)/wearstate demo

test: $(STAMP)
	bash tests/run.sh $(BIN) $(JOBS)

# make check FILE="tests/test_film.py tests/test_bearing.py": lint and these tests alone
check: $(STAMP)
	$(BIN)/ruff check . && $(BIN)/ruff format --check .
	$(BIN)/pytest -q $(FILE)

benchmark: $(STAMP)
	$(BIN)/pytest tests/benchmarks --benchmark-enable --benchmark-only -s

lint: $(STAMP)
	$(BIN)/ruff check . && $(BIN)/ruff format --check .

types: $(STAMP)
	bash tests/types.sh $(BIN)

# the site, in docs/_build/html; needs the network only where the extra is not installed yet
docs: $(STAMP)
	$(BIN)/python -c 'import myst_parser, numpydoc, pydata_sphinx_theme, sphinx_gallery; \
	  __import__("sphinx-mathjax-offline")' 2> /dev/null \
	  || $(BIN)/python -m pip install --quiet --disable-pip-version-check -e '.[docs]'
	OMP_NUM_THREADS=1 $(BIN)/python docs/pictures.py $(JOBS)
	OMP_NUM_THREADS=1 $(BIN)/sphinx-build -q -W -n --keep-going -b html \
	  -d docs/_build/doctrees docs docs/_build/html

$(STAMP): pyproject.toml setup.py
	@$(PYTHON) -c 'import sys; v = sys.version_info; \
	  sys.exit(None if v >= (3, 11) else f"Python {v[0]}.{v[1]} must be >= 3.11; call make PYTHON=python3.11")'
	test -x $(BIN)/python || $(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --no-compile --disable-pip-version-check -e '.[test]'
	@touch $(STAMP)

clean:
	rm -rf .venv docs/_build docs/gallery docs/reference/generated build dist *.egg-info .mypy_cache .ruff_cache
