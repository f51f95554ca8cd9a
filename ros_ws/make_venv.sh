#!/bin/sh
# make_venv.sh FOLDER: make the virtual environment, with the Python that $PYTHON names or the first suitable one.
# Whatever the machine lacks is said in one line, before anything is installed.
set -eu
folder=$1

fail() {
  echo "$*" >&2
  exit 1
}

# Prints why the Python "$1" cannot be used; nothing when it can. Any Python version must be able to read it.
obstacle() {
  "$1" - 2>/dev/null <<'PROBE' || echo "does not run"
import os, sys, sysconfig
version = ".".join(map(str, sys.version_info[:3]))
short = version.rsplit(".", 1)[0]
name = getattr(getattr(sys, "implementation", None), "name", "cpython")
try:
    import ensurepip, venv
    has_venv = True
except ImportError:
    has_venv = False
if name != "cpython" or sysconfig.get_config_var("Py_GIL_DISABLED"):
    print("is not a standard CPython")
elif not (3, 11) <= sys.version_info[:2] <= (3, 13):
    print("is Python " + version)
elif not has_venv:
    print("lacks the venv module: install it (Debian, Ubuntu: apt install python%s-venv)" % short)
elif not os.path.exists(os.path.join(sysconfig.get_paths()["include"], "Python.h")):
    print("lacks its C headers: install them (Debian, Ubuntu: apt install python%s-dev)" % short)
PROBE
}

machine="$(uname -s) $(uname -m)"
[ "$machine" = "Linux x86_64" ] ||
  fail "ROS 2 Jazzy wheels exist for x86-64 Linux only, and this is $machine: use docker/Dockerfile (docs/install.md)."
command -v cmake >/dev/null || fail "cmake is missing: install it (Debian, Ubuntu: apt install cmake)."
command -v "${CXX:-g++}" >/dev/null || fail "${CXX:-g++} is missing: install it (Debian, Ubuntu: apt install g++)."

if [ -n "${PYTHON:-}" ]; then
  reason=$(obstacle "$PYTHON")
  [ -z "$reason" ] || fail "PYTHON=$PYTHON $reason; wanted: Python 3.11, 3.12 or 3.13."
  version='import sys; print(sys.version_info[:2])'
  if [ -e "$folder/complete" ] && [ "$("$folder/bin/python" -c "$version")" = "$("$PYTHON" -c "$version")" ]; then
    exit 0
  fi
  chosen=$PYTHON
else
  chosen=""
  found=""
  for candidate in python3 python3.12 python3.13 python3.11; do
    reason=$(obstacle "$candidate")
    case $reason in
      "") chosen=$candidate && break ;;
      "does not run") ;; # not there, or a pyenv shim of a version that is not active
      *) found="$found $candidate $reason;" ;;
    esac
  done
  [ -n "$chosen" ] ||
    fail "Python 3.11, 3.12 or 3.13 is needed:${found:- none is on PATH;} install one or name it: make PYTHON=/path/to/python3.12"
fi

"$chosen" -m venv --clear "$folder"
touch "$folder/complete"
