# make demo | quick | test | mutants | soak | setup | bench | docs | lock.  Everything is installed from the lock into .venv.
PYTHON ?= python3
BIN := .venv/bin
AXE := tests/system/axe/node_modules
BESIDE := --numprocesses auto --dist worksteal --ignore tests/system
export PIP_DISABLE_PIP_VERSION_CHECK := 1

.PHONY: demo quick test mutants soak setup check bench docs lock clean

demo: setup
	$(BIN)/splinefleet run examples/paper_five.toml

setup: .venv/runtime.stamp

# The inner loop: a tenth of each sweep over seeds, and no tests that start processes.
quick: .venv/dev.stamp check
	$(BIN)/python -m pytest $(BESIDE) --quick

# Every test, each eleventh seed of the sweeps.  Whole fleets drive in real time: two at once, with
# nothing else beside them.
test: .venv/dev.stamp check $(AXE)
	$(BIN)/python -m pytest $(BESIDE) --every 11
	$(BIN)/python -m pytest --numprocesses 2 --dist loadfile tests/system

# What takes longer than a change can wait: all seeds of the sweeps, and others each night.
soak: NIGHT := $(shell date +%Y%m%d)
soak: .venv/dev.stamp
	$(BIN)/python -m pytest $(BESIDE)
	$(BIN)/python -m benchmarks.reliability --count 200 --from-seed $(NIGHT)
	$(BIN)/python -m benchmarks.order_campaign --count 40 --from-seed $(NIGHT)
	$(BIN)/python -m benchmarks.mutation --count 100 --seed $(NIGHT) --minutes 30 --kept benchmarks/results/mutants-$(NIGHT).jsonl

# A few minutes of mutants, others each time, of the rooms whose tests are soon watched.
mutants: NUMBER := $(shell date +%s)
mutants: .venv/dev.stamp
	$(BIN)/python -m benchmarks.mutation --count 100 --seed $(NUMBER) --rooms agent wire --minutes 1 --jobs 2 --kept benchmarks/results/mutants-$(NUMBER).jsonl

check: .venv/dev.stamp
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

bench: .venv/dev.stamp .venv-peers/peers.stamp
	$(BIN)/python -m benchmarks

docs: export NO_MKDOCS_2_WARNING := 1
docs: .venv/dev.stamp
	$(BIN)/python -m mkdocs build --strict --quiet --config-file docs/site/mkdocs.yml

# axe checks the page's accessibility in a browser.  Without npm, or out of its reach, that is skipped.
$(AXE): tests/system/axe/package-lock.json
	npm ci --prefix tests/system/axe --silent --no-audit --no-fund --ignore-scripts || echo "no axe: its tests are skipped"

.venv/bin/python:
	$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "splinefleet needs Python 3.11 or newer")'
	$(PYTHON) -m venv .venv

.venv/runtime.stamp: requirements.lock pyproject.toml | .venv/bin/python
	$(BIN)/python -m pip install --quiet --require-hashes --requirement requirements.lock
	$(BIN)/python -m pip install --quiet --no-deps --no-build-isolation --editable .
	$(BIN)/python -m compileall -q protocol coordinator robot_agent sim splinefleet.py
	$(BIN)/python -m coordinator.service.kernel_setup
	touch $@

.venv/dev.stamp: requirements-dev.lock .venv/runtime.stamp
	$(BIN)/python -m pip install --quiet --require-hashes --requirement requirements-dev.lock
	touch $@

# Libraries that benchmarks measure beside ours need numpy < 2: they have an environment of their own.
# pyrvo declares a simulator that its bindings do not use: it is installed alone.
.venv-peers/peers.stamp: benchmarks/peers/requirements.lock benchmarks/peers/orca.lock
	$(PYTHON) -m venv .venv-peers
	.venv-peers/bin/python -m pip install --quiet --require-hashes --requirement $<
	.venv-peers/bin/python -m pip install --quiet --require-hashes --no-deps --requirement benchmarks/peers/orca.lock
	touch $@

# The locks: hashes, no addresses; the development lock agrees with the runtime lock.
lock:
	uv pip compile --quiet --universal --generate-hashes --no-header --no-annotate --no-emit-index-url --no-emit-find-links --extra build pyproject.toml -o requirements.lock
	uv pip compile --quiet --universal --generate-hashes --no-header --no-annotate --no-emit-index-url --no-emit-find-links --constraint requirements.lock --extra build --extra dev pyproject.toml -o requirements-dev.lock
	uv pip compile --quiet --universal --generate-hashes --no-header --no-annotate --no-emit-index-url --no-emit-find-links --python-version 3.11 benchmarks/peers/requirements.in -o benchmarks/peers/requirements.lock

clean:
	rm -rf .venv .venv-peers runs build $(AXE)
