# What there is to do with raycl; `make` alone lists it.

RAYCL = $${CARGO_TARGET_DIR:-target}/release/raycl
QUICK = results/quick

.DEFAULT_GOAL := help
.PHONY: help setup build demo test lint bench test-browser

help: ## list these targets
	@sed -nE 's/^([a-z-]+):[^#]*## (.*)/make \1\t\2/p' Makefile | expand -t 14

setup: ## install what is missing: a C linker, the OpenCL loader, PoCL (Debian-like; root or sudo)
	@.ci/setup

build: setup ## build target/release/raycl
	cargo build --release --locked

demo: build ## build, cast the paper's scenes in a few strategies, say where pictures and table lie
	$(RAYCL) run configs/quick.toml --out $(QUICK)
	@echo
	@echo "Pictures: $(QUICK)/images/"
	@echo "Table:    $(QUICK)/summary.md (also summary.csv; every point: records.jsonl)"

test: setup ## run the tests
	cargo test --locked

lint: setup ## check format and lints, as CI does
	cargo fmt --check
	cargo clippy --all-targets --locked -- -D warnings

bench: build ## measure the fast strategies
	$(RAYCL) run configs/beyond.toml --out results/beyond

BROWSER = target/browser

test-browser: build ## open the report in a real browser; check exports with Kernel Tuner (installs both)
	@tests/browser/run $(RAYCL) $(BROWSER)
