// vio-slam calibrate: what a recording's calibration lacks.
#include "app/calibrate.h"

#include <cstdio>

#include "app/commands.h"

namespace vio::app {
namespace {

// Each declares one kind; see app/calibrate.h.
constexpr void (*kKinds[])(CLI::App&) = {add_calibrate_imu, add_calibrate_camera,
                                         add_calibrate_imu_camera, add_calibrate_mirror};

}  // namespace

void print_transform(const char* name, const Pose& T) {
    const Eigen::Quaterniond q(T.R);
    std::printf("%-6s position %.6f %.6f %.6f m, quaternion x y z w %.7f %.7f %.7f %.7f\n", name,
                T.p.x(), T.p.y(), T.p.z(), q.x(), q.y(), q.z(), q.w());
}

void add_calibrate(CLI::App& program) {
    CLI::App* command = program.add_subcommand("calibrate", "Find a calibration");
    command->require_subcommand(1);
    for (const auto add : kKinds) add(*command);
}

}  // namespace vio::app
