#!/bin/sh
# Make sure that the system libraries which gmsh and VTK load are there: install them where that is possible,
# otherwise say which Debian packages hold them.
python=$1
missing=$("$python" -m turgor doctor --missing-packages) || exit 1
[ -z "$missing" ] && exit 0
if [ "$(id -u)" = 0 ] && command -v apt-get >/dev/null; then
    echo "installing system libraries: $missing"
    # shellcheck disable=SC2086
    { apt-get update && apt-get install --yes --no-install-recommends $missing; } >/dev/null && exit 0
fi
echo "System libraries are missing. On Debian or Ubuntu: sudo apt-get install $missing" >&2
exit 1
