#!/usr/bin/env bash
# What `calibrate imu` finds in simulated hours at rest, beside the densities that they were made with,
# and what the presets of share/ reach on simulated recordings of their kind: about 15 s.
#   tests/figures_sensors.sh
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
readonly OUT=out/figures VIO_SLAM=build/release/app/vio-slam
mkdir -p "$OUT"

echo "IMU at rest, 1 h at 100 Hz: gyro 1.7e-4, 2e-5; accelerometer 2e-3, 3e-4 (white noise, walk)"
cat >"$OUT/still.ini" <<'END'
[trajectory]
waypoints = 0 0 0 1 0 0 0, 3600 0 0 1 0 0 0
[camera]
width = 640
height = 480
intrinsics = 460 460 319.5 239.5
rate = 0.01
first_image = 1
count = 36
[images]
render = false
[imu]
rate = 100
gyro_noise_density = 1.7e-4
accel_noise_density = 2e-3
gyro_bias_random_walk = 2e-5
accel_bias_random_walk = 3e-4
END
"$VIO_SLAM" simulate "$OUT/still.ini" -o "$OUT/still.rawlog" >/dev/null
"$VIO_SLAM" calibrate imu "$OUT/still.rawlog" -o "$OUT/still_imu.ini" |
    grep -E "^(gyro|accelerometer)|  all"

# preset NAME SCENARIO MOTION IMU: the built-in options, and the preset.
preset() {
    "$VIO_SLAM" simulate "$2" -o "$OUT/$1.rawlog" >/dev/null
    local options result
    for options in "" "--config share/presets/$3.ini --calibration share/imu/$4.ini"; do
        result="$OUT/preset_$1"
        # shellcheck disable=SC2086
        taskset -c 0 "$VIO_SLAM" run "$OUT/$1.rawlog" -o "$result" --overwrite $options >"$result.log"
        "$VIO_SLAM" evaluate "$result" --against "$OUT/$1.truth.tum" --rawlog "$OUT/$1.rawlog" |
            awk -v name="$1, ${options:+$3 and $4}${options:-built-in options}" '
                BEGIN { sub(/--config.*/, "", name) }
                $1 == "completion" { share = $2 } $1 == "scale" { scale = $3 }
                /^ *position/ && !seen++ {
                    printf "%-44s %8.2f cm  scale %7s  complete %s %%\n", name, 100 * $3, scale, share }'
    done
}
echo
echo "Presets: position RMSE after SE(3) alignment"
cat >"$OUT/rover_200s.ini" <<END
[scenario]
include = $PWD/datasets/rover.ini
[trajectory]
route = 15.4 0.0, 12.3 6.1, 4.4 9.6, -4.4 9.2, -12.9 6.9, -14.1 0.4, -11.4 -5.5, -4.7 -9.5
duration = 200
stops = 8
[camera]
count = 290
END
preset rover_200s "$OUT/rover_200s.ini" ground_rover consumer
preset hover datasets/stress/hover.ini drone consumer
preset base datasets/stress/base.ini drone consumer
