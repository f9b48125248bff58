// vio-slam calibrate camera: intrinsics from images of a board.
#include <algorithm>
#include <cstdio>
#include <memory>

#include "app/calibrate.h"
#include "app/calibration_data.h"
#include "app/recording_text.h"
#include "libvio/base/angles.h"
#include "libvio/base/errors.h"
#include "libvio/calibration/board_file.h"
#include "libvio/calibration/camera_calibration.h"
#include "libvio/camera/intrinsics.h"
#include "libvio/io/calibration_file.h"
#include "libvio/io/text.h"

namespace vio::app {
namespace {

struct Arguments {
    BoardSource source;
    std::string board, output;
    int distortion = 0;
    CameraCalibrationOptions options;
};

void print(const CameraCalibration& result, const BoardViews& views) {
    const RigCalibration& c = result.rig;
    double largest = 0;
    for (const auto& r : c.residuals)
        if (!r.outlier) largest = std::max(largest, r.error_px.norm());
    std::printf(
        "images      %d looked at, %d show the board, %d used: %d corners, %d dropped as "
        "outliers\n",
        views.images, result.images_with_board, c.images, c.observations, c.outliers);
    std::printf("residual    RMS %.3f px per coordinate, largest %.3f px; %d iterations, %s\n",
                c.rms_px, largest, c.iterations, c.reason.c_str());
    const int n = static_cast<int>(c.names.size());
    const Eigen::VectorXd values = intrinsics(*c.rig.camera, n),
                          sigma = c.covariance.diagonal().cwiseSqrt();
    std::printf("model       %s, %d x %d; value and 1 sigma (for %.3f px):\n",
                c.rig.camera->model_name().c_str(), c.rig.camera->width(), c.rig.camera->height(),
                c.sigma_px);
    for (int k = 0; k < n; ++k)
        std::printf("  %-3s %14.7f +- %.7f %s\n", c.names[k].c_str(), values(k), sigma(k),
                    k < 4 ? "px" : "");
    std::printf("covariance  (");
    for (int k = 0; k < n; ++k) std::printf("%s%s", k == 0 ? "" : " ", c.names[k].c_str());
    std::printf(")\n");
    for (int i = 0; i < n; ++i) {
        for (int j = 0; j < n; ++j) std::printf(" %12.5e", c.covariance(i, j));
        std::printf("\n");
    }
    const Coverage& coverage = result.coverage;
    std::printf(
        "coverage    corners in %.0f %% of the image, out to %.0f %% of the way to its corners; "
        "board tilted by up to %.0f deg; corners by part of the image:\n",
        100 * coverage.share, 100 * coverage.outermost, coverage.widest_tilt / kDegree);
    for (const auto& row : coverage.cells) {
        for (int cell : row) std::printf(" %5d", cell);
        std::printf("\n");
    }
    for (const std::string& warning : coverage.warnings)
        std::printf("warning     %s\n", warning.c_str());
}

void calibrate(Arguments arguments) {
    CameraCalibrationOptions& options = arguments.options;
    if (options.model == "fisheye" && arguments.distortion != 0 && arguments.distortion != 4)
        throw InputError("--distortion: a fisheye camera has 4 coefficients");
    options.distortion = arguments.distortion != 0    ? arguments.distortion
                         : options.model == "fisheye" ? 4
                                                      : 5;
    const Board board = read_board(arguments.board);
    const BoardViews views = read_board_views(arguments.source, board);
    if (views.width <= 0)
        throw InputError(arguments.source.path + ": does not say how large its images are");
    options.width = views.width;
    options.height = views.height;
    CameraCalibration result;
    try {
        result = calibrate_camera(views.frames, board, options);
    } catch (const InputError& reason) {
        throw InputError(arguments.source.path + ": " + reason.what());
    }
    print(result, views);
    if (!result.rig.converged)
        throw InputError(arguments.source.path + ": the search has not converged (" +
                         result.rig.reason + "); nothing was written");
    write_text(arguments.output, camera_text(result.rig.rig));
    std::printf("calibration %s\n", arguments.output.c_str());
}

}  // namespace

void add_calibrate_camera(CLI::App& calibrate_command) {
    CLI::App* command = calibrate_command.add_subcommand(
        "camera", "Intrinsics of a perspective or fisheye camera, from images of a board");
    auto arguments = std::make_shared<Arguments>();
    command
        ->add_option("IMAGES", arguments->source.path,
                     "Folder of images, or rawlog with images of the board or with its corners as "
                     "features")
        ->required();
    add_board_options(*command, arguments->board, arguments->output);
    command->add_option("--model", arguments->options.model, "Kind of camera")
        ->check(CLI::IsMember({"perspective", "fisheye"}))
        ->capture_default_str();
    command
        ->add_option(
            "--distortion", arguments->distortion,
            "Distortion coefficients: 4, 5 or 8 (k1 k2 p1 p2 k3 k4 k5 k6) of a perspective "
            "camera, default 5; a fisheye camera has 4")
        ->check(CLI::IsMember({4, 5, 8}));
    command
        ->add_option("--images", arguments->options.most_images,
                     "Images to use at most, evenly taken; 0: all")
        ->check(CLI::NonNegativeNumber)
        ->capture_default_str();
    command
        ->add_option("--sigma-px", arguments->options.sigma_px,
                     "1 sigma of a corner's place in the image; default: from the residuals")
        ->check(CLI::NonNegativeNumber);
    command->add_option("--camera-label", arguments->source.recording.camera_label,
                        "Camera; default: the first");
    add_bit_depth(*command, arguments->source.recording.bit_depth);
    command->callback([arguments] { calibrate(*arguments); });
}

}  // namespace vio::app
