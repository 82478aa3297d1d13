# Every target sets itself up: a virtual environment in .venv, the extension built in place.
VENV    := .venv
PY      := $(VENV)/bin/python
CORE    := $(shell find csrc -name '*.c' -o -name '*.h') hostmot2/_bound.c
EXT     := hostmot2/_core.abi3.so
FUZZ_SECONDS ?= 60

.PHONY: all demo test check bench interop docs fuzz mutants coverage registers clean
all: $(EXT)

$(VENV)/ready: pyproject.toml tools/venv
	@tools/venv $(VENV) test
	@touch $@
	@touch -c $(EXT) # just built

# what make check, docs and bench need on top
$(VENV)/ready-dev: $(VENV)/ready
	@tools/venv $(VENV) dev
	@touch $@

$(EXT): $(CORE) csrc/build_ffi.py setup.py $(VENV)/ready
	@echo "building the extensions"
	@$(PY) setup.py -q build_ext --inplace
	@touch $@

demo: $(EXT)
	@$(PY) -m hostmot2.demo

test: $(EXT)
	@$(PY) -m pytest -q -n auto -m "not slow"

check: $(EXT) $(VENV)/ready-dev
	@$(PY) tools/check.py

bench: $(EXT) $(VENV)/ready-dev
	@$(PY) -m hostmot2.bench

# the site in site/; `mkdocs serve` shows it while pages are written
docs: $(EXT) $(VENV)/ready-dev
	@$(PY) tools/check.py registers generated-pages site

# Debian's mesaflash and LinuxCNC against the emulated card; needs root, works in network namespaces of its own
interop: $(EXT)
	@tools/interop $(PY)

# longer than in make check; finds go to build/c/fuzz and build/fuzz
fuzz: $(EXT)
	@$(MAKE) --no-print-directory -f tests/c/Makefile fuzz SECONDS_EACH=$(FUZZ_SECONDS)
	@$(PY) -c 'import atheris' 2>/dev/null || $(PY) -m pip install -q --group fuzz
	@$(PY) tests/fuzz/run.py --all $(FUZZ_SECONDS)

# realistic mistakes, one at a time in a copy of the tree; the tests must notice each; an hour and more
mutants: $(EXT)
	@$(PY) tools/mutants.py && $(PY) tools/mutants.py --report

# lines of Python and branches of C that the tests do not reach; writes docs/reference/coverage.md
coverage: $(EXT) $(VENV)/ready-dev
	@$(PY) tools/coverage_report.py

# after a change in registers/*.rdl
registers: $(VENV)/ready-dev
	@$(PY) registers/generate.py

clean:
	rm -rf build dist site *.egg-info hostmot2/*.so hostmot2/_core.c
	[ -L $(VENV) ] || rm -rf $(VENV)
