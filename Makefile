# Everything a newcomer needs: `make demo` and `make test` create .venv and install what they use.
# They need python3 (3.11 or newer) and a package registry that pip can reach; nothing else.

PYTHON ?= python3
ARGS   ?=
BIN    := .venv/bin
BASE   := .venv/.installed
LIVE   := .venv/.installed-studio
DEV    := .venv/.installed-dev
DOCS   := .venv/.installed-docs

# One thread a process: the matrices are small, and the tests run one process a core.
export OMP_NUM_THREADS := 1
# The tests start some forty programs: they find compiled what the first one has imported.
unexport PYTHONDONTWRITEBYTECODE
PYTEST := $(BIN)/pytest -n 2 --dist worksteal

.DEFAULT_GOAL := help
.PHONY: help demo studio test test-slow test-all test-studio lint format types contract docs bench images screenshots clean

help:  ## show this list
	@awk -F ':.*## ' '/^[a-z-]+:.*## / {printf "  make %-11s  %s\n", $$1, $$2}' $(MAKEFILE_LIST)

demo: $(BASE)  ## picture -> target -> motion, then a page that plays it (ARGS=--no-serve: no page)
	$(BIN)/arm3dof demo --out out $(ARGS)

studio: $(LIVE)  ## a live page: see, aim, grasp, tune (ARGS=--no-browser: only serve it)
	$(BIN)/arm3dof studio $(ARGS)

test: $(DEV)  ## the tests, but for the slow ones; minutes
	$(PYTEST) -m "not slow" $(ARGS)

test-slow: $(DEV)  ## the rest: browsers, physics, large samples, whole commands
	@$(BIN)/python tools/ensure_chromium.py
	@$(BIN)/python tools/ensure_renderers.py
	$(PYTEST) -m "slow and not studio" $(ARGS)

test-all: $(DEV)  ## both at once, which takes less time than one after the other
	@$(BIN)/python tools/ensure_chromium.py
	@$(BIN)/python tools/ensure_renderers.py
	$(PYTEST) -m "not studio" $(ARGS)

test-studio: $(DEV)  ## a person's path through the studio in a browser; wants idle cores
	@$(BIN)/python tools/ensure_chromium.py
	$(BIN)/pytest -m studio $(ARGS)

lint: $(DEV)  ## ruff: style, docstrings, likely bugs, formatting
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

format: $(DEV)  ## let ruff rewrite what it can
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

types: $(DEV)  ## mypy, strict
	$(BIN)/mypy

contract: $(DEV)  ## imports only run down the layers
	$(BIN)/lint-imports

docs: $(DOCS)  ## the manual, in docs/_build/html; a warning is an error
	$(BIN)/sphinx-build -W --keep-going -q -b html docs docs/_build/html
	@echo "open docs/_build/html/index.html"

bench: $(DEV)  ## measure, in turns with the peers, and print and keep the tables (ARGS=--quick: ours alone)
	@$(if $(findstring --quick,$(ARGS)),,$(PYTHON) benchmarks/peers/install.py)
	$(BIN)/python -m benchmarks $(ARGS)

images: $(DEV)  ## draw the pictures that the README and the docs show
	$(BIN)/python tools/make_control_figures.py
	$(BIN)/python tools/make_physics_figure.py
	$(BIN)/python tools/make_seeing_figures.py
	$(BIN)/python tools/make_task_figures.py
	$(BIN)/python tools/make_images.py

screenshots: $(DEV)  ## photograph the pages that the manual shows
	@$(BIN)/python tools/ensure_chromium.py
	$(BIN)/python tools/make_screenshots.py

clean:  ## remove the environments and everything that was built
	rm -rf .venv .venv-peers build dist out docs/_build .pytest_cache .mypy_cache .ruff_cache .import_linter_cache .hypothesis
	find . -name __pycache__ -type d -prune -exec rm -rf {} +

$(BASE): pyproject.toml constraints.txt tools/bootstrap.py
	@$(PYTHON) tools/bootstrap.py physics
	@touch $@

$(LIVE): pyproject.toml constraints.txt tools/bootstrap.py
	@$(PYTHON) tools/bootstrap.py physics studio share
	@touch $@ $(BASE)

$(DEV): pyproject.toml constraints.txt tools/bootstrap.py
	@$(PYTHON) tools/bootstrap.py dev robots physics studio share
	@touch $@ $(LIVE) $(BASE)

$(DOCS): pyproject.toml constraints.txt tools/bootstrap.py
	@$(PYTHON) tools/bootstrap.py dev robots physics studio share docs
	@touch $@ $(DEV) $(LIVE) $(BASE)
