# Two commands matter:
#   make study   set up, then run the re-entry study from plan to verified optimum
#   make test    set up, then run the tests
# Both need only Python 3.11 or newer, make, and a package index.

PYTHON ?= python3
VENV   ?= .venv
BIN    := $(VENV)/bin
# Byte code of what is never imported costs a minute.
PIP    := --quiet --disable-pip-version-check --no-compile
# Hundreds of processes start here; without byte code each would compile every module it imports anew.
unexport PYTHONDONTWRITEBYTECODE
# What the fast tests need besides rsmkit itself.
TESTERS := pytest pytest-xdist hypothesis playwright jupytext nbclient ipykernel

.PHONY: study test quick coverage oldest newest processors lint types docs clean

study: $(VENV)/.rsmkit
	$(BIN)/rsmkit run studies/reentry

test: $(VENV)/.rsmkit-dev
	$(BIN)/python -m pytest -n auto --dist worksteal

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
	$(BIN)/python -m pip install $(PIP) -c constraints.txt -e .
	@touch $@

$(VENV)/.rsmkit-dev: pyproject.toml constraints.txt | $(BIN)/python
	$(BIN)/python -m pip install $(PIP) -c constraints.txt -e ".[dev]"
	@touch $@ $(VENV)/.rsmkit

$(BIN)/python:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
	  { echo "rsmkit needs Python 3.11 or newer; name one with: make PYTHON=/path/to/python3.11 ..."; exit 1; }
	$(PYTHON) -m venv $(VENV)

coverage: $(VENV)/.rsmkit-dev
	$(BIN)/python -m pytest -n auto -m "not slow" --cov=rsmkit --cov=sim --cov-report=term:skip-covered

# The two ends of what pyproject.toml allows, each in an environment of its own.
oldest:
	$(PYTHON) -m venv $(VENV)-oldest
	$(PYTHON) tests/oldest_versions.py > $(VENV)-oldest/constraints.txt
	$(VENV)-oldest/bin/python -m pip install $(PIP) -c $(VENV)-oldest/constraints.txt -e . $(TESTERS)
	$(VENV)-oldest/bin/python -m pytest -n auto -m "not slow" -W default

newest:
	$(PYTHON) -m venv $(VENV)-newest
	$(VENV)-newest/bin/python -m pip install $(PIP) --upgrade -e . $(TESTERS)
	$(VENV)-newest/bin/python -m pytest -n auto -m "not slow" -W default

clean:
	rm -rf $(VENV) $(VENV)-oldest $(VENV)-newest build dist .pytest_cache .mypy_cache .ruff_cache
