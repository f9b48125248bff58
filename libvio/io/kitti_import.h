// Import of KITTI raw recordings.
#pragma once

#include <functional>
#include <string>

#include "libvio/io/measurement_source.h"

namespace vio {

/// What of a drive is imported.
struct KittiImportOptions {
    std::string camera = "image_00";  ///< camera folder; becomes the sensor label
    std::string calibration_dir;      ///< of calib_*.txt; empty: in the drive's folder or above it
    bool external_images = false;     ///< PNG files beside the rawlog, else embedded
    int bit_depth = 0;                ///< of images of 16 bits: see BitDepth
};

/// Converts a drive of KITTI's raw recordings (synced or unsynced) to a rawlog. `dir` contains
/// - image_0X/timestamps.txt and image_0X/data/NNNNNNNNNN.png, in the same order;
/// - oxts/timestamps.txt, oxts/data/NNNNNNNNNN.txt and, if it is there, oxts/dataformat.txt, by
///   which values are found: ax ay az [m/s^2] and wx wy wz [rad/s] become IMU readings, lat lon alt
///   become GPS fixes (quality by posmode), and these with roll pitch yaw become X.truth.tum: T_W_B
///   with W east, north, up about the first position;
/// - here, above, or in the options' folder: calib_imu_to_velo.txt, calib_velo_to_cam.txt,
///   calib_cam_to_cam.txt. The camera is the rectified one (P_rect, R_rect) if the images have its
///   size, else the original (K, D).
/// B is the OXTS unit: x forward, y left, z up. Stamps are taken as UTC (the files name no time
/// zone), which only shifts them. The noise is that of
/// share/imu/tactical.ini.
/// Readings of unsynced drives whose stamps step back are left out and counted.
/// Throws InputError naming file and line for what is missing or malformed; no rawlog is left then.
ImportReport import_kitti(const std::string& dir, const std::string& out_rawlog,
                          const KittiImportOptions& options = {},
                          const std::function<void(double)>& progress = {});

/// "2011-09-26 13:02:25.964389445" as nanoseconds since the UNIX epoch, of UTC; nothing if it is no
/// such stamp.
std::optional<TimeNs> parse_date_time(std::string_view text);

}  // namespace vio
