// vio-slam calibrate mirror: where a mirror sits before its camera.
#include <algorithm>
#include <cstdio>
#include <memory>

#include "app/calibrate.h"
#include "libvio/base/errors.h"
#include "libvio/camera/description.h"
#include "libvio/camera/mirror_calibration.h"
#include "libvio/io/calibration_file.h"
#include "libvio/io/text.h"

namespace vio::app {
namespace {

constexpr double kDegree = 3.14159265358979323846 / 180;

struct Arguments {
    std::string points, calibration, output;
    std::vector<double> camera_pose;
    double sigma_px = 0;
    bool residuals = false;
};

std::vector<CalibrationTarget> read_targets(const std::string& file) {
    std::vector<CalibrationTarget> targets;
    TextRows row(file);
    while (row.next()) {
        row.require(5);
        targets.push_back(
            {{row.number(0), row.number(1), row.number(2)}, {row.number(3), row.number(4)}});
    }
    return targets;
}

Pose pose_from(const std::vector<double>& v) {
    const Eigen::Quaterniond q(v[6], v[3], v[4], v[5]);
    if (std::abs(q.norm() - 1) > 0.01)
        throw InputError("--camera-pose: the quaternion is not of unit length");
    return {q.normalized().toRotationMatrix(), {v[0], v[1], v[2]}};
}

void print(const MirrorCalibration& result, const std::vector<CalibrationTarget>& targets,
           bool all_residuals) {
    double largest = 0;
    for (const Eigen::Vector2d& r : result.residuals_px) largest = std::max(largest, r.norm());
    std::printf(
        "targets     %zu, residual RMS %.3f px per coordinate, largest %.3f px, %d iterations\n",
        targets.size(), result.rms_px, largest, result.iterations);
    print_transform("T_C_M", result.T_C_M);
    print_transform("T_M_C", result.T_C_M.inverse());
    print_transform("T_G_C", result.T_G_C);
    print_transform("T_C_G", result.T_G_C.inverse());
    const Vector6d sigma = result.covariance.diagonal().cwiseSqrt();
    std::printf(
        "1 sigma     (for %.3f px) rotation about the mirror's x, y %.4f %.4f deg, about its axis "
        "not "
        "seen; position x y z %.3f %.3f %.3f mm\n",
        result.sigma_px, sigma(0) / kDegree, sigma(1) / kDegree, 1e3 * sigma(3), 1e3 * sigma(4),
        1e3 * sigma(5));
    std::printf("covariance  of T_C_M (rotation x y z [rad], position x y z [m])\n");
    for (int i = 0; i < 6; ++i) {
        for (int j = 0; j < 6; ++j) std::printf(" %12.5e", result.covariance(i, j));
        std::printf("\n");
    }
    if (!all_residuals) return;
    std::printf("residuals   u v [px], seen less predicted, at u v [px]\n");
    for (std::size_t i = 0; i < targets.size(); ++i)
        std::printf(" %8.3f %8.3f  at %8.2f %8.2f\n", result.residuals_px[i].x(),
                    result.residuals_px[i].y(), targets[i].uv_px.x(), targets[i].uv_px.y());
}

void calibrate_mirror(const Arguments& arguments) {
    Rig rig;
    load_calibration(arguments.calibration, rig);
    const auto nominal = std::dynamic_pointer_cast<const MirrorCamera>(rig.camera);
    if (!nominal)
        throw InputError(arguments.calibration +
                         ": has no camera of a *_mirror model; describe the mirror in [camera]");
    const auto targets = read_targets(arguments.points);
    MirrorCalibrationOptions options;
    options.sigma_px = arguments.sigma_px;
    if (!arguments.camera_pose.empty()) options.T_G_C = pose_from(arguments.camera_pose);
    MirrorCalibration result;
    try {
        result = vio::calibrate_mirror(*nominal, targets, options);
    } catch (const InputError& reason) {
        throw InputError(arguments.points + ": " + reason.what());
    }
    print(result, targets, arguments.residuals);
    MirrorParameters parameters = nominal->parameters();
    parameters.T_C_M = result.T_C_M;
    rig.camera = std::make_shared<MirrorCamera>(parameters);
    write_text(arguments.output, calibration_text(rig));
    std::printf("calibration %s\n", arguments.output.c_str());
}

}  // namespace

void add_calibrate_mirror(CLI::App& calibrate) {
    CLI::App* mirror = calibrate.add_subcommand(
        "mirror", "Place of a mirror before its camera (T_C_M), from one image of known targets");
    auto arguments = std::make_shared<Arguments>();
    mirror
        ->add_option("POINTS", arguments->points,
                     "Text, a row for each target: x y z [m] in any frame G, u v [px]")
        ->required();
    mirror
        ->add_option("--calibration", arguments->calibration,
                     "Calibration with the camera and the mirror's shape, T_C_M as far as known")
        ->required();
    mirror->add_option("-o,--output", arguments->output, "Calibration file to write")->required();
    mirror
        ->add_option("--camera-pose", arguments->camera_pose,
                     "Camera in G where known: x y z [m] qx qy qz qw; default: found from the "
                     "targets, which must not lie in one plane")
        ->expected(7);
    mirror
        ->add_option("--sigma-px", arguments->sigma_px,
                     "1 sigma of a target's place in the image; default: from the residuals")
        ->check(CLI::NonNegativeNumber);
    mirror->add_flag("--residuals", arguments->residuals, "Print each target's residual");
    mirror->callback([arguments] { calibrate_mirror(*arguments); });
}

}  // namespace vio::app
