# The commands of reactive-arm; `make` alone lists them. Most of them set up .venv first if it is missing or outdated.

PYTHON ?=
SCENARIO ?= demo
PARAMETERS ?=
MANIFEST ?=
WEB ?=
# A minute: what starts no process, an arm that starts and stops, and a minute of chaos in virtual time (tests/README.md).
TESTS ?= tests/component tests/promises tests/operator tests/supervision tests/commands tests/chaos tests/security tests/mutants --ignore=tests/commands/test_fleet.py --ignore=tests/security/attacks \
    tests/simulation/test_minute.py tests/system/test_start_kill_stop.py -m "not arm or minute" --untimed
ALL_TESTS := tests interfaces/reactive_node deploy/ground deploy/tools
MINUTES ?= 5
SEED ?=
HOURS ?= 1
SCHEDULE ?=
SIMULATE ?=
CHAOS ?=
RECORD ?=
LAST := # only of the command line
REPLAY ?=
MODULES ?=
BENCH ?=
NAME ?=
ARMS ?=
SECURE ?=
EXPORT ?=
ENCLAVES ?=
HOST := # only of the command line: some shells have a variable of this name
SHELL := /bin/sh
MAKEFLAGS += --no-print-directory
PY := deploy/commands/venv.sh
RUNTIME ?=
STAMP := .venv/made-from
# A Python that is still starting answers Ctrl-C with a traceback: SIGINT waits until the command is ready for it.
HOLD := $(shell env --block-signal=INT echo env --block-signal=INT 2>/dev/null)
ifneq ($(HOST),)
export REACTIVE_ARM_HOST := $(HOST)
endif
export PYTHON SCENARIO PARAMETERS MANIFEST WEB LAST RUNTIME

# The variables of each command. Others on the command line are refused, except by `make stop`: it must not fail.
USED_BY_run := SCENARIO PARAMETERS MANIFEST WEB HOST SECURE
USED_BY_start := $(USED_BY_run)
USED_BY_unit := $(USED_BY_run)
USED_BY_record := LAST
USED_BY_fleet := ARMS SECURE
USED_BY_chaos := MINUTES SEED CHAOS SECURE
USED_BY_simulate := HOURS SEED SCHEDULE SIMULATE
USED_BY_replay := RECORD REPLAY
USED_BY_test := TESTS
USED_BY_mutants := MODULES
USED_BY_bench := BENCH
USED_BY_new-service := NAME
USED_BY_keystore := MANIFEST EXPORT ENCLAVES
# Those of the environment may also stand on the command line of make.
ENVIRONMENT := ROS_% RMW_% CYCLONEDDS_% FASTRTPS_% FASTDDS_% REACTIVE_ARM_% PIP_% PYTHONPATH PATH
GOALS := $(or $(MAKECMDGOALS),help)
ifeq ($(MAKELEVEL)$(filter stop,$(GOALS)),0) # another make passes its own variables on
USED := $(strip PYTHON RUNTIME $(foreach goal,$(GOALS),$(USED_BY_$(goal))))
GIVEN := $(foreach name,$(.VARIABLES),$(if $(filter command,$(origin $(name))),$(name)))
$(foreach name,$(filter-out $(USED) $(ENVIRONMENT),$(GIVEN)),$(error make $(GOALS) has no variable $(name); it has $(USED)))
endif

# Short for ROS 2's own variables.
ifneq ($(if $(filter stop,$(GOALS)),,$(SECURE)),)
$(if $(filter-out yes,$(SECURE)),$(error SECURE=$(SECURE): it is yes, or empty))
export ROS_SECURITY_ENABLE := true
export ROS_SECURITY_STRATEGY := Enforce
export ROS_SECURITY_KEYSTORE := $(or $(ROS_SECURITY_KEYSTORE),$(CURDIR)/.keystore)
endif

.PHONY: help setup tables run start unit stop status logs record terminal fleet chaos simulate replay test test-all mutants check bench new-service keystore

help:
	@echo "make run      start the system, show it in this terminal, stop it with Ctrl-C"
	@echo "make start    start it in the background          (run, start: SCENARIO=demo, listing_5_9, none or a file)"
	@echo "                                                  (PARAMETERS=file; WEB=off for no page, or its port;"
	@echo "                                                  SECURE=yes: only with the keys of make keystore;"
	@echo "                                                  MANIFEST=file with programs of your own;"
	@echo "                                                  HOST=robot or operator for one of two hosts)"
	@echo "make unit     write a systemd unit that starts it at each boot    (the same variables)"
	@echo "make terminal attach this terminal to it"
	@echo "make status   its rclpy, page and services: state, pid, uptime, restarts, last output, health"
	@echo "make logs     follow their logs"
	@echo "make record   record its messages until Ctrl-C     (MCAP for Foxglove and ros2 bag, in .run/records;"
	@echo "                                                  LAST=10: only the last minutes, and each stop)"
	@echo "make fleet    watch all arms of this host, one line each  (ARMS=\"/arm1 /arm2=5\" for other hosts; SECURE=yes)"
	@echo "make stop     stop it"
	@echo "make keystore write the keys with which only this arm's processes meet  (EXPORT=folder ENCLAVES=\"names\" for a host)"
	@echo "make chaos    break a system on purpose and check its promises  (MINUTES=5 SEED= CHAOS=--help for more)"
	@echo "make simulate the same in virtual time, hours in minutes  (HOURS=1 SEED= SCHEDULE=file SIMULATE=--help for more)"
	@echo "make replay   feed a record through these services and show what differs  (RECORD= REPLAY=--help for more)"
	@echo "make test     test the arm for a minute           (TESTS=tests/component for all tests of a part)"
	@echo "make test-all run all tests, for many minutes"
	@echo "make mutants  change the safety path in every small way: do the tests notice?  (MODULES= for a part)"
	@echo "make bench    compare the costs with those of the alternatives  (BENCH=\"--rounds 5\", minutes each)"
	@echo "make tables   write the tables and the graph of the READMEs from the code"
	@echo "make new-service  write a new guard, its test and its topic  (NAME=torque_guard)"
	@echo "make check    ruff, mypy, import rules, shellcheck, yamllint"
	@echo "make setup    only set up .venv                   (PYTHON= chooses the interpreter, 3.11 to 3.14)"
	@echo "All of them run on ROS 2's own rclpy from PyPI, or on a sourced ROS 2. RUNTIME=cyclonedds puts it on Cyclone DDS."

setup:
	@exec $(HOLD) deploy/commands/python.sh deploy.commands.setup "$$PYTHON"

run start unit: setup
	@exec $(HOLD) $(PY) -m deploy.commands.launcher $@ "$$SCENARIO" "$$PARAMETERS"

terminal status logs record:
	@test -e $(STAMP) || { echo ".venv is not set up: make setup (make stop works without it)" >&2; exit 1; }
	@exec $(HOLD) $(PY) -m deploy.commands.launcher $@ $(if $(filter record,$@),"$$LAST")

fleet:
	@test -e $(STAMP) || { echo ".venv is not set up: make setup" >&2; exit 1; }
	@RUNTIME=cyclonedds exec $(HOLD) $(PY) -m deploy.commands.fleet $(ARMS)

keystore: export ROS_SECURITY_KEYSTORE := $(or $(ROS_SECURITY_KEYSTORE),$(CURDIR)/.keystore)
keystore: setup
	@exec $(HOLD) $(PY) -m deploy.commands.launcher keystore "$(EXPORT)" "$(ENCLAVES)"

stop:
	@exec $(HOLD) deploy/commands/python.sh deploy.commands.stop "$$PYTHON"

chaos: setup
	@exec $(HOLD) $(PY) -m tests.chaos --minutes $(MINUTES) $(if $(SEED),--seed $(SEED)) $(CHAOS)

simulate: setup
	@RUNTIME= exec $(HOLD) $(PY) -m tests.simulation --hours $(HOURS) $(if $(SEED),--seed $(SEED)) $(if $(SCHEDULE),--schedule "$(SCHEDULE)") $(SIMULATE)

replay: setup
	@RUNTIME= exec $(HOLD) $(PY) -m tests.replay $(if $(RECORD),"$(RECORD)") $(REPLAY)

test: setup
	@$(PY) -m tests $(TESTS)

test-all: setup
	@$(PY) -m tests $(ALL_TESTS)

mutants: setup
	@RUNTIME= exec $(HOLD) $(PY) -m tests.mutants $(MODULES)

bench: setup
	@exec $(HOLD) $(PY) -m tests.benchmarks $(BENCH)

tables: setup
	@$(PY) -m deploy.commands.tables

new-service: export NAME := $(NAME)
new-service: setup
	@$(PY) -m deploy.commands.new_service "$$NAME"

check: setup
	@$(PY) -m ruff check .
	@$(PY) -m ruff format --check --quiet .
	@$(PY) -m deploy.commands.stubs .mypy_cache/stubs
	@$(PY) -m mypy
	@PYTHONPATH="interfaces/reactive_node/src:deploy/ground/src:tests/simulation_kit/src:deploy/tools/src:$$PYTHONPATH" .venv/bin/lint-imports --no-logo --no-cache
	@.venv/bin/shellcheck deploy/commands/*.sh .ci/run .ci/run-on-ros
	@$(PY) -m yamllint --strict deploy
