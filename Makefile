# Targets to build, test and measure raycl. `make` without a target lists them.

# All builds of programs and tests in this file pass this folder to cargo: cargo's own settings may name another folder,
# and the path RAYCL would then lead to no program. The folder is quoted, since its name may have blanks.
TARGET_DIR = "$${CARGO_TARGET_DIR:-target}"
RAYCL = $(TARGET_DIR)/release/raycl
QUICK = results/quick

.DEFAULT_GOAL := help
.PHONY: help setup setup-tests build demo test test-long mutants mutants-sample oclgrind test-intel test-slurm test-slurm-short test-browser fuzz lint licences figures bench book test-python

help: ## list these targets
	@sed -nE 's/^([a-z-]+):[^#]*## (.*)/make \1\t\2/p' Makefile | expand -t 17

setup: ## install missing packages: a C linker, the OpenCL loader, PoCL (Debian-like; root or sudo)
	@.ci/setup

build: setup ## build target/release/raycl
	cargo build --release --locked --target-dir $(TARGET_DIR)

demo: build ## build, cast the paper's scenes with a few strategies, print where the pictures and the table are
	$(RAYCL) run configs/quick.toml --out $(QUICK) --resume

setup-tests:
	@.ci/setup --test

# The tests run on two more threads than the machine has cores, since some tests only wait.
TEST = RUST_TEST_THREADS=$$(($$(nproc) + 2)) cargo test --locked --target-dir $(TARGET_DIR)

test: setup-tests ## run the tests
	$(TEST)

test-long: setup-tests ## run all tests without sampling: every preset at every local size (several times as long as `make test`)
	RAYCL_TEST_LONG=1 $(TEST)

mutants: setup-tests ## insert mistakes into Rust and kernels, one at a time; tests must notice nearly all of them; continues where it was stopped (an hour; Python 3.11)
	@tests/mutants/run
	RAYCL_TEST_LONG=1 $(TEST) --test all -- ::a_broken_ --skip mutants::

mutants-sample: setup-tests ## insert a sample of the mistakes of `make mutants`, chosen by the date; SAMPLE=2026-11-21 repeats that day's sample
	@tests/mutants/run --sample "$${SAMPLE:-$$(date +%F)}"

oclgrind: setup-tests ## simulate kernels to find races, accesses out of bounds and reads of unwritten values; also with each barrier removed in turn
	RAYCL_TEST_LONG=1 $(TEST) --test all -- oclgrind:: --nocapture

test-intel: setup-tests ## run the kernels' tests on Intel's OpenCL runtime, which is installed under target/
	@.ci/test-intel

test-slurm: build ## run shards on a real Slurm of four nodes on this machine, and kill the shards' processes in various ways (installs Slurm; root; half an hour)
	@tests/slurm/setup mpi
	tests/slurm/run $(RAYCL)

test-slurm-short: setup-tests ## run the part of test-slurm that .ci/run needs: kill one process of raycl, and all processes of one node (installs Slurm; root; a minute)
	@tests/slurm/setup
	cargo test --locked --no-run --target-dir $(TARGET_DIR)
	RUNS=1 tests/slurm/run $(TARGET_DIR)/debug/raycl kill nokill

fuzz: ## fuzz every reader of files for MINUTES each (default: 10); needs cargo-fuzz and a C++ compiler
	@.ci/fuzz

lint: setup ## check format, lints and documentation, as CI does
	cargo fmt --check
	cargo clippy --all-targets --locked -- -D warnings
	RUSTDOCFLAGS="-D warnings" cargo doc --no-deps --lib --locked

licences: ## check licences, bans, sources and Rust versions of all crates, without cargo-deny (Python 3.11)
	@.ci/setup --licences
	@.ci/licences
	@.ci/licences --texts >/dev/null

figures: build ## write the figures of README.md, docs/kernels.md, docs/paper.md and docs/performance.md from the stored records
	$(RAYCL) figures

test-python: ## run the Python code of docs/python.md (installs pandas, Polars and DuckDB under target/)
	@tests/python/run target/python

book: ## build target/book/index.html from docs/ (installs mdbook with cargo if it is missing)
	@.ci/book

bench: build ## measure the fast strategies
	$(RAYCL) run configs/beyond.toml --out results/beyond --resume

BROWSER = target/browser

test-browser: build ## open the report in a real browser; check exports with Kernel Tuner (installs both)
	@tests/browser/run $(RAYCL) $(BROWSER)
