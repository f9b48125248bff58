#include "app/track_pictures.h"

#include <algorithm>
#include <cmath>
#include <deque>
#include <map>
#include <memory>
#include <opencv2/imgproc.hpp>
#include <unordered_set>
#include <vector>

#include "gui_offscreen/film.h"
#include "gui_offscreen/overlay.h"
#include "gui_offscreen/snapshot.h"
#include "libvio/base/errors.h"
#include "libvio/recursive/iekf.h"
#include "libvio/slam/ordered_messages.h"
#include "libvio/tracking/front_end.h"

namespace vio::app {
namespace {

constexpr size_t kTail = 15;                          // images
constexpr size_t kMostUnpaired = 1000;                // images that wait for their features
constexpr int kStripWidth = 1600;                     // [px]
const double kWindow = IekfOptions().message_window;  // [s]

int scale_of(const cv::Mat& image) {
    return std::clamp(static_cast<int>(std::lround(640.0 / image.cols)), 1, 4);
}

cv::Mat draw(const cv::Mat& image, const std::vector<FeatureFrame>& frames,
             const std::unordered_set<FeatureId>& rejected) {
    OverlayOptions options;
    options.tail_images = static_cast<int>(kTail);
    options.scale = scale_of(image);
    return draw_tracks(image, frames, rejected, options);
}

// Gives each image of a rawlog, in order of time, with the frames of features up to it and the
// features that the tracker has rejected. (A file's tracks do not tell why they end.)
template <typename Use>
void for_each_tracked_image(const TrackPictureRequest& request, Use use,
                            const std::function<void(double)>& progress) {
    Recording recording(request.rawlog, request.recording);
    if (!recording.has_images()) throw InputError(request.rawlog + ": no images to draw tracks on");
    const bool has_tracks = recording.has_features();
    if (!has_tracks && !recording.rig().camera)
        throw InputError(request.rawlog +
                         ": the camera is not calibrated; give --calibration FILE");
    std::unique_ptr<TrackingFrontEnd> front_end;
    if (!has_tracks)
        front_end = std::make_unique<TrackingFrontEnd>(TrackerOptions{}, recording.rig(),
                                                       recording.has_imu());
    std::map<TimeNs, cv::Mat> images;
    std::vector<FeatureFrame> tail;
    std::unordered_set<FeatureId> rejected;
    Part part(request.part, kWindow);
    OrderedMessages ordered(kWindow, recording.rig(), recording.has_imu());
    const auto pair_up = [&](const FeatureFrame& frame) {
        tail.push_back(frame);
        for (const FeatureObservation& feature : frame.features) rejected.erase(feature.feature_id);
        if (tail.size() > kTail + 1) tail.erase(tail.begin());
        const auto image = images.find(frame.t);
        if (image == images.end()) return;
        use(image->second, tail, rejected);
        images.erase(images.begin(), std::next(image));
    };
    const auto track = [&](const std::vector<FeatureFrame>& frames) {
        for (size_t i = 0; i < frames.size(); ++i) {
            const TrackerReport& report = front_end->reports()[i];
            rejected.insert(report.rejected.begin(), report.rejected.end());
            pair_up(frames[i]);
        }
    };
    const auto track_ready = [&](bool at_end) {
        while (const auto message = ordered.pop(at_end)) track(front_end->add(*message));
    };
    while (const auto message = recording.next()) {
        progress(recording.progress());
        const bool drawn = part.contains(*message);
        if (part.is_over()) break;
        if (const auto* image = std::get_if<ImageMessage>(&*message); image && drawn) {
            images[image->t] = image->image;
            if (images.size() > kMostUnpaired) images.erase(images.begin());
        }
        if (has_tracks) {
            if (const auto* frame = std::get_if<FeatureFrame>(&*message)) pair_up(*frame);
        } else if (ordered.add(*message)) {
            track_ready(false);
        }
    }
    if (has_tracks) return;
    track_ready(true);
    track(front_end->finish());
}

void write_video(const TrackPictureRequest& request, const std::function<void(double)>& progress) {
    // The rate of the images, from the first ones: they wait until it is known.
    std::deque<std::pair<TimeNs, cv::Mat>> waiting;
    std::unique_ptr<VideoFile> video;
    const auto open = [&] {
        if (waiting.empty())
            throw InputError(request.rawlog + ": no image with features between --from and --to");
        const double span = to_seconds(waiting.back().first - waiting.front().first);
        const double rate = span > 0 ? static_cast<double>(waiting.size() - 1) / span : 1;
        video =
            std::make_unique<VideoFile>(request.output, waiting.front().second.cols,
                                        waiting.front().second.rows, std::clamp(rate, 1., 120.));
        for (const auto& [t, picture] : waiting) video->add(picture);
        waiting.clear();
    };
    for_each_tracked_image(
        request,
        [&](const cv::Mat& image, const std::vector<FeatureFrame>& frames,
            const std::unordered_set<FeatureId>& rejected) {
            cv::Mat picture = draw(image, frames, rejected);
            draw_track_key(picture);
            picture = picture(cv::Rect(0, 0, picture.cols / 2 * 2, picture.rows / 2 * 2));
            if (video) return video->add(picture);
            waiting.emplace_back(frames.back().t, picture);
            if (waiting.size() == 10) open();
        },
        progress);
    if (!video) open();
}

// Images side by side in rows, as the figures of papers show them.
cv::Mat strip(const std::vector<cv::Mat>& pictures) {
    const int columns = std::min<int>(3, static_cast<int>(pictures.size()));
    const int rows = (static_cast<int>(pictures.size()) + columns - 1) / columns;
    constexpr int kGap = 6;
    const int width = (kStripWidth - (columns - 1) * kGap) / columns;
    const int height = width * pictures[0].rows / pictures[0].cols;
    cv::Mat sheet(rows * height + (rows - 1) * kGap, columns * width + (columns - 1) * kGap,
                  CV_8UC3, cv::Scalar::all(255));
    for (int i = 0; i < static_cast<int>(pictures.size()); ++i) {
        const cv::Rect place(i % columns * (width + kGap), i / columns * (height + kGap), width,
                             height);
        cv::resize(pictures[static_cast<size_t>(i)], sheet(place), place.size(), 0, 0,
                   cv::INTER_AREA);
    }
    return sheet;
}

// Time from the first to the last image that is asked for [s].
double span_of_images(const TrackPictureRequest& request) {
    Recording recording(request.rawlog, request.recording);
    Part part(request.part, kWindow);
    std::optional<TimeNs> first;
    double span = 0;
    while (const auto message = recording.next()) {
        const bool drawn = part.contains(*message);
        if (part.is_over()) break;
        const auto* image = std::get_if<ImageMessage>(&*message);
        if (!image || !drawn) continue;
        if (!first) first = image->t;
        span = std::max(span, to_seconds(image->t - *first));
    }
    return span;
}

void write_strip(const TrackPictureRequest& request, const std::function<void(double)>& progress) {
    const double span = span_of_images(request);
    std::vector<cv::Mat> pictures;
    std::optional<TimeNs> first;
    for_each_tracked_image(
        request,
        [&](const cv::Mat& image, const std::vector<FeatureFrame>& frames,
            const std::unordered_set<FeatureId>& rejected) {
            if (!first) first = frames.back().t;
            const int k = static_cast<int>(pictures.size());
            const double due = span * k / std::max(1, request.images - 1) - 1e-6;
            if (k < request.images && to_seconds(frames.back().t - *first) >= due)
                pictures.push_back(draw(image, frames, rejected));
        },
        progress);
    if (pictures.empty())
        throw InputError(request.rawlog + ": no image with features between --from and --to");
    cv::Mat sheet = strip(pictures);
    draw_track_key(sheet);
    save_image(sheet, request.output);
}

}  // namespace

void write_track_pictures(const TrackPictureRequest& request,
                          const std::function<void(double)>& progress) {
    check(request.part);
    if (request.video)
        write_video(request, progress);
    else
        write_strip(request, progress);
}

}  // namespace vio::app
