// Import of EuRoC/ASL and TUM-VI data sets.
#pragma once

#include <functional>
#include <string>

#include "libvio/io/measurement_source.h"

namespace vio {

/// What of a data set is imported.
struct AslImportOptions {
    std::string camera = "cam0";   ///< camera folder; becomes the sensor label
    std::string imu;               ///< IMU folder, likewise; empty: imu0 where there is one
    bool external_images = false;  ///< PNG files beside the rawlog, else embedded
    int bit_depth = 0;             ///< of images of 16 bits: see BitDepth
};

/// Converts a data set in ASL layout to a rawlog. `dir` contains mav0/ or is it:
/// - cam0/sensor.yaml with cam0/data.csv (images) and/or cam0/features.csv[.gz] (rows
///   timestamp_ns,feature_id,u_px,v_px);
/// - imu0/sensor.yaml and imu0/data.csv (optional);
/// - state_groundtruth_estimate0/data.csv or mocap0/data.csv (optional), written as X.truth.tum
///   (T_W_B) beside X.rawlog.
/// Body frame B is the data set's; T_BS and intrinsics go into the rawlog's own fields, noise
/// densities into X.calibration.ini. Rows may have more columns; lines that begin with # are
/// comments. `progress` receives the share done, 0 to 1.
/// Throws InputError naming file and line for missing files and folders that were named, malformed
/// rows, unknown models and stamps that do not increase; no rawlog is left then.
ImportReport import_asl(const std::string& dir, const std::string& out_rawlog,
                        const AslImportOptions& options = {},
                        const std::function<void(double)>& progress = {});

/// The same for a TUM-VI data set as exported in EuRoC/DSO format: `dir` contains mav0/ with cam0,
/// imu0 and mocap0 without sensor.yaml, and the calibration in Kalibr's form:
/// - dso/camchain.yaml: intrinsics of each camera, equidistant (Kannala-Brandt), and T_cam_imu;
/// - dso/imu_config.yaml: noise densities.
/// B is the IMU, whose pose mocap0 gives. The 16-bit images are taken as 8-bit grey.
ImportReport import_tum_vi(const std::string& dir, const std::string& out_rawlog,
                           const AslImportOptions& options = {},
                           const std::function<void(double)>& progress = {});

}  // namespace vio
