#!/bin/sh
# Set up the peers, each in a virtual environment of its own under .peers/, from public registries only.
#
#     sh benchmarks/peers/install.sh [felupe] [ngsolve] [dolfinx] [calculix] [febio]
#
# What cannot be had is reported and left out; run.py then shows it as a row that says so. FEBio is in none of these
# registries and is only built when it is named: git, cmake and a C++ compiler make it from its source (FEBIO_SOURCE, or
# its repository at the tag below) with MKL, in half an hour on two cores. A `febio4` on the path is taken as it is.
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

build_febio() {
    home=$here/.peers/febio
    mkl=$home/lib
    # MKL 2026 has lost functions that FEBio 4.11 calls.
    environment febio python3 --no-deps 'mkl-static==2025.3.0' 'mkl-include==2025.3.0' 'intel-openmp==2025.3.0' &&
        { test -d "$home/source" ||
            git clone --quiet --depth 1 --branch v4.11 "${FEBIO_SOURCE:-https://github.com/febiosoftware/FEBio}" \
                "$home/source"; } &&
        # Some of its files use C's functions of strings without saying so.
        cmake -S "$home/source" -B "$home/build" -DUSE_MKL=ON -DMKL_INC="$home/include" -DMKL_LIB_DIR="$mkl" \
            -DMKL_OMP_LIB="$mkl/libiomp5.so" -DCMAKE_CXX_FLAGS='-include cstring' >/dev/null &&
        cmake --build "$home/build" --target febio4 --parallel 2 >/dev/null &&
        ln -sf "$mkl/libiomp5.so" "$home/build/lib/" && ln -sf ../build/bin/febio4 "$home/bin/febio4" ||
        echo "FEBio could not be built" >&2
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
    febio) command -v febio4 >/dev/null || build_febio ;;
    *) echo "no such peer: $peer" >&2 ;;
    esac
done
