# Every target works alone on a fresh clone: it makes .venv when it is missing or stale.
PYTHON ?= python3.11
# Wheel index with CPU builds of torch, for machines where the default one would bring CUDA.
TORCH_INDEX ?=
# Further options of the demo's run, such as ARGS="--namespace left".
ARGS ?=
# What a run needs, and what tests and training need beside it.
EXTRAS := ros
FURTHER := $(EXTRAS),dashboard,tables,train,cluster,opcua,arm,docs,dev
# The environment's folder: one for each Python that is to stay beside others.
VENV ?= .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.installed
SHORT := $(VENV)/.installed-short
WHOLE := $(VENV)/.installed-whole
# The leg's environment has the versions of Ubuntu 24.04, where stock Jazzy runs.
NOBLE := $(findstring .venv-3.12,$(VENV))
PINS := $(if $(NOBLE),build/noble.txt,constraints.txt)
# pip with the versions that were tested.
PIP = $(BIN)/python -m pip install --quiet --constraint $(PINS) \
    $(if $(TORCH_INDEX),--extra-index-url $(TORCH_INDEX))
# Options that count lines, for `make coverage`.
COUNT :=

ifeq ($(shell command -v $(PYTHON) 2>/dev/null),)
PYTHON := python3
endif

# A test run starts hundreds of processes: none of them compiles the sources anew, whatever the shell sets.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: demo docs kernels check test leg campaign coverage bench bench-peers lint dist sbom audit clean install
install: $(WHOLE)

build/noble.txt: release/noble.txt constraints.txt
	mkdir -p build
	awk -F'==' 'NR == FNR { older[$$1]; print; next } !($$1 in older)' $^ > $@

$(STAMP): pyproject.toml $(PINS)
	$(PYTHON) -c 'import sys; sys.exit(not (3, 11) <= sys.version_info[:2] <= (3, 13) and "Python 3.11, 3.12 or 3.13 is needed, got " + sys.version.split()[0] + "; set PYTHON=")'
	$(PYTHON) -m venv --clear $(VENV)
	$(PIP) --no-compile --editable '.[$(EXTRAS)]'
	touch $@

$(WHOLE): $(STAMP)
	$(PIP) --editable '.[$(FURTHER)]'
	touch $@

$(SHORT): $(STAMP)
	$(PIP) --editable '.[$(EXTRAS),arm,dev]'
	$(if $(NOBLE),$(PIP) opencv-contrib-python-headless)
	touch $@

demo: $(STAMP)
	run=runs/demo-$$(date +%Y%m%d-%H%M%S)-$$$$; \
	    $(BIN)/winding run --case 4 --weights rod_without_4 --output $$run --bag $$run/bag $(ARGS)

# Kernels are compiled once and by one process: code that two make at once may round differently, and
# a test that compiles on a slow computer may pass its time limit.
kernels: $(VENV)/.kernels

$(VENV)/.kernels: $(STAMP) $(shell find ros2_ws/src -name '*.py')
	$(BIN)/winding predict --case 4 --duration-s 1 > /dev/null
	film=$$(mktemp -d) && $(BIN)/winding render $$film/film --duration-s 0.1 > /dev/null \
	    && $(BIN)/winding track $$film/film --case 4 --fps 50 --camera $$film/film/camera.yaml \
	    --motion $$film/film/motion.csv --output $$film/markers.csv > /dev/null && rm -r $$film
	touch $@

# What to run before every commit: lint, and the tests that are quick and start no graph.
check: lint kernels
	$(BIN)/python -m pytest -q -n 2 --dist loadfile --ignore tests/lint -m "not processes and not slow and not campaign"

# A graph of processes fills both cores of a small machine by itself: such tests run one by one.
# Both halves always run, whatever the first one found.
test: $(WHOLE) kernels
	failed=0; \
	    $(BIN)/python -m pytest -n 2 --dist loadfile --ignore tests/lint -m "not processes and not campaign" $(COUNT) || failed=1; \
	    $(BIN)/python -m pytest -m "processes and not campaign" $(COUNT) || failed=1; \
	    exit $$failed

# The graph's processes, calibration and conformance on a further Python, in an environment of
# their own; on 3.12 with the NumPy and OpenCV of Ubuntu 24.04:
# make leg PYTHON=python3.12 VENV=.venv-3.12
leg: $(SHORT) kernels
	run=$$(mktemp -d) && $(BIN)/winding run --case 4 --duration-s 5 --output $$run/run && rm -r $$run
	$(BIN)/python -m pytest tests/graph tests/marker_tracker_node/test_camera.py \
	    tests/winding_cli/conformance -m "not campaign"

# What takes minutes: faults, kills, browsers, networks, tutorials, whole films.
# Both halves, too; what only needs a processor has no deadline. Tests of processes stay with their
# file, whose last ones end the session that the others used.
campaign: $(WHOLE) kernels
	failed=0; \
	    $(BIN)/python -m pytest -n 2 --dist worksteal -m "campaign and not processes" -o timeout=0 $(COUNT) || failed=1; \
	    $(BIN)/python -m pytest -n 2 --dist loadfile -m "campaign and processes" $(COUNT) || failed=1; \
	    exit $$failed

# Every test once more with its lines counted, which costs a quarter more time; fails below
# fail_under in pyproject.toml.
coverage: $(WHOLE)
	$(BIN)/coverage erase
	$(MAKE) test campaign COUNT='--cov --cov-append --cov-report= --cov-fail-under=0'
	$(BIN)/coverage report

bench: $(WHOLE)
	$(BIN)/python -m pytest benchmarks -m "not campaign" -q -s

# Foreign solvers stay out of .venv until they are asked for.
bench-peers: $(WHOLE)
	$(PIP) --editable '.[peers]'
	$(BIN)/python benchmarks/peers/compare.py

# The pages as a site in build/site, whole without a network; a warning fails.
docs: $(WHOLE)
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict --config-file site/mkdocs.yml

lint: $(WHOLE)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports --no-cache
	$(BIN)/python -m pytest -q tests/lint
	$(BIN)/python ros2_ws/package_files.py --check
	$(BIN)/codespell README.md CONTRIBUTING.md SECURITY.md CHANGELOG.md docs docker examples release ros2_ws tests benchmarks
	$(BIN)/hadolint docker/Dockerfile

# Source archive and wheel of the last commit in dist/, the same bytes on every machine.
dist: $(WHOLE)
	rm -rf dist
	release/build.sh $(BIN)/python dist

# What a run's environment holds, as CycloneDX: the wheel with its extra `ros`, and nothing else.
sbom: dist
	release/sbom.sh $(BIN)/python dist

# Known vulnerabilities of the pinned versions, asked of the package index; --strict fails on a
# version that the index does not know. Names inside a pinned ros- wheel are known to no index.
audit:
	$(PYTHON) -m venv --clear build/audit
	build/audit/bin/python -m pip install --quiet pip-audit==2.10.1
	awk -F'==' '{ n = tolower($$1); gsub(/[-_.]+/, "-", n) } NR == FNR { pinned[n]; next } !(("ros-" n) in pinned)' \
	    constraints.txt constraints.txt > build/audit/constraints.txt
	build/audit/bin/pip-audit --strict --requirement build/audit/constraints.txt --no-deps --disable-pip

clean:
	rm -rf .venv .venv-3.* runs build dist *.egg-info .pytest_cache .ruff_cache .mypy_cache .coverage bench.json
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
