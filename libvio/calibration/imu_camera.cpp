#include "libvio/calibration/imu_camera.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "libvio/base/errors.h"
#include "libvio/base/median.h"
#include "libvio/calibration/board.h"
#include "libvio/calibration/board_pose.h"

namespace vio {
namespace {

using Eigen::Vector3d;

[[noreturn]] void fail(const std::string& problem) {
    throw InputError("IMU-camera calibration: " + problem);
}

// Images with the camera's pose, by the known points alone.
struct Sight {
    FeatureFrame frame;
    Pose T_W_C;
};

std::vector<Sight> sights_of(const BatchProblem& problem) {
    constexpr size_t kFewestImages = 20;
    constexpr double kMisfit = 5;  // times the median: points that are mistaken
    std::vector<Sight> sights;
    std::vector<double> rms;
    for (const FeatureFrame& frame : problem.frames)
        if (const auto pose = board_pose(*problem.rig.camera, frame, problem.fiducials)) {
            sights.push_back({frame, pose->T_W_C});
            rms.push_back(pose->rms_px);
        }
    if (sights.size() < kFewestImages)
        fail("only " + std::to_string(sights.size()) + " of " +
             std::to_string(problem.frames.size()) + " images show the board; " +
             std::to_string(kFewestImages) + " are needed; compare the points' ids and the board");
    const double limit = kMisfit * median(rms);
    std::vector<Sight> good;
    for (size_t i = 0; i < sights.size(); ++i)
        if (rms[i] <= limit) good.push_back(std::move(sights[i]));
    return good;
}

// Mean gyro reading between two times from its integral.
class GyroIntegral {
 public:
    explicit GyroIntegral(const ImuSequence& imu) : imu_(imu) {
        sums_.push_back(Vector3d::Zero());
        const auto& r = imu.readings();
        for (size_t k = 1; k < r.size(); ++k)
            sums_.push_back(sums_.back() +
                            to_seconds(r[k].t - r[k - 1].t) / 2 * (r[k].gyro + r[k - 1].gyro));
    }

    std::optional<Vector3d> mean(TimeNs begin, TimeNs end) const {
        if (!imu_.covers(begin, end)) return std::nullopt;
        return (at(end) - at(begin)) / to_seconds(end - begin);
    }

 private:
    Vector3d at(TimeNs t) const {
        const auto& r = imu_.readings();
        const auto after = std::upper_bound(
            r.begin(), r.end(), t, [](TimeNs time, const ImuReading& x) { return time < x.t; });
        const auto before = after == r.begin() ? after : after - 1;
        const auto here = imu_.interpolate(t);
        return sums_[before - r.begin()] +
               to_seconds(t - before->t) / 2 * (before->gyro + here->gyro);
    }

    const ImuSequence& imu_;
    std::vector<Vector3d> sums_;
};

// Rotation of the camera against the IMU, and gyro bias, at one time offset: the turns of both
// between images, w_I = R_I_C w_C + b (Wahba's problem, by the singular values).
struct Turns {
    Eigen::Matrix3d R_I_C = Eigen::Matrix3d::Identity();
    Vector3d bias = Vector3d::Zero();
    double misfit = std::numeric_limits<double>::infinity();  // mean square [(rad/s)^2]
    double spread = 0;  // of the turns in the direction that sees least of them [rad/s]
};

Turns turns_at(const std::vector<Sight>& sights, const GyroIntegral& gyro, double offset) {
    constexpr double kLongest = 0.3;  // [s] between images
    std::vector<Vector3d> camera, imu;
    for (size_t i = 1; i < sights.size(); ++i) {
        const TimeNs begin = sights[i - 1].frame.t, end = sights[i].frame.t;
        const double T = to_seconds(end - begin);
        const auto w = gyro.mean(begin + from_seconds(offset), end + from_seconds(offset));
        if (T > kLongest || !w) continue;
        camera.push_back(so3::log(sights[i - 1].T_W_C.R.transpose() * sights[i].T_W_C.R) / T);
        imu.push_back(*w);
    }
    Turns turns;
    const double n = static_cast<double>(camera.size());
    if (n < 10) return turns;
    Vector3d mean_C = Vector3d::Zero(), mean_I = Vector3d::Zero();
    for (size_t i = 0; i < camera.size(); ++i) {
        mean_C += camera[i] / n;
        mean_I += imu[i] / n;
    }
    Eigen::Matrix3d M = Eigen::Matrix3d::Zero(), spread = Eigen::Matrix3d::Zero();
    for (size_t i = 0; i < camera.size(); ++i) {
        M += (imu[i] - mean_I) * (camera[i] - mean_C).transpose();
        spread += (camera[i] - mean_C) * (camera[i] - mean_C).transpose() / n;
    }
    const Eigen::JacobiSVD<Eigen::Matrix3d> svd(M, Eigen::ComputeFullU | Eigen::ComputeFullV);
    const Eigen::Matrix3d UV = svd.matrixU() * svd.matrixV().transpose();
    turns.R_I_C =
        svd.matrixU() * Vector3d(1, 1, UV.determinant()).asDiagonal() * svd.matrixV().transpose();
    turns.bias = mean_I - turns.R_I_C * mean_C;
    turns.misfit = 0;
    for (size_t i = 0; i < camera.size(); ++i)
        turns.misfit += (imu[i] - turns.R_I_C * camera[i] - turns.bias).squaredNorm() / n;
    // Two axes suffice.
    turns.spread =
        std::sqrt(Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(spread).eigenvalues()(1));
    return turns;
}

// The offset at which the turns fit best: on a grid, then by golden sections about its best.
double find_offset(const std::vector<Sight>& sights, const GyroIntegral& gyro, double about,
                   double largest) {
    constexpr double kStep = 0.01;
    const auto misfit = [&](double offset) { return turns_at(sights, gyro, offset).misfit; };
    double best = about, least = misfit(about);
    for (double d = -largest; d <= largest; d += kStep)
        if (const double m = misfit(about + d); m < least) {
            least = m;
            best = about + d;
        }
    double low = best - kStep, high = best + kStep;
    const double golden = (std::sqrt(5.0) - 1) / 2;
    for (int i = 0; i < 20; ++i) {
        const double a = high - golden * (high - low), b = low + golden * (high - low);
        (misfit(a) < misfit(b) ? high : low) = misfit(a) < misfit(b) ? b : a;
    }
    return (low + high) / 2;
}

// States from the camera's poses; velocities by differences, gravity by the mean specific force.
Estimate start_from(const std::vector<Sight>& sights, const BatchProblem& problem,
                    const Vector3d& gyro_bias, double gravity_norm) {
    const Pose T_C_B = problem.rig.T_B_C.inverse();
    const TimeNs offset = from_seconds(problem.rig.time_offset);
    Estimate start;
    Vector3d force = Vector3d::Zero();
    for (size_t i = 0; i < sights.size(); ++i) {
        StateEstimate state;
        state.t = sights[i].frame.t;
        state.T_W_B = sights[i].T_W_C * T_C_B;
        state.gyro_bias = gyro_bias;
        const size_t a = i == 0 ? 0 : i - 1, b = std::min(i + 1, sights.size() - 1);
        state.v_W = ((sights[b].T_W_C * T_C_B).p - (sights[a].T_W_C * T_C_B).p) /
                    to_seconds(sights[b].frame.t - sights[a].frame.t);
        force += state.T_W_B.R *
                 (problem.rig.T_B_I.R * problem.imu.interpolate(state.t + offset)->accel);
        start.states.push_back(state);
    }
    if (!(force.norm() > 0)) fail("the accelerometer reads zero; check the recording");
    start.g_W = -gravity_norm * force.normalized();
    start.landmarks = landmarks_of(problem.fiducials);
    return start;
}

}  // namespace

RigCalibration calibrate_imu_camera(const BatchProblem& given, const ImuCameraOptions& options) {
    constexpr double kFewestTurns = 0.05;  // [rad/s], about the second axis
    constexpr TimeNs kMargin = 20'000'000;
    if (!given.rig.camera) fail("no camera calibration; give one");
    if (given.fiducials.empty()) fail("no known points");
    if (given.imu.empty()) fail("no IMU readings");
    std::vector<Sight> sights = sights_of(given);

    // 1. Rotation and time offset by the turns of camera and gyro.
    BatchProblem problem = given;
    const GyroIntegral gyro(problem.imu);
    problem.rig.time_offset =
        find_offset(sights, gyro, given.rig.time_offset, options.largest_offset);
    const Turns turns = turns_at(sights, gyro, problem.rig.time_offset);
    if (!std::isfinite(turns.misfit))
        fail("images and IMU readings hardly overlap in time; compare their clocks");
    if (turns.spread < kFewestTurns)
        fail("the camera hardly turns, or about one axis only; turn it about all three");
    problem.rig.T_B_C = given.rig.T_B_I * Pose{turns.R_I_C, given.rig.T_I_C().p};

    // 2. Everything by the batch estimator, from the images inside the readings.
    const TimeNs offset = from_seconds(problem.rig.time_offset);
    std::erase_if(sights, [&](const Sight& s) {
        return !problem.imu.covers(s.frame.t + offset - kMargin, s.frame.t + offset + kMargin);
    });
    problem.frames.clear();
    for (const Sight& sight : sights) problem.frames.push_back(sight.frame);
    const Estimate start = start_from(sights, problem, turns.bias, options.batch.gravity_norm);
    return calibrate_rig(problem, options.batch, {true, true, options.intrinsics}, start);
}

}  // namespace vio
