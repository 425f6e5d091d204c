#!/usr/bin/env bash
# Makes the pictures of the viewer in docs/images from the running program: a session of four worlds, watched by
# Chromium without a window. Needs `make build` and `scripts/setup.sh test` before.
#   screenshots.sh [BIN_DIR] [OUT_DIR]
set -euo pipefail
cd "$(dirname "$0")/.."
bin=$(realpath "${1:-build/release/bin}") out=$(realpath -m "${2:-docs/images}")
folder=$(mktemp -d)
session=screenshots-$$
running=()
finish() {
  for pid in "${running[@]}"; do kill "$pid" 2>/dev/null && wait "$pid" 2>/dev/null || true; done
  rm -rf "$folder"
}
trap finish EXIT

"$bin/soda" scene make demo --bodies 1500 --seed 1 -o "$folder/demo.scene"
"$bin/soda" view --session "$session" --port 0 --token screenshots >"$folder/view.log" 2>&1 &
running+=($!)
"$bin/soda" run "$folder/demo.scene" --session "$session" --worlds 4 --steps 100000000 -q >"$folder/run.log" 2>&1 &
running+=($!)
until url=$(grep -o 'http://[^ ]*' "$folder/view.log"); do sleep 0.1; done

# Software draws a picture in seconds: the session is held meanwhile, early, while much still moves.
sleep 5
"$bin/soda" pause --session "$session"

# NAME HASH KEYS: keys pressed one after the other (docs/viewer.md, or `?` on the page, says what they do)
shot() {
  echo "$1 ..."
  npm --prefix client/viewer/page run --silent shots -- --url "$url" --out "$out" --name "$1" --format jpeg \
    --hash "quality=high&$2" --keys "$3" --width 1280 --height 860 "${@:4}"
}
near=cam=30,-34,17,8,-2,0
shot viewer "$near&colour=body" ""
shot viewer_worlds "$near&colour=world&show=bnm" ""
shot viewer_future "$near&colour=speed" "Shift+ArrowRight Shift+ArrowRight Shift+ArrowRight"
shot viewer_light "$near&colour=sleep&show=b" "" --light
