#!/bin/sh
# From a fresh clone on Debian 12 to pictures: install, build, bake the generated teapot, render it.
# Usage: deploy/quickstart.sh [FOLDER]   where the results go; default: out/quickstart in the clone
set -eu
cd "$(dirname "$0")/.."
out="${1:-out/quickstart}"

deploy/install-packages.sh
cmake --preset release
cmake --build --preset release --target glint

glint=build/release/tools/glint
mkdir -p "$out"
"$glint" scene teapot --vertices 10000 -o "$out/teapot.glb"
"$glint" bake "$out/teapot.glb" -o "$out/teapot.glint" --layers 2
"$glint" verify "$out/teapot.glint"
for sky in studio sunset; do
  for kind in png exr; do
    "$glint" render "$out/teapot.glint" --env "procedural:$sky" --size 1024x768 --background environment \
      -o "$out/teapot-$sky.$kind"
  done
done

echo
echo "Archive:  $out/teapot.glint"
echo "Report:   $out/teapot.glint.json   (or: $glint inspect $out/teapot.glint)"
echo "Pictures: $out/teapot-studio.png $out/teapot-sunset.png (.exr: linear)"
