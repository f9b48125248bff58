// Shapes of revolution of the mirrors.
#pragma once

#include <Eigen/Dense>
#include <string>

namespace vio {

/// Mirror frame M: z is the axis of revolution and points from the camera to the mirror; M's origin
/// is where the camera's centre ought to be. Heights are measured along z.
struct MirrorShapeParameters {
    enum class Kind { kEquiangular, kHyperbolic, kParabolic };
    Kind kind = Kind::kEquiangular;
    double apex_distance = 0;  ///< from M's origin to the mirror's apex [m]
    double gain = 0;           ///< equiangular: alpha, angle of the ray over image angle [-], > 1
    double eccentricity = 0;   ///< hyperbolic: e [-], > 1
    double semi_latus_rectum = 0;  ///< parabolic: p [m]
    double rim_radius = 0;         ///< of the mirror [m]
    double blind_radius = 0;       ///< of the mirror's middle, in which the camera sees itself [m]
};

/// The mirror's surface, given by two coordinates q:
/// - equiangular and hyperbolic (for perspective lenses) by the direction from M's origin,
///   m = h(w) (q_x, q_y, 1), w = |q|^2 = tan(theta)^2, h height;
/// - parabolic (for telecentric lenses) by the place, m = (q_x, q_y, h(w)), w = |q|^2 in m^2.
///
/// Equiangular (Ollis, Herman and Singh 1999): a ray that leaves the camera at the angle theta from
/// the axis leaves the mirror at alpha theta from -z. With psi the angle between ray and tangent
/// (tan psi = r / (dr / d theta)) the reflected ray is at theta + 2 psi from z, and
/// theta + 2 psi = pi - alpha theta gives dr / d theta = r tan(k theta), k = (1 + alpha) / 2, hence
/// r = r0 cos(k theta)^(-1/k).
/// Hyperbolic: the camera in one focus, r = r0 (e - 1) / (e cos(theta) - 1); the single viewpoint
/// is the other focus, at height 2 r0 e / (1 + e). Parabolic: h = h0 + w / (2 p); viewpoint at
/// height h0 + p / 2.
class MirrorShape {
 public:
    /// Throws InputError if the parameters make no mirror.
    explicit MirrorShape(const MirrorShapeParameters& parameters);

    /// Place, and its derivatives with respect to q.
    struct Surface {
        Eigen::Vector3d m, m_x, m_y, m_xx, m_xy, m_yy;
    };
    Surface at(const Eigen::Vector2d& q) const;

    /// Coordinate q of the surface point in the direction, or at the place, of x_M.
    Eigen::Vector2d q_of(const Eigen::Vector3d& x_M) const;
    /// Height of x_M above the surface along z, and its gradient.
    double height_above(const Eigen::Vector3d& x_M, Eigen::Vector3d& gradient) const;

    /// Where a camera in its nominal place would see p_M: exact for single viewpoints.
    Eigen::Vector2d guess(const Eigen::Vector3d& p_M) const;

    /// True from the blind spot's edge to the rim.
    bool used(const Eigen::Vector2d& q) const;
    /// Largest |q| that the shape is continued to, beyond the rim.
    double largest_q() const { return largest_q_; }
    double middle_q() const { return middle_q_; }  ///< |q| half way between blind spot and rim

    bool telecentric() const { return p_.kind == MirrorShapeParameters::Kind::kParabolic; }
    double apex_height() const { return p_.apex_distance; }
    const MirrorShapeParameters& parameters() const { return p_; }
    std::string name() const;

 private:
    // Of the surface above its apex, along the axis [m].
    struct Height {
        double h, h1, h2;  // h and its derivatives with respect to w
    };
    Height height(double w) const;
    double q_at_radius(double radius) const;

    MirrorShapeParameters p_;
    double kappa_ = 0;
    double natural_limit_ = 0;  ///< of |q|, where the shape ends by itself
    double largest_q_ = 0, middle_q_ = 0, rim_w_ = 0, blind_w_ = 0;
};

}  // namespace vio
