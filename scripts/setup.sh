#!/usr/bin/env bash
# Installs the Debian 12 packages that SODA is built from and that are missing here, and says which.
# Does nothing when all are there. Needs root or sudo only when something is missing.
#   setup.sh        what building and running need
#   setup.sh test   also what only tests need: a browser
set -euo pipefail

packages=(
  build-essential cmake ninja-build pkg-config ccache git   # build
  libbullet-dev libeigen3-dev                               # physics: shapes and narrow phase; vectors
  libfastrtps-dev libfastcdr-dev fastddsgen                 # Fast DDS and its IDL compiler
  libprotobuf-dev protobuf-compiler                         # scene files
  libsdformat-dev libassimp-dev libtinyxml2-dev             # SDF worlds and meshes
  libspdlog-dev libcli11-dev libxxhash-dev libzstd-dev      # logs, options, hashes, compression
  libboost-dev                                              # the viewer's gateway (Beast)
  nlohmann-json3-dev                                        # exported files
  cyclonedds-dev cyclonedds-tools                           # tests: another vendor's DDS reads ours
  libgtest-dev libbenchmark-dev                             # tests and micro-benchmarks
  gnuplot-nox                                               # pictures
)

# The viewer's page is built with Node.js: one that is installed already, if it is new enough, else Debian's.
node_major=$(node --version 2>/dev/null | sed 's/^v\([0-9]*\).*/\1/') || node_major=0
if [ "${node_major:-0}" -lt 18 ] || ! command -v npm >/dev/null; then
  packages+=(nodejs npm)
fi

if [ "${1:-}" = test ]; then
  packages+=(chromium fonts-dejavu-core)                    # the page's tests; text on its screenshots
fi

missing=()
for package in "${packages[@]}"; do
  [ "$(dpkg-query -W -f='${db:Status-Status}' "$package" 2>/dev/null)" = installed ] || missing+=("$package")
done
[ ${#missing[@]} -eq 0 ] && exit 0

echo "SODA needs these Debian packages, which are not installed here:"
printf '  %s\n' "${missing[@]}"
sudo=()
if [ "$(id -u)" -ne 0 ]; then
  if ! command -v sudo >/dev/null; then
    echo "error: neither root nor sudo; install them yourself:  apt-get install ${missing[*]}" >&2
    exit 1
  fi
  sudo=(sudo)
fi
echo "installing them (apt-get install) ..."
export DEBIAN_FRONTEND=noninteractive
"${sudo[@]}" apt-get update -qq
"${sudo[@]}" env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends "${missing[@]}" >/dev/null
echo "done."
