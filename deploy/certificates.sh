#!/bin/sh
# Makes an authority and the certificates of one cluster, for trying it out and for small clusters without an authority
# of their own. What is there already stays: remove a certificate to have it made anew.
# Usage: deploy/certificates.sh FOLDER [HOST...]   HOST: names and addresses of the machines of NATS and the service
#   ca       signs the others; keep ca.key away from the cluster
#   nats     the NATS server            service  `glint serve`, towards its clients
#   coordinator, worker                 who they are to NATS: deploy/nats.conf names what each may do
#   client   of the service
set -eu
umask 077
if [ $# -lt 1 ]; then
  sed -n '/^# Usage/,/^set/p' "$0" | sed '$d; s/^# //' >&2
  exit 2
fi
folder="$1"
shift
days="${GLINT_CERTIFICATE_DAYS:-825}"
mkdir -p "$folder"

hosts="DNS:localhost,IP:127.0.0.1"
for host in "$@"; do
  case "$host" in
    *:* | *[0-9].*[0-9].*[0-9].*[0-9]) hosts="$hosts,IP:$host" ;;
    *) hosts="$hosts,DNS:$host" ;;
  esac
done

new_key() {
  openssl genpkey -algorithm EC -pkeyopt ec_paramgen_curve:P-256 -out "$folder/$1.key"
}

# NAME EXTENSIONS: a certificate that the authority signs.
issue() {
  if [ -e "$folder/$1.pem" ]; then
    return
  fi
  new_key "$1"
  printf '%s\n' "$2" "basicConstraints = critical, CA:FALSE" "keyUsage = critical, digitalSignature" > "$folder/$1.ext"
  openssl req -new -key "$folder/$1.key" -subj "/O=Glint/CN=$1" |
    openssl x509 -req -CA "$folder/ca.pem" -CAkey "$folder/ca.key" -days "$days" -extfile "$folder/$1.ext" \
      -out "$folder/$1.pem" 2> /dev/null
  rm "$folder/$1.ext"
}

if [ ! -e "$folder/ca.pem" ]; then
  new_key ca
  openssl req -x509 -new -key "$folder/ca.key" -subj "/O=Glint/CN=authority" -days "$days" \
    -addext "keyUsage = critical, keyCertSign, cRLSign" -out "$folder/ca.pem"
fi
for server in nats service; do
  issue "$server" "subjectAltName = $hosts
extendedKeyUsage = serverAuth"
done
# NATS takes the address as the user's name.
for user in coordinator worker; do
  issue "$user" "subjectAltName = email:$user@glint
extendedKeyUsage = clientAuth"
done
issue client "extendedKeyUsage = clientAuth"
echo "certificates and keys are in $folder"
