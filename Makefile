# Everything runs from a bare machine with Python 3.11+, a C compiler and git: each target sets up what it needs.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
# What users get, and with what tests and checks need besides; the second includes the first.
PLAIN := $(VENV)/.installed-plain
STAMP := $(VENV)/.installed
# Build of PyTorch: cpu leaves out CUDA, where the index of those builds can be reached. By default the system's own.
TORCH ?=
SYSTEM_LIBRARIES := libgl1 libegl1 libopengl0 libusb-1.0-0
SYSTEM_INSTALL := apt-get install -y --no-install-recommends $(SYSTEM_LIBRARIES)
# Long tests run in continuous integration, and here with `make test SLOW=1`.
SLOW ?= $(CI)
# Test processes side by side, up to 3 GB of memory each; who is through with its tests takes some from another.
TEST := $(BIN)/python -m pytest -n logical --maxprocesses 4 --dist worksteal $(if $(SLOW),--durations=25,-m "not slow")

.PHONY: help setup system demo test check bench sheet clean

help:
	@echo "make demo   convert a shipped figure: GLB, 3D Tiles, USDZ and a picture in build/demo"
	@echo "make test   run the tests (SLOW=1: the long ones too)"
	@echo "make check  ruff, mypy and the tests"
	@echo "make bench  measure time and memory: build/bench.json"
	@echo "make sheet  contact sheet of a folder of figures: FIGURES=… OUT=…"

setup: system $(STAMP)

define install
	test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt uv
	$(if $(TORCH),$(UV_INSTALL) --torch-backend $(TORCH) -e $(1) || )$(UV_INSTALL) -e $(1) || \
	  $(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e $(1)
endef
UV_INSTALL := $(BIN)/python -m uv pip install --quiet --python $(BIN)/python -c constraints.txt

$(PLAIN): pyproject.toml constraints.txt
	$(call install,.)
	touch $@

$(STAMP): pyproject.toml constraints.txt
	$(call install,".[dev]")
	touch $(PLAIN) $@

# Open3D and MeshLab load four libraries that a minimal Debian does not have.
system:
	@$(PYTHON) tests/system_libraries.py || { \
	  if [ "$$(id -u)" = 0 ] && command -v apt-get >/dev/null; then \
	    echo "installing $(SYSTEM_LIBRARIES)"; apt-get update -qq && $(SYSTEM_INSTALL) >/dev/null; \
	  else echo "system libraries are missing; run: sudo $(SYSTEM_INSTALL)" >&2; exit 1; fi; }

demo: system $(PLAIN)
	$(BIN)/python examples/place_figure.py build/demo

# Where compiled modules may not be kept, each process that a test starts would compile torch and others anew.
test check: export PYTHONDONTWRITEBYTECODE :=
# One thread of torch a process: those of several processes wait for each other, and small networks gain nothing.
test check: export OMP_NUM_THREADS := 1

# Short tests try properties with the same examples on every machine, long ones with others each time; the first line
# of pytest says their seed, and HYPOTHESIS_SEED=… draws them again.
test check: export HYPOTHESIS_PROFILE := $(if $(SLOW)$(HYPOTHESIS_SEED),random,fixed)

test: setup
	$(TEST)

check: setup
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(TEST)

bench: setup
	$(BIN)/python -m tests.benchmarks.run build/bench.json

sheet: setup
	$(BIN)/python docs/make_contact_sheet.py $(FIGURES) $(OUT)

clean:
	rm -rf build dist *.egg-info .pytest_cache .mypy_cache .ruff_cache .hypothesis
