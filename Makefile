# make demo and make test set themselves up: a virtual environment in .venv, the extension built in place.
PYTHON  ?= python3
VENV    := .venv
PY      := $(VENV)/bin/python
CORE    := $(shell find csrc -name '*.c' -o -name '*.h')
EXT     := hostmot2/_core.abi3.so

.PHONY: all demo test check clean
all: $(EXT)

$(VENV)/ready: pyproject.toml
	$(PYTHON) -m venv $(VENV)
	$(PY) -m pip install -q --upgrade pip "setuptools>=77" wheel
	$(PY) -m pip install -q -e ".[plot,serial,record]" --group dev
	touch $@

$(EXT): $(CORE) csrc/build_ffi.py setup.py $(VENV)/ready
	$(PY) setup.py -q build_ext --inplace
	touch $@

test: $(EXT)
	$(VENV)/bin/pytest -q -n auto -m "not slow"

clean:
	rm -rf build dist $(VENV) $(EXT) hostmot2/_core.c
