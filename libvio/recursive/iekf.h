// Recursive estimator (section 5 of the paper): multirate iterated extended Kalman filter.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "libvio/base/estimate.h"
#include "libvio/base/options.h"
#include "libvio/batch/batch.h"
#include "libvio/camera/rig.h"

namespace vio {

struct IekfOptions {
    std::string motion = "imu_driven";  ///< imu_driven | smooth (the paper's)
    double sigma_px = 1.0;
    int prefix_images = 40;

    void describe(OptionSet& options);
};

/// Feed measurements in order of arrival; read the trajectory.
class Iekf {
   public:
    Iekf(const Rig& rig, const IekfOptions& options, const BatchOptions& prefix_options,
         bool use_imu = true);
    ~Iekf();

    void add(const ImuReading& reading);
    void add(const FeatureFrame& frame);
    /// Call once after the last measurement.
    void finish();

    /// States at all images so far (those of the prefix from its batch estimate), and every
    /// landmark that was ever in the state with its last estimate.
    const Estimate& estimate() const;

   private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

}  // namespace vio
