// What an image does to the state: known points, points of the window.
#include <algorithm>
#include <cmath>
#include <set>

#include "libvio/base/median.h"
#include "libvio/recursive/iekf_impl.h"
#include "libvio/recursive/rest_update.h"

namespace vio {

using Eigen::Vector3d;

namespace {

constexpr int kMaxRejections = 3;       // consecutive, then a landmark is given up
constexpr double kLongestBridge = 0.1;  // [s] without readings that is not worth a word
// What is added to the core's uncertainty when most landmarks contradict it.
constexpr double kDoubtRotation = 0.02, kDoubtPosition = 0.05, kDoubtVelocity = 0.2;

}  // namespace

void Iekf::Impl::move_to(TimeNs t_imu, TimeNs t) {
    ImuReading at{t_imu, now.gyro, now.accel};
    if (use_imu && queue.next_reading()) {
        at = interpolated(now, *queue.next_reading(), t_imu);
    }
    const TimeNs before = last_reading ? last_reading->t : now.t;
    const ImuReading* next = queue.next_reading();
    const double interval = to_seconds((next ? next->t : t_imu) - before);
    if (use_imu && interval > kLongestBridge && before != gap_told) {
        log(camera_time(t_imu), "no inertial readings for more than " +
                                    std::to_string(kLongestBridge).substr(0, 3) + " s");
        gap_told = before;
    }
    motion->advance(*state, now, at, interval);
    now = at;
    state->settle();
    Vector6d pose_rate = Vector6d::Zero();
    double shift = 0;
    if (state->mount_size() > 0) {
        pose_rate = rate_of(state->core(), now).head<6>();
        shift = to_seconds(t + from_seconds(rig.time_offset) - now.t);
    }
    state->clone(++image_idx, pose_rate, shift);
}

void Iekf::Impl::sort_features(const FeatureFrame& frame) {
    std::map<FeatureId, int> landmark_of;
    for (int i = 0; i < static_cast<int>(state->landmarks().size()); ++i) {
        landmark_of[state->landmarks()[i].id] = i;
        ++state->landmark(i).images_unseen;
    }
    known.clear();
    for (const FeatureObservation& feature : frame.features) {
        const auto sight = make_sight(feature, options.sigma_px);
        if (!sight) continue;
        const auto landmark = landmark_of.find(feature.feature_id);
        if (landmark == landmark_of.end()) {
            window.observe(feature.feature_id, image_idx, *sight);
        } else {
            state->landmark(landmark->second).images_unseen = 0;
            known.push_back({landmark->second, *sight});
        }
    }
}

// Whether those of the known points that passed the gate are all that agree with one another, even
// if the prediction were wrong.
bool Iekf::Impl::sights_to_blame(const std::vector<LandmarkSight>& passed) const {
    if (static_cast<int>(passed.size()) < options.min_features) return false;
    std::set<int> passed_idx;
    for (const LandmarkSight& s : passed) passed_idx.insert(s.landmark_idx);
    const auto agree = agreeing_sights(*state, known, state->find_clone(image_idx), *rig.camera,
                                       landmark_gate, kDoubtRotation, kDoubtPosition);
    const auto others = std::count_if(agree.begin(), agree.end(), [&](const LandmarkSight& s) {
        return passed_idx.count(s.landmark_idx) == 0;
    });
    return 4 * others < static_cast<std::ptrdiff_t>(passed.size());
}

void Iekf::Impl::update_known_points() {
    const int slot = state->find_clone(image_idx);
    std::vector<LandmarkSight> passed =
        gated_sights(*state, known, slot, *rig.camera, landmark_gate);
    const auto too_few = [&](const std::vector<LandmarkSight>& sights) {
        return static_cast<int>(known.size()) >= options.min_features &&
               static_cast<double>(sights.size()) < kBadShare * static_cast<double>(known.size());
    };
    contradicted = too_few(passed) && !sights_to_blame(passed);
    if (contradicted) {  // perhaps the prediction is to blame: believe it less
        passed = agreeing_sights(*state, known, state->find_clone(image_idx), *rig.camera,
                                 landmark_gate, kDoubtRotation, kDoubtPosition);
        if (too_few(passed)) passed.clear();
        if (!passed.empty()) state->inflate(slot, kDoubtRotation, kDoubtPosition, kDoubtVelocity);
    }
    judged.push_back({static_cast<int>(known.size()), static_cast<int>(passed.size())});
    if (static_cast<int>(judged.size()) > kJudgedImages) judged.pop_front();
    std::set<int> passed_idx;
    for (const LandmarkSight& s : passed) passed_idx.insert(s.landmark_idx);
    for (const LandmarkSight& s : known) {
        LandmarkState& landmark = state->landmark(s.landmark_idx);
        const bool good = passed_idx.count(s.landmark_idx) > 0;
        landmark.rejections = good ? 0 : landmark.rejections + 1;
        landmark.observations += good;
    }
    if (!passed.empty())
        update_landmarks(*state, passed, slot, *rig.camera, options.max_iterations);
    used = static_cast<int>(passed.size());
    innovations.landmarks = static_cast<int>(known.size());
    innovations.landmarks_rejected = innovations.landmarks - used;
    take_point_innovations();
}

void Iekf::Impl::take_reading_innovations() {
    const InnovationSums sums = state->take_innovations();
    innovations.readings_normalised = sums.normalised;
    innovations.readings_dof = sums.dof;
}

// Adds those of the updates since the last call.
void Iekf::Impl::take_point_innovations() {
    const InnovationSums sums = state->take_innovations();
    if (sums.dof == 0) return;
    scale_correction = std::max(scale_correction, sums.scale);
    ImageInnovations& all = innovations;
    const double squared =
        all.dof * all.rms_px * all.rms_px + sums.squared * options.sigma_px * options.sigma_px;
    all.dof += sums.dof;
    all.normalised += sums.normalised;
    all.rms_px = std::sqrt(squared / all.dof);
}

void Iekf::Impl::drop_lost_points() {
    std::vector<bool> remove;
    for (const LandmarkState& landmark : state->landmarks()) {
        const bool given_up = landmark.rejections >= kMaxRejections;
        if (given_up) rejected.push_back(landmark.id);
        remove.push_back(given_up || landmark.images_unseen > options.lost_after ||
                         !landmark.point.in_front());
    }
    give_up(remove);
}

// The clone of this image was made where that of the last one was.
void Iekf::Impl::hold_at_rest() {
    const int before = state->find_clone(image_idx - 1);
    if (!use_imu || !rest.at_rest() || before < 0) return;
    std::vector<double> ranges;
    for (const LandmarkState& landmark : state->landmarks())
        if (landmark.point.in_front()) ranges.push_back(1 / landmark.point.x.z());
    const double hidden =
        rest.hidden_speed(rig.camera->angular_resolution(), median(std::move(ranges)));
    update_at_rest(*state, before, options.gate, hidden, image_interval);
    state->take_innovations();  // it measures nothing
}

void Iekf::Impl::use_window_points() {
    int oldest = -1, alive = 0;
    for (const ClonedPose& clone : state->clones()) {
        if (clone.image_idx < 0) continue;
        ++alive;
        if (oldest < 0 || clone.image_idx < oldest) oldest = clone.image_idx;
    }
    const bool full = alive > options.clones;
    if (abandoned) {
        used = 0;
    } else {
        const Window::Outcome outcome = window.use(*state, image_idx, full ? oldest : -1);
        used += outcome.used;
        innovations.new_points = outcome.used + outcome.rejected;
        innovations.new_points_rejected = outcome.rejected;
        take_point_innovations();
    }
    if (full) {
        window.forget_image(oldest);
        release(state->find_clone(oldest));
    }
}

// The landmarks that are anchored there move to the newest clone.
void Iekf::Impl::release(int slot) {
    const int newest = state->find_clone(image_idx);
    for (int i = 0; i < static_cast<int>(state->landmarks().size()); ++i) {
        const LandmarkState& landmark = state->landmarks()[i];
        if (landmark.anchor != slot) continue;
        state->reanchor(i, newest,
                        moved_anchor(landmark.point, state->clones()[slot].T_W_I,
                                     state->clones()[newest].T_W_I, state->mount().T_I_C));
    }
    state->release_clone(slot);
}

}  // namespace vio
