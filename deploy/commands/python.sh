#!/bin/sh
# Runs a module of the checkout with a bare interpreter: before .venv exists, and after it was removed.
# usage: python.sh MODULE [INTERPRETER]    default: the one of .venv, else the first on the PATH that fits
set -eu
exec </dev/null # nothing here reads; in place of a closed one, make may have opened a folder, which stops Python

# Prints the base interpreter of $1: .venv cannot build on a virtual environment, nor on its own remains.
base_of() {
    "$1" -Es -c 'import os, sys
(3, 11) <= sys.version_info[:2] <= (3, 14) or sys.exit(1)
print(os.path.realpath(sys._base_executable))'
}

module=$1
CDPATH="" cd -- "$(dirname -- "$0")/../.."
. deploy/commands/entry.sh
if [ -n "${2-}" ]; then
    base=$(base_of "$2" 2>/dev/null) && [ -n "$base" ] && exec "$base" -Es -m "$module"
    command -v "$2" >/dev/null || { echo "PYTHON=$2: there is no such program" >&2 && exit 1; }
    echo "PYTHON=$2 is not a Python 3.11 to 3.14" >&2
    exit 1
fi
for python in .venv/bin/python python3 python3.14 python3.13 python3.12 python3.11; do
    base=$(base_of "$python" 2>/dev/null) && exec "$base" -Es -m "$module"
done
echo "No Python 3.11 to 3.14 found: install one, or name it, for example PYTHON=/path/to/python3.12" >&2
exit 1
