// Intrinsics of a camera as a vector, for calibration.
#pragma once

#include <string>
#include <vector>

#include "libvio/camera/camera.h"

namespace vio {

/// In this order: fx fy cx cy, then the first distortion coefficients. At least 4 in number.
Eigen::VectorXd intrinsics(const Camera& camera, int count);
/// The camera with other values of these. Throws InputError if they make no camera.
CameraPtr with_intrinsics(const Camera& camera, const Eigen::VectorXd& values);
/// Names of the camera's intrinsics in this order.
std::vector<std::string> intrinsic_names(const Camera& camera, int count);

/// Distortion coefficients that the camera uses: 4, 5 or 8 of a perspective camera, none of a
/// telecentric one (before a parabolic mirror), else 4.
int distortion_count(const Camera& camera);

/// d uv / d intrinsics by central differences, from cameras that are made once.
class IntrinsicJacobian {
 public:
    IntrinsicJacobian(const Camera& camera, int count);
    /// Two rows; zero where the point cannot be imaged.
    Eigen::Matrix2Xd operator()(const Eigen::Vector3d& p_C) const;

 private:
    // The camera with one intrinsic a step larger and smaller; step in its unit.
    struct Pair {
        CameraPtr plus, minus;
        double step;
    };
    std::vector<Pair> pairs_;
};

}  // namespace vio
