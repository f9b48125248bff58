// Cost of tracking per image, with the split by step (counters, in milliseconds).
#include <benchmark/benchmark.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "libvio/camera/perspective.h"
#include "libvio/tracking/tracker.h"

namespace {

// The first images of the real recording, or a drifting random texture where it is absent.
std::vector<cv::Mat> images() {
    constexpr std::size_t kImages = 100;
    namespace fs = std::filesystem;
    const char* data = std::getenv("VIO_DATA");
    const fs::path folder =
        (data ? fs::path(data) : fs::path(__FILE__).parent_path() / "../../../shared/data") /
        "euroc_mh01_15s/mav0/cam0/data";
    std::vector<cv::Mat> result;
    if (fs::is_directory(folder)) {
        std::vector<std::string> files;
        for (const auto& file : fs::directory_iterator(folder)) files.push_back(file.path());
        std::sort(files.begin(), files.end());
        for (std::size_t i = 0; i < std::min(kImages, files.size()); ++i)
            result.push_back(cv::imread(files[i], cv::IMREAD_GRAYSCALE));
        return result;
    }
    cv::Mat texture(700, 1100, CV_8U);
    cv::RNG(1).fill(texture, cv::RNG::UNIFORM, 0, 256);
    cv::GaussianBlur(texture, texture, {}, 2.5);
    cv::normalize(texture, texture, 0, 255, cv::NORM_MINMAX);
    for (int i = 0; i < static_cast<int>(kImages); ++i)
        result.push_back(texture(cv::Rect(3 * i, 2 * i, 752, 480)).clone());
    return result;
}

void track_752x480_150_features(benchmark::State& state) {
    cv::setNumThreads(1);
    const auto sequence = images();
    const auto camera = std::make_shared<vio::PerspectiveCamera>(
        vio::PerspectiveParameters{752,
                                   480,
                                   458.654,
                                   457.296,
                                   367.215,
                                   248.375,
                                   {-0.28340811, 0.07395907, 0.00019359, 1.76187114e-05}});
    vio::FeatureTracker tracker(vio::TrackerOptions{}, camera);
    vio::TrackerReport sum;
    double count = 0;
    for (auto _ : state) {
        const cv::Mat& image = sequence[static_cast<std::size_t>(count) % sequence.size()];
        benchmark::DoNotOptimize(tracker.track(static_cast<vio::TimeNs>(++count), image));
        const vio::TrackerReport& report = tracker.report();
        sum.seconds_pyramid += report.seconds_pyramid;
        sum.seconds_flow += report.seconds_flow;
        sum.seconds_realign += report.seconds_realign;
        sum.seconds_geometry += report.seconds_geometry;
        sum.seconds_detect += report.seconds_detect;
        sum.after += report.after;
    }
    const auto ms = [&](double seconds) { return 1e3 * seconds / count; };
    state.counters["pyramid"] = ms(sum.seconds_pyramid);
    state.counters["flow"] = ms(sum.seconds_flow);
    state.counters["realign"] = ms(sum.seconds_realign);
    state.counters["geometry"] = ms(sum.seconds_geometry);
    state.counters["detect"] = ms(sum.seconds_detect);
    state.counters["features"] = sum.after / count;
}
BENCHMARK(track_752x480_150_features)->Unit(benchmark::kMillisecond)->Iterations(100);

}  // namespace
