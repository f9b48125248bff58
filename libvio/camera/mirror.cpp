#include "libvio/camera/mirror.h"

#include <cmath>

#include "libvio/base/errors.h"
#include "libvio/geometry/so3.h"

namespace vio {
namespace {

using Eigen::Matrix2d;
using Eigen::Vector2d;
using Eigen::Vector3d;
using Matrix32d = Eigen::Matrix<double, 3, 2>;

constexpr int kMaxIterations = 30;
// Relative step of q after which Newton's method is at its end.
constexpr double kLastStep = 1e-10;

}  // namespace

// The path p - m - camera, in M.
struct MirrorCamera::Reflection {
    Vector3d m;
    Matrix32d m_q;
    Vector3d u1, u2;                ///< unit vectors camera to m, m to p
    double curvature1, curvature2;  ///< 1 / length of both parts [1/m]; 0: parallel light
    Matrix2d L_qq_inverse;
};

MirrorCamera::MirrorCamera(const MirrorParameters& parameters)
    : parameters_(parameters),
      shape_(parameters.shape),
      lens_(parameters.lens),
      T_M_C_(parameters.T_C_M.inverse()) {
    if (shape_.telecentric())
        for (const double k : parameters.lens.distortion)
            if (k != 0)
                throw InputError(
                    "camera calibration: the telecentric lens of a parabolic mirror has no "
                    "distortion; set it to zeros");
    // Angle between the rays of neighbouring pixels, half way between blind spot and rim.
    const auto middle =
        lens_project(parameters_.T_C_M * shape_.at({shape_.middle_q(), 0}).m, nullptr);
    const auto ray_at = [&](double du, double dv) {
        return middle ? ray(*middle + Vector2d(du, dv)) : std::nullopt;
    };
    const auto r0 = ray_at(0, 0), ru = ray_at(0.01, 0), rv = ray_at(0, 0.01);
    if (!r0 || !ru || !rv)
        throw InputError(
            "camera calibration: the camera does not see the mirror; check T_C_M and the mirror's "
            "dimensions");
    const Vector3d du = ru->direction - r0->direction, dv = rv->direction - r0->direction;
    angular_resolution_ = std::sqrt(du.cross(dv).norm()) / 0.01;
}

std::optional<Vector2d> MirrorCamera::lens_project(const Vector3d& m_C, Matrix23d* J) const {
    if (!shape_.telecentric()) return lens_.project(m_C, J);
    const PerspectiveParameters& p = parameters_.lens;
    if (J) *J << p.fx, 0, 0, 0, p.fy, 0;
    return Vector2d(p.fx * m_C.x() + p.cx, p.fy * m_C.y() + p.cy);
}

std::optional<Ray> MirrorCamera::lens_ray(const Vector2d& uv_px) const {
    if (!shape_.telecentric()) return lens_.ray(uv_px);
    const PerspectiveParameters& p = parameters_.lens;
    return Ray{{(uv_px.x() - p.cx) / p.fx, (uv_px.y() - p.cy) / p.fy, 0}, Vector3d::UnitZ()};
}

std::optional<MirrorCamera::Reflection> MirrorCamera::reflect(const Vector3d& p_M) const {
    Reflection path;
    path.u1 = T_M_C_.R.col(2);
    path.curvature1 = 0;
    Vector2d q = shape_.guess(p_M);
    bool at_limit = false;
    for (int i = 0; i < kMaxIterations; ++i) {
        const MirrorShape::Surface s = shape_.at(q);
        path.m = s.m;
        path.m_q << s.m_x, s.m_y;
        if (!shape_.telecentric()) {
            const Vector3d to_m = s.m - T_M_C_.p;
            path.curvature1 = 1 / to_m.norm();
            path.u1 = to_m * path.curvature1;
        }
        const Vector3d to_p = p_M - s.m;
        path.curvature2 = 1 / to_p.norm();
        path.u2 = to_p * path.curvature2;
        const Vector3d bend = path.u1 - path.u2;
        // m_q^T (I - u u^T) m_q / length for both parts, and the surface's own curvature.
        const Vector2d t1 = path.m_q.transpose() * path.u1, t2 = path.m_q.transpose() * path.u2;
        Matrix2d L_qq = (path.curvature1 + path.curvature2) * path.m_q.transpose() * path.m_q -
                        path.curvature1 * t1 * t1.transpose() -
                        path.curvature2 * t2 * t2.transpose();
        L_qq(0, 0) += bend.dot(s.m_xx);
        L_qq(1, 1) += bend.dot(s.m_yy);
        L_qq(0, 1) += bend.dot(s.m_xy);
        L_qq(1, 0) = L_qq(0, 1);
        const double determinant = L_qq.determinant();
        if (!(determinant > 0 && L_qq(0, 0) > 0)) return std::nullopt;  // no minimum
        path.L_qq_inverse << L_qq(1, 1), -L_qq(0, 1), -L_qq(0, 1), L_qq(0, 0);
        path.L_qq_inverse /= determinant;
        const Vector2d step = path.L_qq_inverse * (t1 - t2);
        q -= step;
        if (step.norm() <= kLastStep * shape_.largest_q()) {
            const Vector3d normal = s.m_y.cross(s.m_x);  // to the camera
            if (!(path.u1.dot(normal) < 0 && path.u2.dot(normal) > 0)) return std::nullopt;
            path.m -= path.m_q * step;
            return path;
        }
        const double size = q.norm();
        if (!std::isfinite(size)) return std::nullopt;
        if (size > shape_.largest_q()) {
            if (at_limit) return std::nullopt;
            q *= shape_.largest_q() / size;
        }
        at_limit = size > shape_.largest_q();
    }
    return std::nullopt;
}

std::optional<Vector2d> MirrorCamera::project(const Vector3d& p_C, Matrix23d* J) const {
    return project(p_C, J, nullptr);
}

std::optional<Vector2d> MirrorCamera::project(const Vector3d& p_C, Matrix23d* J,
                                              Eigen::Matrix<double, 2, 6>* J_T_C_M) const {
    const Vector3d p_M = T_M_C_ * p_C;
    const auto path = reflect(p_M);
    if (!path) return std::nullopt;
    Matrix23d J_lens;
    const auto uv = lens_project(parameters_.T_C_M * path->m, J || J_T_C_M ? &J_lens : nullptr);
    if (!uv || !(J || J_T_C_M)) return uv;
    const Matrix23d J_m = J_lens * parameters_.T_C_M.R;
    const Matrix2d J_q = J_m * path->m_q * path->L_qq_inverse;
    // L_qp = -m_q^T (I - u2 u2^T) / |p - m|, and alike for the camera's centre.
    const auto across = [&](const Vector3d& u, double curvature) -> Matrix23d {
        return curvature * (path->m_q - u * (u.transpose() * path->m_q)).transpose();
    };
    const Matrix23d by_p = J_q * across(path->u2, path->curvature2);
    if (J) *J = by_p * T_M_C_.R;
    if (J_T_C_M) {
        const Matrix23d by_c = J_q * across(path->u1, path->curvature1);
        J_T_C_M->leftCols<3>() = by_p * so3::skew(p_M) - J_m * so3::skew(path->m);
        if (shape_.telecentric())
            J_T_C_M->leftCols<3>() -= J_q * path->m_q.transpose() * so3::skew(path->u1);
        else
            J_T_C_M->leftCols<3>() += by_c * so3::skew(T_M_C_.p);
        J_T_C_M->rightCols<3>() = J_lens - (by_p + by_c) * T_M_C_.R;
    }
    return uv;
}

std::optional<Ray> MirrorCamera::ray(const Vector2d& uv_px) const {
    const auto seen = lens_ray(uv_px);
    if (!seen) return std::nullopt;
    const Vector3d o = T_M_C_ * seen->origin, d = T_M_C_.R * seen->direction;
    if (!(d.z() > 0)) return std::nullopt;
    // Where the camera's own ray meets the mirror: Newton's method from the apex plane.
    double s = (shape_.apex_height() - o.z()) / d.z();
    bool found = false;
    for (int i = 0; i < kMaxIterations && !found; ++i) {
        const Vector3d x = o + s * d;
        if (!(x.z() > 0) || !(shape_.q_of(x).norm() <= 1.5 * shape_.largest_q()))
            return std::nullopt;
        Vector3d gradient;
        const double step = shape_.height_above(x, gradient) / gradient.dot(d);
        s -= step;
        found = std::abs(step) <= 1e-15 * shape_.apex_height() || (i > 8 && std::abs(step) < 1e-13);
    }
    const Vector3d m = o + s * d;
    const Vector2d q = shape_.q_of(m);
    if (!found || !shape_.used(q)) return std::nullopt;
    const MirrorShape::Surface surface = shape_.at(q);
    const Vector3d normal = surface.m_y.cross(surface.m_x).normalized();
    const Vector3d out = d - 2 * d.dot(normal) * normal;
    return Ray{parameters_.T_C_M * m, (parameters_.T_C_M.R * out).normalized()};
}

}  // namespace vio
