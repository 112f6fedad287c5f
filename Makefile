# Two targets for a fresh machine; everything else is a script in scripts/.
# Another environment, folder of builds and more extras: scripts/coverage and CI.
VENV := $(or $(FSN_VENV),.venv)
BUILD := $(or $(FSN_BUILD),build)
PY := $(VENV)/bin/python
FSN := $(VENV)/bin/fsoe-net

.PHONY: help demo robot-cell test test-python test-c master clean
.DEFAULT_GOAL := demo

help: ## this list
	@sed -n 's/^\([a-z-]*\):.*## \(.*\)/  make \1\t\2/p' $(MAKEFILE_LIST) | expand -t 20
	@echo '  scripts/ has what a developer runs, scripts/rig/ what needs root, a bus or hours, packaging/ what builds packages; CONTRIBUTING.md says when.'

demo: $(VENV)/.ready ## check, plan, run and report of the e-stop example, on an emulated bus
	@echo '== check: what is wrong in the files, at file, line and column'
	$(FSN) check examples/estop/network.yaml
	@echo; echo '== plan: compiled to a self-checking copy plan'
	$(FSN) plan examples/estop/network.yaml -o estop.fsnplan --overwrite
	$(FSN) plan --show estop.fsnplan
	@echo; echo '== run: emulated bus, copied by the C core; an e-stop is pressed and released'
	$(FSN) run examples/estop/network.yaml --plan estop.fsnplan --scenario examples/estop/scenario.yaml
	@echo; echo '== report'
	$(FSN) report examples/estop/network.yaml --scenario examples/estop/scenario.yaml -o report.html --overwrite
	@echo; echo "Next, press the e-stop in a browser: $(FSN) demo"

robot-cell: $(VENV)/bin/fsn-master ## two axes, an e-stop while they move, a picture
	$(PY) examples/robot-cell/cell.py

master: $(VENV)/bin/fsn-master ## the real-time executable fsn-master, with SOEM where the network has it

# What the two build knows nothing of each other.
test: test-python test-c ## the Python tests and the C tests; -j2 runs both at once

test-python test-c: $(VENV)/.ready-test master

test-python:
	MAKEFLAGS= PATH="$(abspath $(VENV))/bin:$$PATH" scripts/test

test-c:
	MAKEFLAGS= PATH="$(abspath $(VENV))/bin:$$PATH" scripts/test-c

# Built again when a source of the compiled part or of the packaging changes.
SOURCES := pyproject.toml CMakeLists.txt $(shell find master_core/src master_core/include \
	fsoe_net/core/cdef.h fsoe_net/core/build_module.py master_core/CMakeLists.txt -type f)

$(VENV)/bin/python:
	@scripts/need
	python3 -m venv $(VENV)

$(VENV)/.ready: $(VENV)/bin/python $(SOURCES)
	@echo "== set-up: pip fetches packages and compiles the C core; one to three minutes"
	$(PY) -m pip install --progress-bar on --disable-pip-version-check --editable .
	@touch $@

$(VENV)/.ready-test: $(VENV)/.ready
	@echo "== set-up: pip fetches what the tests need"
	$(PY) -m pip install --quiet --disable-pip-version-check --editable '.[test$(FSN_EXTRAS)]' cmake
	@touch $@

# CMake decides what is to be built again. Without SOEM only the other buses are there.
$(VENV)/bin/fsn-master: $(VENV)/.ready-test $(SOURCES) $(shell find master_core/app -type f)
	@install="$(FSN) install-master --yes --overwrite --build-dir $(BUILD)/master"; \
		$$install || $$install --without-soem
	@touch $@

clean: ## removes what was built
	rm -rf $(VENV) build dist report.html estop.fsnplan robot-cell.svg motion.csv
