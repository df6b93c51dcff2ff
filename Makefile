# One list of targets. `python3 -m plumbline run|test` does the same where there is no make.
PYTHON ?= python3
STUDY ?=
DATA ?= ../shared/data

.PHONY: help setup run test check bench papers discovery data lock

help: ## this list
	@grep -E '^[a-z]+:.*##' $(MAKEFILE_LIST) | sed 's/:.*## /\t/'

setup: ## make .venv from the hash-pinned locks
	@$(PYTHON) -m plumbline setup

run: ## run the demo study, or another: make run STUDY=FOLDER
	@$(PYTHON) -m plumbline run $(if $(STUDY),"$(STUDY)")

test: ## run the tests
	@$(PYTHON) -m plumbline test

check: ## lint, format, types, rules
	@$(PYTHON) -m plumbline check

bench: setup ## benchmarks, against other libraries where there are any
	@.venv/bin/python -m benchmarks

papers: ## compare results with the committed references
	@$(PYTHON) -m plumbline papers

discovery: setup ## is the search for missing effects right? random simulated studies, about two hours on two cores
	@.venv/bin/python -m benchmarks.discovery

data: setup ## link public data into studies/: make data DATA=FOLDER
	@.venv/bin/plumbline data "$(DATA)"

lock: setup ## renew the locks from requirements.in
	.venv/bin/uv pip compile -q --universal --python-version 3.11 --generate-hashes --no-emit-index-url --no-header \
		--no-annotate requirements.in -o requirements.lock
