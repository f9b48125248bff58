#include "libvio/io/sensor_text.h"

namespace vio {
namespace {

constexpr const char* kNotLater = "the time stamp is not later than the one before";

}  // namespace

ImuReading parse_imu_reading(const TextRows& row) {
    row.require(7);
    return {row.integer(0),
            {row.number(1), row.number(2), row.number(3)},
            {row.number(4), row.number(5), row.number(6)}};
}

std::vector<ImuReading> read_imu(const std::string& file) {
    TextRows row(file);
    std::vector<ImuReading> readings;
    while (row.next()) {
        readings.push_back(parse_imu_reading(row));
        const size_t n = readings.size();
        if (n > 1 && readings[n - 1].t <= readings[n - 2].t) throw row.error(kNotLater);
    }
    if (readings.empty())
        throw InputError(file + ": holds no readings; expected rows t[ns],wx,wy,wz,ax,ay,az");
    return readings;
}

std::vector<TimeNs> read_stamps(const std::string& file) {
    TextRows row(file);
    std::vector<TimeNs> stamps;
    while (row.next()) {
        row.require(1);
        stamps.push_back(row.integer(0));
        const size_t n = stamps.size();
        if (n > 1 && stamps[n - 1] <= stamps[n - 2]) throw row.error(kNotLater);
    }
    if (stamps.empty()) throw InputError(file + ": holds no time stamps; expected one [ns] a line");
    return stamps;
}

}  // namespace vio
