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

# Format.
fmt:
    cargo fmt --all

# Lints, warnings denied.
lint:
    cargo clippy --workspace --all-targets --locked -- --deny warnings

# All benches, or one: `just bench -p episode --bench step`.
bench *which="--workspace":
    cargo bench --locked {{which}}
