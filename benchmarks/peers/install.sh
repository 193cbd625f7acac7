#!/bin/sh
# Set up the peers, each in a virtual environment of its own under .peers/, from public registries only.
#
#     sh benchmarks/peers/install.sh [felupe] [ngsolve] [dolfinx] [calculix]
#
# What cannot be had is reported and left out; run.py then shows it as a row that says so. FEBio is not in any of these
# registries: put `febio4` on the path and run.py finds it.
here=$(cd "$(dirname "$0")" && pwd)
peers=${*:-felupe ngsolve dolfinx calculix}

environment() { # name, Python, packages…
    name=$1 python=$2
    shift 2
    "$python" -m venv "$here/.peers/$name" && "$here/.peers/$name/bin/pip" install --quiet "$@" ||
        echo "$name could not be installed" >&2
}

python_from() { # the first of these that runs
    for candidate in "$@"; do
        "$candidate" --version >/dev/null 2>&1 && { echo "$candidate"; return; }
    done
    echo python3
}

for peer in $peers; do
    case $peer in
    felupe) environment felupe python3 'felupe==11.3.0' 'pypardiso==0.4.7' 'einsumt==0.9.4' ;;
    ngsolve) environment ngsolve python3 'ngsolve==6.2.2608' ;;
    dolfinx) # the wheel with PETSc and MUMPS asks for Python 3.12
        python=$(python_from python3.12 "$HOME"/.pyenv/versions/3.12.*/bin/python)
        environment dolfinx "$python" 'dolfinx-solver-real==0.11.0.post0'
        ;;
    calculix)
        command -v ccx >/dev/null ||
            { test "$(id -u)" = 0 && apt-get install --yes --no-install-recommends calculix-ccx; } ||
            echo "CalculiX: as root, apt-get install calculix-ccx" >&2
        ;;
    *) echo "no such peer: $peer" >&2 ;;
    esac
done
