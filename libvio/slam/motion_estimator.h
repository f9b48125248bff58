// Both estimators behind MRPT's face: made by name, fed with observations one by one.
//
//     auto estimator = std::dynamic_pointer_cast<vio::MotionEstimator>(
//         mrpt::rtti::classFactory("vio::RecursiveEstimator"));
//     estimator->process(*observation);                      // for each, in order of arrival
//     if (auto pose = estimator->newest_pose()) use(pose->pdf);
//     estimator->finish();
#pragma once

#include <mrpt/core/Clock.h>
#include <mrpt/obs/CObservation.h>
#include <mrpt/poses/CPose3DPDFGaussian.h>
#include <mrpt/rtti/CObject.h>

#include <memory>
#include <optional>
#include <string>

#include "libvio/base/estimate.h"
#include "libvio/camera/rig.h"

namespace vio {

/// Estimates motion from CObservationImage (or CObservationFeatures) and CObservationIMU. Their
/// calibration is taken from the first of each, as from a rawlog (share/formats.md). A copy
/// (CObject asks for one) has the same options and calibration, and has seen nothing.
class MotionEstimator : public mrpt::rtti::CObject {
    DEFINE_VIRTUAL_MRPT_OBJECT(MotionEstimator)

 public:
    ~MotionEstimator() override;

    // ---- Before the first observation --------------------------------------------------------
    // Each throws InputError (file or assignment, and what is wrong with it).

    /// Options from an INI file: the sections that `vio-slam run --print-options` prints.
    void load_options(const std::string& ini_file);
    /// One option: "section.name=value".
    void set_option(const std::string& assignment);
    /// Calibration that overrides that of the observations (share/formats.md).
    void set_calibration(const std::string& file);
    /// Sensors to use among several; empty: the first.
    void set_labels(const std::string& camera, const std::string& imu);
    /// From images alone.
    void ignore_imu();

    // ---- Observations ------------------------------------------------------------------------

    /// Observations of other sensors and kinds are passed over. What comes before both the camera
    /// and the IMU are known waits for them. Throws InputError for what no sensor can have
    /// measured, for images without calibration, and if one sensor stays silent for 10 s.
    void process(const mrpt::obs::CObservation& observation);
    /// Call once after the last one. Throws InputError where nothing can be estimated.
    void finish();

    // ---- The estimate ------------------------------------------------------------------------

    /// The vehicle's pose at a time, in MRPT's types.
    struct StampedPose {
        mrpt::Clock::time_point stamp;
        mrpt::poses::CPose3DPDFGaussian pdf;  ///< T_W_B: the vehicle in the world, z up
    };
    /// Of the last image that has been estimated; nothing before the start (of the batch: before
    /// finish()).
    std::optional<StampedPose> newest_pose() const;
    /// Everything estimated so far.
    const Estimate& estimate() const;
    /// Calibration in use; its camera is null before the first image.
    const Rig& rig() const;

 protected:
    enum class Kind { kRecursive, kBatch };
    explicit MotionEstimator(Kind kind);
    MotionEstimator(const MotionEstimator& other);
    MotionEstimator& operator=(const MotionEstimator&) = delete;

 private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

/// The iterated extended Kalman filter: a pose for each image soon after it.
class RecursiveEstimator : public MotionEstimator {
    DEFINE_MRPT_OBJECT(RecursiveEstimator, vio)
 public:
    RecursiveEstimator() : MotionEstimator(Kind::kRecursive) {}
};

/// The batch optimiser: everything at once, in finish().
class BatchEstimator : public MotionEstimator {
    DEFINE_MRPT_OBJECT(BatchEstimator, vio)
 public:
    BatchEstimator() : MotionEstimator(Kind::kBatch) {}
};

}  // namespace vio
