// Both estimators behind MRPT's face: made by name, fed with observations one by one.
//
//     auto estimator = std::dynamic_pointer_cast<vio::MotionEstimator>(
//         mrpt::rtti::classFactory("vio::RecursiveEstimator"));
//     estimator->process(*observation);                      // for each, in order of arrival
//     if (auto pose = estimator->newest_pose(); pose && !pose->lost) use(pose->pdf);
//     estimator->finish();
#pragma once

#include <mrpt/core/Clock.h>
#include <mrpt/obs/CObservation.h>
#include <mrpt/poses/CPose3DPDFGaussian.h>
#include <mrpt/rtti/CObject.h>
#include <mrpt/system/COutputLogger.h>

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "libvio/base/estimate.h"
#include "libvio/camera/rig.h"
#include "libvio/recursive/status.h"

namespace vio {

/// Estimates motion from CObservationImage (or CObservationFeatures) and CObservationIMU. Their
/// calibration is taken from the first of each, as from a rawlog (share/formats.md). A copy
/// (CObject asks for one) has the same options and calibration, and has seen nothing.
/// What it tells of its course goes to its log too, as it happens: starts and losses of track as
/// LVL_INFO, observations that are left out as LVL_WARN. The log's output to the console is off
/// until `logging_enable_console_output` is set; callbacks get it in any case
/// (logRegisterCallback).
/// Not for use from several threads at once, its const functions included.
class MotionEstimator : public mrpt::rtti::CObject, public mrpt::system::COutputLogger {
    DEFINE_VIRTUAL_MRPT_OBJECT(MotionEstimator)

 public:
    ~MotionEstimator() override;

    // ---- Before the first observation --------------------------------------------------------
    // Each throws InputError (file or assignment, and what is wrong with it), also where
    // observations have come already.

    /// Options from an INI file: the sections that `vio-slam run --print-options` prints.
    void load_options(const std::string& ini_file);
    /// One option: "section.name=value".
    void set_option(const std::string& assignment);
    /// Calibration that overrides that of the observations, key by key (share/formats.md); called
    /// again, it overrides that of the files before. Throws for a missing file only: process()
    /// reads them, and throws, when the observations have told what they complete.
    void set_calibration(const std::string& file);
    /// Sensors to use among several; empty: the first.
    void set_labels(const std::string& camera, const std::string& imu);
    /// Bits that images of 16 bits a channel fill, 8 to 16; not called: as the first image has them
    /// (BitDepth).
    void set_bit_depth(int bits);
    /// From images alone.
    void ignore_imu();
    /// All of the recursive estimator's path stays in memory, for estimate(): about 4 kB for each
    /// image. Without this, memory does not grow with time. (The batch keeps all in any case.)
    void keep_path();

    // ---- Observations ------------------------------------------------------------------------

    /// In any order within iekf.message_window (0.1 s); what comes later than that, twice, or is
    /// nothing that a sensor can have measured (a rate that is not finite, an image without pixels
    /// or of another size than those before) is left out and counted. Observations of other sensors
    /// and kinds are passed over. What comes before both the camera and the IMU are known waits for
    /// them. Throws InputError for images without calibration, for a first image that has not its
    /// calibration's size, and if the first 10 s know only one of the two: each ends the estimate.
    void process(const mrpt::obs::CObservation& observation);
    /// Call once after the last one. Throws InputError, with the last status, where no pose has
    /// been estimated, and where the batch estimate has not converged.
    void finish();

    // ---- The estimate ------------------------------------------------------------------------

    /// The vehicle's pose at a time, in MRPT's types.
    struct StampedPose {
        mrpt::Clock::time_point stamp;
        mrpt::poses::CPose3DPDFGaussian pdf;  ///< T_W_B: the vehicle in the world, z up
        bool lost = false;  ///< track was lost: the pose is an extrapolation, not to be relied on
    };
    /// Of the last image that has been estimated; nothing before the start (of the batch: before
    /// finish()). An image's pose comes once there are measurements two message windows later.
    std::optional<StampedPose> newest_pose() const;
    /// Recursive: the newest state and the landmarks in the filter; after keep_path() everything so
    /// far. Batch: everything, after finish(). Valid until the next call of a function that is not
    /// const.
    const Estimate& estimate() const;
    /// What happened so far, in words: starts and why there was none, losses of track.
    std::vector<StatusEntry> status() const;
    /// Observations that were left out so far.
    struct LeftOut {
        int repeated = 0;  ///< of the same stamp as another of their sensor
        int late = 0;      ///< by more than iekf.message_window
        int images = 0;    ///< outside the IMU's readings
        int unusable = 0;  ///< nothing that a sensor can have measured; the log says why
    };
    LeftOut left_out() const;
    /// Calibration in use, of the batch after finish() as it was found; its camera is null before
    /// the first image.
    const Rig& rig() const;

 protected:
    enum class Kind { kRecursive, kBatch };
    explicit MotionEstimator(Kind kind);
    MotionEstimator(const MotionEstimator& other);
    MotionEstimator& operator=(const MotionEstimator&) = delete;

 private:
    void log_news();

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
