#include "libvio/camera/fisheye.h"

#include <cmath>

#include "libvio/base/errors.h"

namespace vio {
namespace {

constexpr double kWidest = 3.1;       // [rad] all azimuths meet at pi
constexpr double kLeastSlope = 1e-3;  // of theta_d
constexpr double kEdge = 1e-12;       // rounding at max_angle [rad]
constexpr double kNearAxis = 1e-6;    // r / Z below which X / r says nothing

struct Polynomial {
    double value, slope;  // theta_d / theta, d theta_d / d theta
};

Polynomial polynomial(const std::array<double, 4>& k, double theta) {
    const double t2 = theta * theta;
    return {1 + t2 * (k[0] + t2 * (k[1] + t2 * (k[2] + t2 * k[3]))),
            1 + t2 * (3 * k[0] + t2 * (5 * k[1] + t2 * (7 * k[2] + t2 * 9 * k[3])))};
}

double rising_range(const std::array<double, 4>& k) {
    constexpr int kSteps = 10000;
    for (int i = 1; i <= kSteps; ++i)
        if (!(polynomial(k, kWidest * i / kSteps).slope > kLeastSlope))
            return kWidest * (i - 1) / kSteps;
    return kWidest;
}

}  // namespace

FisheyeCamera::FisheyeCamera(const FisheyeParameters& parameters) : parameters_(parameters) {
    if (parameters.width <= 0 || parameters.height <= 0 || !(parameters.fx > 0) ||
        !(parameters.fy > 0) || !(parameters.max_angle > 0))
        throw InputError(
            "camera calibration: image size, focal lengths and max_angle of a fisheye camera must "
            "be positive; give the camera's intrinsics");
    rising_to_ = rising_range(parameters.k);
    if (!(rising_to_ > 0.1))
        throw InputError(
            "camera calibration: the fisheye polynomial does not rise with the angle; check k1 to "
            "k4 and their order");
}

double FisheyeCamera::angular_resolution() const {
    return 1 / std::sqrt(parameters_.fx * parameters_.fy);
}

std::optional<Eigen::Vector2d> FisheyeCamera::project(const Eigen::Vector3d& p_C,
                                                      Matrix23d* J) const {
    const double x = p_C.x(), y = p_C.y(), z = p_C.z();
    const double r2 = x * x + y * y, r = std::sqrt(r2), d2 = r2 + z * z;
    const double theta = std::atan2(r, z);
    if (!(theta <= rising_to_) || !(d2 > 0)) return std::nullopt;
    const auto [value, slope] = polynomial(parameters_.k, theta);
    const bool near_axis = r <= kNearAxis * z;
    // theta_d / r and its derivative with respect to r over r, at constant z.
    const double scale = near_axis ? 1 / z : theta * value / r;
    if (J) {
        const double by_r = near_axis ? (2 * parameters_.k[0] - 2.0 / 3) / (z * z * z)
                                      : (slope * z / d2 - scale) / r2;
        const double by_z = -slope / d2;                     // r scale depends on z by theta alone
        *J << scale + x * x * by_r, x * y * by_r, x * by_z,  //
            x * y * by_r, scale + y * y * by_r, y * by_z;
        J->row(0) *= parameters_.fx;
        J->row(1) *= parameters_.fy;
    }
    return Eigen::Vector2d(parameters_.fx * scale * x + parameters_.cx,
                           parameters_.fy * scale * y + parameters_.cy);
}

std::optional<Ray> FisheyeCamera::ray(const Eigen::Vector2d& uv_px) const {
    const Eigen::Vector2d d((uv_px.x() - parameters_.cx) / parameters_.fx,
                            (uv_px.y() - parameters_.cy) / parameters_.fy);
    const double theta_d = d.norm(), widest = std::min(rising_to_, parameters_.max_angle);
    if (!(theta_d <= widest * polynomial(parameters_.k, widest).value + kEdge)) return std::nullopt;
    // Newton's method inside a bracket, which theta_d's rise makes safe.
    double low = 0, high = widest, theta = std::min(theta_d, widest);
    constexpr int kMaxIterations = 60;
    for (int i = 0; i < kMaxIterations; ++i) {
        const auto [value, slope] = polynomial(parameters_.k, theta);
        const double error = theta * value - theta_d;
        (error > 0 ? high : low) = theta;
        double next = theta - error / slope;
        if (!(next >= low && next <= high)) next = 0.5 * (low + high);
        const double step = std::abs(next - theta);
        theta = next;
        if (step <= 1e-16 + 1e-15 * theta) break;
    }
    const double s = theta_d > 0 ? std::sin(theta) / theta_d : 0;
    return Ray{Eigen::Vector3d::Zero(),
               Eigen::Vector3d(s * d.x(), s * d.y(), std::cos(theta)).normalized()};
}

}  // namespace vio
