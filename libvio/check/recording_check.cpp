#include "libvio/check/recording_check.h"

#include <algorithm>

#include "libvio/camera/perspective.h"
#include "libvio/check/angular_scale.h"
#include "libvio/check/inertial.h"
#include "libvio/check/rig_check.h"
#include "libvio/check/rotation_agreement.h"
#include "libvio/check/stamps.h"

namespace vio {
namespace {

void append(std::vector<Finding>& all, std::vector<Finding> more) {
    all.insert(all.end(), std::make_move_iterator(more.begin()),
               std::make_move_iterator(more.end()));
}

}  // namespace

void RecordingCheck::add(const Message& message) {
    if (const auto* reading = std::get_if<ImuReading>(&message)) {
        readings_.push_back(*reading);
    } else if (const auto* image = std::get_if<ImageMessage>(&message)) {
        images_.push_back(image->t);
        quality_.add(image->image);
    } else if (const auto* frame = std::get_if<FeatureFrame>(&message)) {
        frames_.push_back(frame->t);
    }
}

void RecordingCheck::add_tracks(const FeatureFrame& frame) {
    tracks_.add(frame);
    rotations_.add(frame);
}

std::vector<ImuReading> RecordingCheck::readings_in_order() const {
    std::vector<ImuReading> readings = readings_;
    std::stable_sort(readings.begin(), readings.end(),
                     [](const auto& a, const auto& b) { return a.t < b.t; });
    readings.erase(std::unique(readings.begin(), readings.end(),
                               [](const auto& a, const auto& b) { return a.t == b.t; }),
                   readings.end());
    return readings;
}

std::vector<Finding> RecordingCheck::findings(int most_pairs) const {
    std::vector<Finding> all = check_rig(rig_, with_imu_);
    const StampStatistics images = stamp_statistics(images_.empty() ? frames_ : images_);
    append(all, check_image_stamps(images));
    append(all, quality_.findings());
    append(all, tracks_.findings());
    // Of a narrow camera the gyro tells more.
    if (rig_.camera && !dynamic_cast<const PerspectiveCamera*>(rig_.camera.get()))
        all.push_back(check_angles(rotations_.angular_scale(*rig_.camera, most_pairs)));
    if (!with_imu_) return all;
    std::vector<TimeNs> stamps;
    for (const ImuReading& reading : readings_) stamps.push_back(reading.t);
    const StampStatistics imu = stamp_statistics(stamps);
    append(all, check_imu_stamps(imu));
    all.push_back(check_overlap(imu, images, rig_.time_offset));
    const std::vector<ImuReading> readings = readings_in_order();
    append(all, check_readings(readings, rig_.imu_noise));
    if (rig_.camera)
        append(all,
               check_rotations(compare_rotations(rotations_, readings, rig_, most_pairs), rig_));
    return all;
}

Grade worst(const std::vector<Finding>& findings) {
    Grade grade = Grade::ok;
    for (const Finding& finding : findings) grade = std::max(grade, finding.grade);
    return grade;
}

}  // namespace vio
