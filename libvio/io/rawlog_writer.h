// Writing the library's own measurements as an MRPT rawlog.
#pragma once

#include <memory>
#include <string>

#include "libvio/io/recording.h"

namespace vio {

/// Sensor labels, and where images go.
struct RawlogWriterOptions {
    std::string camera_label = "cam0";  ///< of images and features
    std::string imu_label = "imu0";
    bool external_images = false;  ///< PNG files in NAME_Images beside NAME.rawlog, else embedded

    /// The labels of the sensors that were asked for, where they were.
    static RawlogWriterOptions labelled(const RecordingOptions& asked) {
        RawlogWriterOptions options;
        if (!asked.camera_label.empty()) options.camera_label = asked.camera_label;
        if (!asked.imu_label.empty()) options.imu_label = asked.imu_label;
        return options;
    }
};

/// Writes a rawlog that Recording reads back bit by bit (stamps to MRPT's tick of 100 ns, rounded
/// down), and the sidecar NAME.calibration.ini with what a rawlog has no field for: noise
/// densities, time offset, and a camera that is neither perspective nor a plain fisheye. The same
/// input gives the same bytes. The rawlog appears under its name in finish(); before, it grows as
/// NAME.rawlog.partial, which the destructor removes.
class RawlogWriter {
 public:
    /// rig.camera may be null: images then carry no calibration. Throws InputError if the file
    /// cannot be written.
    RawlogWriter(const std::string& file, const Rig& rig, const RawlogWriterOptions& options = {});
    ~RawlogWriter();

    /// Appends one measurement; call in order of time, as it arrives. Images must be 8-bit grey,
    /// odometry planar (MRPT's holds x, y and yaw). Throws InputError where a message cannot be
    /// stored or the disk is full.
    void write(const Message& message);

    /// Completes the rawlog and its sidecar. Throws InputError if the disk is full.
    void finish();

 private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

/// Calibration file that belongs to a rawlog: X.rawlog -> X.calibration.ini.
std::string calibration_sidecar(const std::string& rawlog_file);

}  // namespace vio
