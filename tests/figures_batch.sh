#!/usr/bin/env bash
# Measures the batch estimator: convergence, consistency, image-only beside image-and-inertial, a
# flight with rendered images (the filter's too), and speed against Ceres (where vio_bench_batch
# was built):
#   tests/figures_batch.sh [--long] [--only SECTION[,SECTION...]] [DATA_DIR]
# SECTION: arm poor rotations image_only nees rendered speed scaling (default: all).
# --long: the full number of seeds (hours of one core).
# DATA_DIR holds euroc_v101_imu_gt (default: $VIO_DATA, else ../shared/data).
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

long="" only=""
while [[ ${1:-} == --* ]]; do
    case $1 in
        --long) long=yes ;;
        --only)
            only=,${2:?--only: which sections?},
            shift
            ;;
        *)
            echo "figures_batch.sh: no option '$1'" >&2
            exit 2
            ;;
    esac
    shift
done
readonly DATA=${1:-${VIO_DATA:-../shared/data}}
readonly TESTS=build/release/tests
readonly RECORDED=$DATA/euroc_v101_imu_gt/groundtruth.csv

wanted() { [[ -z $only || $only == *,$1,* ]]; }
few() { if [[ $long ]]; then echo "$1"; else echo "$2"; fi; }

# figures TABLE SEEDS [TRUTH]
figures() {
    wanted "$1" || return 0
    echo "== $1"
    "$TESTS/vio_batch_figures" "$1" datasets "${@:2}"
}

figures arm "$(few 10 2)"
figures poor "$(few 10 2)"
figures rotations "$(few 100 10)"
figures image_only "$(few 20 3)"
truth=()
[[ -f $RECORDED ]] && truth=("$RECORDED")
figures nees "$(few 200 20)" "${truth[@]}"

if wanted rendered && [[ -f $RECORDED ]]; then
    echo "== V1_01's path with rendered images, simulated readings, own tracking" \
        "(bars: batch 1.2, filter 1.9 cm)"
    mkdir -p out/figures
    made=out/figures/v101_rendered
    vio_slam=build/release/app/vio-slam
    [[ -f $made.rawlog ]] || # two minutes
        "$vio_slam" simulate datasets/v101.ini --truth "$RECORDED" -o "$made.rawlog"
    for estimator in batch iekf; do
        echo "-- $estimator"
        "$vio_slam" run "$made.rawlog" --estimator $estimator --output "$made.$estimator" \
            --overwrite | grep -E 'cost|time'
        "$vio_slam" evaluate "$made.$estimator" --against "$made.truth.tum" --align se3 |
            grep -E 'completion|scale|average|position +0|rotation +0'
    done
fi

if wanted speed && [[ -x $TESTS/vio_bench_batch ]]; then
    echo "== speed"
    bench=("$TESTS/vio_bench_batch" datasets/rover.ini)
    [[ -f $RECORDED ]] && bench+=(datasets/v101_tracks.ini --truth "$RECORDED")
    "${bench[@]}"
fi
if wanted scaling && [[ -x $TESTS/vio_bench_batch ]]; then
    "$TESTS/vio_bench_batch" --scaling
fi
