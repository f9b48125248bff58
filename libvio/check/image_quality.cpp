#include "libvio/check/image_quality.h"

#include <algorithm>

#include "libvio/base/median.h"

namespace vio {
namespace {

constexpr int kStep = 4;                     // pixels between those that are looked at
constexpr double kDark = 20, kBright = 235;  // mean grey value
constexpr double kBlank = 4;                 // standard deviation of grey values
constexpr double kMostPoor = 0.05, kFarTooManyPoor = 0.5;
constexpr double kMostRepeated = 0.02;
constexpr int kFewFeatures = 40, kTooFewFeatures = 12;
constexpr double kShortTracks = 4;

double share(int part, int whole) {
    return whole > 0 ? static_cast<double>(part) / whole : 0;
}

Finding poor(const char* name, std::string measured, double bad, const char* advice) {
    Finding f{Grade::ok, name, std::move(measured), formatted("at most %g %%", 1e2 * kMostPoor),
              ""};
    if (bad > kMostPoor) {
        f.grade = bad > kFarTooManyPoor ? Grade::error : Grade::warning;
        f.advice = advice;
    }
    return f;
}

}  // namespace

void ImageQuality::add(const cv::Mat& image) {
    cv::Mat few((image.rows + kStep - 1) / kStep, (image.cols + kStep - 1) / kStep, CV_8U);
    for (int y = 0; y < few.rows; ++y)
        for (int x = 0; x < few.cols; ++x)
            few.at<unsigned char>(y, x) = image.at<unsigned char>(y * kStep, x * kStep);
    cv::Scalar mean, deviation;
    cv::meanStdDev(few, mean, deviation);
    ++images_;
    mean_ += mean[0];
    dark_ += mean[0] < kDark;
    bright_ += mean[0] > kBright;
    blank_ += deviation[0] < kBlank;
    if (previous_.size() == few.size()) repeated_ += cv::norm(previous_, few, cv::NORM_INF) == 0;
    previous_ = few;
}

std::vector<Finding> ImageQuality::findings() const {
    if (images_ == 0) return {};
    const double dark = share(dark_, images_), bright = share(bright_, images_);
    const double blank = share(blank_, images_), repeated = share(repeated_, images_);
    Finding again{Grade::ok, "images repeated", formatted("%.1f %%", 1e2 * repeated),
                  formatted("at most %g %%", 1e2 * kMostRepeated), ""};
    if (repeated > kMostRepeated) {
        again.grade = Grade::warning;
        again.advice = "the same picture under new stamps; see the camera's driver";
    }
    return {poor("brightness",
                 formatted("mean %.0f of 255, %.1f %% of the images too dark, %.1f %% too bright",
                           mean_ / images_, 1e2 * dark, 1e2 * bright),
                 dark + bright, "set the exposure, or add light"),
            poor("contrast", formatted("%.1f %% of the images show next to nothing", 1e2 * blank),
                 blank, "lens cap, darkness or a bare wall; leave that part out (--from, --to)"),
            again};
}

void TrackQuality::add(const FeatureFrame& frame) {
    std::vector<FeatureId> ids;
    for (const FeatureObservation& f : frame.features) ids.push_back(f.feature_id);
    std::sort(ids.begin(), ids.end());
    for (const FeatureId id : ids)
        tracks_ += !std::binary_search(previous_.begin(), previous_.end(), id);
    observations_ += ids.size();
    counts_.push_back(static_cast<int>(ids.size()));
    previous_ = std::move(ids);
}

std::vector<Finding> TrackQuality::findings() const {
    if (counts_.empty()) return {};
    const int middle = median(counts_);
    const auto few = std::count_if(counts_.begin(), counts_.end(),
                                   [](int count) { return count < kTooFewFeatures; });
    const double length =
        tracks_ > 0 ? static_cast<double>(observations_) / static_cast<double>(tracks_) : 0;
    Finding f{
        Grade::ok, "tracks",
        formatted("median %d features an image, each in %.1f images; %.1f %% of the images with "
                  "fewer than %d",
                  middle, length,
                  1e2 * share(static_cast<int>(few), static_cast<int>(counts_.size())),
                  kTooFewFeatures),
        formatted("at least %d in at least %g images", kFewFeatures, kShortTracks), ""};
    if (middle < kFewFeatures || length < kShortTracks) {
        f.grade = middle < kTooFewFeatures ? Grade::error : Grade::warning;
        f.advice =
            "too little texture or too fast motion for the rate of images; more light, "
            "shorter exposure, a wider lens";
    }
    return {f};
}

}  // namespace vio
