# make setup   create .venv with everything in it, from requirements.lock
# make loop    the main job, start to end, on a simulated and a measured arm, in out/loop
# make test    style, types and tests
# make types   style and types alone
# make docs    the documentation, tutorials executed, in out/site
# make wheel   the wheel, installed with its dependencies into an empty environment, in out/wheel
# make bench   the benchmarks' ratios
# make blind   how often the verdict on an undeclared effect is right
# make mutants how many changes of the numerics the tests see, quick and slow

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
# Compiled modules are kept, whatever the shell around says: else each of the hundred commands that the tests call would
# compile numpy, Drake and armloop anew, which takes it several seconds.
export PYTHONDONTWRITEBYTECODE =
# Stamps, not the folder: each is touched only after its step has ended well.
PACKAGES := $(VENV)/.packages
INSTALLED := $(VENV)/.installed
TESTING := $(VENV)/.testing
WRITING := $(VENV)/.writing
# The wheel and the environment that it is installed in; a folder outside the checkout will do as well.
WHEEL ?= out/wheel
# A process that crashes ends the run: xdist deals its files again, and may then wait for ever (pytest-xdist#1378).
PYTEST_ARGS ?= -n 2 --dist loadfile --no-loadscope-reorder --max-worker-restart 0

.PHONY: setup loop test types long docs wheel bench blind mutants clean

setup: $(INSTALLED)

# The set-up counts towards what `make loop` takes, so it is kept short. `$(call install,WHAT)`: uv installs in a sixth of
# pip's time; where it cannot be had, or the packages are somewhere only pip is told of, it is pip. Nothing is resolved,
# for the locks are complete, and instead of compiling every module of every package (half a minute), the imports below
# compile those that are used (4 s).
export UV_SYSTEM_CERTS ?= 1
export UV_HTTP_RETRIES ?= 1
install = { $(BIN)/uv pip install -q --no-deps --no-build-isolation --python $(BIN)/python $(1) \
  || $(BIN)/pip install -qq --no-deps --no-build-isolation --no-compile $(1); }

$(PACKAGES): requirements.lock
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' \
	  || { echo "armloop needs Python 3.11 or later: make PYTHON=/path/to/python3" >&2; exit 1; }
	@echo "Setting up $(VENV) from requirements.lock; this takes about half a minute"
	@$(PYTHON) -m venv --clear $(VENV)
	@$(BIN)/pip install -qq --no-deps --no-compile $$(grep '^uv==' requirements.lock) || true
	@$(call install,-r requirements.lock)
	@$(BIN)/python -c 'import sklearn.cluster, sklearn.linear_model, pysindy' & first=$$!; \
	$(BIN)/python -c 'import matplotlib.pyplot, control, osqp, jinja2, pyarrow.csv, pyarrow.parquet' \
	  && $(BIN)/python -c 'import pydrake.multibody.plant, pydrake.multibody.parsing, pydrake.geometry' \
	  && wait $$first
	@touch $@

$(INSTALLED): $(PACKAGES) pyproject.toml
	@$(call install,-e .)
	@touch $@

$(TESTING): requirements-test.lock $(INSTALLED)
	@$(call install,-r requirements-test.lock)
	@touch $@

loop: setup
	$(BIN)/armloop loop --out out/loop

# With the packages of the documentation, whose site a long test builds. A test that hangs ends the run, and says where.
test: types $(WRITING)
	$(BIN)/pytest $(PYTEST_ARGS) -o faulthandler_timeout=1500 -o faulthandler_exit_on_timeout=true -m "not long"

types: setup $(TESTING)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

# What takes minutes a test: ten random arms of another engine, workers killed in the middle.
long: setup $(TESTING)
	$(BIN)/pytest $(PYTEST_ARGS) -m long

$(WRITING): requirements-docs.lock $(TESTING)
	@$(call install,-r requirements-docs.lock)
	@touch $@

# Strict: a link that leads nowhere, an object without a docstring, or a tutorial's error ends it. Nothing is fetched.
docs: setup $(WRITING)
	PATH="$(abspath $(BIN)):$$PATH" $(BIN)/python docs/build.py
	@echo "open out/site/index.html"

# Built, installed as a user would, and asked for from outside the checkout. The versions are the lock's.
wheel: setup
	@rm -rf $(WHEEL) && mkdir -p $(WHEEL)
	$(BIN)/python -m build --wheel --no-isolation --outdir $(WHEEL) . >/dev/null
	$(PYTHON) -m venv $(WHEEL)/environment
	$(BIN)/uv pip install -q --python $(WHEEL)/environment/bin/python -c requirements.lock $(WHEEL)/armloop-*.whl \
	  || $(WHEEL)/environment/bin/pip install -qq --no-compile -c requirements.lock $(WHEEL)/armloop-*.whl
	$(WHEEL)/environment/bin/pip check
	cd / && $(abspath $(WHEEL))/environment/bin/armloop --version

bench: setup $(TESTING)
	@set -e; for file in benchmarks/*.py; do echo "== $$file"; $(BIN)/python $$file; done

# How many of the changes of one place in the numerics the quick tests see (an hour; it goes on where it was ended).
mutants: setup $(TESTING)
	$(BIN)/python tests/mutants/run.py --mutants 200

# Whole loops with an effect hidden from a seed, and clean ones: how often the verdict is right (about ten minutes).
blind: setup $(TESTING)
	$(BIN)/python tests/blind/loops.py --seeds 20 --clean 5 --keep out/blind/loops
	$(BIN)/python tests/blind/run.py --arms 20 --cases 16 --keep out/blind/arms
	$(BIN)/python tests/blind/run.py --outside --arms 12 --cases 8 --keep out/blind/outside

clean:
	rm -rf $(VENV) out dist
