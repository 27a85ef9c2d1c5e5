# What the steps share. Each step reads this first: it stops at errors, goes to the project's folder, and names the
# folder for the tools that only CI uses. Sourced, never run.
# shellcheck shell=bash
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

target=${CARGO_TARGET_DIR:-target}
mkdir -p "$target/ci"
tools=$(realpath "$target/ci")
export PATH="$tools/bin:$PATH"
# A run from nothing has no use for what a later compilation could reuse.
[ -z "${CI:-}" ] || export CARGO_INCREMENTAL=0

as_root() { if [ "$(id -u)" -eq 0 ]; then "$@"; else sudo "$@"; fi; }

# One step at a time installs; another that runs beside it waits.
install_packages() (
    exec 9>"$tools/lock"
    flock 9
    as_root apt-get update -qq
    as_root env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends "$@" >/dev/null
)

# Whether one of these commands exists.
has_any() { local name; for name in "$@"; do command -v "$name" >/dev/null && return; done; return 1; }

# A cargo tool in exactly this version. It goes into the project's target folder, beside a developer's own tools.
install_cargo_tool() { # name, version
    has_any "$1" && [[ "$(cargo "${1#cargo-}" --version)" == *" $2"* ]] && return
    # Without optimisation: it takes longer to compile these than to run them.
    cargo install --locked --quiet --debug --root "$tools" "$1" --version "=$2"
}

# Sets $python to an interpreter that has the packages of .ci/requirements.txt.
use_python() {
    python3 -c 'import ensurepip, venv' 2>/dev/null || install_packages python3 python3-venv
    python=$tools/python/bin/python
    (
        exec 9>"$tools/lock"
        flock 9
        [ -x "$python" ] || python3 -m venv "$tools/python"
        "$python" -m pip install --quiet --disable-pip-version-check --requirement .ci/requirements.txt
    )
}

# The README's test command, of every package or of those that -p names. The compiler is clippy, which compiles as rustc does: its lints and the tests share
# one build. The programs of fuzz_targets/ need a foreign library, and scripts/nightly alone compiles them.
cargo_test() {
    local packages=(--workspace)
    [[ " $* " != *" -p "* ]] || packages=()
    mkdir -p "$tools/documentation"
    RUSTC_WORKSPACE_WRAPPER=clippy-driver CLIPPY_ARGS=-D__CLIPPY_HACKERY__warnings \
        RUSTDOC=$PWD/.ci/rustdoc CI_DOCUMENTATION=$tools/documentation \
        cargo test --locked "${packages[@]}" "$@"
}

# Sets $browser to Chromium.
install_browser() {
    has_any chromium chromium-browser google-chrome || install_packages chromium
    browser=$(command -v chromium || command -v chromium-browser || command -v google-chrome)
}

# Builds the release and sets $masseter to it.
use_release() {
    cargo build --release --locked
    masseter=$target/release/masseter
}

# Repeats a line at the end of .ci/run.
note() { printf '%s\n' "$*" >>"${CI_NOTES:-/dev/null}"; }

# Notes that a shard of scripts/nightly was only sampled, and how its last whole run ended.
sampled() { # shards, as the beginning of their names; the sample
    local runs
    runs=$(sed -n "s/^| \`\($1[^ ]*\)\` | \([^|]*\) | \([^|]*\) | \(.*\) |/\1 of \2 at \3: \4/p" docs/nightly.md | paste -sd ';')
    note "${1%-}: sampled ($2); whole: ${runs:-never yet}"
}
