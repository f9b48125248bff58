#include "libvio/io/asl_export.h"

#include <filesystem>
#include <fstream>
#include <opencv2/imgcodecs.hpp>

#include "libvio/base/errors.h"
#include "libvio/base/files.h"
#include "libvio/camera/description.h"
#include "libvio/io/mrpt_conversions.h"
#include "libvio/io/text.h"
#include "libvio/io/trajectory_io.h"

namespace vio {
namespace {

namespace fs = std::filesystem;

constexpr const char* kImuHeader =
    "#timestamp [ns],w_RS_S_x [rad s^-1],w_RS_S_y [rad s^-1],w_RS_S_z [rad s^-1],"
    "a_RS_S_x [m s^-2],a_RS_S_y [m s^-2],a_RS_S_z [m s^-2]\n";
constexpr const char* kTruthHeader =
    "#timestamp [ns],p_RS_R_x [m],p_RS_R_y [m],p_RS_R_z [m],q_RS_w [],q_RS_x [],q_RS_y [],"
    "q_RS_z []\n";

// A CSV file with its folder and header from the first row on.
class Table {
 public:
    Table(fs::path file, const char* header) : file_(std::move(file)), header_(header) {}

    void add(TimeNs t, const std::string& rest) {
        if (rows_++ == 0) {
            fs::create_directories(file_.parent_path());
            out_.open(file_, std::ios::binary);
            out_ << header_;
            first_ = t;
        }
        last_ = t;
        out_ << t << ',' << rest << '\n';
    }
    void close() {
        if (rows_ == 0) return;
        out_.close();
        if (!out_) throw InputError(file_.string() + ": cannot be written; check folder and space");
    }
    bool empty() const { return rows_ == 0; }
    std::string rate_hz() const {
        return rows_ > 1 && last_ > first_ ? format((rows_ - 1) / to_seconds(last_ - first_)) : "0";
    }

 private:
    fs::path file_;
    const char* header_;
    std::ofstream out_;
    int rows_ = 0;
    TimeNs first_ = 0, last_ = 0;
};

std::string transform(const Pose& T) {
    std::string text = "T_BS:\n  cols: 4\n  rows: 4\n  data: [";
    for (int i = 0; i < 3; ++i) text += joined(T.R.row(i), ", ") + ", " + format(T.p(i)) + ", ";
    return text + "0, 0, 0, 1]\n";
}

std::string camera_yaml(const Rig& rig, const std::string& rate, const std::string& rawlog) {
    if (!rig.camera)
        throw InputError(rawlog + ": its camera has no calibration; name one with --calibration");
    const CameraDescription d = describe(*rig.camera), standard;
    const bool unified = d.model == "unified" && !d.mirror && d.min_angle == standard.min_angle &&
                         d.max_angle == standard.max_angle;
    if (!fits_mrpt(*rig.camera) && !unified)
        throw InputError(rawlog + ": its camera (" + d.model +
                         ", or the limits of its field) has no form in ASL's sensor.yaml");
    const PerspectiveParameters& lens = d.lens;
    const bool fisheye = d.model == "fisheye";
    const std::vector<double> distortion(lens.distortion.begin(),
                                         lens.distortion.begin() + (fisheye ? 4 : 8));
    return "sensor_type: camera\ncomment: exported by vio-slam\n" + transform(rig.T_B_C) +
           "rate_hz: " + rate + "\nresolution: [" + std::to_string(lens.width) + ", " +
           std::to_string(lens.height) + "]\ncamera_model: " + (unified ? "omni" : "pinhole") +
           "\nintrinsics: [" + (unified ? format(d.xi) + ", " : "") +
           joined(std::array{lens.fx, lens.fy, lens.cx, lens.cy}, ", ") +
           "]\ndistortion_model: " + (fisheye ? "equidistant" : "radial-tangential") +
           "\ndistortion_coefficients: [" + joined(distortion, ", ") +
           "]\n# t_imu = t_cam + timeshift_cam_imu [s]\ntimeshift_cam_imu: " +
           format(rig.time_offset) + "\n";
}

std::string imu_yaml(const Rig& rig, const std::string& rate) {
    const ImuNoise& n = rig.imu_noise;
    return "sensor_type: imu\ncomment: exported by vio-slam\n" + transform(rig.T_B_I) +
           "rate_hz: " + rate + "\n# [rad/s/sqrt(Hz)], [rad/s^2/sqrt(Hz)]\n" +
           "gyroscope_noise_density: " + format(n.gyro_noise_density) +
           "\ngyroscope_random_walk: " + format(n.gyro_bias_random_walk) +
           "\n# [m/s^2/sqrt(Hz)], [m/s^3/sqrt(Hz)]\naccelerometer_noise_density: " +
           format(n.accel_noise_density) +
           "\naccelerometer_random_walk: " + format(n.accel_bias_random_walk) +
           "\n# share of the rate [-]\ngyroscope_sensitivity_error: " +
           format(n.gyro_sensitivity_error) + "\n";
}

// The measurements of one rawlog on their way into the folder.
class Exporter {
 public:
    explicit Exporter(fs::path root)
        : root_(std::move(root)),
          imu_(root_ / "imu0/data.csv", kImuHeader),
          images_(root_ / "cam0/data.csv", "#timestamp [ns],filename\n"),
          features_(root_ / "cam0/features.csv", "#timestamp [ns],feature_id [],u [px],v [px]\n") {}

    void put(const ImuReading& r) {
        imu_.add(r.t, joined(r.gyro) + "," + joined(r.accel));
        ++report.imu_readings;
    }
    void put(const ImageMessage& m) {
        const std::string name = std::to_string(m.t) + ".png";
        fs::create_directories(root_ / "cam0/data");
        const std::string path = (root_ / "cam0/data" / name).string();
        if (!cv::imwrite(path, m.image))
            throw InputError(path + ": cannot be written; is the disk full?");
        images_.add(m.t, name);
        ++report.images;
    }
    void put(const FeatureFrame& frame) {
        if (frame.features.empty()) features_.add(frame.t, ",,");
        for (const FeatureObservation& f : frame.features)
            features_.add(frame.t, std::to_string(f.feature_id) + "," + joined(f.uv_px));
        ++report.feature_frames;
    }
    void put(const OdometryMessage&) { ++report.left_out; }
    void put(const GpsMessage&) { ++report.left_out; }

    void put_truth(const std::string& file) {
        Table truth(root_ / "state_groundtruth_estimate0/data.csv", kTruthHeader);
        for (const TimedPose& pose : read_trajectory(file)) {
            const Eigen::Quaterniond q(pose.T_W_B.R);
            truth.add(pose.t,
                      joined(pose.T_W_B.p) + "," + joined(std::array{q.w(), q.x(), q.y(), q.z()}));
            ++report.truth_poses;
        }
        truth.close();
        write_text((root_ / "state_groundtruth_estimate0/sensor.yaml").string(),
                   "sensor_type: visual-inertial\n" + transform(Pose()));
    }

    void finish(const Rig& rig, const std::string& rawlog) {
        for (Table* table : {&imu_, &images_, &features_}) table->close();
        if (imu_.empty() && images_.empty() && features_.empty())
            throw InputError(rawlog + ": holds neither images, features nor IMU readings");
        if (!images_.empty() || !features_.empty())
            write_text((root_ / "cam0/sensor.yaml").string(),
                       camera_yaml(rig, images_.rate_hz(), rawlog));
        if (!imu_.empty())
            write_text((root_ / "imu0/sensor.yaml").string(), imu_yaml(rig, imu_.rate_hz()));
    }

    AslExportReport report;

 private:
    fs::path root_;
    Table imu_, images_, features_;
};

}  // namespace

AslExportReport export_asl(const std::string& rawlog_file, const std::string& dir,
                           const AslExportOptions& options,
                           const std::function<void(double)>& progress) {
    const fs::path root = fs::path(dir) / "mav0", partial = fs::path(dir) / "mav0.partial";
    if (is_there(root))
        throw InputError(root.string() + ": exists already; name another folder or remove it");
    Recording recording(rawlog_file, options.recording);
    std::error_code error;
    fs::remove_all(partial, error);
    fs::create_directories(partial, error);
    if (error) throw InputError(partial.string() + ": cannot be made (" + error.message() + ")");
    try {
        Exporter exporter(partial);
        while (const auto message = recording.next()) {
            std::visit([&](const auto& m) { exporter.put(m); }, *message);
            if (progress) progress(recording.progress());
        }
        std::string truth = options.truth_file;
        const fs::path beside = fs::path(rawlog_file).replace_extension(".truth.tum");
        if (truth.empty() && is_there(beside)) truth = beside.string();
        if (!truth.empty()) exporter.put_truth(truth);
        exporter.finish(recording.rig(), rawlog_file);
        exporter.report.unusable = recording.left_out();
        fs::rename(partial, root);
        return exporter.report;
    } catch (...) {
        fs::remove_all(partial, error);
        throw;
    }
}

}  // namespace vio
