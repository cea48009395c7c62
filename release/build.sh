#!/usr/bin/env bash
# Build the source archive and the wheel of the last commit, byte for byte the same every time.
#
#   release/build.sh PYTHON FOLDER
#
# PYTHON has the extra `dev`; FOLDER takes the two files. What lies in the clone uncommitted, or was
# left by an earlier build, takes no part. The wheel is built from the source archive.
set -euo pipefail

[ $# = 2 ] || { echo "usage: release/build.sh PYTHON FOLDER, got $# arguments" >&2; exit 2; }
python=$1
mkdir -p "$2"
target=$(realpath "$2")
cd "$(dirname "$0")/.."
git rev-parse --verify --quiet HEAD > /dev/null \
    || { echo "error: a release is built from a commit, and this folder is no git clone" >&2; exit 2; }

export SOURCE_DATE_EPOCH=${SOURCE_DATE_EPOCH:-$(git log -1 --format=%ct)}
# Modes of files go into the archives.
umask 022
source=$(mktemp -d)
trap 'rm -rf "$source"' EXIT
git -c tar.umask=0022 archive HEAD | tar --extract --directory "$source"
"$python" -m build --no-isolation --outdir "$target" "$source" > "$source/build.log" 2>&1 \
    || { cat "$source/build.log" >&2; exit 1; }
"$python" -m twine check --strict "$target"/*.tar.gz "$target"/*.whl
