# make demo | make test: everything else (virtual environment, packages) is set up on the way.

VENV      := .venv
BIN       := $(VENV)/bin
INSTALLED := $(VENV)/.installed
PYTHONS   := python3.13 python3.12 python3.11 python3

.DEFAULT_GOAL := help
.PHONY: help demo test slow hours check docs benchmarks clean

help:
	@echo 'make demo    simulate a flight over a foggy warehouse and reconstruct it, into out/demo'
	@echo 'make test    lint, type check and fast tests'
	@echo 'make slow    the slow tests, three quarters of an hour on two cores; with PART=3 a fifth of them'
	@echo 'make hours   the tests that take hours: files and streams changed 100,000 times'
	@echo 'make check   make test, make slow, the path and scripts of strangers, and a sample of faults'
	@echo 'make docs    the documentation site, into out/site'
	@echo 'make benchmarks  measure everything anew, hours, into the tables of the pages'
	@echo 'make clean   remove the virtual environment, caches and out/'

demo: $(INSTALLED)
	@$(BIN)/spisim demo --output out/demo

# Processes that tests start load the modules compiled by the first of them.
test slow: export PYTHONDONTWRITEBYTECODE =

test: $(INSTALLED)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports
	$(BIN)/pytest -n 2 --dist loadfile

slow: $(VENV)/.installed-docs
	$(BIN)/pytest -m slow -n 2 --dist worksteal $(addprefix --part=,$(PART))

hours: $(INSTALLED)
	$(BIN)/pytest -m hours -n 2

check: test docs slow
	$(BIN)/python tools/strangers_path.py
	$(BIN)/python tools/first_hours.py
	$(BIN)/python tools/mutation.py

docs: $(VENV)/.installed-docs
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict

# Those that put tables into pages; what one promises and misses does not stop the others.
benchmarks: $(INSTALLED)
	@missed=; for file in $$(grep -l benchmark_options benchmarks/*.py | grep -v options.py); do \
	  echo "$$file"; $(BIN)/python "$$file" --markdown || missed="$$missed $$file"; \
	done; if [ -n "$$missed" ]; then echo "Not kept:$$missed" >&2; exit 1; fi

clean:
	rm -rf $(VENV) out build *.egg-info .import_linter_cache .mypy_cache .pytest_cache .ruff_cache
	find spisim reconstruction app scenes formats paper serving live compare inverse tests tools benchmarks examples -name __pycache__ -type d -prune -exec rm -rf {} +

$(BIN)/python:
	@for python in $(PYTHONS); do \
	  if $$python -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null; then found=$$python; break; fi; \
	done; \
	if [ -z "$$found" ]; then \
	  echo 'spisim needs Python 3.11 or newer, and none of "$(PYTHONS)" is.' >&2; exit 1; \
	fi; \
	if ! $$found -c 'import ensurepip, venv' 2>/dev/null; then \
	  echo "$$found cannot make virtual environments. On Debian or Ubuntu: apt-get install python3-venv" >&2; exit 1; \
	fi; \
	echo "Making $(VENV) with $$($$found --version)"; \
	$$found -m venv $(VENV) || { rm -rf $(VENV); exit 1; }

$(VENV)/.installed-docs: $(INSTALLED)
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[docs]'
	@touch $@

$(INSTALLED): pyproject.toml | $(BIN)/python
	@echo 'Installing packages (once, a few minutes)'
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[dev]'
	@touch $@
