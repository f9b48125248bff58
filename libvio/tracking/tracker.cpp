#include "libvio/tracking/tracker.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <opencv2/video/tracking.hpp>
#include <string>
#include <utility>

#include "libvio/base/errors.h"
#include "libvio/base/median.h"
#include "libvio/geometry/so3.h"
#include "libvio/tracking/detector.h"
#include "libvio/tracking/patch.h"
#include "libvio/tracking/rigid_window.h"
#include "libvio/tracking/valid_region.h"
#include "libvio/tracking/view_history.h"

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
constexpr double kMostStretch = 2;  // of a look, before it is renewed
constexpr double kSearch_px2 = 4;   // variance of where a missed feature is expected

struct Track {
    FeatureId id = -1;
    Vector2d uv;                       ///< in the newest image, predicted if missed > 0
    Vector3d f;                        ///< direction of its ray in the camera frame
    Matrix2d A;                        ///< shape relative to the first appearance
    std::unique_ptr<Patch> look;       ///< first appearance, or one renewed since
    int missed = 0;                    ///< images since it was last seen
    std::optional<Vector2d> parallax;  ///< last motion beyond that of the far scene [px/s]
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
    options.add("patience", &patience, "images", {0, 100},
                "images that a feature may be missed in before its track ends");
    options.add("geometry_px", &geometry_px, "px", {0.1, 100},
                "largest error of a feature in the geometry of two images or of more");
    options.add("long_gap", &long_gap, "images", {0, 1000},
                "distance of the second geometric check (0: off)");
    options.add("window_images", &window_images, "images", {0, 300},
                "over which each feature must fit one point of a rigid scene (0: off)");
    options.add("realign", &realign, "align each feature with its first appearance");
    options.add("min_correlation", &min_correlation, "", {-1, 1},
                "smallest correlation with the first appearance");
    options.add("texture_covariance", &texture_covariance,
                "shape each feature's covariance by its texture");
    options.add("seed", &seed, "", {0, 2147483647}, "of the random sampling");
}

// Where a feature is expected in a new image, and its shape there.
struct Expectation {
    Vector2d uv;
    Matrix2d A;
    Vector2d uv_far;  ///< as rotation alone moves it
};

struct FeatureTracker::Impl {
    Impl(const TrackerOptions& o, CameraPtr c)
        : options(o),
          camera(std::move(c)),
          history(o.long_gap, o.geometry_px * camera->angular_resolution(),
                  static_cast<unsigned long long>(o.seed)),
          window({.images = o.window_images,
                  .threshold = o.geometry_px * camera->angular_resolution()}) {}

    TrackerOptions options;
    CameraPtr camera;
    cv::Mat mask;
    TrackerReport report;

    std::vector<cv::Mat> pyramid, previous_pyramid;
    std::vector<Track> tracks;
    ViewHistory history;
    RigidWindow window;
    std::optional<TimeNs> last_image;
    TimeNs last_tracked = 0;
    std::optional<Matrix3d> R_since_tracked = Matrix3d::Identity();  // over blank images
    Vector3d rotation_rate_error =
        Vector3d::Zero();         // of the given rotations, camera frame [rad/s]
    double usual_brightness = 0;  // mean grey value, slow average
    FeatureId next_id = 0;
    int ended_by_caller = 0;  // since the last image

    // Of the image in work, one for each track.
    std::vector<Expectation> expected;
    std::vector<char> seen;

    FeatureFrame track(TimeNs t, const cv::Mat& image, const std::optional<Matrix3d>& R_given);
    void admit(TimeNs t, const cv::Mat& image) const;
    std::optional<Matrix3d> corrected_rotation(TimeNs t, const std::optional<Matrix3d>& R_given);
    void build_pyramid(const cv::Mat& image);
    void expect(const std::optional<Matrix3d>& R, double dt);
    void expect_parallax(double dt);
    template <typename Value>
    Vector2d nearest_median(const Vector2d& uv, const std::vector<std::size_t>& of,
                            const Value& value) const;
    void flow();
    bool align(Track& track, const Vector2d& uv, const Matrix2d& A) const;
    void align_all();
    void search_missed();
    bool admissible(Track& track) const;
    void renew_look(Track& track) const;
    void verify(TimeNs t, std::optional<Matrix3d> R);
    void end_sliding(const std::optional<Matrix3d>& R);
    void end_missed(double dt);
    void detect();
    void remember(TimeNs t);
    std::vector<FeatureRay> seen_rays() const;
    cv::Mat half_image() const;
    FeatureFrame frame(TimeNs t) const;
    template <typename Keep>
    int keep_if(const Keep& keep);
};

// The whole course of one image.
FeatureFrame FeatureTracker::Impl::track(TimeNs t, const cv::Mat& image,
                                         const std::optional<Matrix3d>& R_given) {
    admit(t, image);
    report = {.ended_by_caller = std::exchange(ended_by_caller, 0)};
    report.before = static_cast<int>(tracks.size());
    Stopwatch watch;
    const std::optional<Matrix3d> R = corrected_rotation(t, R_given);
    build_pyramid(image);
    watch.lap(report.seconds_pyramid);
    if (report.blank) return {t, {}};
    expect(R, to_seconds(t - last_tracked));
    flow();
    watch.lap(report.seconds_flow);
    align_all();
    search_missed();
    watch.lap(report.seconds_realign);
    verify(t, R);
    end_missed(to_seconds(t - last_tracked));
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

// As far points move, R turns the rays, and with them the shapes.
void FeatureTracker::Impl::expect(const std::optional<Matrix3d>& R, double dt) {
    expected.clear();
    for (const Track& track : tracks) {
        expected.push_back({track.uv, track.A, track.uv});
        if (!R) continue;
        const auto turned = [&](const Vector2d& uv) -> std::optional<Vector2d> {
            const auto ray = camera->ray(uv);
            if (!ray) return std::nullopt;
            return camera->project(R->transpose() * (kFar * ray->direction));
        };
        constexpr double kStep_px = 2;
        const auto uv = turned(track.uv);
        const auto right = turned(track.uv + Vector2d(kStep_px, 0));
        const auto down = turned(track.uv + Vector2d(0, kStep_px));
        if (!uv || !right || !down) continue;
        Matrix2d turn;
        turn << (*right - *uv) / kStep_px, (*down - *uv) / kStep_px;
        expected.back() = {*uv, turn * track.A, *uv};
    }
    expect_parallax(dt);
}

// As near points move: each goes on as it did, a new one as its neighbours did.
void FeatureTracker::Impl::expect_parallax(double dt) {
    std::vector<std::size_t> known;
    for (std::size_t i = 0; i < tracks.size(); ++i)
        if (tracks[i].parallax) known.push_back(i);
    std::vector<Vector2d> shifts;
    for (std::size_t i = 0; i < tracks.size(); ++i)
        shifts.push_back(
            dt * tracks[i].parallax.value_or(nearest_median(
                     expected[i].uv, known, [&](std::size_t k) { return *tracks[k].parallax; })));
    for (std::size_t i = 0; i < tracks.size(); ++i) expected[i].uv += shifts[i];
}

// Frame to frame, for the tracks that the previous image showed.
void FeatureTracker::Impl::flow() {
    seen.assign(tracks.size(), false);
    std::vector<Vector2d> places, predicted;
    std::vector<std::size_t> owner;
    for (std::size_t i = 0; i < tracks.size(); ++i) {
        // What leaves the image would be taken for something like it inside.
        if (tracks[i].missed > 0 || !camera->inside_image(expected[i].uv)) continue;
        owner.push_back(i);
        places.push_back(tracks[i].uv);
        predicted.push_back(expected[i].uv);
    }
    if (owner.empty()) return;
    const std::vector<cv::Point2f> from = to_points(places);
    std::vector<cv::Point2f> to = to_points(predicted);
    std::vector<unsigned char> found;
    std::vector<float> error;
    const cv::TermCriteria stop(cv::TermCriteria::EPS | cv::TermCriteria::COUNT, 20, 0.01);
    cv::calcOpticalFlowPyrLK(previous_pyramid, pyramid, from, to, found, error,
                             {options.window_px, options.window_px}, options.pyramid_levels, stop,
                             cv::OPTFLOW_USE_INITIAL_FLOW, 1e-4);
    for (std::size_t k = 0; k < owner.size(); ++k) {
        tracks[owner[k]].uv = to_vector(to[k]);
        seen[owner[k]] = found[k];
        report.lost_flow += !found[k];
    }
}

bool FeatureTracker::Impl::align(Track& track, const Vector2d& uv, const Matrix2d& A) const {
    const auto aligned = track.look->align(pyramid[0], uv, A);
    if (!aligned || aligned->correlation < options.min_correlation) return false;
    track.uv = aligned->uv_px;
    track.A = aligned->A;
    return true;
}

// Frame-to-frame tracking drifts; the first appearance does not.
void FeatureTracker::Impl::align_all() {
    for (std::size_t i = 0; i < tracks.size(); ++i) {
        if (!seen[i]) continue;
        if (options.realign) seen[i] = align(tracks[i], tracks[i].uv, expected[i].A);
        report.lost_look += !seen[i];
        if (seen[i]) seen[i] = admissible(tracks[i]);
        if (seen[i]) renew_look(tracks[i]);
    }
}

// What has grown or shrunk much is compared with its latest look: the first one tells no more where
// it is, and would soon not be found at all.
void FeatureTracker::Impl::renew_look(Track& track) const {
    const Eigen::Vector2d stretch = Eigen::JacobiSVD<Matrix2d>(track.A).singularValues();
    if (stretch[0] < kMostStretch && stretch[1] > 1 / kMostStretch) return;
    auto look = Patch::cut(pyramid[0], track.uv);
    if (!look) return;
    *track.look = std::move(*look);
    track.A.setIdentity();
}

// The others are expected to have moved against the far scene as their neighbours did.
void FeatureTracker::Impl::search_missed() {
    std::vector<std::size_t> found;
    for (std::size_t i = 0; i < tracks.size(); ++i)
        if (seen[i]) found.push_back(i);
    const cv::Mat half = half_image();
    for (std::size_t i = 0; i < tracks.size(); ++i) {
        if (seen[i] || !camera->inside_image(expected[i].uv)) continue;
        expected[i].uv += nearest_median(expected[i].uv, found, [&](std::size_t k) {
            return Vector2d(tracks[k].uv - expected[k].uv);
        });
        tracks[i].uv = expected[i].uv;
        const auto place = tracks[i].look->search(half, expected[i].uv, expected[i].A,
                                                  kSearch_px2 * Matrix2d::Identity());
        if (!place) continue;
        seen[i] = align(tracks[i], *place, expected[i].A) && admissible(tracks[i]);
        report.found_again += seen[i];
    }
}

// Median, for each coordinate, over the nearest of some tracks.
template <typename Value>
Vector2d FeatureTracker::Impl::nearest_median(const Vector2d& uv,
                                              const std::vector<std::size_t>& of,
                                              const Value& value) const {
    constexpr std::size_t kNeighbours = 7;
    std::vector<std::pair<double, std::size_t>> near;
    for (const std::size_t i : of) near.emplace_back((expected[i].uv - uv).squaredNorm(), i);
    const std::size_t n = std::min(kNeighbours, near.size());
    if (n == 0) return Vector2d::Zero();
    std::partial_sort(near.begin(), near.begin() + static_cast<std::ptrdiff_t>(n), near.end());
    Vector2d result;
    for (const int axis : {0, 1}) {
        std::vector<double> values;
        for (std::size_t k = 0; k < n; ++k) values.push_back(value(near[k].second)[axis]);
        result[axis] = median(std::move(values));
    }
    return result;
}

bool FeatureTracker::Impl::admissible(Track& track) const {
    const auto ray = camera->ray(track.uv);
    if (!ray || !camera->inside_image(track.uv)) return false;
    track.f = ray->direction;
    return mask.empty() || mask.at<unsigned char>(static_cast<int>(std::lround(track.uv.y())),
                                                  static_cast<int>(std::lround(track.uv.x())));
}

// A feature that disagrees with the motion is taken as not seen; so is one that was missed before
// and cannot be checked. Learns from the rotation that the
// features give what the given rotations miss (gyro bias).
void FeatureTracker::Impl::verify(TimeNs t, std::optional<Matrix3d> R) {
    const std::optional<Matrix3d> given = R;
    const std::vector<Verdict> verdicts = history.check(seen_rays(), R);
    std::size_t k = 0;
    for (std::size_t i = 0; i < tracks.size(); ++i) {
        if (!seen[i]) continue;
        const Verdict verdict = verdicts[k++];
        seen[i] =
            verdict == Verdict::agrees || (verdict == Verdict::unchecked && tracks[i].missed == 0);
        report.lost_geometry += !seen[i];
        if (!seen[i]) report.rejected.push_back(tracks[i].id);
    }
    end_sliding(R);
    if (!given || !R || history.inliers() <= 20) return;
    const Vector3d missed = so3::log(given->transpose() * *R);
    if (missed.norm() < 0.05)
        rotation_rate_error += kRotationRateGain * missed / to_seconds(t - last_tracked);
}

// What slides along its epipolar lines. It is nowhere, so its track ends at once.
void FeatureTracker::Impl::end_sliding(const std::optional<Matrix3d>& R) {
    for (const FeatureId id : window.check(seen_rays(), R)) {
        const auto track = std::find_if(tracks.begin(), tracks.end(),
                                        [&](const Track& other) { return other.id == id; });
        if (track == tracks.end()) continue;
        track->missed = options.patience;
        seen[static_cast<std::size_t>(track - tracks.begin())] = false;
        ++report.lost_window;
        report.rejected.push_back(id);
    }
}

void FeatureTracker::Impl::end_missed(double dt) {
    std::size_t i = 0;
    report.ended = keep_if([&](Track& track) {
        const std::size_t k = i++;
        track.missed = seen[k] ? 0 : track.missed + 1;
        track.parallax.reset();
        if (seen[k]) track.parallax = (track.uv - expected[k].uv_far) / dt;
        if (!seen[k]) {
            track.uv = expected[k].uv;
            track.A = expected[k].A;
        }
        return track.missed <= options.patience && camera->inside_image(track.uv);
    });
}

void FeatureTracker::Impl::detect() {
    std::vector<Vector2d> existing;
    int wanted = options.max_features;
    for (const Track& track : tracks) {
        existing.push_back(track.uv);
        wanted -= track.missed == 0;
    }
    const DetectorOptions detector{options.min_distance_px, kBorder_px, options.corner_quality};
    for (const Vector2d& uv :
         detect_features(half_image(), existing, mask, wanted, options.max_features, detector)) {
        const auto ray = camera->ray(uv);
        auto look = Patch::cut(pyramid[0], uv);
        if (!ray || !look) continue;
        tracks.push_back({next_id++,
                          uv,
                          ray->direction,
                          Matrix2d::Identity(),
                          std::make_unique<Patch>(std::move(*look)),
                          0,
                          {}});
        ++report.detected;
    }
}

void FeatureTracker::Impl::remember(TimeNs t) {
    seen.assign(tracks.size(), false);
    for (std::size_t i = 0; i < tracks.size(); ++i) seen[i] = tracks[i].missed == 0;
    const std::vector<FeatureRay> rays = seen_rays();
    history.remember(rays);
    window.remember(rays);
    last_tracked = t;
    R_since_tracked = Matrix3d::Identity();
}

std::vector<FeatureRay> FeatureTracker::Impl::seen_rays() const {
    std::vector<FeatureRay> rays;
    for (std::size_t i = 0; i < tracks.size(); ++i)
        if (seen[i]) rays.push_back({tracks[i].id, tracks[i].f});
    return rays;
}

// Images and their derivatives alternate in the pyramid, which ends early where a level would be
// smaller than the window.
cv::Mat FeatureTracker::Impl::half_image() const {
    if (pyramid.size() > 2) return pyramid[2];
    cv::Mat half;
    cv::pyrDown(pyramid[0], half);
    return half;
}

FeatureFrame FeatureTracker::Impl::frame(TimeNs t) const {
    FeatureFrame result{t, {}};
    result.features.reserve(tracks.size());
    for (const Track& track : tracks) {
        if (track.missed > 0) continue;
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

FeatureTracker::FeatureTracker(const TrackerOptions& options, CameraPtr camera) {
    if (!camera) throw InputError("tracker: no camera calibration; give the camera's intrinsics");
    impl_ = std::make_unique<Impl>(options, std::move(camera));
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
    if (ids.empty()) return;
    impl_->ended_by_caller += impl_->keep_if([&](const Track& track) {
        return std::find(ids.begin(), ids.end(), track.id) == ids.end();
    });
}

const TrackerReport& FeatureTracker::report() const {
    return impl_->report;
}

}  // namespace vio
