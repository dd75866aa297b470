# `make demo` and `make test` set up all they need; the rest is for those who change the code.
.DEFAULT_GOAL := help
.PHONY: help demo test test-slow fuzz test-tools test-slurm tools coverage lint format lock audit docs site bench clean

python := .venv/bin/python
# Tests, and the processes that they start, share the cores already.
pytest := OMP_NUM_THREADS=1 $(python) -m pytest
cores ?= all
inputs ?= 20000

help: ## say what can be made
	@awk -F ':.*## ' '/^[a-z-]+:.*## / {printf "make %-10s %s\n", $$1, $$2}' Makefile

demo: ## run the demo study, print its four tables and name its report
	@./bootstrap requirements.lock
	@.venv/bin/snakemake --cores $(cores) --quiet rules
	@$(python) -m stages.report --study config/demo.yaml --results results/demo --print

test: ## run the fast tests
	@./bootstrap requirements-dev.lock
	@$(pytest) -m "not slow and not tools and not slurm" -n auto --dist loadfile

test-slow: fuzz ## run the rest: damaged input, whole studies through Snakemake, planted wrong signs
	@./bootstrap requirements-dev.lock
	@./bootstrap requirements-site.lock .venv-site
	@$(pytest) -m slow --ignore=tests/studies -n auto --dist loadfile
	@$(pytest) -m slow tests/studies # each has all cores

fuzz: ## feed damaged input to every reader, guided by coverage (inputs=20000)
	@./bootstrap requirements-fuzz.lock .venv-fuzz
	@.venv-fuzz/bin/python -m benchmarks fuzz --inputs $(inputs)

tools: ## put programs by others that read exports into .tools (some 1.4 GB), and a browser
	@./tests/export_tools/install

test-tools: tools ## read exported files with these programs
	@./bootstrap requirements-dev.lock
	@./bootstrap requirements-site.lock .venv-site
	@$(pytest) -m tools

test-slurm: ## run a study on a private Slurm (root, Debian's slurm-wlm and munge)
	@./bootstrap requirements-dev.lock
	@./bootstrap requirements-cluster.lock
	@$(pytest) -m slurm

coverage: ## run the fast tests and print the lines that none of them reaches
	@./bootstrap requirements-dev.lock
	@$(pytest) -m "not slow and not tools and not slurm" -n auto --dist loadfile --cov --cov-report=term-missing:skip-covered --cov-fail-under=90

lint: ## check style, types and the Snakefile
	@./bootstrap requirements-dev.lock
	@.venv/bin/ruff check .
	@.venv/bin/ruff format --check .
	@.venv/bin/mypy
	@.venv/bin/snakefmt --check Snakefile

format: ## put style right
	@./bootstrap requirements-dev.lock
	@.venv/bin/ruff check --fix .
	@.venv/bin/ruff format .
	@.venv/bin/snakefmt Snakefile

docs: ## write what is generated of the guide: pages from the schemas, the diagram from the rules, licences
	@./bootstrap requirements-dev.lock
	@$(python) -m schemas.reference_pages docs
	@$(python) -m workflow.diagram
	@$(python) -m workflow.licences

site: ## make the guide a site of pages, site/index.html, that needs no server and no network
	@./bootstrap requirements-site.lock .venv-site
	@.venv-site/bin/python -m guide.pictures docs/pictures
	@NO_MKDOCS_2_WARNING=1 .venv-site/bin/mkdocs build --quiet

audit: ## ask whether an advisory is known of what the lock files install
	@./bootstrap requirements.lock
	@$(python) .ci/audit.py

bench: ## measure what studies and stages cost, beside others, into docs/benchmarks.md
	@./bootstrap requirements-bench.lock
	@$(python) -m benchmarks cost

lock: ## resolve the dependencies anew (needs uv)
	uv pip compile pyproject.toml --universal --python-version 3.11 --generate-hashes --no-annotate --no-header --upgrade -o requirements.lock
	uv pip compile pyproject.toml --group dev --universal --python-version 3.11 --generate-hashes --no-annotate --no-header -c requirements.lock --upgrade -o requirements-dev.lock
	uv pip compile pyproject.toml --group cluster --universal --python-version 3.11 --generate-hashes --no-annotate --no-header -c requirements.lock --upgrade -o requirements-cluster.lock
	uv pip compile pyproject.toml --group fuzz --universal --python-version 3.11 --generate-hashes --no-annotate --no-header -c requirements.lock --upgrade -o requirements-fuzz.lock
	uv pip compile pyproject.toml --group dev --group bench --universal --python-version 3.11 --generate-hashes --no-annotate --no-header -c requirements-dev.lock --upgrade -o requirements-bench.lock
	uv pip compile pyproject.toml --group site --universal --python-version 3.11 --generate-hashes --no-annotate --no-header -c requirements.lock --upgrade -o requirements-site.lock
	uv pip compile --group audit --universal --python-version 3.11 --generate-hashes --no-annotate --no-header --upgrade -o requirements-audit.lock

clean: ## remove results, the demo's recordings and the site
	rm -rf results data/demo/recordings .snakemake site docs/pictures
