#include "libvio/io/kitti_calibration.h"

#include <filesystem>
#include <map>
#include <vector>

#include "libvio/base/errors.h"
#include "libvio/camera/perspective.h"
#include "libvio/io/text.h"

namespace vio {
namespace {

namespace fs = std::filesystem;

// "key: numbers" lines; the date among them is not read.
class CalibrationText {
 public:
    explicit CalibrationText(const fs::path& file) : file_(file.string()) {
        TextRows row(file_);
        while (row.next()) {
            std::string key(row.text(0));
            if (key.empty() || key.back() != ':') throw row.error("expected 'key: numbers'");
            key.pop_back();
            if (key == "calib_time" || key == "corner_dist") continue;
            std::vector<double>& values = values_[key];
            for (size_t i = 1; i < row.size(); ++i) values.push_back(row.number(i));
        }
    }

    template <int kRows, int kColumns>
    Eigen::Matrix<double, kRows, kColumns> matrix(const std::string& key) const {
        const auto found = values_.find(key);
        if (found == values_.end()) throw error(key, "is missing");
        if (found->second.size() != kRows * kColumns)
            throw error(key, "expected " + std::to_string(kRows * kColumns) + " numbers");
        Eigen::Matrix<double, kRows, kColumns> m;
        auto value = found->second.begin();
        for (int i = 0; i < kRows; ++i)
            for (int j = 0; j < kColumns; ++j) m(i, j) = *value++;
        return m;
    }

    // Rotation, brought to the nearest one: the files hold about seven digits.
    Eigen::Matrix3d rotation(const std::string& key) const {
        const Eigen::Matrix3d R = matrix<3, 3>(key);
        if (!((R.transpose() * R - Eigen::Matrix3d::Identity()).norm() < 1e-3) ||
            R.determinant() < 0)
            throw error(key, "is no rotation");
        return so3::normalized(R);
    }

    Pose pose(const std::string& rotation_key, const std::string& translation_key) const {
        return {rotation(rotation_key), matrix<3, 1>(translation_key)};
    }

    InputError error(const std::string& key, const std::string& problem) const {
        return InputError(file_ + " (" + key + "): " + problem);
    }

 private:
    std::string file_;
    std::map<std::string, std::vector<double>> values_;
};

struct Camera0 {
    PerspectiveParameters lens;
    Pose T_C_C0;  ///< from the first camera, not rectified
};

Camera0 rectified(const CalibrationText& text, const std::string& camera) {
    const auto P = text.matrix<3, 4>("P_rect_" + camera);
    Camera0 c;
    c.lens.fx = P(0, 0), c.lens.fy = P(1, 1), c.lens.cx = P(0, 2), c.lens.cy = P(1, 2);
    // Every rectified camera has the attitude of the first; its place stands in P = K [I | p].
    c.T_C_C0.R = text.rotation("R_rect_00");
    if (!(c.lens.fx > 0 && c.lens.fy > 0)) throw text.error("P_rect_" + camera, "no focal length");
    c.T_C_C0.p = P.leftCols<3>().inverse() * P.col(3);
    return c;
}

Camera0 original(const CalibrationText& text, const std::string& camera) {
    const Eigen::Matrix3d K = text.matrix<3, 3>("K_" + camera);
    const auto D = text.matrix<1, 5>("D_" + camera);
    Camera0 c;
    c.lens.fx = K(0, 0), c.lens.fy = K(1, 1), c.lens.cx = K(0, 2), c.lens.cy = K(1, 2);
    for (int i = 0; i < 5; ++i) c.lens.distortion[static_cast<size_t>(i)] = D(i);
    c.T_C_C0 = text.pose("R_" + camera, "T_" + camera);
    return c;
}

// A tactical-grade unit as in share/imu/tactical.ini; the drives hold no recording at rest from
// which the noise of theirs could be measured.
ImuNoise tactical_noise() {
    ImuNoise noise;
    noise.gyro_noise_density = 4.36e-5;
    noise.accel_noise_density = 1.17e-3;
    noise.gyro_bias_random_walk = 5.7e-8;
    noise.accel_bias_random_walk = 1.16e-5;
    noise.gyro_sensitivity_error = 0.0005;
    return noise;
}

}  // namespace

Rig read_kitti_calibration(const std::string& folder, const std::string& camera, int width,
                           int height) {
    const fs::path dir(folder);
    const CalibrationText cameras(dir / "calib_cam_to_cam.txt");
    const auto has_size = [&](const char* kind) {
        const auto size = cameras.matrix<1, 2>(kind + camera);
        return size(0) == width && size(1) == height;
    };
    Camera0 c;
    if (has_size("S_rect_"))
        c = rectified(cameras, camera);
    else if (has_size("S_"))
        c = original(cameras, camera);
    else
        throw cameras.error("S_rect_" + camera, "is not the size of the images, " +
                                                    std::to_string(width) + "x" +
                                                    std::to_string(height) + " px");
    c.lens.width = width;
    c.lens.height = height;
    const Pose T_C0_V = CalibrationText(dir / "calib_velo_to_cam.txt").pose("R", "T");
    const Pose T_V_B = CalibrationText(dir / "calib_imu_to_velo.txt").pose("R", "T");
    Rig rig;
    rig.camera = std::make_shared<PerspectiveCamera>(c.lens);
    rig.T_B_C = (c.T_C_C0 * T_C0_V * T_V_B).inverse();
    rig.imu_noise = tactical_noise();
    return rig;
}

}  // namespace vio
