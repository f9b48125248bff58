#include "libvio/simulation/slow.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <sstream>
#include <utility>

#include "libvio/base/errors.h"
#include "libvio/base/files.h"
#include "libvio/base/median.h"
#include "libvio/io/rawlog_writer.h"
#include "libvio/io/text.h"
#include "libvio/io/trajectory_io.h"

namespace vio {
namespace {

namespace fs = std::filesystem;

std::string beside(const std::string& rawlog, const char* ending) {
    return fs::path(rawlog).replace_extension(ending).string();
}

// The first stamp of a recording, and the rate of its IMU.
struct Extent {
    TimeNs first = std::numeric_limits<TimeNs>::max();
    double imu_rate = 0;  // [Hz]; zero without IMU
};

Extent extent_of(const std::string& rawlog, const RecordingOptions& options) {
    constexpr size_t kEnough = 1000;  // intervals
    Extent extent;
    Recording recording(rawlog, options);
    std::vector<TimeNs> intervals;
    TimeNs last = 0;
    while (intervals.size() < kEnough) {
        const auto message = recording.next();
        if (!message) break;
        extent.first = std::min(extent.first, time_of(*message));
        if (!std::holds_alternative<ImuReading>(*message)) continue;
        if (last > 0 && time_of(*message) > last) intervals.push_back(time_of(*message) - last);
        last = time_of(*message);
    }
    if (extent.first == std::numeric_limits<TimeNs>::max())
        throw InputError(rawlog + ": holds no measurements; nothing can be slowed");
    if (!intervals.empty()) extent.imu_rate = 1 / to_seconds(median(std::move(intervals)));
    return extent;
}

// Writes messages in order of their slowed times, readings with those between them.
class SlowWriter {
 public:
    SlowWriter(ImuSlower& slower, RawlogWriter& writer, SlowReport& report)
        : slower_(slower), writer_(writer), report_(report) {}

    void push(Message message) {
        const auto* reading = std::get_if<ImuReading>(&message);
        if (!reading) {
            report_.images += std::holds_alternative<ImageMessage>(message);
            report_.feature_frames += std::holds_alternative<FeatureFrame>(message);
            std::visit([this](auto& m) { m.t = slower_.slowed(m.t); }, message);
            waiting_.push_back(std::move(message));
            if (report_.readings_in == 0) flush();
            return;
        }
        ++report_.readings_in;
        for (const ImuReading& slowed : slower_.push(*reading)) {
            ++report_.readings_out;
            waiting_.emplace_back(slowed);
        }
        std::stable_sort(waiting_.begin(), waiting_.end(), [](const Message& a, const Message& b) {
            return time_of(a) < time_of(b);
        });
        flush();
    }

    void flush() {
        for (const Message& message : waiting_) writer_.write(message);
        waiting_.clear();
    }

 private:
    ImuSlower& slower_;
    RawlogWriter& writer_;
    SlowReport& report_;
    std::vector<Message> waiting_;  // since the last reading
};

void slow_poses(const std::string& in, const std::string& out, const ImuSlower& slower) {
    std::vector<TimedPose> poses = read_trajectory(in);
    for (TimedPose& pose : poses) pose.t = slower.slowed(pose.t);
    write_tum(out, poses, "T_W_B, ground truth, slowed");
}

// Velocity and gyro bias shrink with f, the accelerometer's bias with f^2.
void slow_states(const std::string& in, const std::string& out, const ImuSlower& slower,
                 double factor) {
    std::ostringstream text;
    text << "# Truth at the images, slowed. v: velocity of the body in W [m/s]; bg, ba: biases of "
            "the gyro [rad/s] and the accelerometer [m/s^2] in the IMU frame\n"
            "# t_s,vx,vy,vz,bgx,bgy,bgz,bax,bay,baz\n";
    TextRows row(in);
    while (row.next()) {
        row.require(10);
        text << format_seconds(slower.slowed(row.seconds(0)));
        for (size_t i = 1; i < 10; ++i)
            text << "," << format(row.number(i) / (i < 7 ? factor : factor * factor));
        text << "\n";
    }
    write_text(out, text.str());
}

void slow_truth(const std::string& in, const std::string& out, const ImuSlower& slower,
                double factor, SlowReport& report) {
    const auto exists = [&](const char* ending) {
        if (!is_file(beside(in, ending))) return false;
        report.truth_files.push_back(beside(out, ending));
        return true;
    };
    if (exists(".truth.tum"))
        slow_poses(beside(in, ".truth.tum"), beside(out, ".truth.tum"), slower);
    if (exists(".truth_states.csv"))
        slow_states(beside(in, ".truth_states.csv"), beside(out, ".truth_states.csv"), slower,
                    factor);
    if (exists(".truth_points.csv"))
        write_text(beside(out, ".truth_points.csv"), read_text(beside(in, ".truth_points.csv")));
}

}  // namespace

ImuSlower::ImuSlower(const SlowOptions& options, const ImuNoise& noise, double rate, TimeNs first)
    : factor_(options.factor),
      gyro_sigma_(options.restore_noise ? noise.gyro_noise_density * std::sqrt(rate) : 0),
      accel_sigma_(options.restore_noise ? noise.accel_noise_density * std::sqrt(rate) : 0),
      first_(first),
      random_(static_cast<std::uint64_t>(options.seed), "slow") {
    if (options.factor < 2)
        throw InputError("slow: the factor is " + std::to_string(options.factor) +
                         "; choose 2 or more");
}

ImuReading ImuSlower::slowed(const ImuReading& reading, TimeNs t, double share) {
    const double f = factor_, f2 = f * f;
    ImuReading result{t, reading.gyro / f, reading.accel / f2};
    if (gyro_sigma_ > 0) result.gyro += gyro_sigma_ * std::sqrt(1 - share / f2) * random_.normal3();
    if (accel_sigma_ > 0)
        result.accel += accel_sigma_ * std::sqrt(1 - share / (f2 * f2)) * random_.normal3();
    return result;
}

std::vector<ImuReading> ImuSlower::push(const ImuReading& reading) {
    std::vector<ImuReading> result;
    if (!previous_.empty() && reading.t > previous_[0].t) {
        const ImuReading& before = previous_[0];
        const TimeNs gap = reading.t - before.t;  // after step 1 it is f times as long
        for (int k = 1; k < factor_; ++k) {
            const double s = static_cast<double>(k) / factor_;
            const ImuReading between{0, before.gyro + s * (reading.gyro - before.gyro),
                                     before.accel + s * (reading.accel - before.accel)};
            result.push_back(
                slowed(between, slowed(before.t) + k * gap, (1 - s) * (1 - s) + s * s));
        }
    }
    result.push_back(slowed(reading, slowed(reading.t), 1));
    previous_ = {reading};
    return result;
}

SlowReport slow_rawlog(const std::string& in_rawlog, const std::string& out_rawlog,
                       const SlowOptions& options, const std::function<void(double)>& progress) {
    std::error_code ignored;
    if (fs::equivalent(in_rawlog, out_rawlog, ignored))
        throw InputError(out_rawlog + ": is the rawlog to be slowed; name another output");
    const Extent extent = extent_of(in_rawlog, options.recording);
    Recording recording(in_rawlog, options.recording);
    Rig rig = recording.rig();
    ImuSlower slower(options, rig.imu_noise, extent.imu_rate, extent.first);
    const double f = options.factor;
    // A bias b(t) becomes b(t / f) / f, or / f^2.
    rig.imu_noise.gyro_bias_random_walk /= f * std::sqrt(f);
    rig.imu_noise.accel_bias_random_walk /= f * f * std::sqrt(f);
    rig.time_offset *= f;

    SlowReport report;
    report.gravity_factor = 1 / (f * f);
    RawlogWriter writer(out_rawlog, rig, RawlogWriterOptions::labelled(options.recording));
    SlowWriter slow(slower, writer, report);
    while (auto message = recording.next()) {
        slow.push(std::move(*message));
        if (progress) progress(recording.progress());
    }
    slow.flush();
    report.left_out = recording.left_out();
    slow_truth(in_rawlog, out_rawlog, slower, f, report);
    writer.finish();
    return report;
}

}  // namespace vio
