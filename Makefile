# Everything happens in .venv; Rust (1.89 or later) and Python (3.11 or later) must be there already.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
CORE := $(shell find src -name '*.rs' -o -name Cargo.toml) Cargo.toml Cargo.lock pyproject.toml

.PHONY: demo test test-manual test-all lanes wheel man docs outputs notebooks fuzz lint lint-rust lint-python bench build-times clean develop

demo: $(VENV)/.demo ## set up everything, the viewer too, and map the basins of p = 1.7
	$(BIN)/pendmap basins --p 1.7

develop: $(VENV)/.develop ## set up everything for work on pendmap itself

# The modules of tests/rust that ask for the instruction set themselves: what the lanes compute.
LANES := $(patsubst tests/rust/%.rs,%::,$(filter-out %/support.rs,$(shell grep -l '\bsimd()' tests/rust/*.rs)))
# Tests run one beside the other: matrices in several threads would only wait for each other.
PYTEST := OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pytest -q -n logical --maxprocesses 8 --dist worksteal --durations 30

MARKS ?= not thorough and not manual
test: $(VENV)/.develop ## set up everything and run the tests, all but the thorough ones and the manual
	cargo test --locked --quiet
	$(PYTEST) -m '$(MARKS)'

test-manual: $(VENV)/.develop ## set up everything, build the manual and run its commands, cells, notebooks and links
	$(PYTEST) tests/python/docs

test-all: $(VENV)/.develop ## set up everything and run all tests, those of the lanes on every instruction set
	cargo test --locked --quiet
	$(MAKE) lanes SIMD="$$($(BIN)/python -c 'from pendmap import _core; print(*_core.simd_available()[1:])')"
	$(PYTEST)

lanes: ## what the lanes compute, on each instruction set of SIMD
	for simd in $(SIMD); do \
		PENDMAP_SIMD=$$simd cargo test --locked --quiet --test rust -- $(LANES) || exit 1; done

wheel: $(VENV)/bin/maturin ## a wheel of this system, in target/wheels
	$(BIN)/maturin build --release --locked

man: $(VENV)/.develop ## the man pages again, from the texts of --help
	$(BIN)/python docs/man_pages.py

docs: $(VENV)/.develop ## the manual, in docs/_build/html
	$(BIN)/python -m sphinx -W --keep-going -n -q docs docs/_build/html

outputs: $(VENV)/.develop ## what the commands in README.md and the pages print, rewritten from real runs
	$(BIN)/python docs/outputs.py

notebooks: $(VENV)/.develop ## execute docs/notebooks in place
	$(BIN)/python docs/notebooks/run.py

SEED ?= 1
COUNT ?= 1000
fuzz: $(VENV)/.develop ## COUNT cases of bad input and faults drawn from SEED, each a command that must end well
	$(BIN)/python tests/python/fuzz.py --seed $(SEED) --count $(COUNT)

lint: lint-rust lint-python ## formatting, warnings, types, stubs, direction of imports

lint-rust: $(VENV)/.develop
	cargo fmt --all --check
	cargo clippy --locked --quiet --workspace --all-targets -- -D warnings
	RUSTDOCFLAGS="-D warnings" cargo doc --locked --quiet --workspace --no-deps
	! grep -rlE '\b(pyo3|numpy)\b' src Cargo.toml --include=*.rs --include=Cargo.toml | grep -v '^src/python/'
	! grep -rl '\brayon\b' src --include=*.rs | grep -vE '^src/(maps|fit)/'

lint-python: $(VENV)/.develop
	$(BIN)/ruff check --quiet
	$(BIN)/ruff format --check --quiet
	$(BIN)/mypy
	$(BIN)/python -m mypy.stubtest pendmap._core --ignore-disjoint-bases
	$(BIN)/lint-imports

bench: $(VENV)/.develop ## criterion, then the comparisons with other tools
	$(BIN)/pip install --quiet -r benchmarks/requirements.txt
	cargo bench --locked
	for script in speed.integration speed.friction speed.exponents speed.parameters speed.maps speed.sweeps speed.autonomous \
			speed.threads_memory speed.rig speed.stores statistics.coverage; do \
		$(BIN)/python -m benchmarks.$$script || exit 1; done

TIMED := bash -c 'TIMEFORMAT="$$0: %R s, %U s + %S s of processors"; time maturin develop --release --locked --quiet'
build-times: $(VENV)/.develop ## how long the crate takes to build: from nothing, and after a change in src/python
	cargo clean --quiet --release --package pendmap --package pendmap-python
	. $(BIN)/activate && $(TIMED) 'the crate'
	touch src/python/lib.rs
	. $(BIN)/activate && $(TIMED) 'the crate again after a change in src/python'
	touch $(VENV)/.develop $(VENV)/.demo

$(VENV)/bin/maturin:
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check 'maturin>=1.9,<2'

$(VENV)/.demo: $(VENV)/bin/maturin $(CORE)
	. $(BIN)/activate && maturin develop --release --locked --quiet --extras viewer
	touch $@

$(VENV)/.develop: $(VENV)/bin/maturin $(CORE)
	. $(BIN)/activate && maturin develop --release --locked --quiet --extras dev,docs
	touch $@ $(VENV)/.demo

clean: ## remove what was built
	cargo clean
	rm -rf $(VENV)
