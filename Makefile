# make demo | make test: everything else (virtual environment, packages) is set up on the way.

VENV      := .venv
BIN       := $(VENV)/bin
INSTALLED := $(VENV)/.installed
PYTHONS   := python3.13 python3.12 python3.11 python3

.DEFAULT_GOAL := help
.PHONY: help demo test check clean

help:
	@echo 'make demo    simulate a flight over a foggy warehouse and reconstruct it, into out/demo'
	@echo 'make test    lint, type check and fast tests'
	@echo 'make check   make test and the slow tests'
	@echo 'make clean   remove the virtual environment, caches and out/'

demo: $(INSTALLED)
	@$(BIN)/spisim demo --output out/demo

test: $(INSTALLED)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports
	$(BIN)/pytest -n 2 --dist loadfile

check: test
	$(BIN)/pytest -m slow

clean:
	rm -rf $(VENV) out build *.egg-info .import_linter_cache .mypy_cache .pytest_cache .ruff_cache
	find spisim reconstruction tests tools benchmarks examples -name __pycache__ -type d -prune -exec rm -rf {} +

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

$(INSTALLED): pyproject.toml | $(BIN)/python
	@echo 'Installing packages (once, a few minutes)'
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[dev]'
	@touch $@
