#!/bin/sh
# Makes an authority of your own, and certificates by it: for trying out, and for a run among machines that you trust.
#
#     examples/hosts/authority.sh certificates sim.example.org planner viewer
#
# makes the folder `certificates` with ca.pem, and NAME.pem and NAME-key.pem for `sim` and for each NAME behind the host. Certificates are
# valid for 30 days. The sim's is for the host that is named, for localhost and for 127.0.0.1. Give a node ca.pem and its own two files, and
# nothing else; whoever has ca-key.pem can be anybody. Needs openssl 1.1.1 or later. Run it again for more names: what is there is kept.
set -eu
umask 077

if [ $# -lt 2 ]; then
    echo "usage: $0 FOLDER HOST [NAME...]" >&2
    exit 2
fi
folder=$1 host=$2
shift 2
mkdir -p "$folder"
cd "$folder"

key() {
    openssl ecparam -name prime256v1 -genkey -noout | openssl pkcs8 -topk8 -nocrypt -out "$1-key.pem"
}

# certificate NAME EXTENSIONS: by the authority
certificate() {
    [ -e "$1.pem" ] && return
    key "$1"
    printf '%s\n' "basicConstraints=critical,CA:FALSE" "keyUsage=critical,digitalSignature" "$2" > extensions
    openssl req -new -key "$1-key.pem" -subj "/CN=$1" |
        openssl x509 -req -CA ca.pem -CAkey ca-key.pem -set_serial "0x$(openssl rand -hex 16)" -days 30 -extfile extensions -out "$1.pem" 2> errors ||
        { cat errors >&2; exit 1; }
    rm extensions errors
}

if [ ! -e ca.pem ]; then
    key ca
    openssl req -x509 -new -key ca-key.pem -subj "/CN=authority of $host" -days 30 -out ca.pem \
        -addext "basicConstraints=critical,CA:TRUE" -addext "keyUsage=critical,keyCertSign"
fi
case $host in
    *[!0-9.]*) name=DNS:$host ;;
    *) name=IP:$host ;;
esac
certificate sim "subjectAltName=$name,DNS:localhost,IP:127.0.0.1"
for node; do
    certificate "$node" "extendedKeyUsage=clientAuth"
done
