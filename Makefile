# Two commands matter:
#   make study   set up, then run the re-entry study from plan to verified optimum
#   make test    set up, then run the tests
# Both need only Python 3.11 or newer, make, and a package index.

PYTHON ?= python3
VENV   ?= .venv
BIN    := $(VENV)/bin

.PHONY: study test quick processors lint types docs clean

study: $(VENV)/.rsmkit
	$(BIN)/rsmkit run studies/reentry

test: $(VENV)/.rsmkit-dev
	$(BIN)/python -m pytest -n auto

quick: $(VENV)/.rsmkit-dev
	$(BIN)/python -m pytest -n auto -m "not slow"

processors: $(VENV)/.rsmkit-dev
	$(BIN)/python tests/processors.py

lint: $(VENV)/.rsmkit-dev
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .

types: $(VENV)/.rsmkit-dev
	$(BIN)/mypy

docs: $(VENV)/.rsmkit-dev
	$(BIN)/python -m sphinx -q -W --keep-going -c docs . build/site

$(VENV)/.rsmkit: pyproject.toml constraints.txt | $(BIN)/python
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e .
	@touch $@

$(VENV)/.rsmkit-dev: pyproject.toml constraints.txt | $(BIN)/python
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e ".[dev]"
	@touch $@ $(VENV)/.rsmkit

$(BIN)/python:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
	  { echo "rsmkit needs Python 3.11 or newer; name one with: make PYTHON=/path/to/python3.11 ..."; exit 1; }
	$(PYTHON) -m venv $(VENV)

clean:
	rm -rf $(VENV) build dist .pytest_cache .mypy_cache .ruff_cache
