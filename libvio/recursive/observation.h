// A point seen from a pose: residual and Jacobians, Eq. (22), scaled to unit noise.
#pragma once

#include <Eigen/Dense>
#include <optional>

#include "libvio/base/types.h"
#include "libvio/camera/camera.h"
#include "libvio/geometry/pose.h"

namespace vio {

/// Where a feature was seen, with the matrix that scales its residual to unit covariance.
struct Sight {
    Eigen::Vector2d uv_px = Eigen::Vector2d::Zero();
    Eigen::Matrix2d whitening = Eigen::Matrix2d::Identity();  ///< [1/px]
};

/// The observation's covariance is sigma_px^2 covariance_shape; nothing if that is no covariance.
std::optional<Sight> make_sight(const FeatureObservation& observation, double sigma_px);

/// measured - predicted, and the derivatives of the prediction with respect to the errors of the
/// pose (rotation on the right, position in W), of the point (in W) and of T_I_C.
struct SightResidual {
    Eigen::Vector2d residual;
    Matrix23d J_rotation, J_position, J_point;
    Eigen::Matrix<double, 2, 6> J_camera;
};

/// Nothing where the camera cannot image the point.
std::optional<SightResidual> sight_residual(const Camera& camera, const Pose& T_C_I,
                                            const Pose& T_W_I, const Eigen::Vector3d& p_W,
                                            const Sight& sight);

}  // namespace vio
