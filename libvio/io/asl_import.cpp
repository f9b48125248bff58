#include "libvio/io/asl_import.h"

#include <algorithm>
#include <array>
#include <filesystem>
#include <memory>
#include <opencv2/imgcodecs.hpp>
#include <optional>
#include <set>
#include <vector>

#include "libvio/base/errors.h"
#include "libvio/io/rawlog_writer.h"
#include "libvio/io/sensor_text.h"
#include "libvio/io/text.h"
#include "libvio/io/trajectory_io.h"
#include "libvio/io/yaml_calibration.h"

namespace vio {
namespace {

namespace fs = std::filesystem;

// One file of the data set as measurements in order of time.
class Source {
 public:
    virtual ~Source() = default;

    /// Moves to the next measurement; time() is valid while it returned true.
    virtual bool advance() = 0;
    virtual Message message() = 0;
    virtual double progress() const = 0;
    TimeNs time() const { return time_; }

 protected:
    // Stamps of one sensor must increase.
    void set_time(TimeNs t, const TextRows& row) {
        if (started_ && t <= time_)
            throw row.error("the time stamp is not later than the one before");
        started_ = true;
        time_ = t;
    }

 private:
    TimeNs time_ = 0;
    bool started_ = false;
};

class ImuSource final : public Source {
 public:
    explicit ImuSource(const fs::path& csv) : row_(csv.string()) {}

    bool advance() override {
        if (!row_.next()) return false;
        row_.require(7);
        set_time(row_.integer(0), row_);
        return true;
    }

    Message message() override { return parse_imu_reading(row_); }

    double progress() const override { return row_.progress(); }

 private:
    TextRows row_;
};

class ImageSource final : public Source {
 public:
    explicit ImageSource(const fs::path& csv)
        : row_(csv.string()), folder_(csv.parent_path() / "data") {}

    bool advance() override {
        if (!row_.next()) return false;
        row_.require(2);
        set_time(row_.integer(0), row_);
        return true;
    }

    Message message() override {
        const fs::path path = folder_ / std::string(row_.text(1));
        const cv::Mat image =
            fs::is_regular_file(path) ? cv::imread(path.string(), cv::IMREAD_GRAYSCALE) : cv::Mat();
        if (image.empty()) throw row_.error("image " + path.string() + " is missing or damaged");
        return ImageMessage{time(), image};
    }

    double progress() const override { return row_.progress(); }

 private:
    TextRows row_;
    fs::path folder_;
};

// Consecutive rows with one stamp are one frame.
class FeatureSource final : public Source {
 public:
    explicit FeatureSource(const fs::path& csv) : row_(csv.string()), more_(row_.next()) {}

    bool advance() override {
        if (!more_) return false;
        frame_ = {};
        ids_.clear();
        row_.require(4);
        frame_.t = row_.integer(0);
        set_time(frame_.t, row_);
        do add_row();
        while ((more_ = row_.next()) && same_frame());
        return true;
    }

    Message message() override { return frame_; }
    double progress() const override { return row_.progress(); }

 private:
    bool same_frame() const {
        row_.require(4);
        return row_.integer(0) == frame_.t;
    }

    void add_row() {
        FeatureObservation feature;
        feature.feature_id = row_.integer(1);
        feature.uv_px = {row_.number(2), row_.number(3)};
        if (!ids_.insert(feature.feature_id).second)
            throw row_.error("feature " + std::to_string(feature.feature_id) +
                             " appears twice in one image");
        frame_.features.push_back(feature);
    }

    TextRows row_;
    bool more_;
    FeatureFrame frame_;
    std::set<FeatureId> ids_;
};

fs::path find_root(const std::string& dir) {
    if (!fs::is_directory(dir)) throw InputError(dir + ": no such folder; name an ASL data set");
    return fs::is_directory(fs::path(dir) / "mav0") ? fs::path(dir) / "mav0" : fs::path(dir);
}

std::optional<fs::path> existing(std::initializer_list<fs::path> candidates) {
    for (const fs::path& path : candidates)
        if (fs::is_regular_file(path)) return path;
    return {};
}

// In the order in which measurements with the same stamp are written.
std::vector<std::unique_ptr<Source>> open_sources(const fs::path& root,
                                                  const AslImportOptions& options) {
    std::vector<std::unique_ptr<Source>> sources;
    const fs::path camera = root / options.camera, imu = root / options.imu;
    if (fs::is_directory(imu)) sources.push_back(std::make_unique<ImuSource>(imu / "data.csv"));
    const auto images = existing({camera / "data.csv"});
    const auto features = existing({camera / "features.csv", camera / "features.csv.gz"});
    if (!images && !features)
        throw InputError(camera.string() +
                         ": neither data.csv nor features.csv[.gz]; expected an ASL camera folder");
    if (images) sources.push_back(std::make_unique<ImageSource>(*images));
    if (features) sources.push_back(std::make_unique<FeatureSource>(*features));
    return sources;
}

void count(const Message& message, AslImportReport& report) {
    report.imu_readings += std::holds_alternative<ImuReading>(message);
    report.images += std::holds_alternative<ImageMessage>(message);
    report.feature_frames += std::holds_alternative<FeatureFrame>(message);
}

// Writes the measurements of all sources in order of time.
void merge(std::vector<std::unique_ptr<Source>> sources, RawlogWriter& writer,
           AslImportReport& report, const std::function<void(double)>& progress) {
    std::erase_if(sources, [](auto& source) { return !source->advance(); });
    if (sources.empty()) throw InputError("no measurements");
    bool first = true;
    while (!sources.empty()) {
        const auto earliest = std::min_element(
            sources.begin(), sources.end(), [](auto& a, auto& b) { return a->time() < b->time(); });
        Source& source = **earliest;
        const Message message = source.message();
        writer.write(message);
        count(message, report);
        if (first) report.first = source.time();
        first = false;
        report.last = source.time();
        if (progress) progress(source.progress());
        if (!source.advance()) sources.erase(earliest);
    }
}

// Ground truth is the pose of a sensor R of its own: T_W_B = T_W_R T_B_R^-1.
void import_truth(const fs::path& root, const std::string& out_rawlog, AslImportReport& report) {
    const auto csv =
        existing({root / "state_groundtruth_estimate0" / "data.csv", root / "mocap0" / "data.csv"});
    if (!csv) return;
    auto poses = read_trajectory(csv->string());
    if (const auto yaml = existing({csv->parent_path() / "sensor.yaml"})) {
        const Pose T_R_B = read_asl_extrinsics(yaml->string()).inverse();
        for (TimedPose& pose : poses) pose.T_W_B = pose.T_W_B * T_R_B;
    }
    report.truth_file = fs::path(out_rawlog).replace_extension(".truth.tum").string();
    report.truth_poses = static_cast<int>(poses.size());
    write_tum(report.truth_file, poses, "T_W_B, ground truth");
}

}  // namespace

AslImportReport import_asl(const std::string& dir, const std::string& out_rawlog,
                           const AslImportOptions& options,
                           const std::function<void(double)>& progress) {
    const fs::path root = find_root(dir);
    auto sources = open_sources(root, options);
    const AslCamera camera = read_asl_camera((root / options.camera / "sensor.yaml").string());
    Rig rig;
    rig.camera = camera.camera;
    rig.T_B_C = camera.T_B_C;
    if (fs::is_directory(root / options.imu)) {
        const AslImu imu = read_asl_imu((root / options.imu / "sensor.yaml").string());
        rig.T_B_I = imu.T_B_I;
        rig.imu_noise = imu.noise;
    }
    RawlogWriterOptions writer_options;
    writer_options.camera_label = options.camera;
    writer_options.imu_label = options.imu;
    writer_options.external_images = options.external_images;

    AslImportReport report;
    RawlogWriter writer(out_rawlog, rig, writer_options);
    merge(std::move(sources), writer, report, progress);
    import_truth(root, out_rawlog, report);
    writer.finish();
    return report;
}

}  // namespace vio
