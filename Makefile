SHELL := bash
PYTHON ?= python3
VENV ?= .venv
BIN = $(VENV)/bin
STAMP = $(VENV)/.installed
CLIENTS ?= .venv-clients
CLIENTS_STAMP = $(CLIENTS)/.installed
CLIENTS_OF_ENVS = test_launch.py test_descent.py test_vector.py test_sb3.py # Gymnasium and stable-baselines3
DOCS_STAMP = $(VENV)/.installed-docs

SCENARIOS = sled_rollers sled_kickers sled_terraces sled_long boulder_benches sled_snow sled_mat

TEMPLATES = src/sledenv/pages/templates
STYLED = '$(TEMPLATES)/*.js' '$(TEMPLATES)/*.css' 'docs/css/*.css'

.DEFAULT_GOAL := help
.PHONY: help install demo agents references clients docs reproduce wasm wheel test test-slow test-nojit trial versions lint format clean

help: ## list the targets
	@awk -F ':.*## ' '/^[a-z-]+:.*## / {printf "  %-18s %s\n", $$1, $$2}' $(MAKEFILE_LIST)

install: $(STAMP) ## create the virtual environment (PYTHON, VENV choose the interpreter and the folder)

$(STAMP): pyproject.toml constraints.txt
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { \
		echo "sledenv needs Python 3.11 or newer, but PYTHON=$(PYTHON) is" \
			"$$($(PYTHON) --version 2>&1 || true); try: make PYTHON=python3.11" >&2; exit 1; }
	@echo "Creating $(VENV) with $$($(PYTHON) --version)"
	@$(PYTHON) -m venv $(VENV)
	@echo "Installing sledenv and its development tools; PyTorch is large, and the kernel is compiled: some minutes"
	@set -o pipefail; $(BIN)/python -m pip install --disable-pip-version-check --progress-bar off \
		-c constraints.txt -e '.[dev]' | awk '/^Collecting/ {print "  " $$2; fflush()} \
		/^Installing collected/ {print "  unpacking"; fflush()} \
		/Building editable.*started/ {print "  compiling the kernel, about a minute"; fflush()}'
	@touch $@
	@echo "Ready: $(BIN)/python"

# The linker is wasm-ld of LLVM, which comes with ziglang.
wasm: $(STAMP) ## compile the kernel for pages, src/sledenv/pages/kernel.wasm: to be committed with its sources
	$(BIN)/python -m pip install --disable-pip-version-check -q -c constraints.txt ziglang
	$(BIN)/python -m sledenv.pages.kernel

wheel: $(STAMP) ## build the wheel with the kernel for all platforms, dist/
	SLEDENV_TARGETS="linux-x86_64 linux-aarch64 darwin-arm64 win32-x86_64" $(BIN)/python -m pip wheel \
		--disable-pip-version-check -q -c constraints.txt --no-deps --wheel-dir dist .

demo: $(STAMP) ## train and judge a small agent, results in runs/demo
	$(BIN)/python -m sledenv.agents.demo

reproduce: $(STAMP) ## compute the paper's numbers and draw its figures, results in reproduction
	$(BIN)/sledenv reproduce

$(DOCS_STAMP): $(STAMP)
	$(BIN)/python -m pip install --disable-pip-version-check -q -c constraints.txt -e '.[dev,docs]'
	@touch $@

docs: $(DOCS_STAMP) ## build the documentation site, site/index.html
	$(BIN)/python -m sphinx -W --keep-going -q -b html -d .cache/docs -c docs . site
	@echo "Open site/index.html"

agents: $(STAMP) ## train the agents of agents/trained anew: some 70 minutes of CPU, most of them for rides
	for name in $(SCENARIOS); do $(BIN)/python -m sledenv.agents.train --algo critic --scenario $$name \
		--runs agents/trained --overwrite || exit; done

references: $(STAMP) ## freeze what can be expected in held-out contexts, where it is not known: hours of CPU
	for name in $(SCENARIOS); do $(BIN)/python -m sledenv.agents.freeze $$name || exit; done

# Two processes share two cores: more threads in each, of torch and BLAS, would wait for one another.
test: $(STAMP) ## run the fast tests
	OMP_NUM_THREADS=1 $(BIN)/python -m pytest -n 2 -q -m "not slow"

test-slow: $(STAMP) ## run the slow tests
	$(BIN)/python -m pytest -q -m slow

test-nojit: $(STAMP) ## run kernel and compiler as plain Python and measure their coverage
	NUMBA_DISABLE_JIT=1 $(BIN)/python -m pytest -q tests/kernel tests/compiler tests/reproduce/test_euler.py \
		-m "not jit_only and not slow" --cov=src/sledenv/kernel --cov=src/sledenv/compiler \
		--cov-report=term-missing

# RLlib fixes the version of gymnasium, Tianshou asks for older pandas and (by virtualenv) filelock: these clients have an
# environment of their own in which the three are not pinned.
$(CLIENTS_STAMP): pyproject.toml constraints.txt
	@echo "Creating $(CLIENTS): Ray, TorchRL, rl-baselines3-zoo, Minari and JAX are large, so this takes some minutes"
	@$(PYTHON) -m venv $(CLIENTS)
	@$(CLIENTS)/bin/python -m pip install --disable-pip-version-check -q \
		-c <(grep -v '^\(filelock\|gymnasium\|pandas\)==' constraints.txt) -e '.[dev,minari,ray,tianshou,torchrl,zoo]'
	@touch $@

# Those of Gymnasium and stable-baselines3 run by themselves: rl_zoo3 replaces Gymnasium's TimeLimit when it is imported.
clients: $(CLIENTS_STAMP) ## install the clients of docs/clients.md in .venv-clients and run their tests
	OMP_NUM_THREADS=1 $(CLIENTS)/bin/python -m pytest -q tests/clients
	OMP_NUM_THREADS=1 $(CLIENTS)/bin/python -m pytest -q $(addprefix tests/envs/,$(CLIENTS_OF_ENVS))
	@$(CLIENTS)/bin/python -m pip freeze | grep -iE '^(gymnasium|minari|optuna|ray|rl_zoo3|stable_baselines3|tianshou|torchrl)=='

trial: ## install the wheel in an empty environment and try every command in an empty folder (EXTRAS="none benchmark agents")
	PYTHON=$(PYTHON) .ci/trial $(EXTRAS)

versions: ## run the fast tests with the lowest and the newest versions of all dependencies (VERSIONS="lowest tests/envs")
	PYTHON=$(PYTHON) .ci/versions $(VERSIONS)

lint: $(STAMP) ## check style, types, the direction of imports, words, and the templates of pages
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/mypy
	PYTHONPATH=src $(BIN)/lint-imports --no-cache
	$(BIN)/python .ci/words
	$(BIN)/djlint --quiet --lint --check $(TEMPLATES)
	$(BIN)/oxlint --deny-warnings $(TEMPLATES)
	$(BIN)/oxfmt --check $(STYLED)

format: $(STAMP) ## write Python and templates in the one style
	$(BIN)/ruff format
	$(BIN)/djlint --quiet --reformat $(TEMPLATES)
	$(BIN)/oxfmt $(STYLED)

clean: ## remove every build product and cache, but not runs/
	find src agents configs tests perf -name __pycache__ -prune -exec rm -rf {} +
	rm -rf src/sledenv/objects $(VENV) $(CLIENTS) build dist site jupyter_execute .cache src/*.egg-info htmlcov .coverage* .hypothesis .import_linter_cache .mypy_cache \
		.pytest_cache .ruff_cache
