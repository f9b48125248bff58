// A recording of a slower motion, made of a faster one.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "libvio/base/types.h"
#include "libvio/imu/noise.h"
#include "libvio/io/recording.h"
#include "libvio/simulation/random.h"

namespace vio {

/// How many times slower, and what becomes of the noise.
struct SlowOptions {
    int factor = 2;  ///< f
    int seed = 1;    ///< of the noise that is added
    /// Bring the readings' noise back to the sensor's (step 4). Without it, readings free of noise
    /// stay free of it.
    bool restore_noise = true;
    RecordingOptions recording = {};  ///< which camera and IMU, and their calibration
};

/// What was made.
struct SlowReport {
    int images = 0, feature_frames = 0;
    int readings_in = 0, readings_out = 0;
    /// Gravity in the slowed readings as a share of the original's: 1 / f^2.
    double gravity_factor = 1;
    std::vector<std::string> truth_files;  ///< slowed beside the output
    LeftOutList left_out;                  ///< see Recording::left_out
};

/// Slows a rawlog by the paper's four steps (section 7.3.2):
///  1. all time stamps grow f times as distant from the first;
///  2. f - 1 interpolated readings are put between each pair of successive readings;
///  3. angular velocities are divided by f, specific forces by f^2. So gravity and the
///     accelerometer's bias have 1 / f^2 of their size in the result: estimators must be told of
///     gravity (batch.gravity_norm);
///  4. Gaussian noise is added that brings the noise of each reading to what the calibration
///     states. (An interpolated reading has less than those beside it.)
/// The calibration's time offset and bias random walks are slowed too; the truth beside the input
/// (X.truth.tum, X.truth_states.csv, X.truth_points.csv), where there is one, likewise beside the
/// output. Images stay as they are. Throws InputError for a factor below 2, and as Recording and
/// RawlogWriter do.
SlowReport slow_rawlog(const std::string& in_rawlog, const std::string& out_rawlog,
                       const SlowOptions& options,
                       const std::function<void(double)>& progress = {});

/// Steps 1 to 4 on readings. `first` keeps its stamp; rate is the readings' [Hz].
class ImuSlower {
 public:
    ImuSlower(const SlowOptions& options, const ImuNoise& noise, double rate, TimeNs first);

    /// The slowed reading, after those that fill the gap from the one before (without which none).
    std::vector<ImuReading> push(const ImuReading& reading);

    TimeNs slowed(TimeNs t) const { return first_ + factor_ * (t - first_); }

 private:
    /// `share`: of the variance of a recorded reading that this one has before step 3.
    ImuReading slowed(const ImuReading& reading, TimeNs t, double share);

    int factor_;
    double gyro_sigma_, accel_sigma_;  ///< of a recorded reading; zero: no noise is added
    TimeNs first_;
    Random random_;
    std::vector<ImuReading> previous_;  ///< none or one
};

}  // namespace vio
