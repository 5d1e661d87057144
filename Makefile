# Every target first sets up everything that it needs; `make help` lists the targets.

XDG_RUNTIME_DIR ?= /tmp
export XDG_RUNTIME_DIR # without it, Vulkan drivers print warnings

BIN := .venv/bin
DEMO := ear milk gyroid statue leaf
BENCH := sphere ear milk

.PHONY: help setup demo test test-lowest bench lint clean

help: ## list the targets
	@sed -n 's/^\([a-z-]*\):.*## /\1\t/p' Makefile

setup: ## create .venv, install dependencies and, if the machine has no Vulkan device, a software driver
	@.ci/setup

demo: setup ## render pictures into out/
	@mkdir -p out
	$(BIN)/python examples/side_by_side.py ear lambert deon07 jensen02 -o out/methods.png
	@for scene in $(DEMO); do \
		(set -x; $(BIN)/wgsss render $$scene -o out/$$scene.png) || exit 1; \
	done
	$(BIN)/wgsss profile skin1 --model dipole --model better-dipole --model burley --model gaussians --model photons \
		-o out/skin1_profiles.png
	@echo "Pictures: $(CURDIR)/out (methods.png compares three methods)"

test: setup ## run the tests
	@$(BIN)/pytest -q --durations=10 -n 2 --dist loadfile # most of a test runs on one core

test-lowest: setup ## run the tests with the oldest allowed versions of all dependencies
	@.ci/lowest

bench: setup ## run the benchmarks, and chart speed against accuracy into out/bench/
	@$(BIN)/python tests/benchmarks.py
	@mkdir -p out
	$(BIN)/wgsss bench $(BENCH) -o out/bench

lint: setup ## check style and types
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/mypy

clean: ## remove all files that the targets created
	rm -rf .venv .venv-lowest out dist build .pytest_cache .mypy_cache .ruff_cache
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
