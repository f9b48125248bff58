#!/bin/sh
# Arranges the camera-IMU calibration recording euroc_imu_april as an ASL data set, by links:
#   make_april_asl.sh DATA_DIR OUT_DIR        (DATA_DIR holds cam0_corners.csv.gz, imu0.csv, ...)
# Then: vio-slam import asl OUT_DIR -o april.rawlog
set -eu
if [ $# -ne 2 ]; then
    echo "usage: $0 DATA_DIR OUT_DIR" >&2
    exit 2
fi
data=$(cd "$1" && pwd)
for file in cam0_corners.csv.gz cam0_sensor.yaml imu0.csv imu0_sensor.yaml; do
    if [ ! -f "$data/$file" ]; then
        echo "$0: $data/$file: no such file" >&2
        exit 1
    fi
done
mkdir -p "$2/mav0/cam0" "$2/mav0/imu0"
ln -sf "$data/cam0_corners.csv.gz" "$2/mav0/cam0/features.csv.gz"
ln -sf "$data/cam0_sensor.yaml" "$2/mav0/cam0/sensor.yaml"
ln -sf "$data/imu0.csv" "$2/mav0/imu0/data.csv"
ln -sf "$data/imu0_sensor.yaml" "$2/mav0/imu0/sensor.yaml"
