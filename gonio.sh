#!/bin/sh
# gonio with nothing but Python 3.11 to 3.14: the first run makes an environment beside this script, later ones use it.
#
#     ./gonio.sh demo               a first result, in gonio-demo/
#     ./gonio.sh test [...]         the tests (what follows goes to pytest)
#     ./gonio.sh VERB [...]         any verb of the command line: same as .venv/bin/gonio VERB
#     ./gonio.sh dev COMMAND [...]  a command in the developers' environment: linters, PyTorch, the documentation
#
# GONIO_PYTHON names the Python to use (python3.12, or a path). Otherwise users get the newest that serves, and
# developers the oldest, so that the tests see both ends.
set -eu

here=$(cd -P -- "$(dirname -- "$0")" && pwd)

fail() {
    printf 'gonio.sh: %s\n' "$1" >&2
    exit 2
}

# Whether interpreter $1 is one of those that gonio runs on, and has module $2.
serves() {
    "$1" -c "import sys, $2
sys.exit(not ((3, 11) <= sys.version_info < (3, 15) and sys.implementation.name == 'cpython'))" >/dev/null 2>&1
}

# Sets $python to the first of "$@" that serves.
find_python() {
    # Debian's Python cannot make environments before python3-venv is installed; uv can with any.
    needed=ensurepip
    if command -v uv >/dev/null 2>&1; then needed=os; fi
    for python in "$@"; do
        if serves "$python" "$needed"; then return; fi
    done
    for python in "$@"; do
        if serves "$python" os; then
            fail "$python cannot make environments yet. On Debian and Ubuntu: sudo apt install python3-venv"
        fi
    done
    fail "needs Python 3.11 to 3.14, which none of these is: $*. On Debian and Ubuntu: sudo apt install python3-venv"
}

# Installs what lock $2 names, by hash, and gonio from this checkout; hatchling, which builds gonio, is in the lock.
# pip leaves the compilation of modules to their first import, as uv does: most are never imported. The steps are
# chained because `set -e` says nothing inside a condition.
install() {
    if command -v uv >/dev/null 2>&1; then
        UV_PYTHON_DOWNLOADS=never
        export UV_PYTHON_DOWNLOADS
        uv venv --allow-existing --no-project --python "$(command -v "$python")" "$1" &&
            uv pip install --python "$1/bin/python" --require-hashes --only-binary :all: -r "$2" &&
            uv pip install --python "$1/bin/python" --no-deps --no-build-isolation --editable "$here"
    else
        "$python" -m venv "$1" &&
            "$1/bin/python" -m pip install --no-compile --progress-bar off --only-binary :all: --require-hashes -r "$2" &&
            "$1/bin/python" -m pip install --no-deps --no-build-isolation --no-index --editable "$here"
    fi
}

# PyTorch is an authority for tests, not a dependency. Its builds differ from machine to machine, so no hash could be
# locked, and pip is asked, since that finds a build for the processor alone where the machine has one.
install_torch() {
    "$1/bin/python" -m pip install --no-compile --progress-bar off torch==2.13.0
}

# What an environment is made of: where any of it has changed, or the checkout has moved, it is made anew.
recipe() {
    printf '%s\n' "$here" "${GONIO_PYTHON:-}"
    cat "$here/gonio.sh" "$here/requirements/$1.lock"
}

# Makes environment $1 from lock $2, unless it stands, with the first Python of the rest that serves. The recipe is
# written last: a set-up that was interrupted starts again.
environment() {
    venv=$here/$1
    lock=$2
    shift 2
    if [ -x "$venv/bin/gonio" ] && recipe "$lock" | cmp -s - "$venv/recipe"; then return; fi
    if [ -e "$venv" ] && [ ! -e "$venv/recipe" ]; then
        fail "$venv is not of this script's making. Move it away and try again."
    fi
    if [ -n "${GONIO_PYTHON:-}" ]; then set -- "$GONIO_PYTHON"; fi
    find_python "$@"
    printf 'gonio.sh: setting up %s with %s, once; it takes a minute or two\n' "$venv" "$("$python" --version)" >&2
    # Emptied but for the recipe, which says whose folder it is even when this is interrupted.
    mkdir -p "$venv"
    : >"$venv/recipe"
    find "$venv" -mindepth 1 -maxdepth 1 ! -name recipe -exec rm -rf {} +
    log=$venv/setup.log
    if install "$venv" "$here/requirements/$lock.lock" >"$log" 2>&1 &&
        { [ "$lock" != dev ] || install_torch "$venv" >>"$log" 2>&1; }; then
        recipe "$lock" >"$venv/recipe"
    else
        tail -n 20 "$log" >&2
        fail "the set-up did not finish. All that was said is in $log"
    fi
}

case "${1:-}" in
dev)
    shift
    [ $# -gt 0 ] || fail "dev needs a command, as in: ./gonio.sh dev ruff check"
    environment .venv-dev dev python3.11 python3.12 python3.13 python3.14 python3
    PATH=$here/.venv-dev/bin:$PATH
    export PATH
    exec "$@"
    ;;
test)
    shift
    environment .venv test python3.14 python3.13 python3.12 python3.11 python3
    cd "$here"
    # All tests run on several processors, each with one thread, since more would only wait for each other.
    if [ $# -eq 0 ]; then set -- -n auto --maxprocesses 4; fi
    OMP_NUM_THREADS=${OMP_NUM_THREADS:-1} OPENBLAS_NUM_THREADS=${OPENBLAS_NUM_THREADS:-1}
    export OMP_NUM_THREADS OPENBLAS_NUM_THREADS
    exec .venv/bin/python -m pytest "$@"
    ;;
*)
    environment .venv test python3.14 python3.13 python3.12 python3.11 python3
    exec "$here/.venv/bin/gonio" "$@"
    ;;
esac
