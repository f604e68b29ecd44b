# aerialdojo-gen. `make help` lists the targets.

SHELL := /bin/bash
PYTHON ?= $(shell command -v python3.11 || command -v python3)
DATA ?= data
SMOKE_DATA := $(if $(filter-out file,$(origin DATA)),$(DATA),data-smoke)
WORKERS ?=
RUN := .venv/bin/aerialdojo-gen
RUN_FLAGS := $(if $(WORKERS),--workers $(WORKERS))

.DEFAULT_GOAL := help
.PHONY: help env dev torch docs dataset smoke worlds evaluate policy test test-fast fuzz torture nightly facts lint format gallery bench lock clean

help:  ## list the targets
	@awk -F ':.*## ' '/^[a-z-]+:.*## / {printf "  make %-9s %s\n", $$1, $$2}' $(MAKEFILE_LIST)
	@echo "  DATA=DIR chooses the data directory, WORKERS=N the number of processes, PYTHON=… the interpreter."

env: .venv/.installed  ## make the environment in .venv/
dev: .venv/.dev  ## the same with what tests and linters need

# uv installs in seconds what takes pip minutes; both refuse a file whose hash is not in constraints.txt. Where uv cannot
# (a mirror that only pip is told of), pip installs all of constraints.txt: it takes hashes for no less. Where
# PYTHONDONTWRITEBYTECODE is set, as in many containers, each process would compile 2 s of modules that are not compiled here.
PIP := .venv/bin/python -m pip install --disable-pip-version-check
# $(call install,EXTRA,EXTRA)
install = { $(PIP) --quiet --require-hashes -r <(sed -n '/^uv==/,/[^\\]$$/p' constraints.txt) \
    && .venv/bin/uv pip install --compile-bytecode --python .venv/bin/python -c constraints.txt -b constraints.txt -e '.[$(1),$(2)]'; } \
  || { echo "uv could not install them: trying pip" >&2; $(PIP) --require-hashes -r constraints.txt \
    && $(PIP) --no-deps --no-build-isolation -e .; }

# .venv.unfinished lies there until the first installation is through: what was killed before is made anew.
.venv/.installed: pyproject.toml constraints.txt
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { \
	  echo "error: $(PYTHON) is older than Python 3.11: install 3.11, 3.12 or 3.13, or make PYTHON=/path/to/python3" >&2; exit 1; }
	@if [ ! -x .venv/bin/python ] || [ -e .venv.unfinished ]; then \
	  echo "making the environment .venv/ with $(PYTHON)"; touch .venv.unfinished && $(PYTHON) -m venv --clear .venv; fi
	@echo "installing the packages of constraints.txt into .venv/"
	@$(call install,gl,web) || { \
	  echo "error: a package could not be installed, see above. For every one there are wheels for Python 3.11, 3.12 and 3.13:" \
	       "with one of them, make PYTHON=/path/to/python3" >&2; exit 1; }
	@rm -f .venv.unfinished
	@.venv/bin/python -m compileall -q aerialdojo_gen
	@echo "compiling the kernels, once (a minute; three on a busy machine)"
	@dir=$$(mktemp -d) && trap 'rm -rf "$$dir"' EXIT && \
	  small="--pipeline pipelines/smoke.toml --scene U_Courtyard_0 --data $$dir --workers 1" && $(RUN) filter $$small && \
	  { $(RUN) reference-images $$small || echo "nothing can draw pictures here yet: see the line above" >&2; }
	@touch $@

.venv/.dev: .venv/.installed
	@echo "installing what tests, linters and the documentation need into .venv/"
	@$(call install,dev,docs)
	@touch $@

torch: .venv/.train  ## the same with what policies are trained with: PyTorch for the CPU

# A CPU wheel of a folder that pip or uv is told of; else of PyTorch's own index, whose wheels constraints.txt does not
# name; PyPI's brings several GB of CUDA.
TORCH_TAG = $(shell .venv/bin/python -c 'import sys; print("cp%d%d" % sys.version_info[:2])')
TORCH_WHEEL = $(lastword $(sort $(wildcard $(addsuffix /torch-*cpu*-$(TORCH_TAG)-*.whl,$(UV_FIND_LINKS) $(PIP_FIND_LINKS)))))
.venv/.train: .venv/.dev
	@echo "installing PyTorch for the CPU into .venv/"
	@{ test -n "$(TORCH_WHEEL)" && $(PIP) --no-deps "$(TORCH_WHEEL)"; } \
	  || $(PIP) --index-url https://download.pytorch.org/whl/cpu torch 2>/dev/null || $(PIP) torch
	@touch $@

dataset: .venv/.installed  ## generate the dataset: scene_assets/ and annotations/ to $(DATA)/release/
	@$(RUN) run pipelines/aerialdojo-200k.toml --stats --data $(DATA) $(RUN_FLAGS)

smoke: .venv/.installed  ## two small scenes through all stages, a rendered video included (DATA=data-smoke)
	@$(RUN) run pipelines/smoke.toml --data $(SMOKE_DATA) $(RUN_FLAGS)

WORLDS ?= my-worlds
worlds: .venv/.installed  ## four worlds from seeds of every type, with tasks, into $(WORLDS)/
	@$(RUN) vary '*' --seeds 1000:1004 --out $(WORLDS) $(RUN_FLAGS)
	@$(RUN) run $(WORLDS)/pipeline.toml --data $(WORLDS)/data $(RUN_FLAGS)

SAMPLE_AGENTS := oracle stop constant random explorer
SAMPLE := --split id_test --split ood_test --setting base --setting standard --limit 64 $(foreach scene,U_Mall_0 U_Park_1 \
  N_Forest_0 N_Island_1 I_Harbor_0 I_Bridge_1 D_Flood_0 D_Earthquake_1,--scene $(scene))
evaluate: .venv/.installed  ## fly oracle, stop, constant, random, explorer on 64 tasks; print overall, the paper's tables, ID and OOD
	@for agent in $(SAMPLE_AGENTS); do \
	  $(RUN) evaluate --agent $$agent --run tables-$$agent $(SAMPLE) --data $(DATA) $(RUN_FLAGS) || exit 1; done
	@$(RUN) report $(SAMPLE_AGENTS:%=tables-%) --table overall --table results --table partition --data $(DATA) --out $(DATA)/report

POLICY := $(DATA)/policies/imitation/policy.safetensors
policy: .venv/.train  ## train the learned baseline (2 h) and fly the row of it in README: 2,000 tasks of ID test, as many of OOD test
	@$(RUN) train imitation --data $(DATA) $(RUN_FLAGS)
	@for split in id_test ood_test; do \
	  $(RUN) evaluate --agent policy --option weights=$(POLICY) --run imitation-$$split --split $$split --setting base \
	    --limit 2000 --data $(DATA) $(RUN_FLAGS) || exit 1; done
	@$(RUN) report imitation-id_test imitation-ood_test --table averages --data $(DATA)

PYTEST_FLAGS ?= -n 2 --dist loadfile
# A test that never ends is ended; with 30 processes on two cores the fixture `smoke` took 10 min.
PYTEST := .venv/bin/python -m pytest --timeout 1800
test: .venv/.dev  ## run the tests (PYTEST_FLAGS='-k planner' for some of them)
	@$(PYTEST) $(PYTEST_FLAGS)

test-fast: .venv/.dev  ## unit and property tests alone: no whole pipeline, browser, kill, scene, cluster or object store
	@$(PYTEST) $(PYTEST_FLAGS) -m fast

fuzz: .venv/.dev  ## mutants of every input into every parser, N=500 each
	@PYTHONPATH=tests .venv/bin/python -m fuzzing -n $(or $(N),500) $(if $(SEED),--seed $(SEED)) $(foreach t,$(TARGET),--target $(t))
torture: .venv/.dev  ## kill run, render, export, import and evaluate N=100 times and compare what repeating them leaves
	@.venv/bin/python tests/torture.py -n $(or $(N),100) $(if $(SEED),--seed $(SEED))
nightly: .venv/.dev  ## some hours: the nightly tests, fuzz with N=10000, torture with N=100, ten scenes under load, the golden file
	@$(PYTEST) $(PYTEST_FLAGS) -m nightly
	@$(MAKE) --no-print-directory fuzz N=10000 SEED=$(NIGHT)
	@$(MAKE) --no-print-directory torture N=100 SEED=$(NIGHT)
	@.venv/bin/python tests/under_load.py
	@$(RUN) run pipelines/aerialdojo-200k.toml --data $(DATA) $(RUN_FLAGS)
	@.venv/bin/python tests/golden/digests.py $(DATA) | diff tests/golden/release.sha256 -
NIGHT = $(or $(SEED),$(shell date +%Y%m%d))

lint: .venv/.dev  ## ruff, the import contracts, mypy --strict, vulture for what nothing uses, the plans by their schema
	@.venv/bin/ruff check .
	@.venv/bin/ruff format --check .
	@.venv/bin/lint-imports --no-cache --no-logo
	@.venv/bin/mypy
	@! .venv/bin/vulture | grep '^aerialdojo_gen/'
	@.venv/bin/python -m pytest -q -n 0 -k schema tests/scenes/test_plans.py

format: .venv/.dev  ## let ruff format the code
	@.venv/bin/ruff check --fix-only --quiet .
	@.venv/bin/ruff format .

gallery: .venv/.installed  ## picture every prop and every scene into docs/gallery/
	@$(RUN) gallery --out docs/gallery
	@$(RUN) gallery --kit --small --out docs/gallery

docs: .venv/.dev  ## build the documentation's site into build/site/; a broken link or a page left out ends it
	@NO_MKDOCS_2_WARNING=1 .venv/bin/mkdocs build --strict --quiet

facts: .venv/.dev  ## measure the published figures on $(DATA): docs/facts.json, and the figures and tables of the pages
	@.venv/bin/python tests/facts.py $(DATA)

bench: .venv/.dev  ## measure planner, renderer and OMPL's planners beside ours
	@for bench in tests/bench/bench_*.py; do echo "== $$bench"; .venv/bin/python $$bench || exit 1; done

lock: .venv/.dev  ## write constraints.txt anew from the ranges in pyproject.toml, with the hashes of all wheels
	@.venv/bin/uv pip compile pyproject.toml --extra dev --extra docs --universal --python-version 3.11 --generate-hashes \
	  --upgrade --no-header --no-annotate --no-emit-index-url --no-emit-find-links --quiet -o constraints.txt

clean:  ## remove caches (not data, not .venv)
	@rm -rf .mypy_cache .ruff_cache .pytest_cache .hypothesis
	@find aerialdojo_gen tests -name __pycache__ -type d -prune -exec rm -rf {} +
