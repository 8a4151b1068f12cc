#!/bin/sh
# Whether systemd understands the units, finds them tight enough, and Glint understands their words.
# Usage: check_units.sh GLINT FOLDER
set -eu
glint="$1"
folder="$(mktemp -d)"
trap 'rm -rf "$folder"' EXIT
for unit in "$2"/*.service; do
  name="$(basename "$unit")"
  sed "s|/usr/local/bin/glint|$glint|" "$unit" > "$folder/$name"
  systemd-analyze verify "$folder/$name" 2> "$folder/said" || true
  if [ -s "$folder/said" ]; then
    cat "$folder/said" >&2
    exit 1
  fi
  # Of 100: how exposed it leaves the machine.
  systemd-analyze security --offline=yes --threshold=20 --no-pager "$folder/$name" > "$folder/exposure" || {
    grep -E '✗|Overall' "$folder/exposure" >&2
    exit 1
  }
  command="$(sed -n 's|^ExecStart=/usr/local/bin/glint \([a-z]*\).*|\1|p' "$unit")"
  "$glint" "$command" --help > "$folder/help"
  sed -n 's/^ExecStart=//p; s/^#.*_OPTIONS=//p' "$unit" | grep -o -e '--[a-z][a-z-]*' | while read -r word; do
    if ! grep -q -e "$word" "$folder/help"; then
      echo "$name: 'glint $command' has no $word" >&2
      exit 1
    fi
  done
done
