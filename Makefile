# aerialdojo-gen. `make help` lists the targets.

SHELL := /bin/bash
PYTHON ?= $(shell command -v python3.11 || command -v python3)
DATA ?= data
SMOKE_DATA := $(if $(filter-out file,$(origin DATA)),$(DATA),data-smoke)
WORKERS ?=
RUN := .venv/bin/aerialdojo-gen
RUN_FLAGS := $(if $(WORKERS),--workers $(WORKERS))

.DEFAULT_GOAL := help
.PHONY: help env dev torch docs dataset smoke evaluate test test-fast fuzz torture lint format gallery bench lock clean

help:  ## list the targets
	@awk -F ':.*## ' '/^[a-z-]+:.*## / {printf "  make %-9s %s\n", $$1, $$2}' $(MAKEFILE_LIST)
	@echo "  DATA=DIR chooses the data directory, WORKERS=N the number of processes, PYTHON=… the interpreter."

env: .venv/.installed  ## make the environment in .venv/
dev: .venv/.dev  ## the same with what tests and linters need

# uv installs in seconds what takes pip two minutes. Where it cannot (a mirror that only pip is told of), pip does.
PIP := .venv/bin/python -m pip install --quiet --disable-pip-version-check -c constraints.txt
UV := $(PIP) uv 2>/dev/null && .venv/bin/uv pip install --quiet --python .venv/bin/python -c constraints.txt

.venv/.installed: pyproject.toml constraints.txt
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { \
	  echo "error: $(PYTHON) is older than Python 3.11: install 3.11, 3.12 or 3.13, or make PYTHON=/path/to/python3" >&2; exit 1; }
	@test -x .venv/bin/python || $(PYTHON) -m venv .venv
	@echo "installing the packages of constraints.txt into .venv/ (seconds by uv, minutes by pip)"
	@{ $(UV) -e '.[gl,web]' 2>/dev/null; } || $(PIP) -e '.[gl,web]' || { \
	  echo "error: a package could not be installed, see above. For every one there are wheels for Python 3.11, 3.12 and 3.13:" \
	       "with one of them, rm -rf .venv and make PYTHON=/path/to/python3" >&2; exit 1; }
	@echo "compiling the kernels (half a minute, once)"
	@find aerialdojo_gen -name '*.nb[ic]' -delete  # Numba's of an earlier checkout may name modules that have moved
	@dir=$$(mktemp -d) && trap 'rm -rf "$$dir"' EXIT && \
	  $(RUN) plan --pipeline pipelines/smoke.toml --scene U_Courtyard_0 --data "$$dir" --workers 1 --quiet
	@touch $@

.venv/.dev: .venv/.installed
	@{ $(UV) -e '.[dev]' 2>/dev/null; } || $(PIP) -e '.[dev]'
	@touch $@

torch: .venv/.train  ## the same with what policies are trained with: PyTorch for the CPU

# A CPU wheel of a folder that pip or uv is told of; else of PyTorch's own index; PyPI's brings several GB of CUDA.
TORCH_WHEEL = $(lastword $(sort $(wildcard $(addsuffix /torch-*cpu*-cp311-*.whl,$(UV_FIND_LINKS) $(PIP_FIND_LINKS)))))
TRAIN := safetensors tensorboard
.venv/.train: .venv/.dev
	@echo "installing PyTorch for the CPU into .venv/"
	@$(PIP) $(TRAIN)
	@{ test -n "$(TORCH_WHEEL)" && $(PIP) "$(TORCH_WHEEL)"; } \
	  || $(PIP) --index-url https://download.pytorch.org/whl/cpu torch 2>/dev/null || $(PIP) torch
	@touch $@

dataset: .venv/.installed  ## generate the dataset: scene_assets/ and annotations/ to $(DATA)/release/
	@$(RUN) run pipelines/aerialdojo-200k.toml --stats --data $(DATA) $(RUN_FLAGS)

smoke: .venv/.installed  ## two small scenes through all stages, a rendered video included (DATA=data-smoke)
	@$(RUN) run pipelines/smoke.toml --data $(SMOKE_DATA) $(RUN_FLAGS)

SAMPLE_AGENTS := oracle stop constant random explorer
SAMPLE := --split id_test --split ood_test --setting base --setting standard --limit 64 $(foreach scene,U_Mall_0 U_Park_1 \
  N_Forest_0 N_Island_1 I_Harbor_0 I_Bridge_1 D_Flood_0 D_Earthquake_1,--scene $(scene))
evaluate: .venv/.installed  ## fly oracle, stop, constant, random, explorer on 64 tasks; print the paper's tables, ID and OOD
	@for agent in $(SAMPLE_AGENTS); do \
	  $(RUN) evaluate --agent $$agent --run tables-$$agent $(SAMPLE) --data $(DATA) $(RUN_FLAGS) || exit 1; done
	@$(RUN) report $(SAMPLE_AGENTS:%=tables-%) --table results --table partition --data $(DATA) --out $(DATA)/report

PYTEST_FLAGS ?= -n 2 --dist loadfile
test: .venv/.dev  ## run the tests (PYTEST_FLAGS='-k planner' for some of them)
	@.venv/bin/python -m pytest $(PYTEST_FLAGS)

test-fast: .venv/.dev  ## unit and property tests alone: no whole pipeline, browser, kill, scene, cluster or object store
	@.venv/bin/python -m pytest $(PYTEST_FLAGS) -m fast

fuzz: .venv/.dev  ## mutants of every input into every parser, N=500 each (nightly: make fuzz N=10000 SEED=$$RANDOM)
	@PYTHONPATH=tests .venv/bin/python -m fuzzing -n $(or $(N),500) $(if $(SEED),--seed $(SEED)) $(foreach t,$(TARGET),--target $(t))
torture: .venv/.dev  ## kill run, render, export, import and evaluate N=100 times and compare what repeating them leaves
	@.venv/bin/python tests/torture.py -n $(or $(N),100)

lint: .venv/.dev  ## ruff, the import contracts, mypy --strict, and vulture for what nothing uses
	@.venv/bin/ruff check .
	@.venv/bin/ruff format --check .
	@.venv/bin/lint-imports --no-cache --no-logo
	@.venv/bin/mypy
	@! .venv/bin/vulture | grep '^aerialdojo_gen/'

format: .venv/.dev  ## let ruff format the code
	@.venv/bin/ruff check --fix-only --quiet .
	@.venv/bin/ruff format .

gallery: .venv/.installed  ## picture every prop and every scene into docs/gallery/
	@$(RUN) gallery --out docs/gallery

.venv/.docs: .venv/.installed
	@{ $(UV) -e '.[docs]' 2>/dev/null; } || $(PIP) -e '.[docs]'
	@touch $@

docs: .venv/.docs  ## build the documentation's site into build/site/; a broken link or a page left out ends it
	@NO_MKDOCS_2_WARNING=1 .venv/bin/mkdocs build --strict --quiet

bench: .venv/.dev  ## measure planner, renderer and OMPL's planners beside ours
	@for bench in tests/bench/bench_*.py; do echo "== $$bench"; .venv/bin/python $$bench || exit 1; done

lock: .venv/.dev  ## write constraints.txt anew from the ranges in pyproject.toml
	@.venv/bin/uv pip compile pyproject.toml --all-extras --python-version 3.11 --upgrade --no-header \
	  --no-annotate --no-emit-index-url --no-emit-find-links --quiet -o constraints.txt

clean:  ## remove caches (not data, not .venv)
	@rm -rf .mypy_cache .ruff_cache .pytest_cache .hypothesis
	@find aerialdojo_gen tests -name __pycache__ -type d -prune -exec rm -rf {} +
