# `make demo` and `make test` set up all they need; the rest is for those who change the code.
.DEFAULT_GOAL := help
.PHONY: help demo test test-slow test-tools test-slurm tools coverage lint format lock audit docs site bench clean

# A study starts processes by the hundred: with compiled bytecode they start in a third of the time, so it is
# written also where a user's environment says not to.
export PYTHONDONTWRITEBYTECODE=

python := .venv/bin/python
# Tests, and the processes that they start, share the cores already.
pytest := OMP_NUM_THREADS=1 $(python) -m pytest
cores ?= all
inputs ?= 500
users := .venv/requirements.lock
developers := .venv/requirements-dev.lock

help: ## say what can be made
	@awk -F ':.*## ' '/^[a-z-]+:.*## / {printf "make %-10s %s\n", $$1, $$2}' Makefile

# Needs uv, or a Python 3.11 or newer that has venv.
$(python):
	@if command -v uv >/dev/null; then uv venv --quiet --allow-existing --python ">=3.11" .venv; exit; fi; \
	for python in $(PYTHON) python3 python3.14 python3.13 python3.12 python3.11; do \
		$$python -c "import sys, venv, ensurepip; sys.exit(sys.version_info < (3, 11))" 2>/dev/null || continue; \
		exec $$python -m venv .venv; \
	done; \
	echo "error: needs Python 3.11 or newer with venv, or uv; found neither" >&2; exit 2

# What is pinned in a lock, each by its hash, and no newer release that another asks for with an extra; and this
# folder itself; anew only when the lock has changed. By uv, which is fetched where there is none; by pip where uv fails.
pip := $(python) -m pip install --disable-pip-version-check --quiet --require-hashes --no-deps
.venv/%.lock: %.lock requirements-uv.lock | $(python)
	@echo "Installing $<"
	@uv=$$(command -v uv) || { uv=.venv/bin/uv; $(pip) --only-binary :all: -r requirements-uv.lock; $(pip_settings); }; \
	install="$$uv pip install --python $(python) --quiet --no-deps"; \
	$$install --require-hashes -r $< || { install="$(python) -m pip install --quiet --no-deps"; $(pip) -r $<; } && \
	$$install --no-build-isolation --editable .
	@rm -f $(compiled)
	@$(if $(findstring dev,$*),$(compile))
	@cp $< $@

# pip's settings by the names that uv reads: it does not read pip's. Wherever a file comes from, its hash must be right.
pip_settings = eval "$$($(python) -m pip config list 2>/dev/null | sort -r | sed -nE 's/\\n/ /g; \
	s/^[^=]*\.index-url=/export UV_DEFAULT_INDEX=/p; s/^[^=]*\.extra-index-url=/export UV_INDEX=/p; \
	s/^[^=]*\.find-links=/export UV_FIND_LINKS=/p; s/^[^=]*\.trusted-host=/export UV_INSECURE_HOST=/p; \
	s/^[^=]*\.no-index=/export UV_NO_INDEX=/p; s/^[^=]*\.proxy=/export ALL_PROXY=/p; \
	s/^[^=]*\.cert=/export SSL_CERT_FILE=/p')"; export UV_INDEX_STRATEGY=unsafe-best-match

# What fits hands is compiled beside the demo's first stages; fits wait for it.
compiled := .venv/compiled
compile = [ -e $(compiled) ] && [ -z "$$(find shukotsu/fit/kernel -name "*.py" -newer $(compiled))" ] || { \
	echo "Compiling what fits hands" && $(python) -m shukotsu.fit.compile_kernel && touch $(compiled); }

demo: $(users) ## run the demo study, print what it found and name its report
	@{ $(compile); } & .venv/bin/shukotsu demo --cores $(cores); code=$$?; wait; exit $$code

test: $(developers) ## run the fast tests
	@$(pytest) -m "not slow and not tools and not slurm" -n auto --dist loadfile

test-slow: $(developers) ## run the rest: new examples of every property, whole studies through Snakemake, planted wrong signs
	@$(pytest) -m "slow or hypothesis" --hypothesis-profile search -n auto --dist loadfile --no-loadscope-reorder

tools: ## put programs by others that read exports into .tools (some 1.4 GB), and a browser
	@./tests/export_tools/install

test-tools: $(developers) tools ## read exported files with these programs
	@$(pytest) -m tools -n auto --dist loadfile

test-slurm: $(developers) ## run a study on a private Slurm (root, Debian's slurm-wlm and munge)
	@$(pytest) -m slurm

coverage: $(developers) ## run the fast and the slow tests and print the lines that none of them reaches
	@$(pytest) -m "not tools and not slurm" -n auto --dist loadfile --cov --cov-report=term-missing:skip-covered --cov-fail-under=90

lint: $(developers) ## check style, types and the Snakefile
	@.venv/bin/ruff check .
	@.venv/bin/ruff format --check .
	@.venv/bin/mypy
	@.venv/bin/snakefmt --check Snakefile workflow
	@.venv/bin/snakemake --lint

format: $(developers) ## put style right
	@.venv/bin/ruff check --fix .
	@.venv/bin/ruff format .
	@.venv/bin/snakefmt Snakefile

docs: $(developers) ## write what is generated of the guide: pages from the schemas, the diagram from the rules
	@$(python) docs/make_pages.py

site: $(developers) ## make the guide a site of pages, site/index.html, that needs no server and no network
	@NO_MKDOCS_2_WARNING=1 .venv/bin/mkdocs build --quiet

audit: $(developers) ## ask whether an advisory is known of what is installed
	@.venv/bin/pip-audit --skip-editable --progress-spinner off

bench: $(developers) ## measure what studies and a hand cost, into docs/benchmarks.md
	@$(python) -m benchmarks cost --write

lock := uv pip compile pyproject.toml --universal --python-version 3.11 --generate-hashes --no-annotate --no-header --upgrade
lock: ## resolve the dependencies anew (needs uv)
	echo uv | $(subst pyproject.toml,-,$(lock)) -o requirements-uv.lock
	$(lock) --group build -o requirements.lock
	$(lock) --group dev -c requirements.lock -o requirements-dev.lock

clean: ## remove results, the demo's recordings and the site
	rm -rf results data/demo/recordings .snakemake site
