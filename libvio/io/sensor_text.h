// Recorded measurements as text, in the columns of EuRoC/ASL data sets.
#pragma once

#include <string>
#include <vector>

#include "libvio/base/types.h"
#include "libvio/io/text.h"

namespace vio {

/// The row's reading: t[ns], gyro x y z [rad/s], accelerometer x y z [m/s^2]; further fields are
/// not read. Throws InputError (file and line) where one is missing or is no number.
ImuReading parse_imu_reading(const TextRows& row);

/// All readings of a file, plain or gzip-compressed. Throws InputError as parse_imu_reading does,
/// for a file without readings, and for stamps that do not increase.
std::vector<ImuReading> read_imu(const std::string& file);

/// First field of each row as a time stamp [ns]; throws InputError likewise.
std::vector<TimeNs> read_stamps(const std::string& file);

}  // namespace vio
