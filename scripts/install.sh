#!/bin/sh
# Finds Python 3.11 with its venv module, then hands over to scripts/install.py.
# PYTHON names another interpreter: PYTHON=/path/to/python3.11 make install
set -eu

python="${PYTHON:-python3.11}"
if [ "$(id -u)" -eq 0 ]; then apt="apt-get"; else apt="sudo apt-get"; fi
debian_line="$apt install -y python3.11 python3.11-venv"

refuse() {
    echo "error: $1" >&2
    if command -v apt-get >/dev/null 2>&1; then
        echo "On Debian 12 this brings it:" >&2
        echo "    $debian_line" >&2
    fi
    echo "Any other Python 3.11 does as well: PYTHON=/path/to/python3.11 make install" >&2
    exit 2
}

command -v "$python" >/dev/null 2>&1 || refuse "$python was not found; bestman-bt needs Python 3.11."
"$python" -c 'import sys; sys.exit(sys.version_info[:2] != (3, 11))' \
    || refuse "$python is $("$python" --version 2>&1); bestman-bt needs Python 3.11."
"$python" -c 'import venv, ensurepip' 2>/dev/null || refuse "$python has no venv module."

exec "$python" "$(dirname "$0")/install.py"
