#!/bin/sh
# Installs what is missing, builds everything, runs all tests; ends with ctest's summary.
set -eu
cd "$(dirname "$0")/.."

deploy/install-packages.sh
cmake --preset release
cmake --build --preset release
ctest --preset release --output-on-failure --timeout 600 -j "$(nproc)"
