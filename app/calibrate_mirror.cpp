// vio-slam calibrate mirror: where a mirror sits before its camera.
#include <algorithm>
#include <cstdio>
#include <map>
#include <memory>

#include "app/calibrate.h"
#include "app/calibration_data.h"
#include "app/recording_text.h"
#include "libvio/base/angles.h"
#include "libvio/base/errors.h"
#include "libvio/calibration/board_file.h"
#include "libvio/calibration/mirror_calibration.h"
#include "libvio/camera/description.h"
#include "libvio/io/calibration_file.h"
#include "libvio/io/text.h"

namespace vio::app {
namespace {

struct Arguments {
    std::string source, board, calibration, output, camera_label;
    int bit_depth = 0;
    std::vector<double> camera_pose;
    double sigma_px = 0;
    bool residuals = false;
};

// What images show, and where it is. Rows of a file are numbered from 0 on.
struct Targets {
    std::vector<FeatureFrame> frames;
    std::map<FeatureId, Fiducial> places;
};

Targets targets_of_file(const std::string& file) {
    Targets targets;
    targets.frames.resize(1);
    TextRows row(file);
    for (FeatureId id = 0; row.next(); ++id) {
        row.require(5);
        targets.places[id].p_W = {row.number(0), row.number(1), row.number(2)};
        targets.frames[0].features.push_back({id, {row.number(3), row.number(4)}});
    }
    return targets;
}

Targets targets_of_board(const Arguments& arguments, const CameraPtr& camera) {
    const Board board = read_board(arguments.board);
    BoardSource source;
    source.path = arguments.source;
    source.camera = camera;
    source.recording.calibration_files = {arguments.calibration};
    source.recording.camera_label = arguments.camera_label;
    source.recording.bit_depth = arguments.bit_depth;
    const BoardViews views = read_board_views(source, board);
    if (views.width != camera->width() || views.height != camera->height())
        throw InputError(source.path + ": images are " + std::to_string(views.width) + " x " +
                         std::to_string(views.height) + ", the camera's in " +
                         arguments.calibration + " " + std::to_string(camera->width()) + " x " +
                         std::to_string(camera->height()));
    return {views.frames, board.points};
}

Pose pose_from(const std::vector<double>& v) {
    const Eigen::Quaterniond q(v[6], v[3], v[4], v[5]);
    if (std::abs(q.norm() - 1) > 0.01)
        throw InputError("--camera-pose: the quaternion is not of unit length");
    return {q.normalized().toRotationMatrix(), {v[0], v[1], v[2]}};
}

void print(const MirrorCalibration& result, const Pose& before, bool all_residuals) {
    double largest = 0;
    for (const auto& r : result.residuals) largest = std::max(largest, r.error_px.norm());
    std::printf("targets     %zu in %zu image%s, %d dropped as outliers\n", result.residuals.size(),
                result.views.size(), result.views.size() == 1 ? "" : "s", result.outliers);
    std::printf("residual    RMS %.3f px per coordinate, largest %.3f px, %d iterations\n",
                result.rms_px, largest, result.iterations);
    print_transform("T_C_M", result.T_C_M);
    print_transform("T_M_C", result.T_C_M.inverse());
    if (result.views.size() == 1) {
        print_transform("T_G_C", result.views[0].T_G_C);
        print_transform("T_C_G", result.views[0].T_G_C.inverse());
    }
    const Vector6d moved = result.T_C_M.boxminus(before);
    std::printf("moved by    %.4f deg and %.3f mm from what was stated\n",
                moved.head<3>().norm() / kDegree, 1e3 * moved.tail<3>().norm());
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
    std::printf("residuals   u v [px], seen less predicted, at u v [px], of target\n");
    for (const auto& r : result.residuals)
        std::printf(" %8.3f %8.3f  at %8.2f %8.2f  %lld\n", r.error_px.x(), r.error_px.y(),
                    r.uv_px.x(), r.uv_px.y(), static_cast<long long>(r.id));
}

void calibrate_mirror(const Arguments& arguments) {
    Rig rig;
    load_calibration(arguments.calibration, rig);
    const auto nominal = std::dynamic_pointer_cast<const MirrorCamera>(rig.camera);
    if (!nominal)
        throw InputError(arguments.calibration +
                         ": has no camera of a *_mirror model; describe the mirror in [camera]");
    const Targets targets = arguments.board.empty() ? targets_of_file(arguments.source)
                                                    : targets_of_board(arguments, nominal);
    MirrorCalibrationOptions options;
    options.sigma_px = arguments.sigma_px;
    if (!arguments.camera_pose.empty()) options.T_G_C = pose_from(arguments.camera_pose);
    MirrorCalibration result;
    try {
        result = vio::calibrate_mirror(*nominal, targets.frames, targets.places, options);
    } catch (const InputError& reason) {
        throw InputError(arguments.source + ": " + reason.what());
    }
    print(result, nominal->parameters().T_C_M, arguments.residuals);
    MirrorParameters parameters = nominal->parameters();
    parameters.T_C_M = result.T_C_M;
    rig.camera = std::make_shared<MirrorCamera>(parameters);
    write_text(arguments.output, calibration_text(rig));
    std::printf("calibration %s\n", arguments.output.c_str());
}

}  // namespace

void add_calibrate_mirror(CLI::App& calibrate) {
    CLI::App* mirror = calibrate.add_subcommand(
        "mirror", "Place of a mirror before its camera (T_C_M), from images of known targets");
    auto arguments = std::make_shared<Arguments>();
    mirror
        ->add_option(
            "TARGETS", arguments->source,
            "Text, a row for each target of one image: x y z [m] in any frame G, u v [px]; "
            "with --board: image, folder of images, or rawlog")
        ->required();
    mirror->add_option("--board", arguments->board,
                       "Kalibr's target.yaml (aprilgrid, checkerboard) of the board in the images");
    mirror->add_option("--camera-label", arguments->camera_label,
                       "Camera of a rawlog; default: the first");
    add_bit_depth(*mirror, arguments->bit_depth);
    mirror
        ->add_option("--calibration", arguments->calibration,
                     "Calibration with the camera and the mirror's shape, T_C_M as far as known")
        ->required();
    mirror->add_option("-o,--output", arguments->output, "Calibration file to write")->required();
    mirror
        ->add_option("--camera-pose", arguments->camera_pose,
                     "Camera in G where known, for one image: x y z [m] qx qy qz qw; default: "
                     "found, too")
        ->expected(7);
    mirror
        ->add_option("--sigma-px", arguments->sigma_px,
                     "1 sigma of a target's place in the image; default: from the residuals")
        ->check(CLI::NonNegativeNumber);
    mirror->add_flag("--residuals", arguments->residuals, "Print each target's residual");
    mirror->callback([arguments] { calibrate_mirror(*arguments); });
}

}  // namespace vio::app
