# Everything made lies in .venv and build/. Options go through ARGS="...".
.PHONY: demo setup learn test check soak wheel site pages scripts torture model fuzz rt systemd debian13 bench format clean distclean
ARGS ?=
export PYTHONDONTWRITEBYTECODE := 1
export PATH := $(CURDIR)/.venv/bin:$(PATH)

demo:
	@export O80_SINCE=$$(date +%s) && tools/setup.sh demo && \
		.venv/bin/python -m o80_table_tennis.demo $(ARGS)

# Debian packages that demo and test need, as root or with sudo
setup:
	@tools/setup.sh setup

# one seed of table tennis from scratch, about ten minutes on one processor: build/learn
learn:
	@tools/setup.sh learn
	@.venv/bin/python -m o80.learning train o80_table_tennis.learning:ours.json --out build/learn $(ARGS)

# what a change can break; ARGS chooses tests: make test ARGS=control, ARGS=tests/python/test_bursts.py
test:
	@tools/setup.sh environment
	@.venv/bin/python tools/test.py $(ARGS)

# what `make test` leaves; ARGS chooses steps: make check ARGS="ruff mypy asan"
check:
	@tools/setup.sh check
	@.venv/bin/python tools/check.py $(ARGS)

# what `make test` runs, again and again under hostile conditions drawn from a seed; see CONTRIBUTING.md
soak:
	@tools/setup.sh test
	@.venv/bin/python tools/soak.py $(ARGS)

# wheels and source distributions of all packages: build/wheels, build/sdists
wheel:
	@tools/setup.sh wheels
	@.venv/bin/python tools/wheels.py $(ARGS)

# the pages, with search and the reference: build/site/index.html
site:
	@tools/setup.sh site
	@.venv/bin/python docs/site/build_site.py

# every block and command of every page: ARGS=docs/time.md chooses pages; tests/python/pages.toml
pages:
	@tools/setup.sh check
	@.venv/bin/python tests/python/pages.py $(ARGS)

# random scripts of motion, 100 000 of each kind by default: ARGS="--count 1000000 --seed 5000000"
scripts:
	@tools/setup.sh tools
	@.venv/bin/cmake --preset dev > /dev/null
	@.venv/bin/cmake --build --preset dev --target o80_test_scripts
	@.venv/bin/python tools/scripts.py $(ARGS)

# processes killed and stopped until ARGS="--kills 10000" is reached
torture:
	@tools/setup.sh test
	@.venv/bin/cmake --preset dev > /dev/null
	@.venv/bin/cmake --build --preset dev --target o80-torture
	@build/dev/bin/o80-torture --python .venv/bin/python $(ARGS)

# what tests cannot reach: every order of steps, on small cases
model:
	@tools/setup.sh check
	@.venv/bin/python tests/proofs/run.py models $(ARGS)

# the budgets
bench:
	@tools/setup.sh bench
	@.venv/bin/cmake --preset release > /dev/null
	@.venv/bin/cmake --build --preset release
	@.venv/bin/python benchmarks/run.py $(ARGS)

# some minutes for each fuzzer; finds go to build/fuzz/found: make fuzz ARGS="lane --minutes 60 --merge"
fuzz:
	@tools/setup.sh check
	@.venv/bin/python tests/proofs/run.py fuzz --minutes 3 $(ARGS)

# a PREEMPT_RT kernel in a virtual machine: the core tests and a loop, beside cyclictest
rt:
	@tools/setup.sh check
	@.venv/bin/python tests/proofs/run.py real_time $(ARGS)

# a robot as a service, in a virtual machine whose first process is systemd
systemd:
	@tools/setup.sh check
	@tools/setup.sh systemd
	@.venv/bin/cmake --preset dev > /dev/null
	@.venv/bin/cmake --build --preset dev
	@.venv/bin/python tests/proofs/run.py service_machine $(ARGS)

# demo and test on a bare Debian 13, as an ordinary user; as root: make debian13 ARGS=root
debian13:
	@tools/debian13.sh $(ARGS)

format:
	@tools/setup.sh tools
	@.venv/bin/python tools/format.py $(ARGS)

clean:
	rm -rf build

distclean: clean
	rm -rf .venv
