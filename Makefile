# Every target sets up what it needs; `make help` lists them.

XDG_RUNTIME_DIR ?= /tmp
export XDG_RUNTIME_DIR # unset, it makes Vulkan drivers print noise

BIN := .venv/bin
DEMO := ear milk gyroid statue leaf
BENCH := sphere ear milk

.PHONY: help setup demo test test-lowest bench lint clean

help: ## list the targets
	@sed -n 's/^\([a-z-]*\):.*## /\1\t/p' Makefile

setup: ## virtual environment, dependencies and, where there is none, a software Vulkan driver
	@.ci/setup

demo: setup ## render pictures into out/
	@mkdir -p out
	$(BIN)/python examples/side_by_side.py ear lambert deon07 jensen02 -o out/methods.png
	@for scene in $(DEMO); do \
		(set -x; $(BIN)/wgsss render $$scene -o out/$$scene.png) || exit 1; \
	done
	$(BIN)/wgsss profile skin1 --model dipole --model better-dipole --model burley --model gaussians --model photons \
		-o out/skin1_profiles.png
	@echo "Pictures: $(CURDIR)/out (methods.png shows what diffusion does)"

test: setup ## run the tests
	@$(BIN)/pytest -q --durations=10 -n 2 --dist loadfile # much of a test runs on one core

test-lowest: setup ## run the tests with the oldest versions of other packages that are allowed
	@.ci/lowest

bench: setup ## measure what things cost, and chart speed against accuracy into out/bench/
	@$(BIN)/python tests/benchmarks.py
	@mkdir -p out
	$(BIN)/wgsss bench $(BENCH) -o out/bench

lint: setup ## check style and types
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/mypy

clean: ## remove what the targets made
	rm -rf .venv .venv-lowest out dist build .pytest_cache .mypy_cache .ruff_cache
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
