#!/usr/bin/env bash
# The demo of `make run`: a small city on some world daemons, watched in the terminal.
#   demo.sh BIN_DIR [WORLDS] [BODIES] [SECONDS]
set -euo pipefail
bin=$1 worlds=${2:-4} bodies=${3:-3000} seconds=${4:-10}
scene=$(mktemp -d)/demo.scene
trap 'rm -rf "$(dirname "$scene")"' EXIT
"$bin/soda" scene make demo --bodies "$bodies" --seed 1 -o "$scene"
"$bin/soda" run "$scene" --worlds "$worlds" --steps $((seconds * 60)) --pace realtime
