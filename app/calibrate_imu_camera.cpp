// vio-slam calibrate imu-camera: the camera's place on the IMU and the offset of its clock.
#include <cstdio>
#include <memory>
#include <optional>

#include "app/calibrate.h"
#include "app/calibration_data.h"
#include "app/calibration_option.h"
#include "app/recording_text.h"
#include "libvio/base/angles.h"
#include "libvio/base/errors.h"
#include "libvio/calibration/board_file.h"
#include "libvio/calibration/imu_camera.h"
#include "libvio/camera/intrinsics.h"
#include "libvio/io/calibration_file.h"
#include "libvio/io/text.h"

namespace vio::app {
namespace {

struct Arguments {
    BoardSource source;
    std::string board, output;
    std::optional<double> board_sigma_mm;
    bool intrinsics = false;
    ImuCameraOptions options;
};

void print(const RigCalibration& c, const Pose& before, const BoardViews& views, int intrinsics) {
    const Pose T_I_C = c.rig.T_I_C();
    const Eigen::VectorXd sigma = c.covariance.diagonal().cwiseSqrt();
    std::printf("images      %d of %d, %d corners used, %d dropped as outliers\n", c.images,
                views.images, c.observations, c.outliers);
    std::printf("residual    RMS %.3f px per coordinate; %d iterations, %s\n", c.rms_px,
                c.iterations, c.reason.c_str());
    print_transform("T_I_C", T_I_C);
    print_transform("T_C_I", T_I_C.inverse());
    print_transform("T_B_C", c.rig.T_B_C);
    std::printf(
        "1 sigma     (for %.3f px and the IMU's noise densities) rotation about the camera's "
        "x y z %.4f %.4f %.4f deg; position in I x y z %.3f %.3f %.3f mm\n",
        c.sigma_px, sigma(0) / kDegree, sigma(1) / kDegree, sigma(2) / kDegree, 1e3 * sigma(3),
        1e3 * sigma(4), 1e3 * sigma(5));
    std::printf("time offset %.6f +- %.6f s (t_imu = t_cam + offset)\n", c.rig.time_offset,
                sigma(6));
    if (intrinsics > 0) {
        const Eigen::VectorXd values = vio::intrinsics(*c.rig.camera, intrinsics);
        for (int k = 0; k < intrinsics; ++k)
            std::printf("%-11s %.6f +- %.6f\n", c.names[7 + k].c_str(), values(k), sigma(7 + k));
    }
    const Vector6d d = T_I_C.boxminus(before);
    std::printf("moved by    %.4f deg and %.2f mm from what was stated\n",
                d.head<3>().norm() / kDegree, 1e3 * d.tail<3>().norm());
    std::printf(
        "gyro bias   %.5f %.5f %.5f rad/s, accelerometer bias %.4f %.4f %.4f m/s^2 (means)\n",
        c.bias.gyro.x(), c.bias.gyro.y(), c.bias.gyro.z(), c.bias.accel.x(), c.bias.accel.y(),
        c.bias.accel.z());
    std::printf("covariance  (rotation x y z [rad], position x y z [m], time offset [s]%s)\n",
                intrinsics > 0 ? ", intrinsics" : "");
    for (Eigen::Index i = 0; i < c.covariance.rows(); ++i) {
        for (Eigen::Index j = 0; j < c.covariance.cols(); ++j)
            std::printf(" %12.5e", c.covariance(i, j));
        std::printf("\n");
    }
}

void calibrate(Arguments arguments) {
    Board board = read_board(arguments.board);
    if (!board.has_top())
        throw InputError(
            arguments.board +
            ": looks the same upside down, so that its images do not tell how the "
            "camera turned; use an AprilGrid, or an odd and an even number of corners");
    if (arguments.board_sigma_mm) {
        const double sigma = 1e-3 * *arguments.board_sigma_mm;
        for (auto& [id, point] : board.points)
            point.covariance = sigma * sigma * Eigen::Matrix3d::Identity();
    }
    const BoardViews views = read_board_views(arguments.source, board);
    const std::string& file = arguments.source.path;
    if (views.imu.empty())
        throw InputError(file + ": no IMU readings; name the IMU with --imu-label");
    if (!views.rig.camera)
        throw InputError(file +
                         ": the camera is not calibrated; give --calibration FILE (vio-slam "
                         "calibrate camera makes one)");
    BatchProblem problem;
    problem.rig = views.rig;
    problem.frames = views.frames;
    problem.imu = views.imu;
    problem.fiducials = board.points;
    if (arguments.intrinsics)
        arguments.options.intrinsics = distortion_count(*views.rig.camera) + 4;
    RigCalibration result;
    try {
        result = calibrate_imu_camera(problem, arguments.options);
    } catch (const InputError& reason) {
        throw InputError(file + ": " + reason.what());
    }
    print(result, views.rig.T_I_C(), views, arguments.options.intrinsics);
    if (!result.converged)
        throw InputError(file + ": the search has not converged (" + result.reason +
                         "); nothing was written");
    write_text(arguments.output, calibration_text(result.rig));
    std::printf("calibration %s\n", arguments.output.c_str());
}

}  // namespace

void add_calibrate_imu_camera(CLI::App& calibrate_command) {
    CLI::App* command = calibrate_command.add_subcommand(
        "imu-camera",
        "Place of the camera on the IMU (T_I_C) and time offset, from a known board in motion");
    auto arguments = std::make_shared<Arguments>();
    RecordingOptions& recording = arguments->source.recording;
    command
        ->add_option("RAWLOG", arguments->source.path,
                     "Recording with IMU and with images of the board, or with its corners as "
                     "features; the camera's intrinsics in it or in --calibration")
        ->required();
    add_board_options(*command, arguments->board, arguments->output);
    add_calibration_option(*command, recording.calibration_files);
    command->add_option("--camera-label", recording.camera_label, "Camera; default: the first");
    command->add_option("--imu-label", recording.imu_label, "IMU; default: the first");
    add_bit_depth(*command, recording.bit_depth);
    add_part_options(*command, arguments->source.part);
    command->add_flag("--intrinsics", arguments->intrinsics,
                      "Find the camera's intrinsics anew, too");
    command
        ->add_option("--board-sigma-mm", arguments->board_sigma_mm,
                     "1 sigma of the board's points in each direction, which are then found too; "
                     "default: what the board's file says, else exactly known")
        ->check(CLI::NonNegativeNumber);
    command
        ->add_option("--sigma-px", arguments->options.batch.sigma_px,
                     "1 sigma of a corner's place in the image; default: from the residuals")
        ->check(CLI::NonNegativeNumber);
    command
        ->add_option("--largest-offset", arguments->options.largest_offset,
                     "Time offset that is searched, about the stated one [s]")
        ->check(CLI::Range(0.0, 10.0))
        ->capture_default_str();
    command->callback([arguments] { calibrate(*arguments); });
}

}  // namespace vio::app
