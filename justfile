# The chores. `just` alone lists them.

default:
    @just --list --unsorted

# Build everything that is run.
build:
    cargo build --release --workspace --locked

# Drive the built-in demo scenes.
demo: build
    ./target/release/sim run

# The README's test command.
test:
    cargo nextest run --workspace --locked

# The tests that take minutes.
test-slow:
    cargo nextest run --workspace --locked --run-ignored only

# Everything that continuous integration checks.
ci:
    bash .ci/run

# The vectors that hold `sim verify` where the authors' are missing, anew: after a change of generated scenes. Needs Python with numpy.
paper-fixture:
    bash sim/checks/paper_fixture.sh

# The demo set's figures in README.md and docs/planner.md, anew.
demo-figures: build
    python3 sim/checks/demo_figures.py

# All that follows from the content of generated scenes, anew: after a change of the generator.
scenes-changed: paper-fixture demo-figures
    INSTA_UPDATE=always cargo nextest run --workspace --locked --no-fail-fast
    git status --short

# Format.
fmt:
    cargo fmt --all

# Lints, warnings denied.
lint:
    cargo clippy --workspace --all-targets --locked -- --deny warnings

# All benches, or one: `just bench -p episode --bench step`.
bench *which="--workspace":
    cargo bench --locked {{which}}
