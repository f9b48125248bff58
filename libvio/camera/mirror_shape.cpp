#include "libvio/camera/mirror_shape.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "libvio/base/errors.h"

namespace vio {
namespace {

using Kind = MirrorShapeParameters::Kind;

constexpr double kBeyondRim = 1.2;  // radius that the shape is continued to, over the rim's
constexpr double kShortOfEnd = 0.98;
constexpr double kRelativeEdge = 1e-9;  // rounding at blind spot and rim, relative

void check(bool good, const char* problem) {
    if (!good) throw InputError(std::string("camera calibration: ") + problem);
}

}  // namespace

MirrorShape::MirrorShape(const MirrorShapeParameters& parameters) : p_(parameters) {
    check(p_.apex_distance > 0, "apex_distance of the mirror must be positive");
    check(p_.blind_radius >= 0 && p_.rim_radius > p_.blind_radius,
          "rim_radius of the mirror must exceed blind_radius");
    switch (p_.kind) {
        case Kind::kEquiangular:
            check(p_.gain > 1, "gain of an equiangular mirror must exceed 1 (1 is flat)");
            kappa_ = (1 + p_.gain) / 2;
            natural_limit_ = std::tan(kShortOfEnd * std::numbers::pi / (1 + p_.gain));
            break;
        case Kind::kHyperbolic:
            check(p_.eccentricity > 1, "eccentricity of a hyperbolic mirror must exceed 1");
            natural_limit_ = kShortOfEnd * std::sqrt(p_.eccentricity * p_.eccentricity - 1);
            break;
        case Kind::kParabolic:
            check(p_.semi_latus_rectum > 0, "semi_latus_rectum of the mirror must be positive");
            natural_limit_ = 2 * kBeyondRim * p_.rim_radius;
            break;
    }
    const double rim = q_at_radius(p_.rim_radius), blind = q_at_radius(p_.blind_radius);
    check(rim < natural_limit_, "rim_radius is larger than a mirror of this shape can be");
    largest_q_ = std::min(kBeyondRim * rim, natural_limit_);
    middle_q_ = 0.5 * (blind + rim);
    rim_w_ = rim * rim;
    blind_w_ = blind * blind;
}

std::string MirrorShape::name() const {
    switch (p_.kind) {
        case Kind::kEquiangular:
            return "equiangular_mirror";
        case Kind::kHyperbolic:
            return "hyperbolic_mirror";
        default:
            return "parabolic_mirror";
    }
}

MirrorShape::Height MirrorShape::height(double w) const {
    if (p_.kind == Kind::kParabolic)
        return {p_.apex_distance + w / (2 * p_.semi_latus_rectum), 1 / (2 * p_.semi_latus_rectum),
                0};
    if (p_.kind == Kind::kHyperbolic) {
        const double e = p_.eccentricity, root = std::sqrt(1 + w), gap = e - root;
        const double h = p_.apex_distance * (e - 1) / gap;
        const double l1 = 1 / (2 * root * gap);  // d ln h / d w
        return {h, h * l1, h * (2 * l1 * l1 - l1 / (2 * (1 + w)))};
    }
    // g = tan(k theta) / tan(theta): d ln h / d w = (g - 1) / (2 (1 + w)).
    const double k = kappa_, k2 = k * k, s = std::sqrt(w);
    double t2, g, g1;
    constexpr double kSeries = 1e-5;
    if (k2 * w < kSeries) {
        g1 = k * (k2 - 1) / 3;
        const double g2 = k * (1.0 / 5 - k2 / 3 + 2 * k2 * k2 / 15);
        g = k + w * (g1 + w * g2);
        g1 += 2 * w * g2;
        t2 = g * g * w;
    } else {
        const double t = std::tan(k * std::atan(s));
        t2 = t * t;
        g = t / s;
        g1 = (k * (1 + t2) / (1 + w) - g) / (2 * w);
    }
    const double h = p_.apex_distance * std::pow(1 + t2, 1 / (2 * k)) / std::sqrt(1 + w);
    const double l1 = (g - 1) / (2 * (1 + w));
    return {h, h * l1, h * (l1 * l1 + g1 / (2 * (1 + w)) - l1 / (1 + w))};
}

// The radius rises with |q|: bisection.
double MirrorShape::q_at_radius(double radius) const {
    if (telecentric()) return radius;
    double low = 0, high = natural_limit_;
    for (int i = 0; i < 200 && low < high; ++i) {
        const double middle = 0.5 * (low + high);
        if (middle <= low || middle >= high) break;
        (height(middle * middle).h * middle < radius ? low : high) = middle;
    }
    return high;
}

MirrorShape::Surface MirrorShape::at(const Eigen::Vector2d& q) const {
    const double x = q.x(), y = q.y();
    const auto [h, h1, h2] = height(x * x + y * y);
    const double xx = 2 * h1 + 4 * x * x * h2, xy = 4 * x * y * h2, yy = 2 * h1 + 4 * y * y * h2;
    if (telecentric())
        return {{x, y, h},  {1, 0, 2 * x * h1}, {0, 1, 2 * y * h1},
                {0, 0, xx}, {0, 0, xy},         {0, 0, yy}};
    const Eigen::Vector3d d(x, y, 1);
    Surface s;
    s.m = h * d;
    s.m_x = 2 * x * h1 * d;
    s.m_x.x() += h;
    s.m_y = 2 * y * h1 * d;
    s.m_y.y() += h;
    s.m_xx = xx * d;
    s.m_xx.x() += 4 * x * h1;
    s.m_xy = xy * d;
    s.m_xy.x() += 2 * y * h1;
    s.m_xy.y() += 2 * x * h1;
    s.m_yy = yy * d;
    s.m_yy.y() += 4 * y * h1;
    return s;
}

Eigen::Vector2d MirrorShape::q_of(const Eigen::Vector3d& x_M) const {
    if (telecentric()) return x_M.head<2>();
    return x_M.head<2>() / x_M.z();
}

double MirrorShape::height_above(const Eigen::Vector3d& x_M, Eigen::Vector3d& gradient) const {
    const Eigen::Vector2d q = q_of(x_M);
    const double w = q.squaredNorm();
    const auto [h, h1, h2] = height(w);
    if (telecentric())
        gradient << -2 * h1 * q, 1;
    else
        gradient << -2 * h1 / x_M.z() * q, 1 + 2 * h1 * w / x_M.z();
    return x_M.z() - h;
}

Eigen::Vector2d MirrorShape::guess(const Eigen::Vector3d& p_M) const {
    const double radius = p_M.head<2>().norm();
    if (!(radius > 0)) return Eigen::Vector2d::Zero();
    // Angle from -z, seen from the viewpoint.
    const auto below = [&](double viewpoint) { return std::atan2(radius, viewpoint - p_M.z()); };
    double q = 0;
    if (p_.kind == Kind::kEquiangular) {
        const double theta = std::min(below(p_.apex_distance) / p_.gain, 1.5);
        q = std::tan(theta);
    } else if (p_.kind == Kind::kHyperbolic) {
        // From the other focus, r = r_apex (e + 1) / (1 + e cos(beta)), r_apex = 2 c - r0.
        const double e = p_.eccentricity, a = p_.apex_distance / (1 + e);
        const double beta = below(2 * a * e), cosine = 1 + e * std::cos(beta);
        if (!(cosine > 0)) return natural_limit_ / radius * p_M.head<2>();
        const double r = a * (e * e - 1) / cosine;
        q = r * std::sin(beta) / (2 * a * e - r * std::cos(beta));
    } else {
        const double p = p_.semi_latus_rectum, beta = below(p_.apex_distance + p / 2);
        q = p * std::tan(beta / 2);
    }
    return std::min(q, largest_q_) / radius * p_M.head<2>();
}

bool MirrorShape::used(const Eigen::Vector2d& q) const {
    const double w = q.squaredNorm();
    return w >= blind_w_ * (1 - kRelativeEdge) && w <= rim_w_ * (1 + kRelativeEdge);
}

}  // namespace vio
