// YAML files with a place for every error.
#pragma once

#include <yaml-cpp/yaml.h>

#include <cmath>
#include <string>
#include <vector>

#include "libvio/base/errors.h"
#include "libvio/base/files.h"
#include "libvio/geometry/pose.h"
#include "libvio/io/text.h"

namespace vio {

// Departure from a rotation matrix that rounding of text explains.
inline constexpr double kMaxNonOrthogonality = 1e-3;

// Keys of a file or of one of its parts; every error names file and key.
class Yaml {
 public:
    explicit Yaml(const std::string& file) : place_(file) {
        if (!is_file(file)) throw InputError(file + ": no such file; name an existing one");
        try {
            root_.reset(YAML::LoadFile(file));
        } catch (const YAML::Exception& reason) {
            throw InputError(file + ": is not YAML (" + one_line(reason.what()) + ")");
        }
        if (!root_.IsMap()) throw InputError(file + ": holds no keys");
    }

    bool has(const std::string& key) const { return root_[key].IsDefined(); }
    Yaml part(const std::string& key) const {
        if (!has(key) || !root_[key].IsMap()) throw error(key, "is missing or holds no keys");
        return Yaml(place_ + " " + key, root_[key]);
    }

    InputError error(const std::string& key, const std::string& problem) const {
        return InputError(place_ + " (" + key + "): " + problem);
    }

    template <typename T>
    T get(const std::string& key) const {
        return convert<T>(key, root_[key]);
    }

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

    // ASL's T_BS, 16 numbers row by row.
    Pose T_BS() const { return rigid("T_BS", part("T_BS").get<std::vector<double>>("data")); }

    double time_shift(double otherwise) const {
        return has("timeshift_cam_imu") ? get<double>("timeshift_cam_imu") : otherwise;
    }

    // Kalibr's four rows.
    Pose rows(const std::string& key) const {
        std::vector<double> all;
        for (const auto& row : get<std::vector<std::vector<double>>>(key))
            all.insert(all.end(), row.begin(), row.end());
        return rigid(key, all);
    }

 private:
    Yaml(std::string place, const YAML::Node& root) : place_(std::move(place)), root_(root) {}

    template <typename T>
    T convert(const std::string& key, const YAML::Node& node) const {
        if (!node.IsDefined()) throw error(key, "is missing");
        try {
            return node.as<T>();
        } catch (const YAML::Exception&) {
            throw error(key, "has a value of the wrong kind");
        }
    }

    // Rotation is brought to the nearest one: files hold about ten digits.
    Pose rigid(const std::string& key, const std::vector<double>& m) const {
        if (m.size() != 16) throw error(key, "expected 16 numbers, row by row");
        Pose T;
        const Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>> rows(m.data());
        T.R = rows.topLeftCorner<3, 3>();
        T.p = rows.topRightCorner<3, 1>();
        if (!T.p.allFinite() || T.R.determinant() < 0.5 ||
            !((T.R.transpose() * T.R - Eigen::Matrix3d::Identity()).norm() < kMaxNonOrthogonality))
            throw error(key, "is not a rotation and a translation");
        const Eigen::JacobiSVD<Eigen::Matrix3d> svd(T.R, Eigen::ComputeFullU | Eigen::ComputeFullV);
        T.R = svd.matrixU() * svd.matrixV().transpose();
        return T;
    }

    std::string place_;
    YAML::Node root_;
};

}  // namespace vio
