# make help lists the targets. Everything happens in $(VENV), which is made and kept up to date.

VENV ?= .venv
PYTHON ?=
PYTEST_ARGS ?=
MATRIX_ARGS ?=
# Tests run in this many processes, the tests of a file in one of them.
PYTEST_WORKERS ?= 2

BIN := $(VENV)/bin
# One stamp per set of packages: installing again only after these two files changed.
CORE := $(VENV)/.installed-core
DEV := $(VENV)/.installed-dev
PINS := pyproject.toml constraints.txt
NEXT_VENV := $(VENV)-mujoco4
NEXT_BIN := $(NEXT_VENV)/bin
NEXT := $(NEXT_VENV)/.installed
comma := ,

.DEFAULT_GOAL := help
.PHONY: help demo test test-slow test-bounds smoke-mujoco4 test-mujoco4 test-matrix lint clean

help:
	@echo 'make demo        install, then compare the hose models in short form (report in out/demo)'
	@echo '                 and on a garden hose (report in out/demo/garden_hose)'
	@echo 'make test        install with the dev extra, then ruff, mypy, pytest, and the smoke tests'
	@echo '                 under MuJoCo 4 (smoke-mujoco4); PYTEST_ARGS="tests/cli -x" goes to pytest'
	@echo 'make test-slow   only the slow tests, which make test leaves out'
	@echo 'make test-bounds   the tests of the spline hose and the contracts with checked array indices (slow:'
	@echo '                 all kernels are compiled anew, into .numba-bounds)'
	@echo 'make test-mujoco4  the smoke tests, the flex rod and the contracts of all models under MuJoCo 4,'
	@echo '                 in a virtual environment of its own'
	@echo 'make test-matrix   each Python here, times MuJoCo 3.17 and 4, in fresh environments (slow);'
	@echo '                 writes the table of docs/install.md'
	@echo 'make lint        only ruff and mypy'
	@echo 'make clean       remove $(VENV), $(NEXT_VENV), build products, caches and out/demo (runs are kept)'
	@echo ''
	@echo 'PYTHON=/path/to/python picks the interpreter (3.11 to 3.14) of a new $(VENV);'
	@echo 'VENV=folder puts it elsewhere. uv installs if it is on the PATH, pip otherwise.'

# Status 1 means that a check failed, which the table shows: the report is there all the same.
demo: $(CORE)
	$(BIN)/hose-mj compare --quick --out out/demo || test $$? -eq 1
	$(BIN)/hose-mj compare garden_hose --out out/demo/garden_hose || test $$? -eq 1

test: lint
	$(BIN)/python -m pytest --numprocesses $(PYTEST_WORKERS) --dist loadfile $(PYTEST_ARGS)
	$(if $(PYTEST_ARGS),,$(MAKE) smoke-mujoco4)

test-slow: $(DEV)
	$(BIN)/python -m pytest -m slow $(PYTEST_ARGS)

# A kernel that reads or writes beside an array raises IndexError. Numba's key of a compiled kernel
# does not know of the checks, hence a cache of its own.
test-bounds: $(DEV)
	NUMBA_BOUNDSCHECK=1 NUMBA_CACHE_DIR=$(CURDIR)/.numba-bounds \
	  $(BIN)/python -m pytest --numprocesses $(PYTEST_WORKERS) --dist loadfile $(PYTEST_ARGS) \
	  tests/hoses/geds tests/contracts/test_hose_models.py \
	  tests/contracts/test_moments_and_statics.py tests/contracts/test_random_calls.py

# Under MuJoCo 4 dm-control does not load and the composite cable is gone: what is left has to run.
smoke-mujoco4: $(NEXT)
	$(NEXT_BIN)/python -m pytest -m 'not slow' tests/hoses/mujoco/test_mujoco4.py
	PYTHONPATH=$(CURDIR):$(CURDIR)/learning $(NEXT_BIN)/python tools/smoke.py

test-mujoco4: smoke-mujoco4
	$(NEXT_BIN)/python -m pytest -m 'not slow' -k 'flex or geds' $(PYTEST_ARGS) \
	  tests/hoses/mujoco/test_flex.py tests/contracts

test-matrix: | $(BIN)/python
	nice $(BIN)/python tools/test_matrix.py $(MATRIX_ARGS)

lint: $(DEV)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

clean:
	rm -rf $(VENV) $(NEXT_VENV) .numba-bounds build dist out/demo .mypy_cache .pytest_cache .ruff_cache .hypothesis
	find hose_mj learning tools tests -type d -name __pycache__ -prune -exec rm -rf {} +

# A candidate counts only if it runs and is of a version we support: a name on the PATH may be a
# launcher without an interpreter behind it. A virtual environment that fails half way is removed.
$(BIN)/python:
	@check='import sys; sys.exit(not (3, 11) <= sys.version_info[:2] < (3, 15))'; \
	for candidate in $(or $(PYTHON),python3.12 python3.11 python3.13 python3.14 python3 python); do \
	  if "$$candidate" -c "$$check" >/dev/null 2>&1; then found=$$candidate; break; fi; \
	done; \
	if [ -z "$$found" ]; then \
	  echo 'error: no Python 3.11 to 3.14 among: $(or $(PYTHON),python3.12 python3.11 python3.13 python3.14 python3 python)' >&2; \
	  echo 'Install one of them, or name yours: make PYTHON=/path/to/python3.12' >&2; \
	  exit 1; \
	fi; \
	echo "Making $(VENV) with $$("$$found" --version)"; \
	"$$found" -m venv $(VENV) || { \
	  rm -rf $(VENV); \
	  echo 'error: could not make $(VENV); on Debian and Ubuntu install the package python3-venv' >&2; \
	  exit 1; \
	}

$(CORE): $(PINS) | $(BIN)/python
	$(call install,.[all])
	@touch $@

$(DEV): $(PINS) | $(BIN)/python
	$(call install,.[all$(comma)dev])
	@touch $(CORE) $@

# The tested versions of all but MuJoCo; pytest finds the package in this folder.
$(NEXT): $(PINS) | $(BIN)/python
	@echo 'Installing MuJoCo 4 and what the hose models need into $(NEXT_VENV)'
	@$(BIN)/python -m venv $(NEXT_VENV)
	@grep -v '^mujoco==' constraints.txt > $(NEXT_VENV)/constraints.txt
	@$(NEXT_BIN)/python -m pip install --quiet --disable-pip-version-check \
	  --constraint $(NEXT_VENV)/constraints.txt \
	  'mujoco>=4,<5' numpy scipy numba tyro rich gymnasium pettingzoo dm-env pillow \
	  pytest pytest-timeout hypothesis
	@touch $@

define install
@echo 'Installing $(1) into $(VENV) (a minute or two the first time)'
@if command -v uv >/dev/null 2>&1; then \
  uv pip install --quiet --python $(BIN)/python --constraint constraints.txt --editable '$(1)'; \
else \
  $(BIN)/python -m pip install --quiet --disable-pip-version-check \
    --constraint constraints.txt --editable '$(1)'; \
fi
endef
