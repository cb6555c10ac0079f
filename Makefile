# `make help` says what there is. A fresh clone needs Python 3.11 or newer (with venv and headers), make and a C++ compiler.

ENV := .venv
BIN := $(ENV)/bin
KERNEL := CMakeLists.txt pyproject.toml $(wildcard src/kernel/*/*)
WEB := $(wildcard web/src/* web/*.json web/build.mjs)
PINNED = --universal --fork-strategy fewest --python-version 3.11 --generate-hashes --no-annotate \
	--no-emit-index-url --no-emit-find-links --custom-compile-command "make lock" --quiet $(UPGRADE)
COMPILE = uv pip compile pyproject.toml $(PINNED)
COMPILE_WEB = uv pip compile --group web $(PINNED)

# What calls the kernel itself, or through networks, runs and fits; the other tests reach nothing of it that these do not.
SANITIZED := tests/unit/kernel tests/unit/simulation/network tests/unit/simulation tests/unit/fit tests/unit/inference tests/unit/fit/power tests/unit/inference/explain \
	tests/unit/campaign/judge tests/unit/campaign tests/unit/prediction tests/unit/prediction/advice tests/unit/model/test_law.py \
	tests/analytic tests/properties tests/recovery tests/regression

BROWSED := tests/studio tests/unit/reporting/test_in_a_browser.py tests/docs/test_site_browser.py

# uv where it is present; it does not read pip's settings, so pip has the last word.
install = { command -v uv >/dev/null && uv pip install --quiet --python $(BIN)/python --require-hashes -r $(1); } \
	|| $(BIN)/python -m pip install --disable-pip-version-check --quiet --require-hashes -r $(1)

.PHONY: help setup setup-test demo test test-all test-browser bench screenshots firmware bench-tools docs lint torture sanitize format lengths lock clean

help:  ## what can be made
	@sed -nE 's/^([a-z-]+):[^#]*## (.*)/  make \1\t\2/p' Makefile | expand -t 20
	@echo '  PYTHON=/path/to/python chooses the interpreter of the environment.'

setup: $(ENV)/.kernel $(ENV)/.web  ## the environment of the demo, with the compiled kernel
setup-test: $(ENV)/.test $(ENV)/.kernel $(ENV)/.web  ## the same, with the tools of the tests

demo: setup  ## the demonstration; ends with the path of its page
	@$(BIN)/python examples/demo.py

test: lint  ## lint, then every test but the whole campaigns
	OMP_NUM_THREADS=1 $(BIN)/python -m pytest -n 2 --dist loadfile -m "not campaign" -rs --durations=10

test-all: lint  ## lint, then every test
	OMP_NUM_THREADS=1 $(BIN)/python -m pytest -n 2 --dist loadfile -rs --durations=10

test-browser: setup-test  ## every test of a page in a browser; it fails, and does not skip, where Chromium and its driver are missing
	@command -v chromium >/dev/null && command -v chromedriver >/dev/null || { echo 'Chromium or its driver is missing (Debian, Ubuntu: chromium, chromium-driver).' >&2; exit 1; }
	OMP_NUM_THREADS=1 $(BIN)/python -m pytest -n 2 --dist loadfile -rs --durations=10 $(BROWSED)

bench: setup-test  ## every benchmark beside the peers that are installed, the tables of docs/benchmarks.md, the guards
	@for case in B1 B2 B3 B4 B5 B6 B7 B8 B9 B10 B11; do $(BIN)/python benchmarks/run.py $$case --save benchmarks/results || exit 1; done
	@$(BIN)/python benchmarks/table.py
	OMP_NUM_THREADS=1 $(BIN)/python -m pytest -q --benchmark-only tests/benchmarks

screenshots: setup-test  ## pictures of the studio and of a report page at three widths, light and dark, into out/screenshots (needs Chromium)
	@$(BIN)/python scripts/screenshots.py

firmware:  ## the firmware of the bench (needs avr-gcc), with its flash and RAM
	@$(MAKE) --no-print-directory -C firmware

bench-tools: firmware  ## the simulated bench that runs it (needs libsimavr)
	@$(MAKE) --no-print-directory -C bench

docs: setup-test  ## the documentation as pages that open from the disk; ends with the path of the first
	@NO_MKDOCS_2_WARNING=1 $(BIN)/python -m mkdocs build --strict
	@echo $(CURDIR)/build/docs/index.html

torture: setup-test  ## mutants of files, commands and arguments, random networks, kills and full disks (MINUTES=8), the table of docs/torture.md
	$(BIN)/python scripts/torture.py --minutes $(or $(MINUTES),8) --seed $(or $(SEED),1) --page docs/torture.md

sanitize: setup-test  ## the tests that reach the kernel, with a kernel built under address and undefined behaviour sanitizers (gcc)
	scripts/sanitize -m pytest -n 2 -m "not campaign" -rs -p no:cacheprovider $(SANITIZED)

lint: setup-test  ## ruff and mypy
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

format: setup-test  ## let ruff mend and lay out what it can
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

lengths: setup-test  ## which functions are long
	@$(BIN)/python -m pytest -q -rP tests/architecture/test_lengths.py

lock:  ## pin every package again (needs uv; UPGRADE=--upgrade for newer versions)
	@command -v uv >/dev/null || { echo 'make lock needs uv on the PATH.' >&2; exit 1; }
	$(COMPILE) --extra report --extra symbolic --group build -o requirements.lock
	$(COMPILE_WEB) -o requirements-web.lock
	$(COMPILE) --all-extras --group build -c requirements.lock -o requirements-test.lock

clean:  ## remove the environment and everything that was built
	rm -rf $(ENV) build dist web/node_modules src/thermid/app/studio/bundle .mypy_cache .ruff_cache .pytest_cache .hypothesis
	find src tests scripts examples -name __pycache__ -type d -prune -exec rm -rf {} +

# Another PYTHON than the one that made the environment makes it anew.
ifneq ($(PYTHON),)
ifneq ($(PYTHON),$(shell cat $(ENV)/.python 2>/dev/null))
.PHONY: $(ENV)/.python
endif
endif
export PYTHON
# Tests start Python some hundred times; compiled files are read, not made anew.
unexport PYTHONDONTWRITEBYTECODE

$(ENV)/.python:
	@tools=$$(scripts/find_tools) && eval "$$tools" && echo "environment: $(ENV), from $$PYTHON" && rm -rf build \
		&& "$$PYTHON" -m venv --clear $(ENV) && echo "$(PYTHON)" > $@

$(ENV)/.demo: requirements.lock $(ENV)/.python
	@echo 'installing requirements.lock'
	@$(call install,requirements.lock)
	@touch $@

$(ENV)/.test: requirements-test.lock $(ENV)/.demo
	@echo 'installing requirements-test.lock'
	@$(call install,requirements-test.lock)
	@touch $@

# Editable: Python sources are read where they lie; only a change of the kernel or of pyproject.toml builds again.
$(ENV)/.kernel: $(KERNEL) $(ENV)/.demo
	@echo 'building the kernel'
	@tools=$$(scripts/find_tools) && eval "$$tools" && CXX="$$CXX" PATH="$(CURDIR)/$(BIN):$$PATH" $(BIN)/python -m pip install \
		--disable-pip-version-check --quiet --no-deps --no-build-isolation --editable .
	@touch $@

# Without npm's packages the rest is set up all the same; the next `make setup` tries again.
$(ENV)/.web: $(WEB) scripts/build_web requirements-web.lock $(ENV)/.demo
	@echo "building the studio's pages"
	@if scripts/build_web; then touch $@; fi
