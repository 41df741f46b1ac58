# make demo    set up, then bake the showpiece scene into ./aobake-demo
# make test    set up, then run the tests
# make install set up only: everything goes into ./.venv, nothing outside of it is touched
# make check   format, lint, strict types, tests
# make bench   the measurements that the documents quote; BENCH="tracing --quick" chooses
# make bench-check  the ratios that must not get worse, beside the recorded ones
# make viewer  build the viewer of `aobake view` anew, from the versions that viewer/ pins; needs node and npm
# make fuzz    damaged files to every reader, for FUZZ_SECONDS (60); what breaks is kept in .fuzz/failures
#
# PYTHON=python3.12 chooses an interpreter, VENV=folder another place.

PYTHON ?= python3
VENV ?= .venv
FUZZ_SECONDS ?= 60
BENCH ?=
BIN := $(VENV)/bin
STAMP := $(VENV)/.installed

export PIP_DISABLE_PIP_VERSION_CHECK := 1
export PIP_REQUIRE_VIRTUALENV := 1
unexport PIP_USER PYTHONHOME PYTHONPATH

.DELETE_ON_ERROR:
.PHONY: demo test install check lint bench bench-check viewer fuzz clean

demo: install
	@$(BIN)/aobake demo -o aobake-demo --force

test: install
	@$(BIN)/python -m pytest -n auto --dist loadfile

install: $(STAMP)

check: lint test

lint: install
	@$(BIN)/ruff format --check --quiet . || { \
	    echo "Some files are not formatted as agreed: $(BIN)/ruff format ." >&2; exit 1; }
	@$(BIN)/ruff check --quiet .
	@$(BIN)/mypy

bench: install
	@$(BIN)/python benchmarks $(BENCH)

bench-check: install
	@$(BIN)/python benchmarks --check

viewer:
	@command -v npm >/dev/null || { echo "aobake: building the viewer needs node 20 or newer, with npm." >&2; exit 1; }
	@cd viewer && npm ci --ignore-scripts --no-audit --no-fund --silent && npm run --silent build

fuzz: install
	@"$(BIN)/python" -m pip install --quiet --editable ".[fuzz]"
	@$(BIN)/python -m fuzz.run --seconds $(FUZZ_SECONDS)

clean:
	rm -rf "$(VENV)" viewer/node_modules .fuzz aobake-demo build dist .mypy_cache .pytest_cache .ruff_cache .hypothesis

# The stamp is written last, so that an interrupted set-up is taken up again.
$(STAMP): pyproject.toml
	@command -v "$(PYTHON)" >/dev/null || { \
	    echo "aobake: there is no $(PYTHON) here. Install Python 3.11 to 3.13, or name it: make PYTHON=python3.12" >&2; exit 1; }
	@"$(PYTHON)" -c 'import sys; sys.exit(not (3, 11) <= sys.version_info < (3, 14))' || { \
	    echo "aobake: Python 3.11 to 3.13 is needed, and $(PYTHON) is `$(PYTHON) -V 2>&1`. Name another: make PYTHON=python3.12" >&2; exit 1; }
	@"$(PYTHON)" -c 'import ensurepip, venv' 2>/dev/null || { \
	    echo "aobake: $(PYTHON) comes without its venv module. On Debian and Ubuntu: apt install python3-venv" >&2; exit 1; }
	@test ! -e "$(VENV)/pyvenv.cfg" || "$(BIN)/python" -m pip --version >/dev/null 2>&1 || rm -rf "$(VENV)"
	@test -e "$(VENV)/pyvenv.cfg" || { echo "aobake: setting up $(VENV)"; "$(PYTHON)" -m venv "$(VENV)"; }
	@"$(BIN)/python" -m pip install --quiet --editable ".[all,dev]"
	@touch "$@"
