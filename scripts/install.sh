#!/bin/sh
# Finds the Python that .venv/ was made with, else 3.11, 3.12 or 3.13 with its venv module, in this order, then hands over to
# scripts/install.py. PYTHON names another interpreter: PYTHON=/path/to/python3.12 make install
set -eu

supported='import sys; sys.exit(not (3, 11) <= sys.version_info[:2] <= (3, 13))'
here="$(dirname "$0")"
made_with='import ensurepip, os, sys, venv; print(os.path.join(os.path.dirname(sys._base_executable), "python%d.%d" % sys.version_info[:2]))'
kept="$("$here/../.venv/bin/python" -c "$made_with" 2>/dev/null)" || true
python="${PYTHON:-}"
for name in "$kept" python3.11 python3.12 python3.13 python3; do
    [ -n "$python" ] && break
    if "$name" -c "$supported" 2>/dev/null; then python="$name"; fi
done
python="${python:-python3.11}"
if [ "$(id -u)" -eq 0 ]; then apt="apt-get"; else apt="sudo apt-get"; fi

refuse() {
    echo "error: $1" >&2
    if command -v apt-get >/dev/null 2>&1; then
        echo "On Debian 12 this brings it:" >&2
        echo "    $apt install -y python3.11 python3.11-venv" >&2
    fi
    echo "Any other Python 3.11, 3.12 or 3.13 does as well: PYTHON=/path/to/python3.12 make install" >&2
    exit 2
}

command -v "$python" >/dev/null 2>&1 || refuse "$python was not found; bestman-bt needs Python 3.11, 3.12 or 3.13."
"$python" -c "$supported" \
    || refuse "$python is $("$python" --version 2>&1); bestman-bt needs Python 3.11, 3.12 or 3.13."
"$python" -c 'import venv, ensurepip' 2>/dev/null || refuse "$python has no venv module."

exec "$python" "$here/install.py"
