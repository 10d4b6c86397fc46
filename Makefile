# Everything a newcomer needs: make demo, make test. The rest is for daily work.

BIN := .venv/bin
JOBS ?= 2

PAGE := bestman_bt/monitor/page
# Tests against real-time clocks lie here (tests/conftest.py sees to it).
REAL_TIME := tests/hal tests/monitor
PYTEST = $(BIN)/python -m pytest -n $(JOBS) --dist loadfile

# Where it is set, each of the many processes that tests start compiles every module that it imports.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: help install demo test test-quick test-all test-alone test-beside test-cluster test-lerobot properties mutants comparisons eval eval-full gallery lint style types contracts format docs lock page page-packages dist release clean

help:
	@echo "make demo      install, then watch the robot fetch a cup"
	@echo "make test      install, then lint, types, import contracts and the quick tests (about 5 minutes)"
	@echo "make test-all  every test (about 30 minutes); REST=1: those that make test leaves out"
	@echo "make test-cluster  bring Ray and submitit, then evaluate on them while nodes, workers and drivers are killed"
	@echo "make test-lerobot  bring LeRobot 0.4.4 and 0.6.1 into environments of their own, and read datasets with them"
	@echo "make properties  random examples of what holds for each algorithm, for about an hour"
	@echo "make mutants   seed known faults one by one and see that the tests find them (hours; resumes)"
	@echo "make eval      20 seeds of every judged task, and the controls (about an hour; goes on where it stopped)"
	@echo "make eval-full the same with 50 seeds"
	@echo "make comparisons  measure the tables of docs/comparisons.md beside other software (hours)"
	@echo "make gallery   pictures and a short film of every task into docs/gallery"
	@echo "make install   .venv/ with .venv/bin/bestman-bt (locked; quick when up to date)"
	@echo "make lint      ruff, mypy and the import contracts alone"
	@echo "make format    let ruff rewrite the code"
	@echo "make docs      build the documentation into site/"
	@echo "make page      build the live page anew (needs node 20 and npm)"
	@echo "make lock      resolve pyproject.toml anew into requirements.lock"
	@echo "make dist      build the wheel and the source archive into dist/"
	@echo "make release VERSION=x.y.z  check, build, smoke-test, commit and tag a release; pushes nothing"
	@echo "make clean     remove what builds and tests leave (not .venv/, not runs/)"

install:
	@sh scripts/install.sh

demo: install
	$(BIN)/bestman-bt demo

# Tests against real-time clocks run after the others; those that take the whole machine run one after the other. The types are
# checked beside tests that have no such clock.
test: style page-packages
	@$(MAKE) --no-print-directory --jobs 3 types contracts test-quick
	$(PYTEST) -m "not slow and real_time and not alone" $(REAL_TIME)
	$(BIN)/python -m pytest -m "not slow and alone" $(REAL_TIME)

test-quick: install
	$(PYTEST) -m "not slow and not real_time"

# REST=1 leaves out what `make test` has run. Tests that need the machine for themselves leave most of it idle: tests without a
# clock run beside them, with the lowest priority, and their output follows when they end.
test-all: install page-packages
	@$(MAKE) --no-print-directory --keep-going --jobs 2 test-alone test-beside
	$(PYTEST) --durations 30 -m "$(if $(REST),slow and )real_time and not alone" $(REAL_TIME)

test-alone: install
	$(BIN)/python -m pytest --durations 30 -m "$(if $(REST),slow and )alone" $(REAL_TIME)

# These tests wait for other processes a quarter of their time, so one more than there are cores is run.
IDLE := $(if $(shell chrt --idle 0 true 2>&1 || echo no),nice -n 19,chrt --idle 0)
test-beside: install
	@mkdir -p build && echo "Tests without a clock: output in build/test-beside.log"
	@$(IDLE) $(PYTEST) -n $(shell expr $(JOBS) + 1) --timeout 900 --durations 30 -m "$(if $(REST),slow and )not real_time" \
		> build/test-beside.log 2>&1; status=$$?; cat build/test-beside.log; exit $$status

test-cluster: install
	$(BIN)/uv pip install --quiet --python $(BIN)/python "ray>=2.50,<3" "submitit>=1.5,<2"
	$(BIN)/python -m pytest tests/evaluation/launchers

# LeRobot's versions of NumPy and OpenCV are below ours, and 0.6 needs Python 3.12; 4 to 8 GB each, most of it PyTorch with CUDA,
# without which PyTorch's wheel for Linux cannot be imported.
LEROBOT := build/lerobot
PYTHON312 ?= 3.12
test-lerobot: install
	$(BIN)/uv venv --quiet --allow-existing --python 3.11 $(LEROBOT)/0.4.4
	$(BIN)/uv pip install --quiet --python $(LEROBOT)/0.4.4/bin/python "lerobot==0.4.4"
	$(BIN)/uv venv --quiet --allow-existing --python $(PYTHON312) $(LEROBOT)/0.6.1
	$(BIN)/uv pip install --quiet --python $(LEROBOT)/0.6.1/bin/python "lerobot[dataset]==0.6.1" "torch<2.11"
	$(BIN)/python -m pytest tests/manipulation/policy/test_lerobot_layout.py

properties: install
	PROPERTY_EXAMPLES=60 $(BIN)/python -m pytest -n $(JOBS) --dist load --timeout 3600 tests/properties

mutants: install
	$(BIN)/python scripts/mutants.py --jobs $(JOBS)

eval: install
	$(BIN)/bestman-bt eval manipulation --jobs $(JOBS)

eval-full: install
	$(BIN)/bestman-bt eval manipulation --jobs $(JOBS) --episodes 50

# DATA: a folder with motion_bench_maker/ and roscon24/ (docs/comparisons.md); the wheel eai-eval is put there.
DATA ?= build/comparisons
comparisons: install
	$(BIN)/uv pip install --quiet --python $(BIN)/python ".[planning,pyrobosim]" pyperplan
	$(BIN)/python -m pip download --quiet --no-deps --dest $(DATA) "eai-eval==1.0.5"
	$(BIN)/python scripts/comparisons.py --data $(DATA)

gallery: install
	$(BIN)/python scripts/gallery --jobs $(JOBS)

lint: style
	@$(MAKE) --no-print-directory --jobs 2 --output-sync types contracts

style: install
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/python scripts/plain_english.py

# NumPy's own types differ between Python 3.11 and later ones; the code is typed for those of 3.11.
types: install
	@if $(BIN)/python -c 'import sys; sys.exit(sys.version_info >= (3, 12))'; then $(BIN)/mypy ; \
		else echo "types are checked with Python 3.11 alone" ; fi

contracts: install
	$(BIN)/lint-imports

format: install
	$(BIN)/ruff check --fix-only .
	$(BIN)/ruff format .

docs: install
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict --quiet
	@echo "site/index.html; with search: $(BIN)/python -m http.server --bind 127.0.0.1 --directory site"

lock: install
	$(BIN)/uv pip compile --upgrade --quiet --universal --python-version 3.11 --generate-hashes \
		--no-emit-index-url --no-emit-find-links --custom-compile-command "make lock" \
		--extra all --group dev pyproject.toml -o requirements.lock

page: page-packages
	npm run build --prefix $(PAGE)

# For the browser tests, which tell what is missing where there is no npm.
page-packages:
	@if command -v npm >/dev/null && ! cmp -s $(PAGE)/package-lock.json $(PAGE)/node_modules/.installed; then \
		npm ci --no-audit --no-fund --prefix $(PAGE) && cp $(PAGE)/package-lock.json $(PAGE)/node_modules/.installed \
		|| echo "npm could not bring the page's packages: no browser tests"; fi

dist: install
	$(BIN)/python -m build --no-isolation

release: install
	$(BIN)/python scripts/release.py $(VERSION)

clean:
	rm -rf build dist site .mypy_cache .pytest_cache .ruff_cache .import_linter_cache .hypothesis
	find . -name __pycache__ -not -path './.venv/*' -prune -exec rm -rf {} +
