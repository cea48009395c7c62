#!/usr/bin/env bash
# List what a run's environment holds as a CycloneDX SBOM, the same bytes every time.
#
#   release/sbom.sh PYTHON FOLDER
#
# PYTHON has the extra `dev`; FOLDER has the wheel, and takes NAME-VERSION.cdx.json. The environment
# is made anew, with the wheel, its extra `ros` and the versions of constraints.txt.
set -euo pipefail

[ $# = 2 ] || { echo "usage: release/sbom.sh PYTHON FOLDER, got $# arguments" >&2; exit 2; }
python=$1
folder=$(realpath "$2")
root=$(cd "$(dirname "$0")/.." && pwd)
shopt -s nullglob
wheels=("$folder"/cable_winding_twin-*.whl)
[ ${#wheels[@]} = 1 ] || { echo "error: one wheel is needed in $folder, got ${#wheels[@]}: make dist" >&2; exit 2; }
wheel=$(basename "${wheels[0]}")
version=$(cut -d - -f 2 <<< "$wheel")

made=$(mktemp -d)
trap 'rm -rf "$made"' EXIT
# Without pip and setuptools: a run needs neither.
"$python" -m venv --without-pip "$made/environment"
pip=("$python" -m pip --python "$made/environment/bin/python" install --quiet --no-compile)
# Taken by name from the folder: a path would be written into the list.
"${pip[@]}" --no-index --no-deps --find-links "$folder" "cable-winding-twin==$version"
"${pip[@]}" --constraint "$root/constraints.txt" "cable-winding-twin[ros]==$version"
"$python" -m cyclonedx_py environment --output-reproducible --pyproject "$root/pyproject.toml" \
    --output-file "$folder/cable_winding_twin-$version.cdx.json" "$made/environment/bin/python"
