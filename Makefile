# Every target sets up what it needs in .venv; nothing else is written outside the project.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.installed
RUNS ?= 4
JOBS ?= 2
FUZZ ?= 10000
FORGE ?= 20000
SEGMENTS := 1.1:3,3.1:6,6.1:8,8.1:11,11.1:13,13.1:18
export OMP_NUM_THREADS ?= 1

.PHONY: demo test check browser fuzz forge docs packaging verify bench marks control-table autoferry labyrinth gsncp-table jsc-table crowds-table paper paper-quick clean

$(STAMP): setup.cfg pyproject.toml
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --upgrade pip
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[dev]'
	touch $@

# The main job: simulate, estimate, score and report a small campaign into demo/ with pictures.
demo: $(STAMP)
	rm -rf demo
	$(BIN)/echoset simulate uwb-olos --runs $(RUNS) --seed 1 -o demo/recordings/
	$(BIN)/echoset estimate -e eopda-geo demo/recordings/*.h5 -o demo/geo/ -j $(JOBS)
	$(BIN)/echoset estimate -e eopda-ideal demo/recordings/*.h5 -o demo/ideal/ -j $(JOBS)
	$(BIN)/echoset score demo/geo/*.h5 demo/ideal/*.h5 --truth demo/recordings/ \
	    -m rmse,cdf,pcrlb,pcrlb-star --segments $(SEGMENTS) -o demo/scores.csv
	$(BIN)/echoset report demo/scores.csv -o demo/report.md
	$(BIN)/echoset report demo/scores.csv -o demo/report.html
	$(BIN)/echoset plot rmse demo/scores.csv demo/recordings/uwb-olos-s1-0000.h5 -o demo/rmse.svg
	$(BIN)/echoset plot scene demo/recordings/uwb-olos-s1-0000.h5 \
	    demo/geo/uwb-olos-s1-0000.eopda-geo.h5 -o demo/scene.svg
	head -8 demo/report.md

# The README's table: 100 runs, every estimator. An hour on two cores.
marks: $(STAMP)
	PYTHONPATH=benchmarks $(BIN)/python -m papers.uwb

# The unit tests, a file at a time on each of JOBS processes.
test: $(STAMP)
	$(BIN)/python -m pytest -n $(JOBS) --dist loadfile

# Style, types and unit tests: clean before every commit.
check: $(STAMP)
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/mypy
	$(BIN)/python -m pytest -n $(JOBS) --dist loadfile

# What reports look like in a browser; needs Chromium (Debian: apt-get install chromium).
browser: $(STAMP)
	$(BIN)/python -m pytest -m browser

# Changed inputs of every reader: FUZZ of each, on two cores. A few minutes.
fuzz: $(STAMP)
	$(BIN)/python tests/fuzz/fuzz.py --count $(FUZZ) --jobs $(JOBS)

forge: $(STAMP)
	$(BIN)/python tests/fuzz/forge.py --count $(FORGE)

# The documentation as pages for a browser, in docs/_build/html; a warning is an error.
docs: $(STAMP)
	$(BIN)/python -m sphinx -W --keep-going -q -b html docs docs/_build/html

# Wheel and sdist, installed and run in clean environments; fetches the packages they need.
packaging: $(STAMP)
	$(BIN)/python -m pytest -m packaging

# The slow statistical checks, and 100,000 changed inputs of every reader.
verify: $(STAMP)
	$(BIN)/python -m pytest -m verification

# All benchmarks; each file also runs alone.
bench: $(STAMP)
	for file in benchmarks/bench_*.py; do $(BIN)/python $$file || exit 1; done

# Figures 2-6 of the sensor control paper as tables.
control-table: $(STAMP)
	PYTHONPATH=benchmarks $(BIN)/python -m papers.control

# Filters on measured marine radar, beside an empty output and an oracle.
autoferry: $(STAMP)
	PYTHONPATH=benchmarks $(BIN)/python -m papers.autoferry

# The README's table of a measured UWB recording.
labyrinth: $(STAMP)
	PYTHONPATH=benchmarks $(BIN)/python -m papers.labyrinth

# The DI-GSNCP paper's Fig. 2 as a table and as data: 100 runs, every method, on two cores.
gsncp-table: $(STAMP)
	PYTHONPATH=benchmarks $(BIN)/python -m papers.extended --runs 100 --jobs $(JOBS) -o gsncp

# Figures 3 and 4 of the paper on base stations that sense, with an error budget. An hour.
jsc-table: $(STAMP)
	PYTHONPATH=benchmarks $(BIN)/python -m papers.stations --jobs $(JOBS) -o jsc

# Filters and smoothers of many targets, and what they cost: docs/results/crowds.md. Half an hour.
crowds-table: $(STAMP)
	PYTHONPATH=benchmarks $(BIN)/python -m papers --only crowds -j $(JOBS)

# Tables and figures of the papers, ours beside the published, into docs/results; up to ninety
# minutes on two cores. What was made before, in build/pieces, is not made again.
paper: $(STAMP)
	PYTHONPATH=benchmarks $(BIN)/python -m papers -j $(JOBS)

# The same with a tenth of the runs, into build/results.
paper-quick: $(STAMP)
	PYTHONPATH=benchmarks $(BIN)/python -m papers --quick -o build/results -j $(JOBS)

clean:
	rm -rf demo build dist docs/_build docs/reference *.egg-info .mypy_cache .ruff_cache .pytest_cache
	find . -name __pycache__ -not -path './$(VENV)/*' -prune -exec rm -rf {} +
