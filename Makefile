# make demo   the main job end to end: record, train, encode, analyse
# make test   every check and test; what CI runs
# Both do all the set-up on a fresh Debian or Ubuntu machine that has Rust, and Python with pip.

# Dependencies are built once, in one profile, outside the clone.
export CARGO_TARGET_DIR ?= $(or $(XDG_CACHE_HOME),$(HOME)/.cache)/vibes-toolkit/target
export PATH := $(CARGO_TARGET_DIR)/debug:$(PATH)

# Lints come with the build: clippy's driver compiles the workspace, and the dependencies are those that every other build uses.
# `cargo clippy` would check all of them a second time.
linted := RUSTC_WORKSPACE_WRAPPER=clippy-driver CLIPPY_ARGS=-Dwarnings
python = $(shell setup/python.sh --where)/bin

# With -j too: every step either builds with all cores or needs what the step before it has made.
.NOTPARALLEL:

.PHONY: setup build demo demo-online check test tools bench stress gpu-test

setup: ## MuJoCo, the suite's models, EGL
	@setup/fetch.sh
	@setup/egl.sh
	@setup/cargo.sh

build: setup
	cargo build --workspace

demo: build
	@demo/run.sh

demo-online: build ## an agent that learns in the environment, above a random policy: 4 min 23 s on two cores, programs built
	@demo/online.sh

check: setup ## formatting, lints, links and examples in the documentation
	cargo fmt --all --check
	$(linted) cargo build --workspace --all-targets
	RUSTDOC="$(CURDIR)/setup/rustdoc.sh" $(linted) cargo test --workspace --doc --quiet

tools: ## what only the tests need: a Python environment outside the clone, and a browser
	@setup/python.sh
	@setup/browser.sh

# The tools first: what is missing on the system is said before anything is built.
test: tools check
	PATH="$(python):$$PATH" $(linted) cargo test --workspace --all-targets
	PATH="$(python):$$PATH" python notebooks/run.py
	PATH="$(python):$$PATH" python tests/readers.py

bench: build ## rate cards of the three programs
	vibes-collect bench
	vibes-train bench
	vibes-analyze bench

DURATION ?= 30m

stress: setup ## draws for DURATION (30m, 2h, 90s) on all cores, both looks, an upload for every picture; must end without a crash
	cargo build -p vibes-env --example stress
	"$(CARGO_TARGET_DIR)/debug/examples/stress" $$(( $(patsubst %h,%*3600,$(patsubst %m,%*60,$(patsubst %s,%,$(DURATION)))) ))

.PHONY: fuzz

fuzz: DURATION = 10m
fuzz: setup ## every reader of foreign files under libFuzzer for DURATION each; READERS= names some of them
	fuzz/run.sh $$(( $(patsubst %h,%*3600,$(patsubst %m,%*60,$(patsubst %s,%,$(DURATION)))) )) $(READERS)

# Vulkan on the CPU: Debian's and Ubuntu's libvulkan1 and mesa-vulkan-drivers. VULKAN= with another driver's file tests that driver.
VULKAN ?= $(firstword $(wildcard /usr/share/vulkan/icd.d/lvp_icd*.json))

# For the three commands alone: set-up would point plain `cargo build` to this folder too.
on_gpu := CARGO_TARGET_DIR="$(CARGO_TARGET_DIR)/gpu" $(linted)

gpu-test: setup ## the model on wgpu beside flex, and that cuda compiles; not in CI, because it builds Burn a second time
	@[ -f "$(VULKAN)" ] || { echo "gpu-test: lavapipe is missing; sudo apt-get install -y libvulkan1 mesa-vulkan-drivers" >&2; exit 1; }
	$(on_gpu) cargo build -p vibes-model -p vibes-train --features vibes-train/wgpu --tests
	VK_DRIVER_FILES="$(VULKAN)" VK_ICD_FILENAMES="$(VULKAN)" $(on_gpu) cargo test -p vibes-model -p vibes-train --features vibes-train/wgpu --test devices
# Only types are checked, so the LLVM that a build with cuda fetches and links is left out, as on docs.rs.
	DOCS_RS=1 $(on_gpu) cargo check -p vibes-train --features cuda

.PHONY: python python-test

python: setup ## the Python package as a wheel that needs only numpy, under the manylinux tag that is true for it
	@setup/wheel.sh

PYTHON_TEST ?= $(or $(XDG_CACHE_HOME),$(HOME)/.cache)/vibes-toolkit/python-test

python-test: build python ## the Python package with Gymnasium, dm_env, Stable-Baselines3, TorchRL and PyTorch, in an environment outside the clone
	@setup/environment.sh python/tests/requirements.txt "$(PYTHON_TEST)"
# The wheel alone, with nothing but numpy beside it; a second environment, small and made anew.
	python3 -m venv --clear "$(PYTHON_TEST)-numpy" && PIP_USER=0 "$(PYTHON_TEST)-numpy/bin/pip" install --quiet --disable-pip-version-check "$(CARGO_TARGET_DIR)"/wheels/vibes-*.whl
	cd python/tests && "$(PYTHON_TEST)-numpy/bin/python" numpy_alone.py
	PIP_USER=0 "$(PYTHON_TEST)/bin/pip" install --quiet --no-deps --force-reinstall "$(CARGO_TARGET_DIR)"/wheels/vibes-*.whl
	cd python && "$(PYTHON_TEST)/bin/mypy" package
	cd python && "$(PYTHON_TEST)/bin/pytest" -q
	"$(PYTHON_TEST)/bin/python" notebooks/run.py 05

.PHONY: sweep-test

SWEEP_TEST ?= $(or $(XDG_CACHE_HOME),$(HOME)/.cache)/vibes-toolkit/sweep-test

sweep-test: build ## the examples for Ray (two workers, one of which is killed), Optuna and W&B, with the real packages, in an environment outside the clone
	@setup/environment.sh tests/sweep_engines.txt "$(SWEEP_TEST)"
	"$(SWEEP_TEST)/bin/python" tests/sweep_engines.py
