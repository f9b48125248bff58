#!/usr/bin/env bash
# Follows share/TUTORIAL.md to the letter: runs its shell blocks in order in an empty folder, against
# an installed program.
#   tutorial.sh PREFIX TUTORIAL WORK [EUROC]
# Blocks marked "data" need EuRoC's MH_01_easy; EUROC stands for it, without it they are left out.
set -euo pipefail
prefix=$(realpath "$1") tutorial=$(realpath "$2") work=$3 euroc=${4:-}
rm -rf "$work"
mkdir -p "$work"
cd "$work"
[[ -d $euroc ]] && ln -s "$(realpath "$euroc")" MH_01_easy
export PATH=$prefix/bin:$PATH VIO=$prefix/share/vio-slam

# One script of all blocks, so that variables last; each line is shown as it runs.
awk -v data="$([[ -e MH_01_easy ]] && echo 1 || echo 0)" '
    /^```/ && inside { inside = 0; next }
    /^```sh( data)?$/ { inside = 1; take = $2 != "data" || data; next }
    inside && take' "$tutorial" >tutorial.sh
(($(wc -l <tutorial.sh) > 20)) || { echo "the tutorial has hardly a command" >&2; exit 1; }
bash -euxo pipefail tutorial.sh

# What it promises.
for file in out/demo/snapshot.png out/demo/trajectory.tum imu.ini demo_top.png demo_tracks.mp4 again.rawlog; do
    [[ -s $file ]] || { echo "the tutorial made no $file" >&2; exit 1; }
done
# There and back: the same observations, whose sensors bear the names of the layout.
what_it_holds() { vio-slam info "$1" | sed 1d; }
what_it_holds demo.rawlog >demo.info
what_it_holds again.rawlog >again.info
cmp demo.info again.info
if [[ -e MH_01_easy ]]; then
    # Tables of the same recording tell the same path.
    vio-slam evaluate out/tables --against out/iekf/trajectory.tum --align none | tee tables.txt
    awk '/^ *position/ && !seen++ { exit !($5 < 1e-3) }' tables.txt
    [[ -s out/iekf.html ]]
else
    echo "without EuRoC's MH_01 (VIO_DATA): its blocks were left out"
fi
echo "the tutorial holds"
