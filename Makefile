# make demo   the main job end to end: record, train, encode, analyse
# make test   every check and test; what CI runs
# Both do all the set-up on a fresh Debian or Ubuntu machine that has Rust, and Python with pip.

# Dependencies are built once, in one profile, outside the clone.
export CARGO_TARGET_DIR ?= $(or $(XDG_CACHE_HOME),$(HOME)/.cache)/vibes-toolkit/target
export PATH := $(CARGO_TARGET_DIR)/debug:$(PATH)

.PHONY: setup build demo test check bench

setup: ## MuJoCo, the suite's models, EGL
	@setup/fetch.sh
	@setup/egl.sh
	@setup/cargo.sh

build: setup
	cargo build --workspace

demo: build
	@demo/run.sh

check: setup ## formatting, lints, links, dependency fence
	cargo fmt --all --check
	cargo clippy --workspace --tests -- -D warnings
	RUSTDOCFLAGS="-D warnings" cargo doc --workspace --no-deps --quiet

test: check build
	cargo test --workspace
	@[ ! -d data/sample ] || python3 notebooks/run.py
	@[ ! -d data/sample ] || python3 tests/readers.py

bench: build ## rate cards of the three programs
	vibes-collect bench
	vibes-train bench
	vibes-analyze bench
