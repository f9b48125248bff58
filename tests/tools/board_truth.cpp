// Pose of the body at each image of a rawlog whose features are the corners of a surveyed board:
//   vio_board_truth RAWLOG TARGET.csv OUT.tum [--all] [--calibration FILE]
// TARGET.csv has rows feature_id,x,y,z [m] in the board's frame, which becomes the world. The pose
// minimises the squared distance in pixels between the corners and their projections, image by
// image: no inertial data and no other image enter. Images that leave the pose uncertain are left
// out, unless --all is given. FILE overrides the rawlog's calibration.
#include <cmath>
#include <cstdio>
#include <map>
#include <opencv2/calib3d.hpp>
#include <optional>
#include <vector>

#include "libvio/camera/perspective.h"
#include "libvio/io/recording.h"
#include "libvio/io/text.h"
#include "libvio/io/trajectory_io.h"

namespace {

using vio::InputError;

constexpr size_t kMinCorners = 24;
constexpr double kMaxRms = 1.5;  // [px]: beyond, a corner is mistaken
// A pose judges only if it is itself well known: 1-sigma for corners measured to kCornerSigma.
constexpr double kCornerSigma = 0.5;          // [px]
constexpr double kMaxPositionSigma = 0.005;   // [m]
constexpr double kMaxRotationSigma = 0.0044;  // [rad]: 0.25 degrees

std::map<vio::FeatureId, cv::Point3d> read_target(const std::string& file) {
    std::map<vio::FeatureId, cv::Point3d> target;
    vio::TextRows rows(file);
    while (rows.next()) {
        rows.require(4);
        target[rows.integer(0)] = {rows.number(1), rows.number(2), rows.number(3)};
    }
    return target;
}

struct Intrinsics {
    cv::Matx33d K;
    std::vector<double> distortion;

    explicit Intrinsics(const vio::CameraPtr& camera) {
        const auto* model = dynamic_cast<const vio::PerspectiveCamera*>(camera.get());
        if (!model) throw InputError("the rawlog has no calibrated perspective camera");
        const vio::PerspectiveParameters& p = model->parameters();
        K = {p.fx, 0, p.cx, 0, p.fy, p.cy, 0, 0, 1};
        distortion.assign(p.distortion.begin(), p.distortion.end());
    }
};

// Whether the camera's pose in W follows well enough from the derivatives of the pixels with
// respect to (rotation vector, translation) of T_C_W.
bool well_known(const cv::Mat& jacobian, const cv::Vec3d& rotation, const cv::Vec3d& translation) {
    const cv::Mat J = jacobian.colRange(0, 6);
    const cv::Mat covariance = (J.t() * J).inv(cv::DECOMP_CHOLESKY) * (kCornerSigma * kCornerSigma);
    // The camera's centre is -R^T t; its derivatives by differences.
    const auto centre = [](const cv::Vec3d& r, const cv::Vec3d& t) {
        cv::Matx33d R;
        cv::Rodrigues(r, R);
        return -(R.t() * t);
    };
    cv::Mat G(3, 6, CV_64F);
    for (int k = 0; k < 6; ++k) {
        cv::Vec3d r = rotation, t = translation;
        constexpr double kStep = 1e-6;
        (k < 3 ? r[k] : t[k - 3]) += kStep;
        const cv::Vec3d d = (centre(r, t) - centre(rotation, translation)) / kStep;
        for (int i = 0; i < 3; ++i) G.at<double>(i, k) = d[i];
    }
    const double position = std::sqrt(cv::trace(cv::Mat(G * covariance * G.t()))[0]);
    const double turn = std::sqrt(cv::trace(covariance(cv::Rect(0, 0, 3, 3)))[0]);
    return position < kMaxPositionSigma && turn < kMaxRotationSigma;
}

// T_W_C, or nothing with too few or inconsistent corners.
std::optional<vio::Pose> solve(const vio::FeatureFrame& frame,
                               const std::map<vio::FeatureId, cv::Point3d>& target,
                               const Intrinsics& camera, bool all) {
    std::vector<cv::Point3d> points;
    std::vector<cv::Point2d> corners;
    for (const vio::FeatureObservation& seen : frame.features)
        if (const auto known = target.find(seen.feature_id); known != target.end()) {
            points.push_back(known->second);
            corners.emplace_back(seen.uv_px.x(), seen.uv_px.y());
        }
    if (points.size() < kMinCorners) return std::nullopt;
    cv::Vec3d rotation, translation;
    if (!cv::solvePnP(points, corners, camera.K, camera.distortion, rotation, translation, false,
                      cv::SOLVEPNP_SQPNP))
        return std::nullopt;
    cv::solvePnPRefineLM(points, corners, camera.K, camera.distortion, rotation, translation);

    std::vector<cv::Point2d> projected;
    cv::Mat jacobian;
    cv::projectPoints(points, rotation, translation, camera.K, camera.distortion, projected,
                      jacobian);
    const double rms = cv::norm(projected, corners) / std::sqrt(static_cast<double>(points.size()));
    if (rms > kMaxRms) return std::nullopt;
    if (!all && !well_known(jacobian, rotation, translation)) return std::nullopt;
    vio::Pose T_C_W;
    T_C_W.R = vio::so3::exp({rotation[0], rotation[1], rotation[2]});
    T_C_W.p = {translation[0], translation[1], translation[2]};
    return T_C_W.inverse();
}

void run(const std::string& rawlog, const std::string& target_file, const std::string& out,
         bool all, const vio::RecordingOptions& options) {
    const auto target = read_target(target_file);
    vio::Recording recording(rawlog, options);
    const Intrinsics camera(recording.rig().camera);
    const vio::Pose T_C_B = recording.rig().T_B_C.inverse();
    std::vector<vio::TimedPose> poses;
    int frames = 0;
    while (const auto message = recording.next())
        if (const auto* frame = std::get_if<vio::FeatureFrame>(&*message)) {
            ++frames;
            if (const auto T_W_C = solve(*frame, target, camera, all))
                poses.push_back({frame->t, *T_W_C * T_C_B});
        }
    vio::write_tum(out, poses, "T_W_B, W the board, from the board's corners image by image");
    std::printf("%s: %zu poses of %d images\n", out.c_str(), poses.size(), frames);
}

}  // namespace

int main(int argc, char** argv) {
    bool all = false, good = argc >= 4;
    vio::RecordingOptions options;
    for (int k = 4; k < argc; ++k) {
        const std::string argument = argv[k];
        if (argument == "--all")
            all = true;
        else if (argument == "--calibration" && k + 1 < argc)
            options.calibration_files.emplace_back(argv[++k]);
        else
            good = false;
    }
    if (!good) {
        std::fprintf(stderr,
                     "usage: vio_board_truth RAWLOG TARGET.csv OUT.tum [--all] "
                     "[--calibration FILE]\n");
        return 2;
    }
    try {
        run(argv[1], argv[2], argv[3], all, options);
    } catch (const std::exception& error) {
        std::fprintf(stderr, "vio_board_truth: error: %s\n", error.what());
        return 1;
    }
    return 0;
}
