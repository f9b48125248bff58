// Import of recordings as tables: phones, loggers, own programs.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "libvio/io/measurement_source.h"

namespace vio {

/// A table in a text file, plain or gzip-compressed, separated by commas or blanks, and those of
/// its columns that are taken: by the names in its first row, or by numbers from 1. A first row
/// that is no row of numbers is taken for names.
struct CsvTable {
    std::string file;
    std::vector<std::string> columns;
    /// Of the first column, the time: s, ms, us or ns. Decimal stamps are taken exactly.
    std::string time_unit = "s";
};

/// Which tables there are, and what they mean.
struct CsvImportOptions {
    /// time, gyro x y z, and if accel has no file, accelerometer x y z.
    CsvTable gyro;
    /// time, accelerometer x y z, where it is a stream of its own with stamps of its own: taken at
    /// the gyro's times by linear interpolation.
    CsvTable accel;
    double gyro_unit = 1;   ///< [rad/s]
    double accel_unit = 1;  ///< [m/s^2]; negative where readings show -g upwards at rest
    /// time, file name; or the time alone, in the order of the files' names in images_dir.
    CsvTable images;
    std::string images_dir;                      ///< of the files; empty: the table's folder
    std::vector<std::string> calibration_files;  ///< camera, IMU, or both; see load_calibration
    bool external_images = false;                ///< PNG files beside the rawlog, else embedded
    int bit_depth = 0;                           ///< of images of 16 bits: see BitDepth
};

/// Converts tables to a rawlog with the labels cam0 and imu0. Images (8 or 16 bits, any number of
/// channels) and IMU may each be absent. Readings with the stamp of the one before, and those
/// outside or in gaps (> 0.1 s) of a separate accelerometer, are left out and counted.
/// Throws InputError naming file and line for a missing file or column, a value that is no number
/// and a stamp that steps back; no rawlog is left then.
ImportReport import_csv(const std::string& out_rawlog, const CsvImportOptions& options,
                        const std::function<void(double)>& progress = {});

}  // namespace vio
