# Everything a newcomer or CI calls. `make` alone explains.
SHELL := /bin/sh
VENV := .venv
PY := $(VENV)/bin/python
MSGS := ros_ws/src/dcmg_msgs
INTERFACES := $(wildcard $(MSGS)/msg/*.msg $(MSGS)/srv/*.srv) $(MSGS)/CMakeLists.txt $(MSGS)/package.xml
PROJECTS := $(wildcard engine/native/*) pyproject.toml constraints.txt $(wildcard ros_ws/src/*/setup.py ros_ws/src/*/setup.cfg)
BUILD := $(VENV)/build/dcmg_msgs
LOWEST := tests/monitor tests/papers/test_turan_2021.py tests/papers/test_delayed.py tests/bags/test_golden.py tests/fuzz
# Test files beside each other: one a core, four at most (a run over ROS has 15 processes).
SIDE_BY_SIDE := --numprocesses auto --maxprocesses 4 --dist loadfile
# What turns a folder of ROS packages into the place where CMake looks for them.
ON_WHEELS = AMENT_PREFIX_PATH=$(abspath $(VENV)) CMAKE_PREFIX_PATH=$(abspath $(VENV))
PYTHON_ARG = -DPython3_EXECUTABLE=$(abspath $(PY))

# What pip does not do for a package that is installed in place: ROS finds it, its launch files and its command.
define IN_INDEX
mkdir -p $(VENV)/share/ament_index/resource_index/packages $(VENV)/share/$(one) $(VENV)/lib/$(one) && \
  cp ros_ws/src/$(one)/resource/$(one) $(VENV)/share/ament_index/resource_index/packages && \
  cp -r ros_ws/src/$(one)/package.xml $(wildcard ros_ws/src/$(one)/launch) $(VENV)/share/$(one) && \
  ln -sf ../../bin/dcmg $(VENV)/lib/$(one)/dcmg;
endef

# Neither a sourced ROS installation nor another ROS environment may shine through.
ifneq ($(AMENT_PREFIX_PATH)$(_ROS_WHEELS_BOOTSTRAP_COMPLETE),)
unexport AMENT_PREFIX_PATH CMAKE_PREFIX_PATH COLCON_PREFIX_PATH LD_LIBRARY_PATH PYTHONPATH
unexport RMW_IMPLEMENTATION _ROS_WHEELS_BOOTSTRAP_COMPLETE
endif

.PHONY: help demo test lint kernels lowest fuzz torture hosts pictures site bench colcon install clean FORCE
.DELETE_ON_ERROR:

help: ## this list
	@sed -n 's/^\([a-z]*\):.*## /\1\t/p' $(MAKEFILE_LIST) | expand -t 10
	@echo "PYTHON=python3.12 chooses the interpreter of $(VENV). More: docs/install.md"

demo: install ## six DGUs over ROS 2, an attack and its detection (what to run first)
	@$(VENV)/bin/dcmg run gallo_six_dgu --out out/demo-$$(date +%Y%m%d-%H%M%S)

test: lint ## all checks and all tests
	@$(PY) -m pytest $(SIDE_BY_SIDE)

coverage: install ## all tests once, and which share of the code they run (in processes of their own too)
	@rm -f .coverage .coverage.*
	@$(PY) -m coverage run -m pytest $(SIDE_BY_SIDE)
	@$(PY) -m coverage combine -q && $(PY) -m coverage report

lint: install ## import contracts, ruff, formatting, mypy --strict
	@$(VENV)/bin/lint-imports
	@$(VENV)/bin/ruff check
	@$(VENV)/bin/ruff format --check
	@$(VENV)/bin/mypy

kernels: install ## the numerical tests under two other BLAS kernels that this processor can run
	@$(PY) tests/kernels.py

lowest: $(VENV)/complete ## the numerical tests with the lowest versions that pyproject.toml allows
	@$(PY) -m venv --clear $(VENV)/lowest
	@$(VENV)/lowest/bin/python -m pip install -qq -r .ci/lowest.txt
	@OPENBLAS_NUM_THREADS=1 $(VENV)/lowest/bin/python -m pytest -p no:cacheprovider $(LOWEST)

hosts: install ## one run over three hosts made of namespaces: the same bytes, cables pulled, a host switched off
	@$(PY) -m pytest tests/hosts

MINUTES := 10
fuzz: install ## random plants against every design, MINUTES=10 (docs/fuzz.md)
	@$(PY) -m tests.fuzz.run --minutes $(MINUTES)

torture: install ## kills, hangs, damaged bags and hostile input against the product, MINUTES=10 (docs/torture.md)
	@$(PY) -m tests.torture.run --minutes $(MINUTES)

pictures: install ## the pictures of README and docs anew (minutes; needs chromium)
	@docs/pictures.sh

site: install ## the documentation as a site that opens without a network: build/site/index.html
	@$(PY) -m pip install -qq -c constraints.txt mkdocs-material 'mkdocstrings[python]'
	@NO_MKDOCS_2_WARNING=1 $(PY) -m mkdocs build --strict --quiet && echo "open build/site/index.html"

bench: install ## measure the speed on this machine
	@$(PY) -m pytest -m bench -s tests/bench

colcon: $(VENV)/packages ## build ros_ws with colcon against the wheels, and try the result
	@$(PY) -m pip install -qq -c constraints.txt colcon-common-extensions
	@rm -rf ros_ws/build ros_ws/install ros_ws/log
	@cd ros_ws && $(ON_WHEELS) $(abspath $(VENV)/bin/colcon) build --cmake-args $(PYTHON_ARG)
	@. ros_ws/install/setup.sh && ros_ws/install/dcmg_bringup/lib/dcmg_bringup/dcmg run gallo_six_dgu --duration 2 --no-plots \
	  --out ros_ws/log/run && $(PY) -m pytest tests/ros/test_interfaces.py

install: $(VENV)/messages ## only make .venv: Python packages, ROS 2 and our messages

clean: ## remove .venv and everything built; out/ stays
	@rm -rf $(VENV) build dist ros_ws/build ros_ws/install ros_ws/log
	@rm -rf .mypy_cache .ruff_cache .pytest_cache .hypothesis .import_linter_cache .coverage .coverage.*
	@find . -name __pycache__ -prune -exec rm -rf {} + -o -name '*.egg-info' -prune -exec rm -rf {} +

ifdef PYTHON
export PYTHON
$(VENV)/complete: FORCE # another Python than that of .venv makes it anew
endif
$(VENV)/complete:
	@ros_ws/make_venv.sh $(VENV)

$(VENV)/packages: $(VENV)/complete $(PROJECTS)
	@echo "Installing ROS 2 Jazzy and the Python packages into $(VENV): one or two minutes, once ..."
	@$(PY) -m pip install -qq -c constraints.txt setuptools
	@$(PY) -m pip install -qq -c constraints.txt --no-build-isolation --use-pep517 \
	  -e '.[dev,messages,ros]' -e ros_ws/src/dcmg_nodes -e ros_ws/src/dcmg_bringup
	@$(foreach one,dcmg_nodes dcmg_bringup,$(IN_INDEX))
	@touch $@

$(VENV)/messages: $(INTERFACES) $(VENV)/complete constraints.txt | $(VENV)/packages
	@echo "Building the ROS messages ..."
	@rm -rf $(BUILD) && mkdir -p $(BUILD)
	@{ $(ON_WHEELS) cmake -S $(MSGS) -B $(BUILD) -DCMAKE_INSTALL_PREFIX=$(abspath $(VENV)) $(PYTHON_ARG) \
	     -DCMAKE_PROJECT_INCLUDE=$(abspath ros_ws/unite_generated.cmake) && \
	   $(ON_WHEELS) cmake --build $(BUILD) --parallel && cmake --install $(BUILD); } >$(BUILD).log 2>&1 || \
	  { tail -n 20 $(BUILD).log; echo "The messages did not build; the whole log: $(BUILD).log"; exit 1; } >&2
	@touch $@
