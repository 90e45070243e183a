# `make run` and `make test` do everything on a fresh Debian or Ubuntu machine: what is missing is installed first.
SHELL := /bin/bash
.SHELLFLAGS := -eu -o pipefail -c
.DEFAULT_GOAL := help
BIN := .venv/bin
# Threads of OpenBLAS wait for each other longer than they compute on matrices as small as ours.
export OPENBLAS_NUM_THREADS ?= 1
# pyright would ask the network for a newer one.
export PYRIGHT_PYTHON_IGNORE_WARNINGS ?= 1

.PHONY: help set-up run test check format bench lock wheel wheel-test figures clean

help:  ## list the targets
	@grep -E '^[a-z-]+:.*##' $(MAKEFILE_LIST) | sed -E 's/:.*## /\t/' | expand -t 14

set-up:  ## install what is missing; quick when nothing is
	@scripts/set-up

run: set-up  ## the main job: the twin scans, plans and welds the straight and the curved workpiece
	@$(BIN)/weldsim run straight
	@$(BIN)/weldsim run curve

test: set-up  ## all tests
	@$(BIN)/pytest -n 2

check: set-up  ## lint, format, types, import contracts; all are tried, any failure fails
	@failed=0; for tool in "ruff check --output-format concise ." "ruff format --check ." pyright lint-imports; do \
	    echo "== $$tool"; $(BIN)/$$tool || failed=1; done; exit $$failed

format: set-up  ## format and repair what ruff can
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .

bench: set-up  ## time the stages and the two methods
	@shopt -s nullglob; for script in experiments/bench/*.py; do echo "== $$script"; $(BIN)/python $$script; done

figures: set-up  ## write the measured figures of experiments/results/readme.json into README.md
	@$(BIN)/python experiments/figures.py

lock: set-up  ## pin every dependency of pyproject.toml in requirements.lock
	@CUSTOM_COMPILE_COMMAND="make lock" $(BIN)/pip-compile --quiet --output-file requirements.lock pyproject.toml

wheel: set-up  ## build dist/weldsim-*.whl
	@$(BIN)/python -m hatchling build --target wheel

wheel-test: set-up  ## build the wheel and use it from a clean virtual environment
	@$(BIN)/pytest tests/e2e/test_wheel.py

clean:  ## remove the virtual environment, builds and caches
	rm -rf .venv dist build .pytest_cache .ruff_cache .import_linter_cache .hypothesis
