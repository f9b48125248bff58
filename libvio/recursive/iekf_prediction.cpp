// Where the landmarks will be seen.
#include "libvio/recursive/iekf_impl.h"
#include "libvio/recursive/landmark_update.h"

namespace vio {

// As take() and move_to() will move the state, if no image comes before.
std::vector<PredictedFeature> Iekf::Impl::predict(TimeNs t_imu) const {
    if (!state || lost || abandoned || state->landmarks().empty() || t_imu < now.t) return {};
    FilterState ahead = *state;
    ImuReading from = now;
    TimeNs last = last_reading ? last_reading->t : now.t;
    for (const ImuReading& reading : queue.readings()) {
        const bool reaches = reading.t >= t_imu;
        const double interval = to_seconds(reading.t - last);
        const ImuReading to = reaches ? interpolated(from, reading, t_imu) : reading;
        motion->advance(ahead, from, to, interval);
        if (!reaches) motion->measure(ahead, reading, interval);
        from = to;
        last = reading.t;
        if (reaches) break;
    }
    if (from.t < t_imu) motion->advance(ahead, from, {t_imu, from.gyro, from.accel});
    ahead.settle();
    const int image = image_idx + 1;
    ahead.clone(image, ahead.mount_size() > 0 ? Vector6d(rate_of(ahead.core(), from).head<6>())
                                              : Vector6d(Vector6d::Zero()));
    return predicted_features(ahead, ahead.find_clone(image), *rig.camera);
}

std::vector<PredictedFeature> Iekf::predict(TimeNs t) const {
    return impl_->predict(t + from_seconds(impl_->rig.time_offset));
}

}  // namespace vio
