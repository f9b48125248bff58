#include "libvio/io/asl_import.h"

#include <filesystem>
#include <memory>
#include <optional>
#include <set>
#include <vector>

#include "libvio/base/errors.h"
#include "libvio/base/files.h"
#include "libvio/io/sensor_text.h"
#include "libvio/io/text.h"
#include "libvio/io/trajectory_io.h"
#include "libvio/io/yaml_calibration.h"

namespace vio {
namespace {

namespace fs = std::filesystem;

// Calibration of a TUM-VI data set, beside mav0/.
constexpr const char* kTumViCamera = "dso/camchain.yaml";
constexpr const char* kTumViImu = "dso/imu_config.yaml";
constexpr const char* kUsualImu = "imu0";

class ImuSource final : public MeasurementSource {
 public:
    explicit ImuSource(const fs::path& csv) : row_(csv.string()) {}

    bool advance() override {
        if (!row_.next()) {
            if (!started()) throw InputError(row_.file() + ": holds no readings");
            return false;
        }
        row_.require(7);
        set_time(row_.integer(0), row_);
        return true;
    }

    double progress() const override { return row_.progress(); }

 private:
    const char* what() const override { return "IMU readings"; }
    Message message() override { return parse_imu_reading(row_); }

    TextRows row_;
};

std::vector<ImageFile> read_image_list(const fs::path& csv) {
    std::vector<ImageFile> files;
    TextRows row(csv.string());
    while (row.next()) {
        row.require(2);
        files.push_back(
            {row.integer(0), csv.parent_path() / "data" / std::string(row.text(1)), row.place()});
    }
    return files;
}

// Consecutive rows with one stamp are one frame; a row with the stamp alone, one without features.
class FeatureSource final : public MeasurementSource {
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

    double progress() const override { return row_.progress(); }

 private:
    const char* what() const override { return "feature frames"; }
    Message message() override { return frame_; }

    bool same_frame() const {
        row_.require(4);
        return row_.integer(0) == frame_.t;
    }

    void add_row() {
        if (row_.text(1).empty() && row_.text(2).empty() && row_.text(3).empty()) return;
        FeatureObservation feature;
        feature.feature_id = row_.integer(1);
        try {
            feature.uv_px = {row_.number(2), row_.number(3)};
        } catch (const UnusableMeasurement& reason) {
            left_out_.add("features", reason.what());
            return;
        }
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
    if (!is_folder(dir)) throw InputError(dir + ": no such folder; name an ASL data set");
    return is_folder(fs::path(dir) / "mav0") ? fs::path(dir) / "mav0" : fs::path(dir);
}

// The sensors' folders of a data set, for an error message.
std::string folders_in(const fs::path& root) {
    std::set<std::string> names;
    for (const auto& entry : fs::directory_iterator(root))
        if (is_there(entry.path() / "data.csv") || is_there(entry.path() / "sensor.yaml") ||
            is_there(entry.path() / "features.csv") || is_there(entry.path() / "features.csv.gz"))
            names.insert(entry.path().filename().string());
    std::string text;
    for (const std::string& name : names) text += (text.empty() ? "" : ", ") + name;
    return text;
}

// The options with the IMU's folder, empty if there is none. A folder that was named is there.
AslImportOptions with_folders(const fs::path& root, AslImportOptions options) {
    const bool imu_named = !options.imu.empty();
    if (!imu_named && is_folder(root / kUsualImu)) options.imu = kUsualImu;
    const std::string there = folders_in(root);
    for (const std::string& name : {options.camera, options.imu})
        if (!name.empty() && !there.empty() && !is_folder(root / name))
            throw InputError((root / name).string() + ": no such folder; there are " + there);
    return options;
}

std::optional<fs::path> existing(std::initializer_list<fs::path> candidates) {
    for (const fs::path& path : candidates)
        if (is_file(path)) return path;
    return {};
}

// In the order in which measurements with the same stamp are written.
MeasurementSources open_sources(const fs::path& root, const AslImportOptions& options,
                                std::vector<std::string>& remarks) {
    MeasurementSources sources;
    const fs::path camera = root / options.camera, imu = root / options.imu;
    if (!options.imu.empty()) sources.push_back(std::make_unique<ImuSource>(imu / "data.csv"));
    const auto images = existing({camera / "data.csv"});
    const auto features = existing({camera / "features.csv", camera / "features.csv.gz"});
    if (!images && !features)
        throw InputError(camera.string() +
                         ": neither data.csv nor features.csv[.gz]; expected an ASL camera folder");
    if (images)
        sources.push_back(image_file_source(read_image_list(*images), options.bit_depth, remarks));
    if (features) sources.push_back(std::make_unique<FeatureSource>(*features));
    return sources;
}

// Ground truth is the pose of a sensor R of its own: T_W_B = T_W_R T_B_R^-1.
void import_truth(const fs::path& root, const std::string& out_rawlog, ImportReport& report) {
    const auto csv =
        existing({root / "state_groundtruth_estimate0" / "data.csv", root / "mocap0" / "data.csv"});
    if (!csv) return;
    auto poses = read_trajectory(csv->string());
    if (const auto yaml = existing({csv->parent_path() / "sensor.yaml"})) {
        const Pose T_R_B = read_asl_extrinsics(yaml->string()).inverse();
        for (TimedPose& pose : poses) pose.T_W_B = pose.T_W_B * T_R_B;
    }
    write_truth(out_rawlog, poses, report);
}

ImportReport import_measurements(const fs::path& root, const Rig& rig,
                                 const std::string& out_rawlog, const AslImportOptions& options,
                                 const std::function<void(double)>& progress) {
    RawlogWriterOptions writer_options;
    writer_options.camera_label = options.camera;
    if (!options.imu.empty()) writer_options.imu_label = options.imu;
    writer_options.external_images = options.external_images;
    ImportReport report;
    auto sources = open_sources(root, options, report.remarks);
    RawlogWriter writer(out_rawlog, rig, writer_options);
    merge_sources(std::move(sources), writer, report, progress);
    import_truth(root, out_rawlog, report);
    writer.finish();
    return report;
}

}  // namespace

ImportReport import_asl(const std::string& dir, const std::string& out_rawlog,
                        const AslImportOptions& given,
                        const std::function<void(double)>& progress) {
    const fs::path root = find_root(dir);
    const AslImportOptions options = with_folders(root, given);
    const fs::path yaml = root / options.camera / "sensor.yaml";
    if (!is_there(yaml) && is_there(root.parent_path() / kTumViCamera))
        throw InputError(yaml.string() +
                         ": no such file; for a TUM-VI data set use `import tum-vi`");
    if (!is_there(yaml))
        throw InputError(
            yaml.string() +
            ": no such file; name the folder that holds mav0/, or mav0 itself, and its "
            "camera folder");
    const AslCamera camera = read_asl_camera(yaml.string());
    Rig rig;
    rig.camera = camera.camera;
    rig.T_B_C = camera.T_B_C;
    rig.time_offset = camera.time_offset;
    if (!options.imu.empty()) {
        const AslImu imu = read_asl_imu((root / options.imu / "sensor.yaml").string());
        rig.T_B_I = imu.T_B_I;
        rig.imu_noise = imu.noise;
    }
    return import_measurements(root, rig, out_rawlog, options, progress);
}

ImportReport import_tum_vi(const std::string& dir, const std::string& out_rawlog,
                           const AslImportOptions& given,
                           const std::function<void(double)>& progress) {
    const fs::path root = find_root(dir);
    const AslImportOptions options = with_folders(root, given);
    const fs::path camera = root.parent_path() / kTumViCamera, imu = root.parent_path() / kTumViImu;
    for (const fs::path& yaml : {camera, imu})
        if (!is_file(yaml))
            throw InputError(yaml.string() +
                             ": no such file; name the folder of a TUM-VI data set, with dso/ and "
                             "mav0/ (of the export in EuRoC/DSO format)");
    StatedRig stated;
    load_yaml_calibration(camera.string(), stated, options.camera);
    load_yaml_calibration(imu.string(), stated);
    return import_measurements(root, stated.resolved(), out_rawlog, options, progress);
}

}  // namespace vio
