# `make demo` runs tasks on the virtual Arduino, `make test` runs every check. Both install into
# .venv first if it is missing or older than the lock. Only `make test` installs the test tools.

# Downloads, linters and the build of a peer run in parallel; the tests run after them.
MAKEFLAGS += --jobs=3

PYTHON ?= python3
VENV := .venv
PIP := $(VENV)/bin/pip
READY := $(VENV)/.ready
TOOLS := $(VENV)/.tools
PEERS := $(VENV)/.peers
GROOT := $(VENV)/.behaviortree
PAGE := $(VENV)/.page
ROS2 := $(VENV)/.ros2
JAZZY := $(VENV)/.jazzy

INSTALL := $(PIP) install --quiet --disable-pip-version-check
COMPILE := $(VENV)/bin/uv pip compile --quiet --universal --python-version 3.11 --generate-hashes --no-header \
	--no-emit-index-url --no-emit-find-links

.PHONY: demo fleet mcp ros2 docs test jazzy quick lint types rooms damage faults soak mutation firmware page pictures lock

demo: $(READY)
	$(VENV)/bin/armtree run 0 1 2 0 --port virtual

# What `armtree fleet` needs beside armtree itself.
fleet: $(READY)
	$(INSTALL) --require-hashes -r .ci/lock-fleet.txt

# What `armtree mcp` needs beside armtree itself.
mcp: $(READY)
	$(INSTALL) --require-hashes -r .ci/lock-mcp.txt

# What `armtree ros2` needs beside armtree itself, if no ROS 2 is sourced.
ros2: $(ROS2)

# The documentation site, in build/site. Its pages open without a server; the search needs one.
docs: $(TOOLS)
	NO_MKDOCS_2_WARNING=1 $(VENV)/bin/mkdocs build --strict -f docs/mkdocs.yml
	@echo "build/site/index.html; with the search: $(VENV)/bin/mkdocs serve -f docs/mkdocs.yml"

test: lint types rooms $(PEERS) $(GROOT) $(ROS2)
	$(VENV)/bin/pytest

# The tests of ROS 2 with the wheels of Jazzy; `make test` uses those of Kilted.
jazzy: $(TOOLS) $(JAZZY)
	ROS2_OF_TESTS=$(CURDIR)/$(VENV)/jazzy $(VENV)/bin/pytest -n 0 tests/executive/ros2

# All tests except those marked slow; less than a minute on 2 cores.
quick: $(TOOLS)
	$(VENV)/bin/pytest -m "not slow"

lint: $(TOOLS) $(PAGE)
	$(VENV)/bin/ruff format --check .
	$(VENV)/bin/ruff check .
	@command -v npm >/dev/null || exit 0; cd executive/server/page && npm run --silent check

types: $(TOOLS)
	$(VENV)/bin/mypy

rooms: $(TOOLS)
	$(VENV)/bin/lint-imports

# 100,000 damaged frames; the suite sends 10,000.
damage: $(TOOLS)
	ARMTREE_CORRUPTIONS=100000 $(VENV)/bin/pytest -k corruptions --durations=2 \
		tests/hardware/drivers/arduino/firmware/test_avr_armtree.py tests/hardware/drivers/arduino/virtual/test_armtree_firmware.py

# Takes up to 20 minutes on 2 cores. Injects every fault of docs/faults.md, writes that page, and
# fails if one does not hold. `make faults ARGS="--only unplug --times 50 --seed 7 --keep"` selects.
faults: $(TOOLS)
	$(VENV)/bin/python tests/faults/run.py $(ARGS)

# Takes an hour: one server, random clients, faults and recoveries. Fails if a promise does not hold,
# or if the server grows. `make soak ARGS="--minutes 5 --seed 7 --json found.json"` selects.
soak: $(TOOLS)
	$(VENV)/bin/python tests/faults/soak.py $(ARGS)

# Takes two to ten minutes. Fails if no test notices a small change to the code that guards the wire.
mutation: $(TOOLS)
	$(VENV)/bin/python -P tests/mutation/run.py

# Needs avr-gcc. The version in Debian 12 builds the committed .hex.
firmware:
	hardware/drivers/arduino/firmware/build

# Needs npm. Builds the libraries of the server's page.
page: $(PAGE)
	cd executive/server/page && npm run --silent build

# Needs chromium. Takes pictures of every view of the page, to look at after a change.
pictures: $(TOOLS)
	$(VENV)/bin/python -m tests.support.generated.page_pictures build/pictures
	@echo "build/pictures"

$(PIP):
	@$(PYTHON) -c 'import sys; sys.exit("armtree needs Python 3.11 or later" if sys.version_info < (3, 11) else 0)'
	@$(PYTHON) -c 'import ensurepip' 2>/dev/null || .ci/debian python3-venv
	$(PYTHON) -m venv $(VENV)

$(READY): .ci/lock.txt pyproject.toml | $(PIP)
	@echo "Installing armtree and $$(grep -c '==' .ci/lock.txt) packages into $(VENV): planners, plots, server, recordings. pip prints nothing until it has ended."
	$(INSTALL) --require-hashes -r .ci/lock.txt
	$(INSTALL) --no-deps --no-build-isolation -e .
	$(VENV)/bin/python -m compileall -q armtree.py executive hardware logs skills trees
	@touch $@

$(TOOLS): $(READY) .ci/lock-dev.txt
	@echo "Installing the tools of the tests: $$(grep -c '==' .ci/lock-dev.txt) packages."
	$(INSTALL) --require-hashes -r .ci/lock-dev.txt
	@touch $@

# JavaScript clients for the tests. Without npm, their tests report that they are skipped.
$(PEERS): tests/peers/package-lock.json | $(PIP)
	@command -v npm >/dev/null || exit 0; cd tests/peers && npm ci --silent --ignore-scripts --no-audit --no-fund
	@touch $@

# TypeScript checks the page's code. Without npm, it is not checked.
$(PAGE): executive/server/page/package-lock.json | $(PIP)
	@command -v npm >/dev/null || exit 0; cd executive/server/page && npm ci --silent --ignore-scripts --no-audit --no-fund
	@touch $@

# BehaviorTree.CPP for the tests. Without a C++ compiler, its test reports that it is skipped.
$(GROOT): tests/peers/build_behaviortree tests/peers/behaviortree.cpp tests/peers/behaviortree.txt | $(PIP)
	@command -v g++ >/dev/null || exit 0; tests/peers/build_behaviortree $(PIP) $(CURDIR)/$@

# ROS 2 from its wheels, and the messages of armtree. Without them, their tests report that they are
# skipped.
$(ROS2) $(JAZZY): executive/ros2/install $(wildcard executive/ros2/arduinobot_msgs/*.* executive/ros2/arduinobot_msgs/*/*)

$(ROS2): .ci/lock-ros2.txt | $(READY)
	executive/ros2/install $(CURDIR)/$(VENV)/bin/python $(CURDIR)/$(VENV)/ros2 .ci/lock-ros2.txt
	@touch $@

$(JAZZY): .ci/lock-jazzy.txt | $(READY)
	executive/ros2/install $(CURDIR)/$(VENV)/bin/python $(CURDIR)/$(VENV)/jazzy .ci/lock-jazzy.txt
	@touch $@

# For maintainers: resolve all pins together, then write the locks.
lock: $(TOOLS)
	mkdir -p build
	$(COMPILE) --upgrade pyproject.toml --group build --group dev --group ros2 -o build/lock.txt
	$(COMPILE) -c build/lock.txt pyproject.toml --group build -o .ci/lock.txt
	$(COMPILE) -c build/lock.txt --group dev -o .ci/lock-dev.txt
	$(COMPILE) -c build/lock.txt --group fleet -o .ci/lock-fleet.txt
	$(COMPILE) -c build/lock.txt --group mcp -o .ci/lock-mcp.txt
	$(COMPILE) -c build/lock.txt --group ros2 -o .ci/lock-ros2.txt
	$(COMPILE) -c .ci/lock.txt --group jazzy -o .ci/lock-jazzy.txt
