#!/bin/sh
# Whether the container file installs the package of every library that the program needs.
# Usage: check_container.sh GLINT CONTAINERFILE
set -eu
missing=0
for library in $(objdump -p "$1" | awk '/NEEDED/ { print $2 }'); do
  file="$(ldd "$1" | awk -v library="$library" '$1 == library && $3 { print $3 }')"
  if [ -z "$file" ]; then
    continue # the loader itself
  fi
  # /lib and /usr/lib are one folder to the loader and two to dpkg.
  package="$({ dpkg -S "$file" || dpkg -S "/usr$file"; } 2> /dev/null | cut -d: -f1)"
  case "$package" in
    libc6 | libgcc-s1 | libstdc++6) continue ;; # in every image
  esac
  if [ -z "$package" ] || ! grep -qw -e "$package" "$2"; then
    echo "$2 does not install ${package:-the package} that $library is from" >&2
    missing=1
  fi
done
exit "$missing"
