# `make demo` and `make test` set up everything they need in .venv; a second call installs nothing.

NEW_ENOUGH := -c 'import sys; sys.exit(sys.version_info < (3, 11))'
PYTHON ?= $(shell for p in python3 python3.13 python3.12 python3.11; do \
	$$p $(NEW_ENOUGH) 2>/dev/null && echo $$p && break; done)
BIN := .venv/bin
INSTALLED := .venv/.installed

.PHONY: demo test test-all lint clean

demo: $(INSTALLED)
	@$(BIN)/turgor run examples/demo.yaml --out demo --overwrite
	@echo "Open demo/report.html in a browser; load demo/result.pvd into ParaView."

test: $(INSTALLED) lint
	@$(BIN)/pytest -n 2 -m "not slow"

test-all: $(INSTALLED) lint
	@$(BIN)/pytest -n 2

lint: $(INSTALLED)
	@$(BIN)/ruff check --quiet .
	@$(BIN)/ruff format --quiet --check .
	@$(BIN)/mypy

$(INSTALLED): pyproject.toml
	@test -n "$(PYTHON)" && $(PYTHON) $(NEW_ENOUGH) || \
		{ echo "Turgor needs Python 3.11 or newer; name one with make PYTHON=/path/to/python"; exit 1; }
	@test -x $(BIN)/python || $(PYTHON) -m venv .venv || \
		{ echo "Python cannot make a virtual environment here; on Debian or Ubuntu: apt-get install python3-venv"; exit 1; }
	@echo "installing Turgor and what it needs into .venv (once)"
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[test]'
	@sh scripts/system-libraries.sh $(BIN)/python
	@touch $@

clean:
	rm -rf .venv demo
