#include "libvio/tracking/tracker.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <deque>
#include <map>
#include <opencv2/imgproc.hpp>
#include <opencv2/video/tracking.hpp>
#include <string>

#include "libvio/base/errors.h"
#include "libvio/geometry/so3.h"
#include "libvio/tracking/detector.h"
#include "libvio/tracking/patch.h"
#include "libvio/tracking/two_view.h"
#include "libvio/tracking/valid_region.h"

namespace vio {
namespace {

using Eigen::Matrix2d;
using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double kBorder_px = 10;  // new features keep away from the edge by this much
constexpr int kRimBorder_px = 5;   // and all from the edge of what sees the world, which stands
constexpr double kFar = 1e3;       // [m]: rotation alone moves what is as far as this
constexpr double kBlankDeviation = 2.5;  // standard deviation of grey values of a blank image
constexpr double kBrightnessForgetting = 0.05, kMostGain = 4, kLeastGainChange = 0.02;
// Share of the rotation error seen at one image that is taken over as the gyro's.
constexpr double kRotationRateGain = 0.1;

struct Track {
    FeatureId id = -1;
    Vector2d uv;
    Vector3d f;                   ///< direction of its ray in the camera frame
    Matrix2d A;                   ///< shape relative to the first appearance
    std::unique_ptr<Patch> look;  ///< first appearance
};

/// Rays of one image, to check later ones against.
struct PastView {
    std::map<FeatureId, Vector3d> rays;
    std::optional<Matrix3d> R_next;  ///< rotation from this image to the next
};

class Stopwatch {
 public:
    /// Adds the time since construction or the last call.
    void lap(double& seconds) {
        const auto now = std::chrono::steady_clock::now();
        seconds += std::chrono::duration<double>(now - begin_).count();
        begin_ = now;
    }

 private:
    std::chrono::steady_clock::time_point begin_ = std::chrono::steady_clock::now();
};

std::vector<cv::Point2f> to_points(const std::vector<Vector2d>& places) {
    std::vector<cv::Point2f> points;
    points.reserve(places.size());
    for (const Vector2d& uv : places)
        points.emplace_back(static_cast<float>(uv.x()), static_cast<float>(uv.y()));
    return points;
}

Vector2d to_vector(const cv::Point2f& p) {
    return {p.x, p.y};
}

void check_image(const cv::Mat& image, const Camera& camera, const std::string& what) {
    if (image.type() != CV_8UC1 || image.cols != camera.width() || image.rows != camera.height())
        throw InputError(
            what + ": " + std::to_string(image.cols) + "x" + std::to_string(image.rows) +
            " pixels in " + std::to_string(image.channels()) + " channel(s) of " +
            std::to_string(8 * image.elemSize1()) + " bits, but the calibration is for " +
            std::to_string(camera.width()) + "x" + std::to_string(camera.height()) +
            " in 8-bit grey; give the calibration of these images or convert them");
}

}  // namespace

void TrackerOptions::describe(OptionSet& options) {
    options.section("tracker");
    options.add("max_features", &max_features, "", {8, 5000}, "features held in each image");
    options.add("min_distance_px", &min_distance_px, "px", {2, 500},
                "distance between a new feature and all others");
    options.add("corner_quality", &corner_quality, "", {1e-5, 1},
                "weakest corner, as a share of the image's strongest");
    options.add("window_px", &window_px, "px", {5, 101}, "side of the Lucas-Kanade window");
    options.add("pyramid_levels", &pyramid_levels, "", {1, 8}, "halvings of the image");
    options.add("round_trip_px", &round_trip_px, "px", {0.01, 100},
                "largest error of tracking forward and back");
    options.add("epipolar_px", &epipolar_px, "px", {0.1, 100},
                "largest error in the geometry of two images");
    options.add("long_gap", &long_gap, "images", {0, 1000},
                "distance of the second geometric check (0: off)");
    options.add("realign", &realign, "align each feature with its first appearance");
    options.add("min_correlation", &min_correlation, "", {-1, 1},
                "smallest correlation with the first appearance");
    options.add("texture_covariance", &texture_covariance,
                "shape each feature's covariance by its texture");
    options.add("seed", &seed, "", {0, 2147483647}, "of the random sampling");
}

struct FeatureTracker::Impl {
    TrackerOptions options;
    CameraPtr camera;
    cv::Mat mask;
    TrackerReport report;

    std::vector<cv::Mat> pyramid, previous_pyramid;
    std::vector<Track> tracks;
    std::deque<PastView> past;  // newest last; the previous image is its last
    std::optional<TimeNs> last_image;
    TimeNs last_tracked = 0;
    std::optional<Matrix3d> R_since_tracked = Matrix3d::Identity();  // over blank images
    Vector3d rotation_rate_error =
        Vector3d::Zero();         // of the given rotations, camera frame [rad/s]
    double usual_brightness = 0;  // mean grey value, slow average
    FeatureId next_id = 0;

    FeatureFrame track(TimeNs t, const cv::Mat& image, const std::optional<Matrix3d>& R_given);
    void admit(TimeNs t, const cv::Mat& image) const;
    std::optional<Matrix3d> corrected_rotation(TimeNs t, const std::optional<Matrix3d>& R_given);
    void build_pyramid(const cv::Mat& image);
    std::vector<Vector2d> predict(const std::optional<Matrix3d>& R) const;
    void flow(const std::vector<Vector2d>& predicted);
    void realign();
    std::optional<Matrix3d> verify(TimeNs t, const std::optional<Matrix3d>& R);
    void verify_long(const std::optional<Matrix3d>& R);
    std::optional<TwoViewMotion> check_against(const PastView& view,
                                               const std::optional<Matrix3d>& R);
    void detect();
    void remember(TimeNs t);
    FeatureFrame frame(TimeNs t) const;
    template <typename Keep>
    int keep_if(const Keep& keep);
};

// The whole course of one image.
FeatureFrame FeatureTracker::Impl::track(TimeNs t, const cv::Mat& image,
                                         const std::optional<Matrix3d>& R_given) {
    admit(t, image);
    report = {.ended_by_caller = report.ended_by_caller};
    report.before = static_cast<int>(tracks.size());
    Stopwatch watch;
    std::optional<Matrix3d> R = corrected_rotation(t, R_given);
    build_pyramid(image);
    watch.lap(report.seconds_pyramid);
    if (report.blank) return {t, {}};
    flow(predict(R));
    watch.lap(report.seconds_flow);
    realign();
    watch.lap(report.seconds_realign);
    R = verify(t, R);
    verify_long(R);
    watch.lap(report.seconds_geometry);
    detect();
    watch.lap(report.seconds_detect);
    remember(t);
    report.after = static_cast<int>(tracks.size());
    return frame(t);
}

void FeatureTracker::Impl::admit(TimeNs t, const cv::Mat& image) const {
    const std::string what = "image stream (t = " + std::to_string(t) + " ns)";
    check_image(image, *camera, what);
    if (last_image && t <= *last_image)
        throw InputError(what +
                         ": time does not increase; sort the recording or remove duplicates");
}

// Rotation since the last image that was tracked, without the gyro's bias as far as it is known.
std::optional<Matrix3d> FeatureTracker::Impl::corrected_rotation(
    TimeNs t, const std::optional<Matrix3d>& R_given) {
    if (!last_image) {
        last_image = last_tracked = t;
        return std::nullopt;
    }
    const double dt = to_seconds(t - *last_image);
    last_image = t;
    if (!R_given || !R_since_tracked)
        R_since_tracked.reset();
    else
        R_since_tracked = *R_since_tracked * *R_given * so3::exp(rotation_rate_error * dt);
    return R_since_tracked;
}

void FeatureTracker::Impl::build_pyramid(const cv::Mat& image) {
    cv::Scalar mean, deviation;
    cv::meanStdDev(image, mean, deviation);
    report.blank = deviation[0] < kBlankDeviation;
    if (report.blank) return;
    // Exposure is a gain, which Lucas and Kanade's method takes for motion: undo it.
    usual_brightness +=
        (usual_brightness > 0 ? kBrightnessForgetting : 1.0) * (mean[0] - usual_brightness);
    const double gain = std::clamp(usual_brightness / mean[0], 1 / kMostGain, kMostGain);
    cv::Mat even = image;
    if (std::abs(gain - 1) > kLeastGainChange) image.convertTo(even, CV_8U, gain);
    std::swap(pyramid, previous_pyramid);
    // With a copy of the image: the caller may reuse his.
    cv::buildOpticalFlowPyramid(even, pyramid, {options.window_px, options.window_px},
                                options.pyramid_levels, true, cv::BORDER_REFLECT_101,
                                cv::BORDER_CONSTANT, false);
}

std::vector<Vector2d> FeatureTracker::Impl::predict(const std::optional<Matrix3d>& R) const {
    std::vector<Vector2d> places;
    places.reserve(tracks.size());
    for (const Track& track : tracks) {
        std::optional<Vector2d> uv;
        if (R) uv = camera->project(R->transpose() * (kFar * track.f));
        places.push_back(uv && camera->inside_image(*uv) ? *uv : track.uv);
    }
    return places;
}

// Forward, then back from where that ended, each starting at its prediction.
void FeatureTracker::Impl::flow(const std::vector<Vector2d>& predicted) {
    if (tracks.empty()) return;
    std::vector<Vector2d> places;
    for (const Track& track : tracks) places.push_back(track.uv);
    const std::vector<cv::Point2f> from = to_points(places);
    std::vector<cv::Point2f> to = to_points(predicted), back(from.size());
    std::vector<unsigned char> found, found_back;
    std::vector<float> error;
    const cv::Size window(options.window_px, options.window_px);
    const cv::TermCriteria stop(cv::TermCriteria::EPS | cv::TermCriteria::COUNT, 20, 0.01);
    cv::calcOpticalFlowPyrLK(previous_pyramid, pyramid, from, to, found, error, window,
                             options.pyramid_levels, stop, cv::OPTFLOW_USE_INITIAL_FLOW, 1e-4);
    for (std::size_t i = 0; i < from.size(); ++i)
        back[i] =
            to[i] + from[i] -
            cv::Point2f(static_cast<float>(predicted[i].x()), static_cast<float>(predicted[i].y()));
    cv::calcOpticalFlowPyrLK(pyramid, previous_pyramid, to, back, found_back, error, window,
                             options.pyramid_levels, stop, cv::OPTFLOW_USE_INITIAL_FLOW, 1e-4);
    std::size_t i = 0;
    report.lost_flow = keep_if([&](Track& track) {
        const std::size_t k = i++;
        track.uv = to_vector(to[k]);
        if (!found[k] || !camera->inside_image(track.uv)) return false;
        // Marked here, removed below: the order of the arrays is that of the tracks.
        if (!found_back[k] || cv::norm(back[k] - from[k]) > options.round_trip_px) track.id = -1;
        return true;
    });
    report.lost_round_trip = keep_if([](const Track& track) { return track.id >= 0; });
}

// Frame-to-frame tracking drifts; the first appearance does not.
void FeatureTracker::Impl::realign() {
    if (options.realign)
        report.lost_look = keep_if([&](Track& track) {
            const auto aligned = track.look->align(pyramid[0], track.uv, track.A);
            if (!aligned || aligned->correlation < options.min_correlation) return false;
            track.uv = aligned->uv_px;
            track.A = aligned->A;
            return true;
        });
    report.lost_look += keep_if([&](Track& track) {
        const auto ray = camera->ray(track.uv);
        if (!ray || !camera->inside_image(track.uv)) return false;
        track.f = ray->direction;
        return mask.empty() || mask.at<unsigned char>(static_cast<int>(std::lround(track.uv.y())),
                                                      static_cast<int>(std::lround(track.uv.x())));
    });
}

std::optional<TwoViewMotion> FeatureTracker::Impl::check_against(const PastView& view,
                                                                 const std::optional<Matrix3d>& R) {
    std::vector<RayPair> pairs;
    std::vector<std::size_t> owner;
    for (std::size_t i = 0; i < tracks.size(); ++i) {
        const auto then = view.rays.find(tracks[i].id);
        if (then == view.rays.end()) continue;
        pairs.push_back({then->second, tracks[i].f});
        owner.push_back(i);
    }
    TwoViewOptions two_view;
    two_view.threshold = options.epipolar_px * camera->angular_resolution();
    two_view.seed = static_cast<unsigned long long>(options.seed);
    auto motion = estimate_two_view(pairs, R, two_view);
    if (!motion) return motion;
    std::vector<char> good(tracks.size(), true);
    for (std::size_t k = 0; k < owner.size(); ++k) good[owner[k]] = motion->inlier[k];
    std::size_t i = 0;
    report.lost_geometry += keep_if([&](const Track&) { return good[i++]; });
    return motion;
}

// Returns the rotation since the previous image, refined on the features where possible, and
// learns from it what the given rotations miss (gyro bias).
std::optional<Matrix3d> FeatureTracker::Impl::verify(TimeNs t, const std::optional<Matrix3d>& R) {
    if (past.empty()) return R;
    const auto motion = check_against(past.back(), R);
    if (!motion) return R;
    const double dt = to_seconds(t - last_tracked);
    if (R && motion->inliers > 20) {
        const Vector3d missed = so3::log(R->transpose() * motion->R_C1_C2);
        if (missed.norm() < 0.05) rotation_rate_error += kRotationRateGain * missed / dt;
    }
    return motion->R_C1_C2;
}

// The same against an image further back, where slow errors have added up.
void FeatureTracker::Impl::verify_long(const std::optional<Matrix3d>& R) {
    if (past.empty()) return;
    past.back().R_next = R;
    if (options.long_gap < 2 || static_cast<int>(past.size()) < options.long_gap) return;
    std::optional<Matrix3d> R_long = Matrix3d::Identity();
    for (const PastView& view : past) {
        if (!view.R_next) {
            R_long.reset();
            break;
        }
        R_long = *R_long * *view.R_next;
    }
    check_against(past.front(), R_long);
}

void FeatureTracker::Impl::detect() {
    // Images and their derivatives alternate; a pyramid ends early where a level would be smaller
    // than the window.
    cv::Mat half;
    if (pyramid.size() > 2)
        half = pyramid[2];
    else
        cv::pyrDown(pyramid[0], half);
    const int wanted = options.max_features - static_cast<int>(tracks.size());
    std::vector<Vector2d> existing;
    for (const Track& track : tracks) existing.push_back(track.uv);
    const DetectorOptions detector{options.min_distance_px, kBorder_px, options.corner_quality};
    for (const Vector2d& uv :
         detect_features(half, existing, mask, wanted, options.max_features, detector)) {
        const auto ray = camera->ray(uv);
        auto look = Patch::cut(pyramid[0], uv);
        if (!ray || !look) continue;
        tracks.push_back({next_id++, uv, ray->direction, Matrix2d::Identity(),
                          std::make_unique<Patch>(std::move(*look))});
        ++report.detected;
    }
}

void FeatureTracker::Impl::remember(TimeNs t) {
    PastView view;
    for (const Track& track : tracks) view.rays[track.id] = track.f;
    past.push_back(std::move(view));
    while (static_cast<int>(past.size()) > std::max(1, options.long_gap)) past.pop_front();
    last_tracked = t;
    R_since_tracked = Matrix3d::Identity();
}

FeatureFrame FeatureTracker::Impl::frame(TimeNs t) const {
    FeatureFrame result{t, {}};
    result.features.reserve(tracks.size());
    for (const Track& track : tracks) {
        FeatureObservation observation{track.id, track.uv, Matrix2d::Identity()};
        if (options.texture_covariance)
            observation.covariance_shape =
                covariance_shape(track.look->structure_tensor(), track.A);
        result.features.push_back(observation);
    }
    return result;
}

template <typename Keep>
int FeatureTracker::Impl::keep_if(const Keep& keep) {
    std::size_t kept = 0;
    for (std::size_t i = 0; i < tracks.size(); ++i)
        if (keep(tracks[i])) {
            if (kept != i) tracks[kept] = std::move(tracks[i]);
            ++kept;
        }
    const int removed = static_cast<int>(tracks.size() - kept);
    tracks.resize(kept);
    return removed;
}

FeatureTracker::FeatureTracker(const TrackerOptions& options, CameraPtr camera)
    : impl_(std::make_unique<Impl>()) {
    if (!camera) throw InputError("tracker: no camera calibration; give the camera's intrinsics");
    impl_->options = options;
    impl_->camera = std::move(camera);
    impl_->mask = valid_region(*impl_->camera, kRimBorder_px);
}

FeatureTracker::~FeatureTracker() = default;

FeatureFrame FeatureTracker::track(TimeNs t, const cv::Mat& image,
                                   const std::optional<Eigen::Matrix3d>& R_C1_C2) {
    return impl_->track(t, image, R_C1_C2);
}

void FeatureTracker::set_mask(const cv::Mat& mask) {
    check_image(mask, *impl_->camera, "feature mask");
    const cv::Mat valid = valid_region(*impl_->camera, kRimBorder_px);
    impl_->mask = valid.empty() ? mask.clone() : cv::Mat(mask & valid);
}

void FeatureTracker::end_tracks(const std::vector<FeatureId>& ids) {
    impl_->report.ended_by_caller = impl_->keep_if([&](const Track& track) {
        return std::find(ids.begin(), ids.end(), track.id) == ids.end();
    });
}

const TrackerReport& FeatureTracker::report() const {
    return impl_->report;
}

}  // namespace vio
