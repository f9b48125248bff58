#include "libvio/io/asl_calibration.h"

#include <yaml-cpp/yaml.h>

#include <cmath>
#include <filesystem>
#include <vector>

#include "libvio/base/errors.h"
#include "libvio/io/text.h"

namespace vio {
namespace {

// Departure from a rotation matrix that rounding of text explains.
constexpr double kMaxNonOrthogonality = 1e-3;

// One sensor.yaml, whose every error names file and key.
class SensorYaml {
 public:
    explicit SensorYaml(const std::string& file) : file_(file) {
        if (!std::filesystem::is_regular_file(file))
            throw InputError(file + ": no such file; the data set needs it");
        try {
            root_ = YAML::LoadFile(file);
        } catch (const YAML::Exception& reason) {
            throw InputError(file + ": is not YAML (" + one_line(reason.what()) + ")");
        }
        if (!root_.IsMap()) throw InputError(file + ": holds no keys; expected a sensor.yaml");
    }

    InputError error(const std::string& key, const std::string& problem) const {
        return InputError(file_ + " (" + key + "): " + problem);
    }

    template <typename T>
    T get(const std::string& key) const {
        return convert<T>(key, root_[key]);
    }

    bool has(const std::string& key) const { return root_[key].IsDefined(); }

    std::vector<double> numbers(const std::string& key, std::size_t least) const {
        const auto all = get<std::vector<double>>(key);
        if (all.size() < least) throw error(key, "has too few numbers");
        return all;
    }

    double positive(const std::string& key) const {
        const double value = get<double>(key);
        if (!(value > 0) || !std::isfinite(value)) throw error(key, "must be positive");
        return value;
    }

    // Rotation is brought to the nearest one: files hold about ten digits.
    Pose T_BS() const {
        const auto m = convert<std::vector<double>>("T_BS data", root_["T_BS"]["data"]);
        if (m.size() != 16) throw error("T_BS", "expected 16 numbers, row by row");
        Pose T;
        for (int i = 0; i < 3; ++i) {
            for (int j = 0; j < 3; ++j) T.R(i, j) = m[static_cast<std::size_t>(4 * i + j)];
            T.p(i) = m[static_cast<std::size_t>(4 * i + 3)];
        }
        if (!T.p.allFinite() || T.R.determinant() < 0.5 ||
            !((T.R.transpose() * T.R - Eigen::Matrix3d::Identity()).norm() < kMaxNonOrthogonality))
            throw error("T_BS", "is not a rotation and a translation");
        const Eigen::JacobiSVD<Eigen::Matrix3d> svd(T.R, Eigen::ComputeFullU | Eigen::ComputeFullV);
        T.R = svd.matrixU() * svd.matrixV().transpose();
        return T;
    }

 private:
    template <typename T>
    T convert(const std::string& key, const YAML::Node& node) const {
        if (!node.IsDefined()) throw error(key, "is missing");
        try {
            return node.as<T>();
        } catch (const YAML::Exception&) {
            throw error(key, "has a value of the wrong kind");
        }
    }

    std::string file_;
    YAML::Node root_;
};

void set_distortion(const SensorYaml& yaml, mrpt::img::TCamera& params) {
    const auto model = yaml.get<std::string>("distortion_model");
    if (model == "none") {
        params.distortion = mrpt::img::DistortionModel::none;
        return;
    }
    const auto k = yaml.numbers("distortion_coefficients", 4);
    if (model == "radial-tangential" || model == "radtan" || model == "plumb_bob") {
        if (k.size() != 4 && k.size() != 5 && k.size() != 8)
            throw yaml.error("distortion_coefficients", "expected 4, 5 or 8 numbers");
        params.distortion = mrpt::img::DistortionModel::plumb_bob;
        params.setDistortionParamsVector(k);
    } else if (model == "equidistant" || model == "kannala_brandt") {
        params.setDistortionKannalaBrandt(k[0], k[1], k[2], k[3]);
    } else {
        throw yaml.error("distortion_model", "'" + model +
                                                 "' is not known; radial-tangential, equidistant "
                                                 "and none are");
    }
}

}  // namespace

AslCamera read_asl_camera(const std::string& sensor_yaml) {
    const SensorYaml yaml(sensor_yaml);
    const auto model = yaml.get<std::string>("camera_model");
    if (model != "pinhole")
        throw yaml.error("camera_model", "'" + model + "' is not known; pinhole is");
    const auto size = yaml.get<std::vector<int>>("resolution");
    if (size.size() != 2 || size[0] <= 0 || size[1] <= 0)
        throw yaml.error("resolution", "expected width and height");
    const auto intrinsics = yaml.numbers("intrinsics", 4);
    if (!(intrinsics[0] > 0) || !(intrinsics[1] > 0))
        throw yaml.error("intrinsics", "focal lengths must be positive");

    AslCamera camera;
    camera.T_B_C = yaml.T_BS();
    camera.params.ncols = static_cast<std::uint32_t>(size[0]);
    camera.params.nrows = static_cast<std::uint32_t>(size[1]);
    camera.params.setIntrinsicParamsFromValues(intrinsics[0], intrinsics[1], intrinsics[2],
                                               intrinsics[3]);
    set_distortion(yaml, camera.params);
    return camera;
}

AslImu read_asl_imu(const std::string& sensor_yaml) {
    const SensorYaml yaml(sensor_yaml);
    AslImu imu;
    imu.T_B_I = yaml.T_BS();
    imu.noise.gyro_noise_density = yaml.positive("gyroscope_noise_density");
    imu.noise.gyro_bias_random_walk = yaml.positive("gyroscope_random_walk");
    imu.noise.accel_noise_density = yaml.positive("accelerometer_noise_density");
    imu.noise.accel_bias_random_walk = yaml.positive("accelerometer_random_walk");
    return imu;
}

Pose read_asl_extrinsics(const std::string& sensor_yaml) {
    return SensorYaml(sensor_yaml).T_BS();
}

}  // namespace vio
