#!/bin/sh
# Installs what is missing, fuzzes the file readers for a bounded time, builds everything and runs all tests; ends with
# ctest's summary.
set -eu
cd "$(dirname "$0")/.."

deploy/install-packages.sh clang libclang-rt-14-dev shellcheck systemd yamllint

cmake --preset fuzz
cmake --build --preset fuzz
ctest --preset fuzz -j "$(nproc)" --no-label-summary

cmake --preset release
cmake --build --preset release
ctest --preset release --timeout 600 -j "$(nproc)" --no-label-summary
