# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

# Every target sets up what it needs first; where all is set up already that costs no time.

# Tests start hundreds of processes, which then need not compile again what they import.
unexport PYTHONDONTWRITEBYTECODE
# Only these plugins: a machine's own (launch_testing, coverage) have no say in our tests.
export PYTEST_DISABLE_PLUGIN_AUTOLOAD = 1
# They steal work from each other: the long tests would come last and alone.
PYTEST = -m pytest -p xdist -p timeout -p hypothesispytest --dist worksteal

# Unit tests see nothing of ROS, even in a shell where it is sourced.
WITHOUT_ROS = env -u AMENT_PREFIX_PATH -u CMAKE_PREFIX_PATH -u COLCON_PREFIX_PATH \
	-u PYTHONPATH -u ROS_DISTRO -u ROS_VERSION

.DEFAULT_GOAL := help
.PHONY: help setup demo run test lint types unit ros mutants campaign fuzz bench docs pages
.PHONY: all bench-gate build clean coverage exhaustive golden laws masters soak

help: ## list the targets
	@echo 'make demo and make test are all one needs; each sets up what it needs in this folder.'
	@sed -n 's/^\([a-z-]*\):.*## \(.*\)/  make \1\t\2/p' Makefile | expand -t 20

setup: ## set up .venv, and build into install
	@tools/setup

# Neither demo nor run sets up what only tests use.
.PHONY: setup-run
setup-run:
	@tools/setup run

demo: setup-run ## a short run of a simulated drive, from enable to stop, recorded and drawn
	@tools/run python -m nfo_sinus_driver.demo

run: setup-run ## driver and simulated drive, up until Ctrl-C, for ros2 topic pub
	@tools/run python -m nfo_sinus_driver.demo.run

# Tests that wait leave a third of two processors idle: one worker that computes has that.
test: setup ## lint, types, unit and ros, the last two at once
	@for stage in lint types; do \
		$(MAKE) --no-print-directory $$stage || exit; \
	done
	@$(MAKE) --no-print-directory -j2 BESIDE=$(if $(FULL),auto,1) computing waiting-then-ros
ifdef FULL
	@$(MAKE) --no-print-directory other-libraries
endif

all: ## all that says whether it is right: test, docs, masters, mutants, campaign, exhaustive (hours)
	@for stage in test docs masters mutants campaign exhaustive; do \
		$(MAKE) --no-print-directory $$stage FULL=1 || exit; \
	done

lint: setup ## ruff, and who may import whom
	@echo '== lint: ruff, import-linter'
	@.venv/bin/ruff check
	@.venv/bin/lint-imports --no-logo > .venv/log/imports 2>&1 || { cat .venv/log/imports; exit 1; }

types: setup ## mypy, on all that is not ROS
	@echo '== types: mypy --strict'
	@.venv/bin/mypy

# Those that compute, in virtual time, have a worker for each processor, and are heard when they
# have ended; beside them those that wait, in real time, have more. Each group collects its own.
COMPUTING = test/unit/drive test/unit/link test/unit/catalog test/unit/families
REAL = $(addprefix test/unit/,drive/line/test_slave_by_hand.py drive/test_threads.py \
	$(addprefix link/test_,can_ports.py line_ports.py link_ports.py tcp_link.py))
WAITING = $(REAL) $(filter-out $(COMPUTING:=/) %__pycache__/, \
	$(wildcard test/unit/*/ test/unit/test_*.py))

unit: setup ## tests without ROS; of products a share (FULL=1: all, and with every library)
	@$(MAKE) --no-print-directory -j2 computing waiting
ifdef FULL
	@$(MAKE) --no-print-directory other-libraries
endif

.PHONY: computing waiting waiting-then-ros compiled other-libraries
computing: compiled
	@FULL=$(FULL) $(WITHOUT_ROS) $(if $(BESIDE),nice -n 19) \
		.venv/without-ros/bin/python $(PYTEST) -n $(or $(BESIDE),auto) \
		$(addprefix --ignore=,$(REAL)) $(COMPUTING) > .venv/log/computing 2>&1; \
	status=$$?; echo '== unit: those that compute'; cat .venv/log/computing; exit $$status

waiting: compiled
	@echo '== unit: without rclpy, with the oldest pymodbus'
	@FULL=$(FULL) $(WITHOUT_ROS) .venv/without-ros/bin/python $(PYTEST) -n 6 $(WAITING)

waiting-then-ros: compiled
	@$(MAKE) --no-print-directory waiting
	@$(MAKE) --no-print-directory ros

# so that the workers have it compiled already
compiled: setup
	@.venv/without-ros/bin/python -m compileall -q nfo_sinus_driver test

other-libraries: setup
	@echo '== unit again, what uses pymodbus: the current one'
	@FULL=1 $(WITHOUT_ROS) .venv/bin/python $(PYTEST) -n 9 test/unit/link test/unit/simulator
	@if [ -d .venv/noble ]; then \
		echo '== unit again: the libraries of Ubuntu 24.04, Python 3.12'; \
		FULL=1 $(WITHOUT_ROS) .venv/noble/bin/python $(PYTEST) -n 9 test/unit; \
	fi

ros: setup ## end-to-end tests with rclpy (CONNECTION=classic_v2: over another one; CONNECTION=all: over every)
	@echo '== ros: driver, simulated drive and clients, each a process of its own'
	@tools/run python $(PYTEST) -n $$(tools/workers $(if $(BESIDE),6,8)) $(if $(CONNECTION),--connection $(CONNECTION)) test/ros

# One after the other: LinuxCNC's have one room on a machine.
masters: setup ## masters of others (LinuxCNC's, mbpoll, pymodbus, minimalmodbus) run simulated drives
	@$(WITHOUT_ROS) .venv/bin/python $(PYTEST) -n 0 test/masters

coverage: setup ## which lines and branches of the driver the tests go through, unit and ros
	@rm -rf .venv/coverage && mkdir .venv/coverage
	@$(WITHOUT_ROS) .venv/bin/python -m coverage run $(PYTEST) -n 9 test/unit
	@tools/run python -m coverage run $(PYTEST) -n $$(tools/workers 8) test/ros
	@.venv/bin/python -m coverage combine --quiet
	@.venv/bin/python -m coverage report

mutants: setup ## break each law in a copy and see that a test fails (half an hour)
	@tools/run python test/mutants/run.py

campaign: setup ## many histories of commands, faults and line losses in any order (HISTORIES=3000)
	@seed=$(or $(SEED),$$(od -An -N3 -tu4 /dev/urandom | tr -d ' ')); echo "seed $$seed"; \
	SEED=$$seed HISTORIES=$(or $(HISTORIES),3000) tools/run python $(PYTEST) \
		-n auto --dist worksteal test/unit/drive/any_order/test_any_order.py -k campaign
	@ACKNOWLEDGEMENTS=$(or $(ACKNOWLEDGEMENTS),1000) tools/run python $(PYTEST) -n auto \
		test/unit/drive/starts/test_no_turn_at_acknowledge.py -k no_turn

exhaustive: setup ## each thing that can go wrong at each request of a run (PART=1/8 PAIRS=1)
	@$(WITHOUT_ROS) .venv/without-ros/bin/python test/exhaustive/run.py $(if $(PART),--part $(PART)) \
		$(if $(PAIRS),--pairs) $(if $(MACHINE),--machine $(MACHINE))

soak: setup ## one driver and four drives for hours: do memory and threads settle? (HOURS=2 SEED=1)
	@tools/run python test/soak/run.py $(if $(MINUTES),--minutes $(MINUTES),--hours $(or $(HOURS),2)) \
		$(if $(SEED),--seed $(SEED))

golden: setup ## name the tests whose frames are others than with the driver of COMMIT (HEAD)
	@$(WITHOUT_ROS) .venv/without-ros/bin/python tools/golden.py $(COMMIT)

laws: setup ## for each law of docs/architecture.md the tests that hold it, and its mutants
	@$(WITHOUT_ROS) .venv/without-ros/bin/python tools/list_laws.py

fuzz: setup ## spoiled frames through every decoder (FRAMES=1000000 SEED=1 ONLY=frame)
	@$(WITHOUT_ROS) PYTHONPATH=.:test .venv/without-ros/bin/python -m fuzz \
		--frames $(or $(FRAMES),1000000) $(if $(SEED),--seed $(SEED)) $(if $(ONLY),--only $(ONLY))

# Not a part of setup: only the peer needs it.
bench: setup ## measure speed, stops, noise and silence, and a peer (two hours; BENCH=--quick: 10 minutes)
	@env -u PYTHONPATH .venv/bin/python -m pip install --quiet --no-input --no-cache-dir \
		--disable-pip-version-check --requirement=benchmark/requirements.txt
	@tools/run python benchmark/run.py $(BENCH)

bench-gate: setup ## fail where the driver is slower than its last release (15 minutes)
	@env -u PYTHONPATH .venv/bin/python -m pip install --quiet --no-input --no-cache-dir \
		--disable-pip-version-check --requirement=benchmark/requirements.txt
	@tools/run python benchmark/gate.py $(GATE)

# An environment of its own: what it needs and what colcon needs exclude each other.
.venv/docs/installed: docs/requirements.txt | setup
	@.venv/bin/python -m venv .venv/docs
	@.venv/docs/bin/python -m pip install --quiet --no-input --no-cache-dir \
		--disable-pip-version-check --requirement=docs/requirements.txt
	@touch $@

docs: .venv/docs/installed ## the documentation as a site, in site/; every link is checked
	@echo '== docs: every page is made and in the contents, no link leads nowhere'
	@# anew each time: what is wrong in a page is only said when the page is read
	@.venv/docs/bin/sphinx-build -q -W -E --keep-going -b html -c docs . site
	@echo 'site/index.html'

pages: setup ## write what is made in docs/: parameters, settings, states, manuals, troubleshooting
	@PYTHONPATH=. .venv/bin/python tools/pages.py

build: ## build both packages again
	@rm -rf build install
	@tools/setup

clean: ## remove all that was set up, built or cached
	rm -rf .venv/stamps .venv build install log .hypothesis .mypy_cache .pytest_cache .ruff_cache
	find . -name __pycache__ -prune -exec rm -rf {} +
