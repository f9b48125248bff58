#include "libvio/io/measurement_source.h"

#include <algorithm>

#include "libvio/io/image_depth.h"
#include "libvio/io/trajectory_io.h"

namespace vio {
namespace {

namespace fs = std::filesystem;

class ImageFileSource final : public MeasurementSource {
 public:
    ImageFileSource(std::vector<ImageFile> files, BitDepth depth)
        : files_(std::move(files)), depth_(depth) {}

    bool advance() override {
        if (next_ == files_.size()) return false;
        set_time(files_[next_].t, files_[next_]);
        ++next_;
        return true;
    }

    double progress() const override {
        return static_cast<double>(next_) / static_cast<double>(files_.size());
    }

 private:
    const char* what() const override { return "images"; }

    Message message() override {
        const ImageFile& file = files_[next_ - 1];
        const cv::Mat image = read_grey(file.path);
        const auto unusable = [&](const std::string& why) {
            return UnusableMeasurement(file.place + ": image " + file.path.string() + why);
        };
        if (image.empty()) throw unusable(" is missing or damaged");
        try {
            return ImageMessage{time(), depth_.to_8_bit(image)};
        } catch (const UnusableMeasurement& reason) {
            throw unusable(std::string(": ") + reason.what());
        }
    }

    std::vector<ImageFile> files_;
    BitDepth depth_;
    size_t next_ = 0;
};

void count(const Message& message, ImportReport& report) {
    report.imu_readings += std::holds_alternative<ImuReading>(message);
    report.images += std::holds_alternative<ImageMessage>(message);
    report.feature_frames += std::holds_alternative<FeatureFrame>(message);
    report.gps_fixes += std::holds_alternative<GpsMessage>(message);
}

}  // namespace

std::unique_ptr<MeasurementSource> image_file_source(std::vector<ImageFile> files, int bit_depth,
                                                     std::vector<std::string>& remarks) {
    std::vector<fs::path> paths;
    for (const ImageFile& file : files) paths.push_back(file.path);
    const BitDepth depth = find_bit_depth(bit_depth, paths);
    if (const std::string remark = depth.remark(); !remark.empty()) remarks.push_back(remark);
    return std::make_unique<ImageFileSource>(std::move(files), depth);
}

std::optional<Message> MeasurementSource::take() {
    try {
        Message taken = message();
        any_taken_ = true;
        return taken;
    } catch (const UnusableMeasurement& reason) {
        left_out_.add(what(), reason.what());
        return {};
    }
}

void merge_sources(MeasurementSources sources, RawlogWriter& writer, ImportReport& report,
                   const std::function<void(double)>& progress) {
    const auto drop = [&](MeasurementSources::iterator source) {
        const LeftOutList& left_out = (*source)->left_out();
        if (!(*source)->any_taken() && !left_out.empty())
            throw InputError(left_out.kinds()[0].first +
                             "; so all had to be left out: " + std::to_string(left_out.total()));
        report.left_out.add(left_out);
        return sources.erase(source);
    };
    for (auto source = sources.begin(); source != sources.end();)
        source = (*source)->advance() ? source + 1 : drop(source);
    if (sources.empty()) throw InputError("no measurements");
    bool first = true;
    while (!sources.empty()) {
        const auto earliest = std::min_element(
            sources.begin(), sources.end(), [](auto& a, auto& b) { return a->time() < b->time(); });
        MeasurementSource& source = **earliest;
        if (const auto message = source.take()) {
            writer.write(*message);
            count(*message, report);
            if (first) report.first = source.time();
            first = false;
            report.last = source.time();
        }
        if (progress) progress(source.progress());
        if (!source.advance()) drop(earliest);
    }
}

void write_truth(const std::string& rawlog_file, const std::vector<TimedPose>& poses,
                 ImportReport& report) {
    report.truth_file = fs::path(rawlog_file).replace_extension(".truth.tum").string();
    report.truth_poses = static_cast<int>(poses.size());
    write_tum(report.truth_file, poses, "T_W_B, ground truth");
}

}  // namespace vio
