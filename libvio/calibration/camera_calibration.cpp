#include "libvio/calibration/camera_calibration.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "libvio/base/angles.h"
#include "libvio/base/errors.h"
#include "libvio/base/median.h"
#include "libvio/calibration/board_pose.h"
#include "libvio/camera/description.h"

namespace vio {
namespace {

[[noreturn]] void fail(const std::string& problem) {
    throw InputError("camera calibration: " + problem);
}

CameraPtr camera_with(const CameraCalibrationOptions& options, double focal_length) {
    CameraDescription d;
    d.model = options.model;
    d.lens.width = options.width;
    d.lens.height = options.height;
    d.lens.fx = d.lens.fy = focal_length;
    d.lens.cx = (options.width - 1) / 2.0;
    d.lens.cy = (options.height - 1) / 2.0;
    return make_camera(d);
}

// Evenly over the recording.
std::vector<FeatureFrame> some_of(const std::vector<FeatureFrame>& frames, size_t most) {
    std::vector<FeatureFrame> some;
    const size_t n = frames.size();
    for (size_t k = 0; k < std::min(n, most); ++k)
        some.push_back(frames[k * n / std::min(n, most)]);
    return some;
}

// Root of the mean over images of the smaller ones' squared misfit: an image that fails counts as
// the worst.
double misfit(const Camera& camera, const std::vector<FeatureFrame>& frames, const Board& board) {
    std::vector<double> rms;
    for (const FeatureFrame& frame : frames) {
        const auto pose = board_pose(camera, frame, board.points);
        rms.push_back(pose ? pose->rms_px : std::numeric_limits<double>::infinity());
    }
    return median(std::move(rms));
}

CameraPtr start_camera(const std::vector<FeatureFrame>& frames, const Board& board,
                       const CameraCalibrationOptions& options) {
    constexpr size_t kImages = 15;
    constexpr double kNarrowest = 4, kStep = 1.12;  // focal length over the image's width
    const double widest = options.model == "fisheye" ? 0.2 : 0.3;
    const std::vector<FeatureFrame> some = some_of(frames, kImages);
    CameraPtr best;
    double least = std::numeric_limits<double>::infinity();
    for (double f = widest; f < kNarrowest; f *= kStep) {
        CameraPtr camera = camera_with(options, f * options.width);
        if (const double m = misfit(*camera, some, board); m < least) {
            least = m;
            best = std::move(camera);
        }
    }
    if (!best)
        fail("no pose of the board is found in most images; compare it with its description");
    return best;
}

Coverage coverage_of(const RigCalibration& rig, const CameraCalibrationOptions& options) {
    Coverage c;
    const double w = options.width, h = options.height;
    for (const RigCalibration::Residual& r : rig.residuals) {
        if (r.outlier) continue;
        const int col = std::clamp(static_cast<int>(r.uv_px.x() / w * c.kCols), 0, c.kCols - 1),
                  row = std::clamp(static_cast<int>(r.uv_px.y() / h * c.kRows), 0, c.kRows - 1);
        ++c.cells[row][col];
        c.outermost = std::max(c.outermost, std::hypot(r.uv_px.x() - w / 2, r.uv_px.y() - h / 2) /
                                                std::hypot(w / 2, h / 2));
    }
    int filled = 0;
    for (const auto& row : c.cells)
        for (int cell : row) filled += cell > 0;
    c.share = filled / static_cast<double>(c.kCols * c.kRows);
    for (const TimedPose& pose : rig.T_W_C)
        c.widest_tilt =
            std::max(c.widest_tilt, std::acos(std::min(1.0, std::abs(pose.T_W_B.R(2, 2)))));
    constexpr double kShare = 0.7, kOutermost = 0.8, kTilt = 20 * kDegree;
    constexpr int kImages = 10;
    const auto percent = [](double share) {
        return std::to_string(std::lround(100 * share)) + " %";
    };
    if (c.share < kShare)
        c.warnings.push_back("corners in " + percent(c.share) +
                             " of the image only: move the board over all of it");
    if (c.outermost < kOutermost)
        c.warnings.push_back("no corner beyond " + percent(c.outermost) +
                             " of the way to the image's corners: distortion there is guessed");
    if (c.widest_tilt < kTilt)
        c.warnings.push_back("the board is never tilted by more than " +
                             std::to_string(std::lround(c.widest_tilt / kDegree)) +
                             " degrees: focal length and distance are hardly told apart");
    if (rig.images < kImages)
        c.warnings.push_back(std::to_string(rig.images) + " images only: take " +
                             std::to_string(kImages) + " or more");
    return c;
}

}  // namespace

CameraCalibration calibrate_camera(const std::vector<FeatureFrame>& frames, const Board& board,
                                   const CameraCalibrationOptions& options) {
    constexpr size_t kFewestImages = 3;
    constexpr size_t kFewestCorners = 12;
    std::vector<FeatureFrame> useful;
    for (const FeatureFrame& frame : frames)
        if (frame.features.size() >= kFewestCorners) useful.push_back(frame);
    CameraCalibration result;
    result.images_with_board = static_cast<int>(useful.size());
    if (useful.size() < kFewestImages)
        fail(std::to_string(useful.size()) + " image(s) show " + std::to_string(kFewestCorners) +
             " corners or more; at least " + std::to_string(kFewestImages) + " must");
    if (options.most_images > 0) useful = some_of(useful, static_cast<size_t>(options.most_images));

    // 1. Focal length and poses without distortion.
    BatchProblem problem;
    problem.rig.camera = start_camera(useful, board, options);
    problem.fiducials = board.points;
    Estimate start;
    for (const FeatureFrame& frame : useful)
        if (const auto pose = board_pose(*problem.rig.camera, frame, board.points)) {
            StateEstimate state;
            state.t = frame.t;
            state.T_W_B = pose->T_W_C;
            start.states.push_back(state);
            problem.frames.push_back(frame);
        }
    start.landmarks = landmarks_of(board.points);

    // 2. Everything.
    BatchOptions batch;
    batch.sigma_px = options.sigma_px;
    batch.loss = "none";  // outliers are dropped
    result.rig = calibrate_rig(problem, batch, {false, false, 4 + options.distortion}, start);
    result.coverage = coverage_of(result.rig, options);
    return result;
}

}  // namespace vio
