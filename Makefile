# The front door: each target is thin over a CMake preset. `make help` lists them.
PRESET ?= release
RUN_WORLDS ?= 4
.DEFAULT_GOAL := help
.PHONY: help setup setup-test configure build run test test-all format

help:            ## list the targets
	@grep -hE '^[a-z-]+: .*##' $(MAKEFILE_LIST) | sed 's/: .*##/\t/' | expand -t 12

setup:           ## install the Debian packages that are missing (says which)
	@scripts/setup.sh

setup-test:
	@scripts/setup.sh test

configure: setup ## configure build/$(PRESET)
	@cmake --preset $(PRESET) --log-level=WARNING

build: configure ## build into build/$(PRESET), programs in build/$(PRESET)/bin
	@cmake --build --preset $(PRESET)

run: configure   ## the demo: a small city on 4 world daemons (builds no tests)
	@cmake --build --preset $(PRESET) --target programs
	@scripts/demo.sh build/$(PRESET)/bin $(RUN_WORLDS)

test: setup-test build ## unit, simulation and distributed tests, and the sanitizers' sample (what CI runs)
	@scripts/test.sh sample

test-all: setup-test build ## every test, whole matrices
	@scripts/test.sh all

format:          ## clang-format over our sources
	@git ls-files '*.h' '*.cpp' | xargs clang-format -i
