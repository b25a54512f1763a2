# Sourced by the scripts beside it: installs what a peer needs, and fails with the reason when it cannot.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."
root=$PWD
peers=${CARGO_TARGET_DIR:-$root/target}/peers
mkdir -p "$peers"

fail() { echo "peer: $*" >&2; exit 1; }

# Debian packages, those that are missing.
debian() {
    local missing=()
    for package in "$@"; do
        dpkg-query -W -f='${Status}' "$package" 2>/dev/null | grep -q "ok installed" || missing+=("$package")
    done
    [ ${#missing[@]} -eq 0 ] && return
    command -v apt-get >/dev/null || fail "needs ${missing[*]}, and there is no apt-get"
    local sudo=; [ "$(id -u)" -eq 0 ] || sudo=sudo
    # One at a time: dpkg takes no second one.
    exec {lock}>"$peers/apt.lock"
    flock "$lock"
    $sudo apt-get update -qq
    DEBIAN_FRONTEND=noninteractive $sudo apt-get install -y -qq --no-install-recommends "${missing[@]}" >/dev/null ||
        fail "cannot install ${missing[*]}"
    exec {lock}>&-
}

# A Python with these packages; sets $python.
python_env() {
    python=$peers/python/bin/python
    if ! [ -x "$python" ]; then
        debian python3-venv
        python3 -m venv "$peers/python" || fail "cannot make a Python environment"
    fi
    "$python" -m pip install --quiet --disable-pip-version-check "$@" || fail "cannot install $*"
}

# Node packages; sets $node_modules.
npm_env() {
    command -v npm >/dev/null || debian npm
    node_modules=$peers/node/node_modules
    npm install --silent --no-fund --no-audit --prefix "$peers/node" "$@" >/dev/null || fail "cannot install $*"
}

# The tests of the drivers, built as the whole suite builds them, so that nothing is built twice.
driver_tests() {
    cargo test --quiet --locked --workspace --test hardware --no-run || fail "the tests do not build"
}

# Runs one of them that is ignored otherwise, by its full name, and checks that it did run.
driver_test() {
    local output
    output=$(timeout 600 cargo test --quiet --locked --workspace --test hardware -- \
        --ignored --exact "$1" --nocapture 2>&1) || { echo "$output"; return 1; }
    echo "$output"
    grep -q "1 passed" <<<"$output"
}

# The program with all drivers, built as the tests build it, and more features if they are given,
# such as `--features foxhunt-cli/ros2`; sets $foxhunt.
foxhunt_program() {
    cargo test --quiet --locked --workspace --test program --no-run "$@" || fail "the program does not build"
    foxhunt=${CARGO_TARGET_DIR:-$root/target}/debug/foxhunt
}
