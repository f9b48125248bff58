#include "app/recording_text.h"

#include <cmath>
#include <cstdio>

#include "app/calibration_option.h"
#include "app/progress.h"
#include "libvio/camera/mirror.h"
#include "libvio/check/stamps.h"
#include "libvio/io/calibration_file.h"

namespace vio::app {
namespace {

void print(const StreamInfo& stream) {
    const StampStatistics s = stamp_statistics(stream.stamps);
    std::printf("%-12s %-24s %7d", stream.label.empty() ? "(no label)" : stream.label.c_str(),
                stream.class_name.c_str(), s.count);
    if (s.median_interval > 0) {
        std::printf("  %8.2f Hz  %9.3f s", s.rate(), s.duration());
    }
    if (s.gaps > 0)
        std::printf("  %d gaps, the longest %.4f s after %.3f s", s.gaps, to_seconds(s.largest_gap),
                    to_seconds(s.largest_gap_at - s.first));
    if (s.repeated > 0) std::printf("  %d stamps are repeated", s.repeated);
    if (s.backward > 0) std::printf("  %d stamps do not increase", s.backward);
    std::printf("\n");
}

// A transformation that maps coordinates of the second frame to the first.
void print(const char* name, const Pose& T) {
    const Eigen::Quaterniond q(T.R);
    // What would be rounded to "-0.000000" is zero.
    const auto shown = [](double value) { return std::abs(value) < 5e-7 ? 0. : value; };
    std::printf("%-8s position %.6f %.6f %.6f m, quaternion x y z w %.6f %.6f %.6f %.6f\n", name,
                shown(T.p.x()), shown(T.p.y()), shown(T.p.z()), shown(q.x()), shown(q.y()),
                shown(q.z()), shown(q.w()));
}

void print_camera(const Rig& rig) {
    if (!rig.camera) {
        std::printf("camera   none, or not calibrated\n");
        return;
    }
    std::printf("camera   [px, m, rad] %s\n", camera_summary(*rig.camera).c_str());
    print("T_B_C", rig.T_B_C);
    print("T_C_B", rig.T_B_C.inverse());
    if (const auto* mirror = dynamic_cast<const MirrorCamera*>(rig.camera.get())) {
        print("T_C_M", mirror->parameters().T_C_M);
        print("T_M_C", mirror->parameters().T_C_M.inverse());
    }
}

void print_imu(const Rig& rig) {
    const ImuNoise& noise = rig.imu_noise;
    std::printf("IMU      gyro noise %g rad/s/sqrt(Hz), bias walk %g rad/s^2/sqrt(Hz)\n",
                noise.gyro_noise_density, noise.gyro_bias_random_walk);
    std::printf("         accelerometer noise %g m/s^2/sqrt(Hz), bias walk %g m/s^3/sqrt(Hz)\n",
                noise.accel_noise_density, noise.accel_bias_random_walk);
    print("T_B_I", rig.T_B_I);
    print("T_I_B", rig.T_B_I.inverse());
    if (rig.camera) {
        print("T_I_C", rig.T_I_C());
        print("T_C_I", rig.T_I_C().inverse());
    }
    std::printf("         t_imu = t_cam + %g s\n", rig.time_offset);
}

}  // namespace

void add_recording_options(CLI::App& command, RecordingOptions& options, const std::string& use) {
    add_calibration_option(command, options.calibration_files, use);
    add_camera_label(command, options.camera_label, use);
    command.add_option("--imu-label", options.imu_label,
                       use + "IMU to use; default: the first in the rawlog");
    add_bit_depth(command, options.bit_depth, use);
}

CLI::Option* add_bit_depth(CLI::App& command, int& bits, const std::string& use) {
    return command
        .add_option("--bit-depth", bits,
                    use +
                        "Bits of 16 that images fill, if the largest value of some does not tell: "
                        "10, 12, 14 ...")
        ->check(CLI::Range(8, 16));
}

CLI::Option* add_camera_label(CLI::App& command, std::string& label, const std::string& use) {
    return command.add_option("--camera-label", label,
                              use + "Camera to use; default: the first in the rawlog");
}

std::string print_streams(const std::string& rawlog) {
    RawlogInfo info;
    {
        Progress progress("reading");
        info = read_rawlog_info(rawlog, [&](double share) { progress.update(share); });
    }
    std::printf("%s\n\nstreams (label, class, count, rate, duration)\n", rawlog.c_str());
    for (const StreamInfo& stream : info.streams) print(stream);
    std::fflush(stdout);
    return info.damage;
}

void print_calibration(const Recording& recording) {
    std::printf(
        "\ncalibration (B vehicle, C camera, I IMU, M mirror; T_B_C maps C's coordinates to B)\n");
    print_camera(recording.rig());
    if (recording.has_imu()) print_imu(recording.rig());
    for (const std::string& remark : recording.remarks()) print_note(remark);
    std::fflush(stdout);
}

void print_left_out(const LeftOutList& left_out) {
    for (const LeftOut& kind : left_out.kinds())
        std::printf("left out: %s\n", one_line(kind).c_str());
    std::fflush(stdout);
}

void print_note(const std::string& text) {
    std::printf("note        %s\n", text.c_str());
    std::fflush(stdout);
}

void print_repeated(int messages) {
    if (messages > 0) std::printf("left out    %d messages that are there twice\n", messages);
}

void print_late(int messages, double window) {
    if (messages > 0)
        std::printf("left out    %d messages that came more than %g s late (iekf.message_window)\n",
                    messages, window);
}

std::vector<Finding> left_out_findings(const LeftOutList& left_out) {
    std::vector<Finding> findings;
    for (const LeftOut& kind : left_out.kinds())
        findings.push_back({Grade::warning, "left out", one_line(kind), "", ""});
    return findings;
}

}  // namespace vio::app
