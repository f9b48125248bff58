#!/usr/bin/env bash
# Opens what a run wrote with the programs that MRPT's users open it with, and takes a picture of
# each window to look at:
#   tests/mrpt_programs.sh RESULT PICTURES
# Needs: apt install mrpt-apps xvfb imagemagick
set -euo pipefail
readonly HERE=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
readonly RESULT=$(realpath "$1")
mkdir -p "$2"
cd "$2"

Xvfb :93 -screen 0 1280x900x24 >xvfb.log 2>&1 &
readonly XVFB=$!
trap 'kill $XVFB' EXIT
export DISPLAY=:93
sleep 2

# window NAME COMMAND...: the picture of a program's window, which is then closed.
window() {
    local name=$1
    shift
    "$@" >"$name.log" 2>&1 </dev/null &
    local program=$!
    sleep "${VIO_WINDOW_SECONDS:-8}"
    import -window root "$name.png"
    kill "$program" 2>/dev/null || echo "$name: ended by itself; see $name.log"
    wait "$program" 2>/dev/null || true
}

window SceneViewer3D SceneViewer3D "$RESULT/scene.3Dscene"
window robot-map-gui robot-map-gui "$RESULT/keyframes.simplemap"
window graph-slam graph-slam --3d --view -i "$RESULT/keyframes.graph"

echo "== graph-slam: the graph, and its optimum =="
graph-slam --3d --info -i "$RESULT/keyframes.graph" </dev/null | grep count
graph-slam --3d --levmarq -i "$RESULT/keyframes.graph" -o optimised.graph </dev/null >levmarq.log 2>&1
grep -c VERTEX optimised.graph

echo "== observations2map: a map of points from the key-frames =="
observations2map "$HERE/share/points_map.ini" "$RESULT/keyframes.simplemap" map </dev/null |
    grep -i "done"
wc -l map_*.txt
