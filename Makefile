# Everything made lies in .venv and build/. Options go through ARGS="...".
.PHONY: demo test bench format clean distclean
ARGS ?=
export PYTHONDONTWRITEBYTECODE := 1
export PATH := $(CURDIR)/.venv/bin:$(PATH)

demo:
	@tools/setup.sh demo
	@.venv/bin/python -m o80_table_tennis.demo $(ARGS)

# ARGS names the steps to run, all by default: make test ARGS="dev pytest"
test:
	@tools/setup.sh test
	@.venv/bin/python tools/test.py $(ARGS)

bench:
	@tools/setup.sh bench
	@.venv/bin/cmake --preset release > /dev/null
	@.venv/bin/cmake --build --preset release
	@.venv/bin/python benchmarks/run.py $(ARGS)

format:
	@tools/setup.sh test
	@.venv/bin/python tools/format.py $(ARGS)

clean:
	rm -rf build

distclean: clean
	rm -rf .venv
