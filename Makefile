# `make demo` shows the arm at work on the virtual Arduino, `make test` runs every check. Both set
# up .venv first if it is missing or older than the lock; the tools of `make test` come with it only.

PYTHON ?= python3
VENV := .venv
READY := $(VENV)/.ready
TOOLS := $(VENV)/.tools
PEERS := $(VENV)/.peers
GROOT := $(VENV)/.behaviortree

INSTALL := $(VENV)/bin/pip install --quiet --disable-pip-version-check
COMPILE := uv pip compile --quiet --universal --python-version 3.11 --generate-hashes --no-header \
	--no-emit-index-url --no-emit-find-links

.PHONY: demo test damage mutation firmware lock

demo: $(READY)
	$(VENV)/bin/armtree run 0 1 2 0 --port virtual

test: $(TOOLS) $(PEERS) $(GROOT)
	$(VENV)/bin/ruff format --check .
	$(VENV)/bin/ruff check .
	$(VENV)/bin/mypy
	$(VENV)/bin/lint-imports
	$(VENV)/bin/pytest

# The suite damages 10 000 frames; here it is ten times as many.
damage: $(TOOLS)
	ARMTREE_CORRUPTIONS=100000 $(VENV)/bin/pytest -k corruptions --durations=2 \
		tests/test_hardware_avr_armtree.py tests/test_hardware_virtual_armtree.py

# Two to ten minutes: does a test notice every small change to what guards the wire?
mutation: $(TOOLS)
	$(VENV)/bin/python -P tests/mutation/run.py

# Needs avr-gcc; the committed .hex is what Debian 12's makes.
firmware:
	hardware/firmware/build

$(READY): .ci/lock.txt pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit("armtree needs Python 3.11 or later" if sys.version_info < (3, 11) else 0)'
	@$(PYTHON) -c 'import ensurepip' 2>/dev/null || .ci/debian python3-venv
	$(PYTHON) -m venv $(VENV)
	$(INSTALL) --require-hashes -r .ci/lock.txt
	$(INSTALL) --no-deps --no-build-isolation -e .
	@touch $@

$(TOOLS): $(READY) .ci/lock-dev.txt
	$(INSTALL) --require-hashes -r .ci/lock-dev.txt
	@touch $@

# A client in JavaScript for the tests; where there is no npm, its test says that it is skipped.
$(PEERS): tests/peers/package-lock.json
	@command -v npm >/dev/null || exit 0; cd tests/peers && npm ci --silent --ignore-scripts --no-audit --no-fund
	@touch $@

# BehaviorTree.CPP for the tests; where there is no C++ compiler, its test says that it is skipped.
$(GROOT): tests/peers/build_behaviortree tests/peers/behaviortree.cpp tests/peers/behaviortree.txt $(TOOLS)
	@command -v g++ >/dev/null || exit 0; tests/peers/build_behaviortree $(VENV)/bin/pip $(CURDIR)/$@

# For maintainers, with uv: pin everything anew, all in one go, then in the two parts.
lock:
	mkdir -p build
	$(COMPILE) --upgrade pyproject.toml --group build --group dev -o build/lock.txt
	$(COMPILE) -c build/lock.txt pyproject.toml --group build -o .ci/lock.txt
	$(COMPILE) -c build/lock.txt --group dev -o .ci/lock-dev.txt
