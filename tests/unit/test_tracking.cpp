#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <random>
#include <set>

#include "libvio/base/errors.h"
#include "libvio/camera/perspective.h"
#include "libvio/geometry/so3.h"
#include "libvio/tracking/front_end.h"
#include "libvio/tracking/gyro_prediction.h"
#include "libvio/tracking/patch.h"
#include "libvio/tracking/tracker.h"
#include "libvio/tracking/two_view.h"

namespace vio {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr int kWidth = 480, kHeight = 320;
constexpr double kFocal = 300;

CameraPtr camera() {
    return std::make_shared<PerspectiveCamera>(
        PerspectiveParameters{kWidth, kHeight, kFocal, kFocal, 239.5, 159.5, {}});
}

// Smooth random grey values, larger than the image, with structure of several sizes.
const cv::Mat& texture() {
    static const cv::Mat image = [] {
        cv::Mat sum(900, 1100, CV_32F, cv::Scalar(0));
        cv::RNG random(7);
        for (const double sigma : {2.0, 5.0}) {
            cv::Mat noise(sum.size(), CV_32F);
            random.fill(noise, cv::RNG::NORMAL, 0, 1);
            cv::GaussianBlur(noise, noise, {}, sigma);
            cv::Scalar mean, deviation;
            cv::meanStdDev(noise, mean, deviation);
            sum += noise / deviation[0];
        }
        cv::Mat grey;
        sum.convertTo(grey, CV_8U, 30, 128);
        return grey;
    }();
    return image;
}

// A textured plane at infinity (homography K R^T K^-1) seen by a camera of attitude R_W_C.
cv::Mat view(const Matrix3d& R_W_C, const cv::Mat& plane = texture()) {
    Matrix3d K, K_texture;
    K << kFocal, 0, 239.5, 0, kFocal, 159.5, 0, 0, 1;
    K_texture << kFocal, 0, 549.5, 0, kFocal, 449.5, 0, 0, 1;
    const Matrix3d H = K_texture * R_W_C * K.inverse();
    const cv::Matx33d M(H(0, 0), H(0, 1), H(0, 2), H(1, 0), H(1, 1), H(1, 2), H(2, 0), H(2, 1),
                        H(2, 2));
    cv::Mat image;
    cv::warpPerspective(plane, image, M, {kWidth, kHeight},
                        cv::INTER_LINEAR | cv::WARP_INVERSE_MAP);
    return image;
}

Vector2d place(const Vector3d& f_W, const Matrix3d& R_W_C) {
    return *camera()->project(R_W_C.transpose() * f_W);
}

// Directions in the world of all features of a frame.
std::map<FeatureId, Vector3d> directions(const FeatureFrame& frame, const Matrix3d& R_W_C) {
    std::map<FeatureId, Vector3d> result;
    for (const auto& f : frame.features)
        result[f.feature_id] = R_W_C * camera()->ray(f.uv_px)->direction;
    return result;
}

// Errors [px] of the features of a frame that are known from before.
std::vector<double> errors(const FeatureFrame& frame, const Matrix3d& R_W_C,
                           const std::map<FeatureId, Vector3d>& truth) {
    std::vector<double> result;
    for (const auto& f : frame.features)
        if (const auto it = truth.find(f.feature_id); it != truth.end())
            result.push_back((f.uv_px - place(it->second, R_W_C)).norm());
    std::sort(result.begin(), result.end());
    return result;
}

TEST(FeatureTracker, FollowsARotatingViewWithoutDrift) {
    FeatureTracker tracker(TrackerOptions{}, camera());
    std::map<FeatureId, Vector3d> first;
    std::set<FeatureId> dead;
    std::set<FeatureId> alive;
    for (int i = 0; i <= 20; ++i) {
        const Matrix3d R = so3::exp(Vector3d(0.004, -0.003, 0.01) * i);
        const FeatureFrame frame = tracker.track(i + 1, view(R));
        std::set<FeatureId> now;
        for (const auto& f : frame.features) EXPECT_TRUE(now.insert(f.feature_id).second);
        for (const FeatureId id : now) EXPECT_FALSE(dead.contains(id)) << "id used again";
        for (const FeatureId id : alive)
            if (!now.contains(id)) dead.insert(id);
        alive = now;
        for (const auto& [id, f] : directions(frame, R)) first.emplace(id, f);
        if (i < 20) continue;
        const auto e = errors(frame, R, first);
        EXPECT_GT(frame.features.size(), 100u);
        EXPECT_LT(e[e.size() / 2], 0.1);
        EXPECT_LT(e[e.size() * 99 / 100], 0.5);
    }
}

TEST(FeatureTracker, PredictionLetsLongJumpsBeTracked) {
    const Matrix3d R = so3::exp(Vector3d(0, 40 / kFocal, 0));
    TrackerOptions options;
    options.pyramid_levels = 2;
    const auto followed = [&](const std::optional<Matrix3d>& prediction) {
        FeatureTracker tracker(options, camera());
        const auto truth =
            directions(tracker.track(1, view(Matrix3d::Identity())), Matrix3d::Identity());
        const auto e = errors(tracker.track(2, view(R), prediction), R, truth);
        return std::count_if(e.begin(), e.end(), [](double px) { return px < 0.5; });
    };
    const auto with = followed(R);
    EXPECT_GT(with, 80);
    EXPECT_GT(with, 2 * followed(std::nullopt));
}

TEST(FeatureTracker, SurvivesExposureChangeAndDarkImage) {
    FeatureTracker tracker(TrackerOptions{}, camera());
    const auto attitude = [](int i) { return so3::exp(Vector3d(0.002, 0.003, 0) * i); };
    const auto truth = directions(tracker.track(1, view(attitude(0))), attitude(0));
    cv::Mat dimmed;
    view(attitude(1)).convertTo(dimmed, CV_8U, 0.6);
    EXPECT_GT(errors(tracker.track(2, dimmed), attitude(1), truth).size(), 100u);
    const cv::Mat dark(kHeight, kWidth, CV_8U, cv::Scalar(2));
    EXPECT_TRUE(tracker.track(3, dark).features.empty());
    EXPECT_TRUE(tracker.report().blank);
    const auto e = errors(tracker.track(4, view(attitude(3))), attitude(3), truth);
    ASSERT_GT(e.size(), 90u);
    EXPECT_LT(e[e.size() / 2], 0.1);
}

// What the caller gives stays his: exposure is undone in a copy.
TEST(FeatureTracker, LeavesTheGivenImageAlone) {
    FeatureTracker tracker(TrackerOptions{}, camera());
    tracker.track(1, view(Matrix3d::Identity()));
    cv::Mat dimmed;
    view(Matrix3d::Identity()).convertTo(dimmed, CV_8U, 0.6);
    const cv::Mat given = dimmed.clone();
    tracker.track(2, dimmed);
    EXPECT_EQ(cv::norm(dimmed, given, cv::NORM_INF), 0);
}

// Images are missing; the gyro, with a bias, bridges the gap of 24 px and a turn.
TEST(FeatureTracker, GoesOnAfterDroppedImages) {
    FeatureTracker tracker(TrackerOptions{}, camera());
    const auto attitude = [](double i) { return so3::exp(Vector3d(0.004, 0.016, 0.01) * i); };
    std::map<FeatureId, Vector3d> truth;
    TimeNs last = 0;
    std::size_t expected = 0;
    for (const int i : {0, 1, 2, 7, 8}) {
        const Matrix3d given = attitude(last).transpose() * attitude(i) *
                               so3::exp(Vector3d(0.0005, -0.0005, 0.0005) * (i - last));
        const FeatureFrame frame = tracker.track(i + 1, view(attitude(i)), given);
        if (i == 2) {
            truth = directions(frame, attitude(i));
            for (const auto& [id, f] : truth)
                expected += camera()->inside_image(place(f, attitude(8)), 15);
        }
        last = i;
        if (i < 7) continue;
        const auto e = errors(frame, attitude(i), truth);
        EXPECT_GT(static_cast<double>(e.size()), 0.9 * static_cast<double>(expected));
        EXPECT_LT(e[e.size() / 2], 0.15);
        EXPECT_LT(e[e.size() * 99 / 100], 1);
    }
}

// Without a gyro the view jumps by more than a square of a checker wall. Only an estimator can tell
// the squares apart; features that it does not speak of, and all where it is plainly wrong, are
// found or not as without it.
TEST(FeatureTracker, SearchesWhereTheEstimatorExpects) {
    constexpr int kSquare = 22;
    cv::Mat wall(900, 1100, CV_8U);
    for (int y = 0; y < wall.rows; ++y)
        for (int x = 0; x < wall.cols; ++x)
            wall.at<unsigned char>(y, x) = (x / kSquare + y / kSquare) % 2 ? 190 : 60;
    cv::GaussianBlur(wall, wall, {}, 0.8);
    const Matrix3d R1 = Matrix3d::Identity(), R2 = so3::exp(Vector3d(0.002, 40 / kFocal, 0));
    const auto correct = [&](const Vector2d& error_px, double sigma_px) {
        FeatureTracker tracker(TrackerOptions{}, camera());
        const auto truth = directions(tracker.track(1, view(R1, wall)), R1);
        std::vector<PredictedFeature> predicted;
        for (const auto& [id, f] : truth)
            predicted.push_back(
                {id, place(f, R2) + error_px, sigma_px * sigma_px * Eigen::Matrix2d::Identity()});
        const auto e = errors(tracker.track(2, view(R2, wall), {}, predicted), R2, truth);
        return std::count_if(e.begin(), e.end(), [](double px) { return px < 0.5; });
    };
    EXPECT_GT(correct({1.5, -2}, 2), 60);
    EXPECT_LT(correct({0, 0}, 100), 10) << "knows no better than the tracker";
}

// The camera moves to the right past two walls of different depth; a part moves down.
TEST(FeatureTracker, RejectsAPartThatMovesByItself) {
    FeatureTracker tracker(TrackerOptions{}, camera());
    const cv::Rect part(150, 100, 120, 120);
    std::map<FeatureId, int> seen;  // images in which a feature lay inside the moving part
    std::size_t outside = 0;
    for (int i = 0; i < 6; ++i) {
        cv::Mat image = texture()(cv::Rect(50 + 4 * i, 50, kWidth, kHeight)).clone();
        const cv::Rect lower(0, kHeight / 2, kWidth, kHeight / 2);
        texture()(cv::Rect(300 + 8 * i, 500, lower.width, lower.height)).copyTo(image(lower));
        texture()(cv::Rect(600, 500 - 5 * i, part.width, part.height)).copyTo(image(part));
        outside = 0;
        for (const auto& f : tracker.track(i + 1, image, Matrix3d::Identity()).features) {
            const bool inside = (f.uv_px - Vector2d(210, 160)).cwiseAbs().maxCoeff() < 45;
            if (inside) {
                EXPECT_LE(++seen[f.feature_id], 1) << "followed in the moving part";
            } else {
                ++outside;
            }
        }
    }
    EXPECT_FALSE(seen.empty());
    EXPECT_GT(outside, 60u);
}

TEST(FeatureTracker, SameBytesWhateverTheThreadCount) {
    const auto run = [](int threads) {
        cv::setNumThreads(threads);
        FeatureTracker tracker(TrackerOptions{}, camera());
        std::vector<double> all;
        for (int i = 0; i < 4; ++i)
            for (const auto& f :
                 tracker.track(i + 1, view(so3::exp(Vector3d(0.01, 0, 0.01) * i))).features)
                all.insert(all.end(), {double(f.feature_id), f.uv_px.x(), f.uv_px.y()});
        return all;
    };
    const auto one = run(1), two = run(2);
    cv::setNumThreads(-1);
    EXPECT_EQ(one, two);
}

TEST(FeatureTracker, HonoursMaskDistanceAndWantedNumber) {
    TrackerOptions options;
    options.max_features = 60;
    FeatureTracker tracker(options, camera());
    cv::Mat mask(kHeight, kWidth, CV_8U, cv::Scalar(255));
    mask(cv::Rect(0, 0, kWidth / 2, kHeight)).setTo(0);
    tracker.set_mask(mask);
    for (int i = 0; i < 3; ++i) {
        const FeatureFrame frame = tracker.track(i + 1, view(so3::exp(Vector3d(0, 0.02, 0) * i)));
        EXPECT_GT(frame.features.size(), 45u);
        EXPECT_LE(frame.features.size(), 60u);
        for (const auto& f : frame.features) EXPECT_GE(f.uv_px.x(), kWidth / 2 - 0.5);
        if (i > 0) continue;
        for (const auto& a : frame.features)
            for (const auto& b : frame.features)
                if (a.feature_id != b.feature_id) {
                    EXPECT_GT((a.uv_px - b.uv_px).norm(), options.min_distance_px - 3);
                }
    }
}

TEST(FeatureTracker, EndsTracksOnRequestAndRefusesForeignImages) {
    FeatureTracker tracker(TrackerOptions{}, camera());
    const FeatureFrame frame = tracker.track(1, view(Matrix3d::Identity()));
    const FeatureId gone = frame.features.front().feature_id;
    tracker.end_tracks({gone});
    for (const auto& f : tracker.track(2, view(Matrix3d::Identity())).features)
        EXPECT_NE(f.feature_id, gone);
    EXPECT_THROW(tracker.track(3, cv::Mat(100, 100, CV_8U, cv::Scalar(0))), InputError);
    EXPECT_THROW(tracker.track(3, cv::Mat(kHeight, kWidth, CV_8UC3)), InputError);
    EXPECT_THROW(tracker.track(2, view(Matrix3d::Identity())), InputError);
}

// Directions of the features of one run, each where it was first seen, and how later sights fit.
class Judge {
 public:
    void add(const FeatureFrame& frame, const Matrix3d& R_W_C) {
        alive_ = 0;
        errors_.clear();
        for (const auto& [id, f] : directions(frame, R_W_C)) {
            const auto [first, is_new] = first_.emplace(id, f);
            if (is_new) continue;
            ++alive_;
            errors_.push_back(
                (*camera()->project(R_W_C.transpose() * f) - place(first->second, R_W_C)).norm());
            ++observations_;
            mistracks_ += errors_.back() > 2;
        }
        std::sort(errors_.begin(), errors_.end());
    }
    int alive() const { return alive_; }  // features of the last frame that were known before
    double median() const { return errors_.empty() ? 1e9 : errors_[errors_.size() / 2]; }
    double mistrack_share() const { return static_cast<double>(mistracks_) / observations_; }

 private:
    std::map<FeatureId, Vector3d> first_;
    std::vector<double> errors_;  // of the last frame
    int alive_ = 0, observations_ = 0, mistracks_ = 0;
};

// A wall of squares, each corner like its neighbours but one; from image to image it moves by more
// than a square. The gyro says where, but for a bias.
TEST(FeatureTracker, KeepsItsPlaceOnACheckerWall) {
    constexpr int kSquare = 22;
    cv::Mat wall(900, 1100, CV_8U);
    for (int y = 0; y < wall.rows; ++y)
        for (int x = 0; x < wall.cols; ++x)
            wall.at<unsigned char>(y, x) = (x / kSquare + y / kSquare) % 2 ? 190 : 60;
    cv::GaussianBlur(wall, wall, {}, 0.8);
    const Vector3d rate(0.01, 27 / kFocal, 0.02);  // per image
    FeatureTracker tracker(TrackerOptions{}, camera());
    Judge judge;
    for (int i = 0; i < 12; ++i) {
        const int step = i < 6 ? i : 12 - i;  // there and back: the wall is not wide
        const Matrix3d R = so3::exp((step - 3.0) * rate);
        const double sign = i <= 6 ? 1 : -1;
        const Matrix3d given = so3::exp(sign * rate + Vector3d(0.004, -0.006, 0.003));
        judge.add(tracker.track(i + 1, view(R, wall), given), R);
    }
    EXPECT_GT(judge.alive(), 60);
    EXPECT_LT(judge.median(), 0.3);
    EXPECT_LT(judge.mistrack_share(), 0.01);
}

// Motion blur over several images: most features are there again when the image is sharp.
TEST(FeatureTracker, FindsFeaturesAgainAfterBlur) {
    FeatureTracker tracker(TrackerOptions{}, camera());
    Judge judge;
    const auto attitude = [](double i) { return so3::exp(Vector3d(0, 0.008, 0.002) * i); };
    std::set<FeatureId> before, after;
    for (int i = 0; i < 10; ++i) {
        cv::Mat image = view(attitude(i));
        if (i >= 4 && i < 6) cv::blur(image, image, {9, 1});
        const FeatureFrame frame = tracker.track(i + 1, image, attitude(1));
        judge.add(frame, attitude(i));
        for (const auto& f : frame.features) (i == 3 ? before : after).insert(f.feature_id);
        if (i <= 3 || i == 5) after.clear();
    }
    std::size_t kept = 0;
    for (const FeatureId id : before) kept += after.contains(id);
    EXPECT_GT(kept, before.size() * 8 / 10);
    EXPECT_LT(judge.median(), 0.15);
    EXPECT_LT(judge.mistrack_share(), 0.01);
}

// Something passes before the lens for two images.
TEST(FeatureTracker, FindsFeaturesAgainBehindWhatPasses) {
    FeatureTracker tracker(TrackerOptions{}, camera());
    Judge judge;
    const auto attitude = [](double i) { return so3::exp(Vector3d(0.003, 0.004, 0) * i); };
    std::set<FeatureId> hidden, again;
    const cv::Rect hand(120, 60, 200, 200);
    for (int i = 0; i < 6; ++i) {
        cv::Mat image = view(attitude(i));
        if (i == 3 || i == 4) image(hand).setTo(30);
        const FeatureFrame frame = tracker.track(i + 1, image, attitude(1));
        judge.add(frame, attitude(i));
        for (const auto& f : frame.features) {
            const bool behind =
                cv::Rect(hand.tl() + cv::Point(20, 20), hand.size() - cv::Size(40, 40))
                    .contains({static_cast<int>(f.uv_px.x()), static_cast<int>(f.uv_px.y())});
            if (behind && i == 2) hidden.insert(f.feature_id);
            if (behind && (i == 3 || i == 4)) ADD_FAILURE() << "seen through the hand";
            if (i == 5 && hidden.contains(f.feature_id)) again.insert(f.feature_id);
        }
    }
    ASSERT_GT(hidden.size(), 10u);
    EXPECT_GE(again.size(), hidden.size() * 8 / 10);
    EXPECT_LT(judge.mistrack_share(), 0.01);
}

// Two fields, half an image's time apart, in one image: what is tracked lies between them.
TEST(FeatureTracker, FollowsInterlacedFields) {
    FeatureTracker tracker(TrackerOptions{}, camera());
    Judge judge;
    const auto attitude = [](double i) { return so3::exp(Vector3d(0, 0.008, 0) * i); };  // 2.4 px
    for (int i = 0; i < 8; ++i) {
        cv::Mat image = view(attitude(i - 0.25));
        const cv::Mat odd = view(attitude(i + 0.25));
        for (int y = 1; y < image.rows; y += 2) odd.row(y).copyTo(image.row(y));
        judge.add(tracker.track(i + 1, image, attitude(1)), attitude(i));
    }
    EXPECT_GT(judge.alive(), 90);
    EXPECT_LT(judge.median(), 0.6);  // half of what lies between the fields
    EXPECT_LT(judge.mistrack_share(), 0.01);
}

TEST(Patch, SearchFindsItsPlaceAndRefusesLikelyOnes) {
    const cv::Mat image = view(Matrix3d::Identity());
    cv::Mat half;
    cv::pyrDown(image, half);
    const auto patch = Patch::cut(image, {200, 150});
    ASSERT_TRUE(patch);
    const Eigen::Matrix2d I = Eigen::Matrix2d::Identity();
    const auto found = patch->search(half, {207, 144}, I, 16 * I);
    ASSERT_TRUE(found);
    EXPECT_LT((*found - Vector2d(200, 150)).norm(), 2);
    EXPECT_FALSE(patch->search(half, {260, 150}, I, 16 * I)) << "out of its reach";
    cv::Mat twin = image.clone();
    image(cv::Rect(180, 130, 41, 41)).copyTo(twin(cv::Rect(200, 130, 41, 41)));
    image(cv::Rect(180, 130, 20, 41)).copyTo(twin(cv::Rect(180, 130, 20, 41)));
    image(cv::Rect(190, 130, 21, 41)).copyTo(twin(cv::Rect(190, 130, 21, 41)));
    image(cv::Rect(190, 130, 21, 41)).copyTo(twin(cv::Rect(211, 130, 21, 41)));
    cv::pyrDown(twin, half);
    EXPECT_FALSE(patch->search(half, {210, 150}, I, 36 * I)) << "two places look alike";
}

TEST(Patch, AlignsUnderAffineWarpAndExposure) {
    const cv::Mat before = view(Matrix3d::Identity());
    const Vector2d uv(200, 150);
    const auto patch = Patch::cut(before, uv);
    ASSERT_TRUE(patch);
    const cv::Matx23d M(1.1, 0.08, 3.4, -0.05, 0.95, -7.2);  // before to after
    cv::Mat after;
    cv::warpAffine(before, after, M, before.size());
    after.convertTo(after, CV_8U, 0.7, 20);
    const Vector2d truth(M(0, 0) * 200 + M(0, 1) * 150 + M(0, 2),
                         M(1, 0) * 200 + M(1, 1) * 150 + M(1, 2));
    Patch::Alignment a{truth + Vector2d(0.8, -0.6), Eigen::Matrix2d::Identity(), 0};
    for (int i = 0; i < 30; ++i) {  // the shape is free to change only slowly
        const auto next = patch->align(after, a.uv_px, a.A);
        ASSERT_TRUE(next);
        a = *next;
    }
    EXPECT_LT((a.uv_px - truth).norm(), 0.1);
    EXPECT_GT(a.correlation, 0.97);
    EXPECT_NEAR(a.A(0, 0), 1.1, 0.03);
    EXPECT_FALSE(Patch::cut(before, {3, 3}));
    EXPECT_FALSE(Patch::cut(cv::Mat(50, 50, CV_8U, cv::Scalar(90)), {25, 25}));
}

TEST(Patch, CovarianceShapeIsIdentityForIsotropicTextureAndLongAlongEdges) {
    const Eigen::Matrix2d I = Eigen::Matrix2d::Identity();
    EXPECT_LT((covariance_shape(37 * I, I) - I).norm(), 1e-12);
    const Eigen::Matrix2d edge = Vector2d(4, 1).asDiagonal();  // gradient mostly along x
    EXPECT_LT((covariance_shape(edge, I) - Eigen::Matrix2d(Vector2d(0.5, 2).asDiagonal())).norm(),
              1e-12);
}

// Pairs of a scene seen under a known motion, the last `outliers` of them wrong.
// In braces numbers are drawn in the order of the text, whatever the compiler.
std::vector<RayPair> scene(const Matrix3d& R, const Vector3d& t, int outliers, unsigned seed = 3) {
    std::mt19937_64 random(seed);
    std::uniform_real_distribution<double> u(-1, 1);
    std::normal_distribution<double> noise(0, 0.0005);
    std::vector<RayPair> pairs;
    for (int i = 0; i < 120; ++i) {
        const Vector3d p1{3 * u(random), 2 * u(random), 5 + 2 * u(random)};
        const Vector3d n1{noise(random), noise(random), 0}, n2{noise(random), noise(random), 0};
        pairs.push_back({(p1.normalized() + n1).normalized(),
                         ((R.transpose() * (p1 - t)).normalized() + n2).normalized()});
        if (i >= 120 - outliers)
            pairs.back().f2 = Vector3d{0.6 * u(random), 0.4 * u(random), 1}.normalized();
    }
    return pairs;
}

class TwoView : public ::testing::TestWithParam<double> {};  // error of the given rotation [rad]

TEST_P(TwoView, FindsMotionAndRejectsOutliers) {
    const Matrix3d R = so3::exp({0.02, -0.05, 0.03});
    const Vector3d t(0.4, 0.1, -0.2);
    const int outliers = 40;
    const TwoViewOptions options{.threshold = 0.003};
    std::optional<Matrix3d> given;
    if (GetParam() >= 0) given = R * so3::exp(Vector3d(1, -1, 1).normalized() * GetParam());
    for (unsigned seed = 1; seed <= 10; ++seed) {
        const auto motion = estimate_two_view(scene(R, t, outliers, seed), given, options);
        ASSERT_TRUE(motion);
        EXPECT_LT(so3::log(motion->R_C1_C2.transpose() * R).norm(), 0.003) << seed;
        EXPECT_GT(motion->t_C1.dot(t.normalized()), std::cos(0.05)) << seed;
        const auto good = motion->inlier.begin() + (120 - outliers);
        EXPECT_GE(std::count(motion->inlier.begin(), good, 1), 78) << seed;
        EXPECT_LE(std::count(good, motion->inlier.end(), 1), 6) << seed;  // by chance on their line
    }
}

// Exact, biased, useless (must fall back on five pairs), absent.
INSTANTIATE_TEST_SUITE_P(Rotations, TwoView, ::testing::Values(0.0, 0.004, 0.5, -1.0));

TEST(TwoView, PureRotationKeepsAllThatFit) {
    const Matrix3d R = so3::exp({0.02, -0.05, 0.03});
    const auto pairs = scene(R, Vector3d::Zero(), 30);
    const auto motion = estimate_two_view(pairs, R, {.threshold = 0.003});
    ASSERT_TRUE(motion);
    EXPECT_GE(std::count(motion->inlier.begin(), motion->inlier.begin() + 90, 1), 89);
    EXPECT_LE(std::count(motion->inlier.begin() + 90, motion->inlier.end(), 1), 4);
}

Rig tilted_rig() {
    Rig rig;
    rig.camera = camera();
    rig.T_B_C.R = so3::exp({0.3, -1.2, 0.5});
    rig.T_B_I.R = so3::exp({-0.4, 0.2, 0.9});
    rig.time_offset = 0.004;
    return rig;
}

TEST(GyroPrediction, MatchesTheTrueRotationWithBiasAndTimeOffset) {
    const Rig rig = tilted_rig();
    const Vector3d rate(0.5, -0.8, 1.1), bias(0.02, 0.03, -0.01);
    ImuSequence imu;
    for (int i = 0; i < 60; ++i)
        imu.push_back({i * from_seconds(0.005), rate + bias, Vector3d::Zero()});
    const TimeNs t1 = from_seconds(0.0123), t2 = from_seconds(0.1);
    const auto R = camera_rotation(imu, rig, t1, t2, bias);
    ASSERT_TRUE(R);
    const Matrix3d R_I_C = rig.T_B_I.R.transpose() * rig.T_B_C.R;
    const Matrix3d truth = R_I_C.transpose() * so3::exp(rate * to_seconds(t2 - t1)) * R_I_C;
    EXPECT_LT((*R - truth).norm(), 1e-9);
    EXPECT_FALSE(camera_rotation(imu, rig, t1, from_seconds(0.292)));  // offset: beyond the end
    EXPECT_TRUE(camera_rotation(imu, rig, t1, from_seconds(0.290)));
}

ImuReading still(double seconds) {
    return {from_seconds(seconds), Vector3d::Zero(), Vector3d::Zero()};
}

TEST(TrackingFrontEnd, ImagesWaitForTheGyroButNotForEver) {
    const Rig rig = tilted_rig();
    TrackingFrontEnd front_end(TrackerOptions{}, rig);
    const cv::Mat image = view(Matrix3d::Identity());
    EXPECT_TRUE(front_end.add(still(0)).empty());
    EXPECT_TRUE(front_end.add(ImageMessage{from_seconds(0.01), image}).empty());
    EXPECT_TRUE(front_end.add(still(0.0135)).empty());
    const auto frames = front_end.add(still(0.015));
    ASSERT_EQ(frames.size(), 1u);
    EXPECT_EQ(frames[0].t, from_seconds(0.01));
    std::size_t out = 0;
    for (int i = 1; i <= TrackingFrontEnd::kMostWaiting + 2; ++i)
        out += front_end.add(ImageMessage{from_seconds(0.05 * i), image}).size();
    EXPECT_EQ(out, 2u);
    EXPECT_EQ(front_end.finish().size(), std::size_t{TrackingFrontEnd::kMostWaiting});
}

}  // namespace
}  // namespace vio
