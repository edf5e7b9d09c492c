# Every target first makes its own environment in .venv, from uv.lock. It needs Python 3.11 or
# newer and pip's usual access to PyPI, nothing else. PYTHON=... chooses the interpreter.
SHELL := /bin/sh
VENV := .venv
PY := $(VENV)/bin/python
STAMP := $(VENV)/.installed
# The tools of the documentation live apart: they are no part of what physique is tested with.
DOCS_VENV := .venv-docs
DOCS_STAMP := $(DOCS_VENV)/.installed
# Where the package is installed as a user has it, not from src/; tests that meet all of its files.
WHEEL_VENV := .venv-wheel
WHEEL_TESTS ?= tests/body tests/cli tests/commands tests/motion tests/report tests/runs
WORKERS ?= 2
# Numerical libraries must not start threads of their own under our process and thread pools.
ONE_THREAD := OPENBLAS_NUM_THREADS=1 OMP_NUM_THREADS=1 MKL_NUM_THREADS=1

.DEFAULT_GOAL := help
.PHONY: help env demo test test-slow test-wheel check format bench gallery docs docs-serve bundle clean

help: ## list the targets
	@sed -n 's/^\([a-z-]*\):.*## \(.*\)/  make \1\t\2/p' Makefile | expand -t 20

env: $(STAMP) ## make or update .venv

demo: $(STAMP) ## retarget a shipped clip onto shipped bodies, into out/demo
	$(VENV)/bin/physique demo --out out/demo

test: $(STAMP) ## run the tests
	$(ONE_THREAD) $(PY) -m pytest -n $(WORKERS)

test-slow: $(STAMP) ## run all tests, the ones of minutes too
	$(ONE_THREAD) $(PY) -m pytest -n $(WORKERS) -m "slow or not slow"

test-wheel: $(STAMP) ## run tests of what the built wheel holds, in an environment that has nothing else
	UV_PROJECT_ENVIRONMENT=$(WHEEL_VENV) UV_PYTHON_DOWNLOADS=never \
	  $(PY) -m uv sync --frozen --no-editable --reinstall-package physique --python $(PY) --quiet
	$(ONE_THREAD) $(WHEEL_VENV)/bin/python -m pytest -n $(WORKERS) $(WHEEL_TESTS)

check: $(STAMP) ## lint, format, types, import layers
	$(PY) -m ruff check .
	$(PY) -m ruff format --check .
	$(PY) -m mypy
	$(VENV)/bin/lint-imports

format: $(STAMP) ## apply the formatter and the safe lint fixes
	$(PY) -m ruff check --fix .
	$(PY) -m ruff format .

bench: $(STAMP) ## measure speed and quality, into out/bench
	$(ONE_THREAD) $(PY) benchmarks/run.py --out out/bench

gallery: $(STAMP) ## make the moving pictures of docs/gallery.md (a quarter of an hour)
	$(ONE_THREAD) $(PY) benchmarks/gallery.py

docs: $(DOCS_STAMP) ## build the documentation site, into out/site
	NO_MKDOCS_2_WARNING=1 $(DOCS_VENV)/bin/mkdocs build --strict

docs-serve: $(DOCS_STAMP) ## serve the documentation on 127.0.0.1:8000, anew at each change
	NO_MKDOCS_2_WARNING=1 $(DOCS_VENV)/bin/mkdocs serve

bundle: ## rebuild the 3-D viewer of reports from tools/web (needs Node.js)
	cd tools/web && npm ci --ignore-scripts && npm run build

clean: ## remove results and caches (not the environments)
	rm -rf out dist .pytest_cache .mypy_cache .ruff_cache .hypothesis .import_linter_cache
	find . \( -path "./.venv*" \) -prune -o -name __pycache__ -type d -prune -exec rm -rf {} +

# A stamp, so that nothing is done while the requirements stand as they are.
$(STAMP): pyproject.toml uv.lock
	@set -e; \
	usable() { "$$1" -c 'import sys; sys.exit(sys.version_info < (3, 11))' >/dev/null 2>&1; }; \
	if ! usable $(PY); then \
	  found=; \
	  for name in $(PYTHON) python3 python3.14 python3.13 python3.12 python3.11 python; do \
	    if usable "$$name"; then found=$$name; break; fi; \
	  done; \
	  if [ -z "$$found" ]; then \
	    echo "physique needs Python 3.11 or newer and found none; install one, or say where it is: make PYTHON=/path/to/python3" >&2; \
	    exit 2; \
	  fi; \
	  if ! "$$found" -c 'import venv, ensurepip' >/dev/null 2>&1; then \
	    echo "$$found has no venv module; install it (Debian, Ubuntu: apt install python3-venv), or choose another interpreter: make PYTHON=/path/to/python3" >&2; \
	    exit 2; \
	  fi; \
	  "$$found" -m venv --clear $(VENV); \
	fi; \
	$(PY) -m pip --version >/dev/null 2>&1 || $(PY) -m ensurepip --upgrade >/dev/null; \
	$(PY) -m pip install --quiet --disable-pip-version-check "uv>=0.9,<1"; \
	UV_PROJECT_ENVIRONMENT=$(VENV) UV_PYTHON_DOWNLOADS=never \
	  $(PY) -m uv sync --frozen --inexact --quiet; \
	touch $@

# Only the group: the API is read from src/ and never imported.
$(DOCS_STAMP): $(STAMP) pyproject.toml uv.lock
	UV_PROJECT_ENVIRONMENT=$(DOCS_VENV) UV_PYTHON_DOWNLOADS=never \
	  $(PY) -m uv sync --frozen --only-group docs --python $(PY) --quiet
	touch $@
