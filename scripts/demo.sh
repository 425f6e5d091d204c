#!/usr/bin/env bash
# The demo of `make run`: a small city on some world daemons, shown in the browser, until Ctrl-C.
#   demo.sh BIN_DIR [WORLDS] [BODIES] [PORT]
set -euo pipefail
bin=$1 worlds=${2:-4} bodies=${3:-3000} port=${4:-8080}
folder=$(mktemp -d)
session=demo-$$
viewer=
trap 'rm -rf "$folder"; [ -z "$viewer" ] || kill "$viewer" 2>/dev/null || true' EXIT
"$bin/soda" scene make demo --bodies "$bodies" --seed 1 -o "$folder/demo.scene"
if [ -e "$bin/../share/soda/viewer/index.html" ]; then
  view() { "$bin/soda" view --session "$session" --port "$1" & viewer=$!; sleep 1; }  # it says where, above the table
  view "$port"
  if ! kill -0 "$viewer" 2>/dev/null; then
    echo "the viewer did not start at port $port: trying another one"
    view 0
  fi
else
  echo "the viewer's page was not built (no Node.js 18): the demo is shown here only"
fi
echo "the session's name: $session (soda status --session $session, and so on)"
# In the background, and in a group of its own, so that whatever ends this script ends the run, too.
set -m
"$bin/soda" run "$folder/demo.scene" --session "$session" --worlds "$worlds" --steps 100000000 --pace realtime &
run=$!
set +m
trap 'kill -INT "$run" 2>/dev/null || true' INT
trap 'kill -TERM "$run" 2>/dev/null || true' TERM HUP
status=0
while kill -0 "$run" 2>/dev/null; do
  wait "$run" && status=0 || status=$?
done
exit "$status"
