#include "libvio/io/mrpt_conversions.h"

#include <mrpt/obs/CActionRobotMovement2D.h>
#include <mrpt/obs/CActionRobotMovement3D.h>
#include <mrpt/obs/gnss_messages_ascii_nmea.h>

#include <algorithm>
#include <cmath>
#include <cstring>

#include "libvio/base/errors.h"
#include "libvio/camera/fisheye.h"
#include "libvio/camera/perspective.h"

namespace vio {
namespace {

// Before the model's name, in place of a name of the camera.
constexpr char kModelElsewhere[] = "see calibration file: ";

using mrpt::img::DistortionModel;

constexpr std::int64_t kNanosecondsPerTick = 100;
// MRPT counts from 1601-01-01: ticks up to the UNIX epoch.
constexpr std::int64_t kTicksToUnixEpoch = 116444736000000000LL;
// About 145 years around that epoch: differences of nanoseconds hold in 64 bits. No stamp, and
// those of damaged files, are put to the end.
constexpr std::int64_t kMostTicks = 46000000000000000LL;

// Keeps the angular derivatives finite at gimbal lock.
constexpr double kMinCosPitch = 1e-9;

// d (yaw, pitch, roll) / d rotation
Eigen::Matrix3d angles_jacobian(const mrpt::poses::CPose3D& T) {
    const double sr = std::sin(T.roll()), cr = std::cos(T.roll());
    const double sp = std::sin(T.pitch()), cp = std::max(std::cos(T.pitch()), kMinCosPitch);
    Eigen::Matrix3d J;
    J << 0, sr / cp, cr / cp,  //
        0, cr, -sr,            //
        1, sr * sp / cp, cr * sp / cp;
    return J;
}

Matrix6d tangent_jacobian(const mrpt::poses::CPose3D& T) {
    Matrix6d J = Matrix6d::Zero();
    J.topRightCorner<3, 3>().setIdentity();
    J.bottomLeftCorner<3, 3>() = angles_jacobian(T);
    return J;
}

// MRPT keeps a 0.1 s clock in the message beside the observation's stamp.
mrpt::obs::gnss::UTC_time time_of_day(TimeNs t) {
    constexpr TimeNs kDay = 86400LL * 1000000000LL;
    const TimeNs of_day = ((t % kDay) + kDay) % kDay;
    mrpt::obs::gnss::UTC_time utc;
    utc.hour = static_cast<std::uint8_t>(of_day / (3600LL * 1000000000LL));
    utc.minute = static_cast<std::uint8_t>(of_day / (60LL * 1000000000LL) % 60);
    utc.sec = to_seconds(of_day % (60LL * 1000000000LL));
    return utc;
}

}  // namespace

mrpt::Clock::time_point to_mrpt(TimeNs t) {
    TimeNs ticks = t / kNanosecondsPerTick;
    if (t % kNanosecondsPerTick < 0) --ticks;
    return mrpt::Clock::time_point(mrpt::Clock::duration(ticks + kTicksToUnixEpoch));
}

TimeNs from_mrpt(mrpt::Clock::time_point t) {
    const std::int64_t ticks = t.time_since_epoch().count();
    if (ticks < kTicksToUnixEpoch - kMostTicks) return -kMostTicks * kNanosecondsPerTick;
    if (ticks > kTicksToUnixEpoch + kMostTicks) return kMostTicks * kNanosecondsPerTick;
    return (ticks - kTicksToUnixEpoch) * kNanosecondsPerTick;
}

mrpt::poses::CPose3D to_mrpt(const Pose& T) {
    mrpt::math::CMatrixDouble33 R;
    mrpt::math::CVectorFixedDouble<3> p;
    for (int i = 0; i < 3; ++i) {
        p[i] = T.p(i);
        for (int j = 0; j < 3; ++j) R(i, j) = T.R(i, j);
    }
    return mrpt::poses::CPose3D(R, p);
}

Pose from_mrpt(const mrpt::poses::CPose3D& T) {
    Pose pose;
    const auto& R = T.getRotationMatrix();
    for (int i = 0; i < 3; ++i) {
        pose.p(i) = T[static_cast<unsigned>(i)];
        for (int j = 0; j < 3; ++j) pose.R(i, j) = R(i, j);
    }
    return pose;
}

Matrix6d mrpt_tangent_jacobian(const Pose& T) {
    return tangent_jacobian(to_mrpt(T));
}

mrpt::poses::CPose3DPDFGaussian to_mrpt(const Pose& T, const Matrix6d& covariance) {
    mrpt::poses::CPose3DPDFGaussian pdf(to_mrpt(T));
    const Matrix6d J = tangent_jacobian(pdf.mean);
    const Matrix6d mapped = J * covariance * J.transpose();
    for (int i = 0; i < 6; ++i)
        for (int j = 0; j < 6; ++j) pdf.cov(i, j) = 0.5 * (mapped(i, j) + mapped(j, i));
    return pdf;
}

PoseWithCovariance from_mrpt(const mrpt::poses::CPose3DPDFGaussian& pdf) {
    Matrix6d covariance;
    for (int i = 0; i < 6; ++i)
        for (int j = 0; j < 6; ++j) covariance(i, j) = pdf.cov(i, j);
    const Matrix6d J = tangent_jacobian(pdf.mean).inverse();
    const Matrix6d mapped = J * covariance * J.transpose();
    return {from_mrpt(pdf.mean), 0.5 * (mapped + mapped.transpose())};
}

bool fits_mrpt(const Camera& camera) {
    const auto* fisheye = dynamic_cast<const FisheyeCamera*>(&camera);
    return dynamic_cast<const PerspectiveCamera*>(&camera) ||
           (fisheye && fisheye->parameters().max_angle == FisheyeParameters{}.max_angle);
}

mrpt::img::TCamera to_mrpt(const CameraPtr& camera) {
    mrpt::img::TCamera params;
    if (!camera) return params;
    params.ncols = static_cast<std::uint32_t>(camera->width());
    params.nrows = static_cast<std::uint32_t>(camera->height());
    if (const auto* perspective = dynamic_cast<const PerspectiveCamera*>(camera.get())) {
        const PerspectiveParameters& p = perspective->parameters();
        params.setIntrinsicParamsFromValues(p.fx, p.fy, p.cx, p.cy);
        params.distortion = DistortionModel::plumb_bob;
        params.dist = p.distortion;
    } else if (const auto* fisheye = dynamic_cast<const FisheyeCamera*>(camera.get())) {
        const FisheyeParameters& p = fisheye->parameters();
        params.setIntrinsicParamsFromValues(p.fx, p.fy, p.cx, p.cy);
        params.setDistortionKannalaBrandt(p.k[0], p.k[1], p.k[2], p.k[3]);
    } else {
        params.cameraName = kModelElsewhere + camera->model_name();
    }
    return params;
}

CameraPtr from_mrpt(const mrpt::img::TCamera& camera) {
    if (camera.ncols == 0 || camera.nrows == 0 || !(camera.fx() > 0) || !(camera.fy() > 0))
        return nullptr;
    const int width = static_cast<int>(camera.ncols), height = static_cast<int>(camera.nrows);
    if (camera.distortion == DistortionModel::kannala_brandt)
        return std::make_shared<FisheyeCamera>(
            FisheyeParameters{width,
                              height,
                              camera.fx(),
                              camera.fy(),
                              camera.cx(),
                              camera.cy(),
                              {camera.k1(), camera.k2(), camera.k3(), camera.k4()}});
    PerspectiveParameters p{width, height, camera.fx(), camera.fy(), camera.cx(), camera.cy(), {}};
    if (camera.distortion == DistortionModel::plumb_bob) p.distortion = camera.dist;
    return std::make_shared<PerspectiveCamera>(p);
}

std::string model_elsewhere(const mrpt::img::TCamera& camera) {
    if (!camera.cameraName.starts_with(kModelElsewhere)) return {};
    return camera.cameraName.substr(std::string(kModelElsewhere).size());
}

mrpt::obs::CObservationIMU to_mrpt(const ImuReading& reading) {
    using namespace mrpt::obs;
    CObservationIMU observation;
    observation.timestamp = to_mrpt(reading.t);
    observation.set(IMU_WX, reading.gyro.x());
    observation.set(IMU_WY, reading.gyro.y());
    observation.set(IMU_WZ, reading.gyro.z());
    observation.set(IMU_X_ACC, reading.accel.x());
    observation.set(IMU_Y_ACC, reading.accel.y());
    observation.set(IMU_Z_ACC, reading.accel.z());
    return observation;
}

std::optional<ImuReading> from_mrpt(const mrpt::obs::CObservationIMU& observation) {
    using namespace mrpt::obs;
    for (const auto index : {IMU_WX, IMU_WY, IMU_WZ, IMU_X_ACC, IMU_Y_ACC, IMU_Z_ACC}) {
        // A damaged file's flags are bytes of any value, which must not be read as bool.
        unsigned char present = 0;
        std::memcpy(&present, &observation.dataIsPresent[index], 1);
        if (present == 0) return {};
    }
    ImuReading reading;
    reading.t = from_mrpt(observation.timestamp);
    const auto& values = observation.rawMeasurements;
    reading.gyro = {values[IMU_WX], values[IMU_WY], values[IMU_WZ]};
    reading.accel = {values[IMU_X_ACC], values[IMU_Y_ACC], values[IMU_Z_ACC]};
    return reading;
}

mrpt::obs::CObservationGPS to_mrpt(const GpsMessage& fix) {
    mrpt::obs::gnss::Message_NMEA_GGA gga;
    gga.fields.UTCTime = time_of_day(fix.t);
    gga.fields.latitude_degrees = fix.latitude_deg;
    gga.fields.longitude_degrees = fix.longitude_deg;
    gga.fields.altitude_meters = fix.altitude_m;
    gga.fields.fix_quality = static_cast<std::uint8_t>(std::clamp(fix.fix_quality, 0, 255));
    mrpt::obs::CObservationGPS observation;
    observation.timestamp = to_mrpt(fix.t);
    observation.originalReceivedTimestamp = observation.timestamp;
    observation.setMsg(gga);
    return observation;
}

std::optional<GpsMessage> from_mrpt(const mrpt::obs::CObservationGPS& observation) {
    using mrpt::obs::gnss::Message_NMEA_GGA;
    if (!observation.hasMsgClass<Message_NMEA_GGA>()) return {};
    const auto& gga = observation.getMsgByClass<Message_NMEA_GGA>().fields;
    return GpsMessage{from_mrpt(observation.timestamp), gga.latitude_degrees, gga.longitude_degrees,
                      gga.altitude_meters, gga.fix_quality};
}

std::optional<Pose> odometry_increment(const mrpt::obs::CAction& action) {
    using namespace mrpt::obs;
    if (const auto* planar = dynamic_cast<const CActionRobotMovement2D*>(&action);
        planar && planar->estimationMethod == CActionRobotMovement2D::emOdometry)
        return from_mrpt(mrpt::poses::CPose3D(planar->rawOdometryIncrementReading));
    if (const auto* full = dynamic_cast<const CActionRobotMovement3D*>(&action);
        full && full->estimationMethod == CActionRobotMovement3D::emOdometry)
        return from_mrpt(full->poseChange.mean);
    return std::nullopt;
}

CObservationFeatures to_mrpt(const FeatureFrame& frame) {
    CObservationFeatures observation;
    observation.timestamp = to_mrpt(frame.t);
    const bool isotropic =
        std::all_of(frame.features.begin(), frame.features.end(), [](const FeatureObservation& f) {
            return f.covariance_shape == Eigen::Matrix2d::Identity();
        });
    for (const FeatureObservation& f : frame.features) {
        observation.feature_ids.push_back(f.feature_id);
        observation.u_px.push_back(f.uv_px.x());
        observation.v_px.push_back(f.uv_px.y());
        if (!isotropic)
            observation.covariance_shapes.push_back(
                {f.covariance_shape(0, 0), f.covariance_shape(0, 1), f.covariance_shape(1, 1)});
    }
    return observation;
}

FeatureFrame from_mrpt(const CObservationFeatures& observation) {
    FeatureFrame frame;
    frame.t = from_mrpt(observation.timestamp);
    frame.features.resize(observation.feature_ids.size());
    for (std::size_t i = 0; i < frame.features.size(); ++i) {
        FeatureObservation& f = frame.features[i];
        f.feature_id = observation.feature_ids[i];
        f.uv_px = {observation.u_px[i], observation.v_px[i]};
        if (observation.covariance_shapes.empty()) continue;
        const auto& [xx, xy, yy] = observation.covariance_shapes[i];
        f.covariance_shape << xx, xy, xy, yy;
    }
    return frame;
}

}  // namespace vio
