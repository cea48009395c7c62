#!/usr/bin/env bash
# Build the image and run the demo in it where no container registry and no Docker engine is at
# hand: a Debian root file system is bootstrapped here, buildah does the rest. Needs root, buildah
# and mmdebstrap (apt), about 6 GB of disk and ten minutes.
#
#   docker/build_without_registry.sh [FOLDER]
#
# FOLDER (./container-build by default) takes the storage; nothing is written elsewhere.
# MOUNTS names what the build must see of this machine, read-only and in no layer, such as a pip
# configuration, certificates or wheels: MOUNTS="/etc/pip.conf /srv/wheels".
set -euo pipefail

root=$(cd "$(dirname "$0")/.." && pwd)
work=$(realpath --canonicalize-missing "${1:-container-build}")
suite=${SUITE:-bookworm}
for tool in buildah mmdebstrap; do
    command -v "$tool" > /dev/null || { echo "error: $tool is not installed" >&2; exit 2; }
done
[ "$(id -u)" = 0 ] || { echo "error: building without a registry needs root" >&2; exit 2; }
mkdir -p "$work"

storage=(--root "$work/storage" --runroot "$work/run" --storage-driver vfs)
mounts=()
for path in ${MOUNTS:-}; do
    mounts+=(--volume "$path:$path:ro")
done

if ! buildah "${storage[@]}" inspect --type image localhost/debian-base > /dev/null 2>&1; then
    mmdebstrap --variant=minbase --include=ca-certificates "$suite" "$work/base.tar"
    base=$(buildah "${storage[@]}" from scratch)
    buildah "${storage[@]}" add "$base" "$work/base.tar" /
    buildah "${storage[@]}" commit --rm "$base" localhost/debian-base
    rm "$work/base.tar"
fi

buildah "${storage[@]}" bud --isolation chroot --network host --pull-never --format docker \
    --file "$root/docker/Dockerfile" --ignorefile "$root/docker/Dockerfile.dockerignore" \
    --build-arg BASE=localhost/debian-base \
    "${mounts[@]}" --tag cable-winding-twin "$root"

# The demo, inside, as the image's own user.
container=$(buildah "${storage[@]}" from --pull-never cable-winding-twin)
buildah "${storage[@]}" run --isolation chroot --network host "$container" -- \
    winding-entrypoint winding run --case 4 --duration-s "${DURATION:-20}" --output runs/demo
buildah "${storage[@]}" run --isolation chroot "$container" -- ls -l runs/demo/report runs/demo/run.json
buildah "${storage[@]}" rm "$container" > /dev/null
buildah "${storage[@]}" images
