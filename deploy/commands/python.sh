#!/bin/sh
# Chooses the interpreter of .venv and lets deploy/commands/setup.py bring it up to date.
# usage: setup.sh [INTERPRETER]    default: the one .venv has, else the first on the PATH that fits
set -eu

# Prints the interpreter itself, also where $1 belongs to a virtual environment: .venv cannot stand on another one.
base_of() {
    "$1" -c 'import sys; (3, 11) <= sys.version_info[:2] <= (3, 13) or sys.exit(1); print(sys._base_executable)'
}

cd "$(dirname "$0")/../.."
if [ -n "${1-}" ]; then
    base=$(base_of "$1") && [ -n "$base" ] && exec "$base" -m deploy.commands.setup
    echo "PYTHON=$1 is not a Python 3.11, 3.12 or 3.13" >&2
    exit 1
fi
for python in .venv/bin/python python3 python3.13 python3.12 python3.11; do
    base=$(base_of "$python" 2>/dev/null) && exec "$base" -m deploy.commands.setup
done
echo "No Python 3.11, 3.12 or 3.13 found: install one, or name it: make setup PYTHON=/path/to/python3.12" >&2
exit 1
