#include "libvio/camera/intrinsics.h"

#include "libvio/camera/description.h"

namespace vio {
namespace {

constexpr int kWithoutDistortion = 4;

}  // namespace

Eigen::VectorXd intrinsics(const Camera& camera, int count) {
    const PerspectiveParameters lens = describe(camera).lens;
    Eigen::VectorXd values(count);
    values.head<kWithoutDistortion>() << lens.fx, lens.fy, lens.cx, lens.cy;
    for (int k = kWithoutDistortion; k < count; ++k)
        values(k) = lens.distortion[k - kWithoutDistortion];
    return values;
}

CameraPtr with_intrinsics(const Camera& camera, const Eigen::VectorXd& values) {
    CameraDescription d = describe(camera);
    d.lens.fx = values(0);
    d.lens.fy = values(1);
    d.lens.cx = values(2);
    d.lens.cy = values(3);
    for (int k = kWithoutDistortion; k < values.size(); ++k)
        d.lens.distortion[k - kWithoutDistortion] = values(k);
    return make_camera(d);
}

std::vector<std::string> intrinsic_names(const Camera& camera, int count) {
    std::vector<std::string> names{"fx", "fy", "cx", "cy"};
    const std::vector<std::string> distortion =
        camera.model_name() == "fisheye"
            ? std::vector<std::string>{"k1", "k2", "k3", "k4"}
            : std::vector<std::string>{"k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"};
    names.insert(names.end(), distortion.begin(), distortion.begin() + (count - names.size()));
    return names;
}

int distortion_count(const Camera& camera) {
    if (camera.model_name() == "parabolic_mirror") return 0;  // a telecentric lens
    const auto k = describe(camera).lens.distortion;
    const bool rational = k[5] != 0 || k[6] != 0 || k[7] != 0;
    return rational ? 8 : k[4] != 0 ? 5 : 4;
}

IntrinsicJacobian::IntrinsicJacobian(const Camera& camera, int count) {
    const Eigen::VectorXd values = intrinsics(camera, count);
    // Pixels are linear in the first four, nearly so in distortion.
    constexpr double kPixels = 1e-2, kDistortion = 1e-5;
    for (int k = 0; k < count; ++k) {
        const double step = k < kWithoutDistortion ? kPixels : kDistortion;
        Eigen::VectorXd plus = values, minus = values;
        plus(k) += step;
        minus(k) -= step;
        pairs_.push_back({with_intrinsics(camera, plus), with_intrinsics(camera, minus), 2 * step});
    }
}

Eigen::Matrix2Xd IntrinsicJacobian::operator()(const Eigen::Vector3d& p_C) const {
    Eigen::Matrix2Xd J = Eigen::Matrix2Xd::Zero(2, static_cast<Eigen::Index>(pairs_.size()));
    for (size_t k = 0; k < pairs_.size(); ++k) {
        const auto plus = pairs_[k].plus->project(p_C), minus = pairs_[k].minus->project(p_C);
        if (plus && minus) J.col(static_cast<Eigen::Index>(k)) = (*plus - *minus) / pairs_[k].step;
    }
    return J;
}

}  // namespace vio
