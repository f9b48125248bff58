// Tracked features as an MRPT observation, so that a rawlog can carry tracks in place of images.
#pragma once

#include <mrpt/img/TCamera.h>
#include <mrpt/obs/CObservation.h>
#include <mrpt/poses/CPose3D.h>

#include <array>
#include <cstdint>
#include <vector>

namespace vio {

/// The features of one image. The arrays run in parallel, one element a feature. The calibration
/// travels with it, as in mrpt::obs::CObservationImage.
class CObservationFeatures : public mrpt::obs::CObservation {
    DEFINE_SERIALIZABLE(CObservationFeatures, vio)

 public:
    mrpt::poses::CPose3D cameraPose;  ///< T_B_C: camera in the vehicle frame
    mrpt::img::TCamera cameraParams;  ///< intrinsics; zero focal length: not calibrated
    std::vector<std::int64_t> feature_ids;
    std::vector<double> u_px, v_px;  ///< the centre of the top-left pixel is (0, 0)
    /// (xx, xy, yy) of each feature's covariance up to the estimator's sigma_px^2; empty if all are
    /// isotropic.
    std::vector<std::array<double, 3>> covariance_shapes;

    void getSensorPose(mrpt::poses::CPose3D& pose) const override { pose = cameraPose; }
    void setSensorPose(const mrpt::poses::CPose3D& pose) override { cameraPose = pose; }
    void getDescriptionAsText(std::ostream& out) const override;
};

/// Makes the project's classes known to MRPT, so that rawlogs and simple maps that hold them load.
/// Recording and the writers call it; other programs load the module vio_mrpt_plugin instead.
void register_mrpt_classes();

}  // namespace vio
