#!/usr/bin/env bash
# Measures the batch estimator: convergence, consistency, image-only beside image-and-inertial, and
# speed against Ceres (where vio_bench_batch was built):
#   tests/figures_batch.sh [--long] [DATA_DIR]
# --long: the full number of seeds (hours of one core), and Ceres on two threads too.
# DATA_DIR holds euroc_v101_imu_gt (default: $VIO_DATA, else ../shared/data).
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

long=""
[[ ${1:-} == --long ]] && long=yes && shift
readonly DATA=${1:-${VIO_DATA:-../shared/data}}
readonly TESTS=build/release/tests
readonly RECORDED=$DATA/euroc_v101_imu_gt/groundtruth.csv

figures() {
    echo "== $1"
    "$TESTS/vio_batch_figures" "$1" datasets "${@:2}"
}

few() { if [[ $long ]]; then echo "$1"; else echo "$2"; fi; }

figures arm "$(few 10 2)"
figures poor "$(few 10 2)"
figures rotations "$(few 100 10)"
figures image_only "$(few 20 3)"
if [[ -f $RECORDED ]]; then
    figures nees "$(few 200 20)" "$RECORDED"
else
    figures nees "$(few 200 20)"
fi

if [[ -x $TESTS/vio_bench_batch ]]; then
    echo "== speed"
    bench=("$TESTS/vio_bench_batch" datasets/rover.ini)
    [[ -f $RECORDED ]] && bench+=(datasets/v101_tracks.ini --truth "$RECORDED")
    "${bench[@]}"
    "$TESTS/vio_bench_batch" --scaling
fi
