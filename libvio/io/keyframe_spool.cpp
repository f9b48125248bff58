#include "libvio/io/keyframe_spool.h"

#include <mrpt/io/CMemoryStream.h>
#include <mrpt/maps/CSimpleMap.h>
#include <mrpt/maps/CSimplePointsMap.h>
#include <mrpt/obs/CObservationBearingRange.h>
#include <mrpt/obs/CObservationPointCloud.h>
#include <mrpt/obs/CSensoryFrame.h>
#include <mrpt/poses/CPose3DPDFGaussian.h>
#include <mrpt/serialization/CArchive.h>

#include <Eigen/Dense>
#include <filesystem>

#include "libvio/base/errors.h"
#include "libvio/io/mrpt_conversions.h"
#include "libvio/io/rawlog_objects.h"
#include "libvio/io/text.h"

namespace vio {
namespace {

// The camera turned to MRPT's convention for sensors: x forward, y to the left, z up.
Pose forward_sensor(const Pose& T_B_C) {
    Pose T_C_S;
    T_C_S.R << 0, -1, 0, 0, 0, -1, 1, 0, 0;
    return T_B_C * T_C_S;
}

// What a key-frame saw of the landmarks.
mrpt::obs::CSensoryFrame sighted(const FeatureFrame& frame, const Pose& T_W_B, const Rig& rig,
                                 LandmarkSpool& landmarks) {
    const Pose T_B_S = forward_sensor(rig.T_B_C);
    const Pose T_S_W = (T_W_B * T_B_S).inverse();
    auto sights = mrpt::obs::CObservationBearingRange::Create();
    auto cloud = mrpt::obs::CObservationPointCloud::Create();
    auto points = mrpt::maps::CSimplePointsMap::Create();
    sights->timestamp = cloud->timestamp = to_mrpt(frame.t);
    sights->sensorLabel = "camera bearings";
    cloud->sensorLabel = "camera points";
    sights->sensorLocationOnRobot = cloud->sensorPose = to_mrpt(T_B_S);
    cloud->pointcloud = points;
    for (const FeatureObservation& feature : frame.features) {
        const auto landmark = landmarks.find(feature.feature_id);
        if (!landmark) continue;
        const Eigen::Vector3d p = T_S_W * landmark->p_W;
        double range = 0, yaw = 0, pitch = 0;
        mrpt::poses::CPose3D().sphericalCoordinates({p.x(), p.y(), p.z()}, range, yaw, pitch);
        mrpt::obs::CObservationBearingRange::TMeasurement sight;
        sight.range = static_cast<float>(range);
        sight.yaw = static_cast<float>(yaw);
        sight.pitch = static_cast<float>(pitch);
        sight.landmarkID = landmarks.narrow_id(landmark->id);
        sights->sensedData.push_back(sight);
        points->insertPoint(static_cast<float>(p.x()), static_cast<float>(p.y()),
                            static_cast<float>(p.z()));
    }
    mrpt::obs::CSensoryFrame sensors;
    sensors.insert(sights);
    sensors.insert(cloud);
    return sensors;
}

}  // namespace

KeyframeSpool::KeyframeSpool(const std::string& file, const Rig& rig)
    : file_(file), rig_(rig), out_(file) {
    register_mrpt_classes();
}

void KeyframeSpool::add(const FeatureFrame& frame, const StateEstimate& state) {
    const Matrix6d covariance = state.covariance.topLeftCorner<6, 6>();
    write_object(to_mrpt(state.T_W_B, covariance), out_);
    write_object(to_mrpt(frame), out_);
    ++count_;
}

void KeyframeSpool::finish(const std::string& map_file, LandmarkSpool& landmarks) {
    out_.close();
    write_complete(map_file, [&](const std::string& name) { write_map(name, landmarks); });
    std::filesystem::remove(file_);
}

// MRPT's class holds all elements in memory; its serialised form is a head, their number, the
// elements, and an end mark.
void KeyframeSpool::write_map(const std::string& name, LandmarkSpool& landmarks) const {
    mrpt::io::CMemoryStream empty;
    mrpt::serialization::archiveFrom(empty) << mrpt::maps::CSimpleMap();
    const auto* bytes = static_cast<const char*>(empty.getRawBufferData());
    const size_t size = empty.getTotalBytesCount();
    constexpr size_t kEnd = 1;
    GzOutput gz(name);
    gz.Write(bytes, size - kEnd - sizeof count_);
    gz.Write(&count_, sizeof count_);
    GzInput in(file_);
    auto from = mrpt::serialization::archiveFrom(in);
    for (std::uint32_t i = 0; i < count_; ++i) {
        mrpt::poses::CPose3DPDFGaussian pose;
        CObservationFeatures features;
        from >> pose >> features;
        write_object(pose, gz);
        write_object(sighted(from_mrpt(features), from_mrpt(pose.mean), rig_, landmarks), gz);
    }
    gz.Write(bytes + size - kEnd, kEnd);
    gz.close();
}

}  // namespace vio
