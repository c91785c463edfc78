# The commands of reactive-arm; `make` alone lists them. Each sets up .venv first where that is still to be done.

PYTHON ?=
SCENARIO ?= demo
PARAMETERS ?=
TESTS ?= tests interfaces/reactive_node deploy/runtime
MINUTES ?= 5
SEED ?=
CHAOS ?=
SHELL := /bin/sh
MAKEFLAGS += --no-print-directory
PY := .venv/bin/python
STAMP := .venv/made-from

.PHONY: help setup run start stop status logs console chaos test check bench

help:
	@echo "make run      start the system, show it in this terminal, stop it with Ctrl-C"
	@echo "make start    start it in the background          (run, start: SCENARIO=demo, listing_5_9 or a file)"
	@echo "make console  attach this terminal to it"
	@echo "make status   its services: state, pid, uptime, restarts, last output"
	@echo "make logs     follow their logs"
	@echo "make stop     stop it"
	@echo "make chaos    let a monkey break a system of its own, and judge  (MINUTES=5 SEED= CHAOS=--help for more)"
	@echo "make test     run the tests                       (TESTS=tests/component for a part)"
	@echo "make bench    measure what rclpy costs on this machine"
	@echo "make check    ruff, mypy, shellcheck, yamllint"
	@echo "make setup    only set up .venv                   (PYTHON= chooses the interpreter, 3.11 to 3.13)"

setup:
	@deploy/commands/setup.sh '$(PYTHON)'

run start: setup
	@$(PY) -m deploy.commands.launcher $@ '$(SCENARIO)' '$(PARAMETERS)'

# These do without a set-up: what they look at, or end, runs already. Nothing runs from half of one: it has no stamp.
console status logs stop:
	@if test -e $(STAMP); then exec $(PY) -m deploy.commands.launcher $@; else echo "Nothing runs: .venv is not set up (make setup)."; fi

chaos: setup
	@$(PY) -m deploy.chaos --minutes $(MINUTES) $(if $(SEED),--seed $(SEED)) $(CHAOS)

test: setup
	@$(PY) -m pytest $(TESTS)

bench: setup
	@$(PY) deploy/runtime/benchmarks/run.py

check: setup
	@$(PY) -m ruff check .
	@$(PY) -m ruff format --check --quiet .
	@PYTHONPATH=deploy/runtime/src $(PY) -m rosidl_runtime_embedded.stubs --output deploy/runtime/build/stubs
	@$(PY) -m mypy
	@$(PY) -m mypy --config-file deploy/runtime/pyproject.toml
	@.venv/bin/shellcheck deploy/commands/setup.sh .ci/run
	@$(PY) -m yamllint --strict deploy
