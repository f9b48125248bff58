// What keeps noise from telling, or moving, the filter's scale.
#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <random>
#include <vector>

#include "libvio/camera/perspective.h"
#include "libvio/recursive/errors_in_variables.h"
#include "libvio/recursive/window.h"

namespace vio {
namespace {

using Eigen::MatrixXd;
using Eigen::Vector3d;

// Errors of a core and a clone, and the part of them that noise has in their sensitivity to scale,
// both of many samples: what ErrorsInVariables says of them holds for the samples.
class SensitivitySamples {
 public:
    static constexpr int kCore = 15, kClone = 6, kWindow = 21, kLandmark = 3, kMeasured = 4;
    static constexpr int kDistance = kWindow + 2;

    void propagate() {
        const CoreMatrix F = CoreMatrix::Identity(kCore, kCore) + 0.2 * drawn(kCore, kCore);
        const MatrixXd root = 0.3 * drawn(kCore, kCore);
        CoreMatrix M = F;  // what attitude and biases do to what is read of position and velocity
        M.middleRows<3>(kRotation).setZero();
        M.bottomRows(kCore - kGyroBias).setZero();
        M.middleCols<6>(kPosition).setZero();
        const CoreMatrix P_core = P_.topLeftCorner(kCore, kCore);
        tracked_.propagate(F, root * root.transpose(), P_core);
        const MatrixXd w = root * drawn(kCore, samples());
        noise_.topRows(kCore) = (F * noise_.topRows(kCore) + M * errors_.topRows(kCore)).eval();
        noise_.middleRows<6>(kPosition) += w.middleRows<6>(kPosition);
        errors_.topRows(kCore) = (F * errors_.topRows(kCore) + w).eval();
        tracked_.settle(P_.bottomLeftCorner(P_.rows() - kCore, kCore));
        MatrixXd T = MatrixXd::Identity(P_.rows(), P_.rows());
        T.topLeftCorner(kCore, kCore) = F;
        P_ = (T * P_ * T.transpose()).eval();
        P_.topLeftCorner(kCore, kCore) += root * root.transpose();
    }

    void clone() {
        tracked_.clone(kCore, true);
        MatrixXd T = MatrixXd::Identity(kWindow, kCore);
        T.bottomLeftCorner(kClone, kClone).setIdentity();
        become(T);
    }

    // One whose distance errs with the clone. It alone reads scale.
    void add_landmark() {
        scale_.direction = drawn(kWindow + kLandmark, 1);
        scale_.reading =
            Eigen::VectorXd::Unit(kWindow + kLandmark, kDistance) / scale_.direction(kDistance);
        MatrixXd G = MatrixXd::Zero(kLandmark, kClone);
        G.bottomRows<1>() = drawn(1, kClone);
        tracked_.augment(kCore, G);
        tracked_.read_scale_anew(kCore, G, scale_);
        MatrixXd T = MatrixXd::Identity(kWindow + kLandmark, kWindow);
        T.block(kWindow, kCore, kLandmark, kClone) = G;
        become(T);
        P_.bottomRightCorner(kLandmark, kLandmark) += MatrixXd::Identity(kLandmark, kLandmark);
        errors_.bottomRows(kLandmark) += drawn(kLandmark, samples());
        read_scale();
    }

    // Images do not see how much of the noise is scale.
    void read_scale() { noise_ -= scale_.direction * (scale_.reading.transpose() * noise_).eval(); }

    void become(const MatrixXd& T) {
        P_ = (T * P_ * T.transpose()).eval();
        errors_ = (T * errors_).eval();
        noise_ = (T * noise_).eval();
    }

    void update() {
        const Eigen::Index n = P_.rows();
        MatrixXd H = MatrixXd::Zero(kMeasured, n);
        H.leftCols(kWindow) = drawn(kMeasured, kWindow);
        H.col(kDistance) = drawn(kMeasured, 1);
        const MatrixXd S = H * P_ * H.transpose() + MatrixXd::Identity(kMeasured, kMeasured);
        const MatrixXd gain = P_ * H.transpose() * S.inverse(),
                       reduction = MatrixXd::Identity(n, n) - gain * H;
        const MatrixXd y = H * errors_ + drawn(kMeasured, samples());
        noise_ = (reduction * (noise_ - tracked_.correlation() * H.transpose() * S.inverse() * y))
                     .eval();
        read_scale();
        errors_ -= gain * y;
        P_ = (reduction * P_).eval();
        const auto times_Ht = [&](const blas::ConstMatrix& M) -> MatrixXd {
            return M * H.leftCols(M.cols()).transpose();
        };
        tracked_.take_out(times_Ht, S.llt().matrixL().toDenseMatrix());
        tracked_.update(gain, times_Ht, scale_);
    }

    // Of a correlation between samples, from what is stated, beside the largest of its kind.
    double difference(const MatrixXd& a, const MatrixXd& b, const MatrixXd& stated) const {
        const MatrixXd sampled = a * b.transpose() / samples();
        return (sampled - stated).cwiseAbs().maxCoeff() / stated.cwiseAbs().maxCoeff();
    }
    void check() const {
        EXPECT_LT(difference(noise_, errors_, tracked_.correlation()), kBound);
        const MatrixXd window = noise_.topRows(kWindow);
        EXPECT_LT(difference(window, window, tracked_.noise()), kBound);
    }

 private:
    static constexpr double kBound = 0.06;
    static int samples() { return 20000; }
    MatrixXd drawn(Eigen::Index rows, Eigen::Index columns) {
        std::normal_distribution<double> normal;
        return MatrixXd::NullaryExpr(rows, columns, [&] { return normal(random_); });
    }

    std::mt19937 random_{3};
    ErrorsInVariables tracked_;
    ErrorsInVariables::Scale scale_;
    MatrixXd P_ = MatrixXd::Identity(kCore, kCore);
    MatrixXd errors_ = drawn(kCore, samples()), noise_ = MatrixXd::Zero(kCore, samples());
};

TEST(ErrorsInVariables, SaysWhatNoiseIsInTheSensitivity) {
    SensitivitySamples samples;
    samples.propagate();
    samples.propagate();
    samples.clone();
    samples.add_landmark();
    samples.check();
    samples.update();
    samples.check();
    for (int i = 0; i < 3; ++i) {
        samples.propagate();
        samples.update();
    }
    samples.check();
}

TEST(ErrorsInVariables, ShareOfMotionIsThatOfTheMeans) {
    ErrorsInVariables tracked;
    EXPECT_EQ(tracked.share_of_motion(2, 0), 1);
    double share = 0;
    for (int i = 0; i < 400; ++i) share = tracked.share_of_motion(i % 2 ? 0.5 : 1.5, 0.25);
    EXPECT_NEAR(share, 0.75, 0.02);
    for (int i = 0; i < 400; ++i) share = tracked.share_of_motion(1, 1.5);
    EXPECT_EQ(share, 0);
    tracked.forget();
    EXPECT_EQ(tracked.share_of_motion(1, 0.5), 0.5);
}

// A camera moves sideways past points of one distance. Which of them become landmarks first must
// not depend on what noise makes of that distance: judged by it, those that seem near come first.
TEST(Window, NewLandmarksAreNotThoseThatNoiseBringsNear) {
    constexpr double kRho = 0.25, kStep = 0.03, kFocal = 500, kSigma = 2;
    constexpr int kImages = 12, kPoints = 40, kRuns = 40;
    PerspectiveParameters parameters;
    parameters.width = parameters.height = 1000;
    parameters.fx = parameters.fy = kFocal;
    parameters.cx = parameters.cy = 500;
    const auto camera = std::make_shared<PerspectiveCamera>(parameters);
    WindowOptions options;
    options.max_landmarks = options.max_points = 2 * kPoints;
    options.angular_sigma = kSigma / kFocal;
    std::mt19937 random(7);
    std::normal_distribution<double> noise(0, kSigma);
    std::uniform_real_distribution<double> side(-2, 2);
    double sum = 0, sum2 = 0;
    int count = 0;
    for (int run = 0; run < kRuns; ++run) {
        const CoreMatrix exact = 1e-12 * CoreMatrix::Identity(15, 15);
        FilterState state(CoreKind::inertial, {}, exact, true);
        state.start_mount({}, MatrixXd());
        state.clone(0);
        LandmarkState usual;
        usual.anchor = 0;
        usual.point.x = {0, 0, kRho};
        state.start_landmarks({usual}, 1e-12 * MatrixXd::Identity(24, 24));
        Window window(options, camera);
        std::vector<Vector3d> points;
        for (int i = 0; i < kPoints; ++i) points.emplace_back(side(random), side(random), 1 / kRho);
        std::vector<bool> known(kPoints);
        for (int image = 0; image < kImages; ++image) {
            if (image > 0) {
                CoreState core;
                core.T_W_I.p.x() = image * kStep;
                state.propagate(core, CoreMatrix::Identity(15, 15), 0 * exact);
                state.settle();
                state.clone(image);
            }
            for (int i = 0; i < kPoints; ++i) {
                if (known[i]) continue;
                FeatureObservation feature;
                feature.feature_id = i;
                feature.uv_px = *camera->project(points[i] - Vector3d(image * kStep, 0, 0)) +
                                Eigen::Vector2d(noise(random), noise(random));
                window.observe(i, image, *make_sight(feature, kSigma));
            }
            const std::size_t before = state.landmarks().size();
            window.use(state, image, -1);
            for (std::size_t i = before; i < state.landmarks().size(); ++i) {
                const LandmarkState& landmark = state.landmarks()[i];
                known[static_cast<std::size_t>(landmark.id)] = true;
                const Vector3d seen_from = state.clones()[landmark.anchor].T_W_I.p;
                const Vector3d& point = points[static_cast<std::size_t>(landmark.id)];
                const double error = landmark.point.x.z() * (point - seen_from).norm() - 1;
                sum += error;
                sum2 += error * error;
                ++count;
            }
        }
    }
    ASSERT_GT(count, kRuns * kPoints * 9 / 10);
    const double mean = sum / count, sigma = std::sqrt(sum2 / count / count);
    RecordProperty("mean", std::to_string(mean));
    RecordProperty("sigma", std::to_string(sigma));
    EXPECT_LT(std::abs(mean), 3 * sigma);
}

}  // namespace
}  // namespace vio
