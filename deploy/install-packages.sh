#!/bin/sh
# Installs the Debian 12 packages that Glint is built from; nothing is downloaded if all are there.
# Extra package names may follow.
set -eu

packages="build-essential cmake ninja-build pkg-config
  libembree-dev libtinygltf-dev libstb-dev libdraco-dev libopenexr-dev libpng-dev
  libglm-dev libzstd-dev libxxhash-dev libssl-dev openssl nlohmann-json3-dev libcli11-dev libgtest-dev librapidcheck-dev
  libcpp-httplib-dev libnats-dev nats-server libgrpc++-dev libprotobuf-dev protobuf-compiler protobuf-compiler-grpc libsqlite3-dev
  libopenmesh-dev
  gnuplot-nox $*"

missing=""
for package in $packages; do
  if ! dpkg-query -W -f='${Status}' "$package" 2>/dev/null | grep -q '^install ok installed$'; then
    missing="$missing $package"
  fi
done
if [ -z "$missing" ]; then
  exit 0
fi

sudo=""
if [ "$(id -u)" -ne 0 ]; then
  sudo="sudo"
fi
$sudo apt-get update
# shellcheck disable=SC2086  # one word a package
$sudo env DEBIAN_FRONTEND=noninteractive apt-get install -y --no-install-recommends $missing
