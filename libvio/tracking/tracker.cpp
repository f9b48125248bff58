#include "libvio/tracking/tracker.h"

#include <algorithm>
#include <chrono>
#include <string>
#include <utility>

#include "libvio/base/errors.h"
#include "libvio/geometry/so3.h"
#include "libvio/tracking/detector.h"
#include "libvio/tracking/expectation.h"
#include "libvio/tracking/follower.h"
#include "libvio/tracking/image_pyramid.h"
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
// Share of the rotation error seen at one image that is taken over as the gyro's.
constexpr double kRotationRateGain = 0.1;

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

struct FeatureTracker::Impl {
    Impl(const TrackerOptions& o, CameraPtr c)
        : options(o),
          camera(std::move(c)),
          images(o.window_px, o.pyramid_levels),
          follower(options, camera, images),
          history(o.long_gap, o.geometry_px * camera->angular_resolution(),
                  static_cast<unsigned long long>(o.seed)),
          window({.images = o.window_images,
                  .threshold = o.geometry_px * camera->angular_resolution()}) {}

    TrackerOptions options;
    CameraPtr camera;
    TrackerReport report;

    ImagePyramid images;
    Follower follower;
    std::vector<Track> tracks;
    ViewHistory history;
    RigidWindow window;
    std::optional<TimeNs> last_image;
    TimeNs last_tracked = 0;
    std::optional<Matrix3d> R_since_tracked = Matrix3d::Identity();  // over blank images
    Vector3d rotation_rate_error =
        Vector3d::Zero();  // of the given rotations, camera frame [rad/s]
    FeatureId next_id = 0;
    int ended_by_caller = 0;  // since the last image

    FeatureFrame track(TimeNs t, const cv::Mat& image, const std::optional<Matrix3d>& R_given,
                       const std::vector<PredictedFeature>& predicted);
    void admit(TimeNs t, const cv::Mat& image) const;
    std::optional<Matrix3d> corrected_rotation(TimeNs t, const std::optional<Matrix3d>& R_given);
    void verify(TimeNs t, std::optional<Matrix3d> R);
    void end_sliding(const std::optional<Matrix3d>& R);
    void end_missed(double dt);
    void detect();
    void remember(TimeNs t);
    std::vector<FeatureRay> seen_rays() const;
    FeatureFrame frame(TimeNs t) const;
    template <typename Keep>
    int keep_if(const Keep& keep);
};

// The whole course of one image.
FeatureFrame FeatureTracker::Impl::track(TimeNs t, const cv::Mat& image,
                                         const std::optional<Matrix3d>& R_given,
                                         const std::vector<PredictedFeature>& predicted) {
    admit(t, image);
    report = {.ended_by_caller = std::exchange(ended_by_caller, 0)};
    report.before = static_cast<int>(tracks.size());
    Stopwatch watch;
    const std::optional<Matrix3d> R = corrected_rotation(t, R_given);
    report.blank = !images.add(image);
    watch.lap(report.seconds_pyramid);
    if (report.blank) return {t, {}};
    expect(tracks, *camera, R, to_seconds(t - last_tracked), predicted);
    follower.flow(tracks, report);
    watch.lap(report.seconds_flow);
    follower.align(tracks, report);
    follower.hold_to_regions(tracks);
    follower.search(tracks, report);
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

// A feature that disagrees with the motion is taken as not seen; so is one that was missed before
// and cannot be checked. Learns from the rotation that the features give what the given rotations
// miss (gyro bias).
void FeatureTracker::Impl::verify(TimeNs t, std::optional<Matrix3d> R) {
    const std::optional<Matrix3d> given = R;
    const std::vector<Verdict> verdicts = history.check(seen_rays(), R);
    std::size_t k = 0;
    for (Track& track : tracks) {
        if (!track.seen) continue;
        const Verdict verdict = verdicts[k++];
        if (!options.two_views) continue;
        track.seen =
            verdict == Verdict::agrees || (verdict == Verdict::unchecked && track.missed == 0);
        report.lost_geometry += !track.seen;
        if (!track.seen) report.rejected.push_back(track.id);
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
        track->seen = false;
        ++report.lost_window;
        report.rejected.push_back(id);
    }
}

void FeatureTracker::Impl::end_missed(double dt) {
    report.ended = keep_if([&](Track& track) {
        track.missed = track.seen ? 0 : track.missed + 1;
        track.parallax.reset();
        if (track.seen) {
            track.parallax = (track.uv - track.expected.uv_far) / dt;
        } else {
            track.uv = track.expected.uv;
            track.A = track.expected.A;
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
    for (const Vector2d& uv : detect_features(images.half(), existing, follower.mask(), wanted,
                                              options.max_features, detector)) {
        const auto ray = camera->ray(uv);
        auto look = Patch::cut(images.image(), uv);
        if (!ray || !look) continue;
        tracks.push_back({.id = next_id++,
                          .uv = uv,
                          .f = ray->direction,
                          .A = Matrix2d::Identity(),
                          .look = std::make_unique<Patch>(std::move(*look))});
        ++report.detected;
    }
}

void FeatureTracker::Impl::remember(TimeNs t) {
    const std::vector<FeatureRay> rays = seen_rays();
    history.remember(rays);
    window.remember(rays);
    last_tracked = t;
    R_since_tracked = Matrix3d::Identity();
}

std::vector<FeatureRay> FeatureTracker::Impl::seen_rays() const {
    std::vector<FeatureRay> rays;
    for (const Track& track : tracks)
        if (track.seen) rays.push_back({track.id, track.f});
    return rays;
}

FeatureFrame FeatureTracker::Impl::frame(TimeNs t) const {
    FeatureFrame result{t, {}};
    result.features.reserve(tracks.size());
    for (const Track& track : tracks) {
        if (!track.seen) continue;
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
    impl_->follower.set_mask(valid_region(*impl_->camera, kRimBorder_px));
}

FeatureTracker::~FeatureTracker() = default;

FeatureFrame FeatureTracker::track(TimeNs t, const cv::Mat& image,
                                   const std::optional<Eigen::Matrix3d>& R_C1_C2,
                                   const std::vector<PredictedFeature>& predicted) {
    return impl_->track(t, image, R_C1_C2, predicted);
}

void FeatureTracker::set_mask(const cv::Mat& mask) {
    check_image(mask, *impl_->camera, "feature mask");
    const cv::Mat valid = valid_region(*impl_->camera, kRimBorder_px);
    impl_->follower.set_mask(valid.empty() ? mask.clone() : cv::Mat(mask & valid));
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
