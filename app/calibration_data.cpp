#include "app/calibration_data.h"

#include <algorithm>
#include <filesystem>
#include <opencv2/imgcodecs.hpp>
#include <optional>

#include "app/progress.h"
#include "app/recording_text.h"
#include "libvio/base/errors.h"
#include "libvio/base/files.h"
#include "libvio/calibration/board_detector.h"
#include "libvio/camera/description.h"
#include "libvio/io/image_depth.h"
#include "libvio/recursive/iekf.h"

namespace vio::app {
namespace {

namespace fs = std::filesystem;

// Takes images and features in; corners are looked for once the first image asks for it.
class Collector {
 public:
    Collector(BoardViews& views, const Board& board) : views_(views), board_(board) {}

    /// That takes the images, as far as known.
    void set_camera(const CameraPtr& camera) {
        const bool mirrors =
            camera && (is_mirror_model(camera->model_name()) || describe(*camera).mirror);
        camera_ = mirrors ? camera : nullptr;
    }

    void add(TimeNs t, const cv::Mat& image, const std::string& name) {
        if (!detector_) detector_.emplace(board_, camera_);
        if (views_.width > 0 && (image.cols != views_.width || image.rows != views_.height))
            throw InputError(name + ": is " + std::to_string(image.cols) + " x " +
                             std::to_string(image.rows) + ", others are " +
                             std::to_string(views_.width) + " x " + std::to_string(views_.height) +
                             "; all must come from one camera");
        views_.width = image.cols;
        views_.height = image.rows;
        ++views_.images;
        if (FeatureFrame frame{t, detector_->detect(image)}; !frame.features.empty())
            views_.frames.push_back(std::move(frame));
    }

    void add(const FeatureFrame& frame) {
        ++views_.images;
        FeatureFrame known{frame.t, {}};
        for (const FeatureObservation& f : frame.features)
            if (board_.points.contains(f.feature_id)) known.features.push_back(f);
        if (!known.features.empty()) views_.frames.push_back(std::move(known));
    }

 private:
    BoardViews& views_;
    const Board& board_;
    CameraPtr camera_;  // if it shows boards as they are not
    std::optional<BoardDetector> detector_;
};

void read_images(std::vector<fs::path> files, int bit_depth, Collector& collector) {
    std::sort(files.begin(), files.end());
    BitDepth depth = find_bit_depth(bit_depth, files);
    if (const std::string remark = depth.remark(); !remark.empty()) print_note(remark);
    Progress progress("looking for the board");
    for (size_t k = 0; k < files.size(); ++k) {
        const cv::Mat image = read_grey(files[k]);
        if (image.empty()) throw InputError(files[k].string() + ": cannot be read as an image");
        try {
            collector.add(from_seconds(static_cast<double>(k)), depth.to_8_bit(image),
                          files[k].string());
        } catch (const UnusableMeasurement& reason) {
            throw InputError(files[k].string() + ": " + reason.what());
        }
        progress.update(static_cast<double>(k + 1) / static_cast<double>(files.size()));
    }
}

std::vector<fs::path> images_in(const std::string& folder) {
    std::vector<fs::path> files;
    for (const auto& entry : fs::directory_iterator(folder))
        if (entry.is_regular_file() && cv::haveImageReader(entry.path().string()))
            files.push_back(entry.path());
    if (files.empty()) throw InputError(folder + ": holds no images");
    return files;
}

// By time, each time once.
template <typename Measurement>
void put_in_order(std::vector<Measurement>& measurements) {
    std::stable_sort(measurements.begin(), measurements.end(),
                     [](const auto& a, const auto& b) { return a.t < b.t; });
    const auto repeated = std::unique(measurements.begin(), measurements.end(),
                                      [](const auto& a, const auto& b) { return a.t == b.t; });
    measurements.erase(repeated, measurements.end());
}

void read_rawlog(const BoardSource& source, BoardViews& views, Collector& collector) {
    Recording recording(source.path, source.recording);
    views.rig = recording.rig();
    collector.set_camera(views.rig.camera);
    if (!recording.has_images() && !recording.has_features())
        throw InputError(source.path +
                         ": no images and no features; name the camera with "
                         "--camera-label");
    if (recording.rig().camera) {
        views.width = recording.rig().camera->width();
        views.height = recording.rig().camera->height();
    }
    Progress progress("looking for the board");
    check(source.part);
    Part part(source.part, IekfOptions().message_window);
    std::vector<ImuReading> readings;
    while (const auto message = recording.next()) {
        if (!part.contains(*message)) continue;
        if (const auto* reading = std::get_if<ImuReading>(&*message)) {
            readings.push_back(*reading);
        } else if (const auto* frame = std::get_if<FeatureFrame>(&*message)) {
            collector.add(*frame);
        } else if (const auto* image = std::get_if<ImageMessage>(&*message)) {
            if (!recording.has_features())
                collector.add(image->t, image->image,
                              source.path + " (image t = " + std::to_string(image->t) + " ns)");
        }
        progress.update(recording.progress());
    }
    print_left_out(recording.left_out());
    for (const std::string& remark : recording.remarks()) print_note(remark);
    if (const std::string why = part.why_empty(); !why.empty())
        throw InputError(source.path + ": " + why);
    print_late(part.late(), IekfOptions().message_window);
    put_in_order(views.frames);
    put_in_order(readings);
    for (const ImuReading& reading : readings) views.imu.push_back(reading);
}

}  // namespace

BoardViews read_board_views(const BoardSource& source, const Board& board) {
    BoardViews views;
    Collector collector(views, board);
    collector.set_camera(source.camera);
    if (is_folder(source.path))
        read_images(images_in(source.path), source.recording.bit_depth, collector);
    else if (is_there(source.path) && cv::haveImageReader(source.path))
        read_images({source.path}, source.recording.bit_depth, collector);
    else
        read_rawlog(source, views, collector);
    if (views.frames.empty())
        throw InputError(source.path + ": no corner of the board in any of " +
                         std::to_string(views.images) +
                         " images; compare the board's description with the board");
    return views;
}

void add_board_options(CLI::App& command, std::string& board, std::string& output) {
    command
        .add_option("--board", board,
                    "Kalibr's target.yaml (aprilgrid, checkerboard), or rows id,x,y,z [m] of the "
                    "points that the features' ids name")
        ->required();
    command.add_option("-o,--output", output, "Calibration file to write")->required();
}

}  // namespace vio::app
