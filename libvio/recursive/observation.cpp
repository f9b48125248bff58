#include "libvio/recursive/observation.h"

#include "libvio/geometry/so3.h"

namespace vio {

std::optional<Sight> make_sight(const FeatureObservation& observation, double sigma_px) {
    const Eigen::LLT<Eigen::Matrix2d> llt(sigma_px * sigma_px * observation.covariance_shape);
    if (llt.info() != Eigen::Success || !observation.uv_px.allFinite()) return std::nullopt;
    return Sight{observation.uv_px, llt.matrixL().solve(Eigen::Matrix2d::Identity())};
}

std::optional<SightResidual> sight_residual(const Camera& camera, const Pose& T_C_I,
                                            const Pose& T_W_I, const Eigen::Vector3d& p_W,
                                            const Sight& sight) {
    const Eigen::Matrix3d R_I_W = T_W_I.R.transpose();
    const Eigen::Vector3d p_I = R_I_W * (p_W - T_W_I.p);
    const Eigen::Vector3d p_C = T_C_I * p_I;
    Matrix23d J_C;
    const auto uv = camera.project(p_C, &J_C);
    if (!uv) return std::nullopt;
    J_C = (sight.whitening * J_C).eval();
    const Matrix23d J_I = J_C * T_C_I.R;
    SightResidual result;
    result.residual = sight.whitening * (sight.uv_px - *uv);
    result.J_rotation = J_I * so3::skew(p_I);  // exp(-theta) p_I
    result.J_point = J_I * R_I_W;
    result.J_position = -result.J_point;
    result.J_camera << J_C * so3::skew(p_C), -J_I;
    return result;
}

}  // namespace vio
