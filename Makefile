# Every target works on a fresh clone with Python 3.11 or later, pip and cargo.
# Python goes into .venv/, compiled code into target/; nothing is installed elsewhere.

SHELL := /bin/bash
.SHELLFLAGS := -euo pipefail -c
.DEFAULT_GOAL := help
.DELETE_ON_ERROR:
.NOTPARALLEL:

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
PIP_INSTALL := $(BIN)/python -m pip install --quiet --disable-pip-version-check --require-hashes

# Validation data beside the checkout. Tests that need it skip, and say so, when the variable is empty.
OARLOCK_DATA ?= $(abspath $(wildcard ../shared))
export OARLOCK_DATA
export PYO3_PYTHON := $(CURDIR)/$(BIN)/python

RUST_SOURCES := Cargo.toml Cargo.lock $(wildcard crates/*/Cargo.toml) $(shell find crates/*/src -name '*.rs')

.PHONY: help demo test test-all test-long fuzz memcheck bench bench-others bench-page bench-live soak golden golden-write pages player pictures lint format docs site validation wheel sdist release-checks lock clean

help: ## list the targets
	@awk -F ':.*## ' '/^[a-z-]+:.*## / { printf "  make %-12s %s\n", $$1, $$2 }' $(MAKEFILE_LIST)

demo: $(VENV)/.package ## build, then track a simulated sculler and a real pendulum
	$(BIN)/oarlock demo --out out/demo --force

# Seeded, so that a change alone can make it fail; `make test-all` and `make fuzz` draw anew.
test: export PROPTEST_RNG_SEED := 1
test: $(VENV)/.package $(VENV)/.dev ## run the tests that every change must pass: about 10 minutes on two cores
	cargo test --locked --quiet --package oarlock
	$(BIN)/python -m pytest -m "not long" --numprocesses auto --dist loadfile

test-all: $(VENV)/.package $(VENV)/.dev ## run all tests: long statistics, browsers, commands of the README, five minutes of fuzzing
	cargo test --locked --quiet --package oarlock -- --include-ignored
	$(BIN)/python -m pytest --numprocesses auto --dist loadfile
	$(MAKE) fuzz FUZZ_MINUTES=5

# Another part every hour; LONG_TURN repeats the choice that a run printed.
LONG_SECONDS ?= 600
test-long: $(VENV)/.package $(VENV)/.dev ## run what is only in `make test-all` for LONG_SECONDS (600), another part every hour
	$(BIN)/python .ci/long_tier.py --seconds $(LONG_SECONDS) $(if $(LONG_TURN),--turn $(LONG_TURN))

# There are 10 campaigns in Rust and 109 in Python; each gets an equal share of the time.
FUZZ_MINUTES ?= 60
fuzz: export OARLOCK_FUZZ_SECONDS := $(shell echo $$(( $(FUZZ_MINUTES) * 60 / 119 )))
fuzz: export OARLOCK_FUZZ_SEED ?= $(shell date +%s)
fuzz: $(VENV)/.package $(VENV)/.dev ## feed parsers, readers, arrays and filters with rubbish for FUZZ_MINUTES (60)
	@echo "seeds from $$OARLOCK_FUZZ_SEED, $$OARLOCK_FUZZ_SECONDS s a campaign"
	cargo test --locked --quiet --package oarlock --test fuzz -- --nocapture --test-threads 1
	$(BIN)/python -m pytest --timeout 0 -s $(sort $(wildcard tests/test_fuzz_*.py))

# All `unsafe` lines of the engine are in its kernels.
MEMCHECK := target."cfg(all())".runner = ["valgrind", "--quiet", "--error-exitcode=9"]
memcheck: ## run the tests of the engine's unsafe lines under valgrind, which reports every access outside of an array
	if command -v valgrind > /dev/null; then \
		cargo test --locked --quiet --package oarlock --lib --config '$(MEMCHECK)' -- --test-threads 1 kernels::; \
	else echo "memcheck: NOT RUN, valgrind is missing"; fi

bench: $(VENV)/.package ## time steps, parts, recordings, latency and memory, and print one table
	OARLOCK_BENCH_OUT="$(CURDIR)/out/bench" cargo bench --locked --package oarlock
	$(BIN)/python -m oarlock_lab.bench

bench-others: $(VENV)/.package $(VENV)/.bench ## measure this machine beside filterpy, JAX and biorbd, which are installed for it
	$(BIN)/oarlock lab bench

bench-page: ## put the table of the last `make bench` into docs/performance.md
	$(BIN)/python -m oarlock_lab.bench --page docs/performance.md

LIVE_RUNS ?= 3
bench-live: $(VENV)/.package $(VENV)/.dev ## time a live session from packet to estimate to painted figure, and put the table into docs/live.md
	$(BIN)/python -m oarlock_lab.soak.latency --runs $(LIVE_RUNS)
	$(BIN)/python -m oarlock_lab.soak.latency --page docs/live.md

# Rates in the session without waiting are low, so that ten hours end within one.
SOAK_MINUTES ?= 60
SOAK_HOURS ?= 10
soak: $(VENV)/.package ## run live sessions with devices that misbehave: SOAK_MINUTES (60) in true time, SOAK_HOURS (10) without waiting
	$(BIN)/python -m oarlock_lab.soak --minutes 0 --hours $(SOAK_HOURS) --rate-hz 10
	$(BIN)/python -m oarlock_lab.soak --minutes $(SOAK_MINUTES) --hours 0 --rate-hz 100

# `make pages PAGES=status` measures one of them, SEEDS=1 a shorter study of faults, SETS=broad one set of the validation.
PAGES ?= status coverage validation robustness
pages: $(VENV)/.package $(VENV)/.validation ## measure the figures of README, bands, validation and robustness anew, with date and commit
	$(BIN)/python -m oarlock_lab.pages $(PAGES) $(if $(SEEDS),--seeds $(SEEDS)) $(if $(SETS),--sets $(SETS))

player: ## build player and live page from viewer/ with npm, into python/oarlock/
	cd viewer && npm ci --no-audit --no-fund --silent && npm run --silent build

pictures: $(VENV)/.package $(VENV)/.dev ## make the pictures of the pages anew from the demo; needs Chromium
	$(BIN)/python docs/pictures/make.py

# `make golden BEFORE=COMMIT` compares with that commit to the bit; without it with the committed outputs, within tolerances.
golden: $(VENV)/.package $(VENV)/.dev ## compare outputs of everything with those that are committed, or of the commit BEFORE to the bit
	$(BIN)/python -m golden $(if $(BEFORE),--before $(BEFORE))

golden-write: $(VENV)/.package $(VENV)/.dev ## replace the committed outputs after a change that is meant
	$(BIN)/python -m golden --renew

lint: $(VENV)/.package $(VENV)/.dev ## checks of the project's text, ruff, mypy, clippy and rustfmt, changing nothing
	$(BIN)/python -m checks
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	cargo fmt --all --check
	cargo clippy --locked --quiet --workspace --all-targets -- -D warnings

format: $(VENV)/.dev ## let ruff and rustfmt lay out the code
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .
	cargo fmt --all

docs: $(VENV)/.package $(VENV)/.dev ## check the links of the documentation and run its commands and examples
	$(BIN)/python -m checks
	$(BIN)/python -m pytest tests/test_docs.py

site: $(VENV)/.package $(VENV)/.dev ## build the documentation site strictly into out/site/html, with reports of shipped examples
	$(BIN)/python -m oarlock_lab.pages.site

validation: $(VENV)/.package $(VENV)/.validation ## track public recordings with Oarlock and with other software, and compare
	$(BIN)/python -m oarlock_lab.validation --out out/validation

# TARGET is a target triple of Rust, such as aarch64-unknown-linux-musl; its standard library has to be installed.
TARGET ?=
DIST ?= dist
wheel: $(VENV)/.release ## build a wheel into dist/ and check its contents
	$(RELEASE) wheel $(if $(TARGET),--target $(TARGET)) --out $(DIST)
	$(RELEASE) check $(DIST)/*.whl

sdist: $(VENV)/.release ## build the source distribution into dist/ and check its contents
	$(RELEASE) sdist --out $(DIST)
	$(RELEASE) check $(DIST)/*.tar.gz

release-checks: $(VENV)/.release $(VENV)/.deny ## check workflows and citation, and licences and sources of the Rust dependencies
	$(VENV)/release/bin/zizmor --offline --no-progress --pedantic .github/workflows
	$(VENV)/release/bin/cffconvert --validate
	PATH="$(CURDIR)/$(VENV)/deny/bin:$$PATH" cargo deny --locked --all-features check licenses bans sources

# `make lock UPGRADE=--upgrade` moves every pin to its newest version. Pins and hashes are those of every system and Python.
COMPILE := UV_CUSTOM_COMPILE_COMMAND="make lock" $(VENV)/lock/bin/uv pip compile --quiet --no-config --universal --python-version 3.11 \
	--strip-extras --generate-hashes --no-emit-index-url --annotation-style=line $(UPGRADE)
lock: $(VENV)/.created ## compute the pinned versions in requirements/ again
	$(BIN)/python -m venv $(VENV)/lock
	$(VENV)/lock/bin/python -m pip install --quiet --disable-pip-version-check uv
	$(COMPILE) --extra full --extra test --extra lint --extra dataframe --extra xarray --extra c3d --extra hdf5 --extra mcap --extra compare \
		--extra ble --extra serial --extra mqtt --extra season --extra s3 --extra dask --extra fit \
		--extra polars --extra plot --extra notebooks --extra video --extra site \
		--output-file requirements/dev.txt pyproject.toml requirements/build.in
	$(COMPILE) --constraint requirements/dev.txt --extra full --extra season --output-file requirements/run.txt pyproject.toml requirements/build.in
	$(COMPILE) --constraint requirements/dev.txt --output-file requirements/validation.txt requirements/validation.in
	$(COMPILE) --output-file requirements/release.txt requirements/release.in
	$(COMPILE) --constraint requirements/dev.txt --excludes <(echo oarlock) --extra full --extra bench \
		--output-file requirements/bench.txt pyproject.toml lab/pyproject.toml

clean: ## remove everything that was built or installed
	rm -rf $(VENV) target dist out viewer/node_modules python/oarlock/data .pytest_cache .mypy_cache .ruff_cache .hypothesis python/oarlock/*.so
	find . -name __pycache__ -type d -prune -exec rm -rf {} +

# Stamps: a step is done again only if what it depends on has changed.

$(VENV)/.created:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
		{ echo "Oarlock needs Python 3.11 or later; $(PYTHON) is older or missing. Try: make PYTHON=python3.12 ..."; exit 1; }
	@command -v cargo > /dev/null || { echo "Oarlock needs cargo, the Rust build tool: https://rustup.rs"; exit 1; }
	$(PYTHON) -m venv $(VENV)
	@touch $@

$(VENV)/.run: requirements/run.txt | $(VENV)/.created
	$(PIP_INSTALL) --requirement $<
	@touch $@

$(VENV)/.dev: requirements/dev.txt | $(VENV)/.run
	$(PIP_INSTALL) --requirement $<
	@touch $@

$(VENV)/.validation: requirements/validation.txt | $(VENV)/.run
	$(PIP_INSTALL) --requirement $<
	@touch $@

$(VENV)/.bench: requirements/bench.txt | $(VENV)/.run
	$(PIP_INSTALL) --requirement $<
	@touch $@

# Its own environment: zig is large, and cffconvert needs an old jsonschema.
RELEASE := $(VENV)/release/bin/python -m release
$(VENV)/.release: requirements/release.txt | $(VENV)/.created
	$(BIN)/python -m venv $(VENV)/release
	$(VENV)/release/bin/python -m pip install --quiet --disable-pip-version-check --require-hashes --requirement $<
	@touch $@

# Without optimisation it builds in a third of the time; it runs for half a second. The workflow advisories.yml has the same version.
$(VENV)/.deny: | $(VENV)/.created
	cargo install --quiet --debug --locked cargo-deny@0.20.2 --root $(VENV)/deny
	@touch $@

$(VENV)/.package: $(RUST_SOURCES) pyproject.toml lab/pyproject.toml | $(VENV)/.run
	env -u CONDA_PREFIX PIP_QUIET=1 VIRTUAL_ENV="$(CURDIR)/$(VENV)" $(BIN)/maturin develop --release --locked --quiet
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-index --no-deps --no-build-isolation --editable lab
	rm -rf python/oarlock/data # copies of examples/, which only wheels need
	@touch $@
