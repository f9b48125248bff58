// The inside of the recursive estimator: what it holds and the steps of its course. The course is
// in iekf.cpp; the steps are in iekf_start.cpp, iekf_points.cpp, iekf_health.cpp, iekf_output.cpp
// and iekf_prediction.cpp.
#pragma once

#include <deque>
#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "libvio/recursive/iekf.h"
#include "libvio/recursive/landmark_update.h"
#include "libvio/recursive/message_queue.h"
#include "libvio/recursive/motion.h"
#include "libvio/recursive/prefix.h"
#include "libvio/recursive/rest.h"
#include "libvio/recursive/window.h"
#include "libvio/tracking/keyframes.h"

namespace vio {

/// All that the filter holds between two measurements.
struct Iekf::Impl {
    Impl(const Rig& rig, const IekfOptions& options, const BatchOptions& batch, bool use_imu);

    // ---- The course ----------------------------------------------------------------------------

    void take_messages(bool at_end);
    void take(const ImuReading& reading);
    void take(const TimedFrame& image);

    void process_image(const TimedFrame& image);

    // ---- Steps ---------------------------------------------------------------------------------

    TimeNs given_time() const;
    void begin_given(const ImuReading& next);
    bool starting() const { return (!state && !given_start) || restarting; }
    void try_start(const TimedFrame& image);
    void start_from_rest();
    bool start_from_prefix(const ImuReading* next);
    void start_from(Prefix::Start start);
    bool start_without_more_images();
    void coast_from_attitude();
    ImuReading reading_at(TimeNs t_imu) const;
    void begin_found(const std::vector<StateEstimate>& states, const BatchTail& tail,
                     const MountEstimate& mount, const Pose& from, TimeNs from_t,
                     const std::string& how);
    void begin(const BatchTail& tail, const MountEstimate& mount, const ImuReading& at);
    void know_mount(const CameraMount& mount);
    MountEstimate known_mount() const;
    void restart(TimeNs t, const std::string& why);
    void recovered(TimeNs t);
    void move_to(TimeNs t_imu, TimeNs t);
    void sort_features(const FeatureFrame& frame);
    void update_known_points();
    bool sights_to_blame(const std::vector<LandmarkSight>& passed) const;
    void take_reading_innovations();
    void take_point_innovations();
    void drop_lost_points();
    void hold_at_rest();
    void use_window_points();
    void release(int slot);
    /// Whether an image should have come long before t.
    bool image_missing(TimeNs t) const {
        constexpr double kUsualIntervals = 3;
        const double interval = to_seconds(t - image_time);
        return interval > options.lost_after_seconds && image_interval > 0 &&
               interval > kUsualIntervals * image_interval;
    }
    bool unseen(TimeNs t) const { return to_seconds(t - last_good) > options.lost_after_seconds; }
    double known_velocity() const;
    double velocity_limit(double sigma) const;
    std::string velocity_known(double limit) const;
    std::string scale_contradicted() const;
    bool restarts() const { return use_imu && options.motion == "imu_driven"; }
    void abandon_if_blind(TimeNs t);
    void abandon(TimeNs t, const std::string& why);
    bool contradicts();
    void judge(TimeNs t);
    StateEstimate body_at(TimeNs t, int features) const;
    void report(TimeNs t, int features);
    void note_coasting(TimeNs t);
    CoreState core_at(TimeNs t, Matrix15d& P) const;
    void add_mounting(StateEstimate& body, const Eigen::Vector3d& omega_I) const;
    void follow_keyframes(const FeatureFrame& frame);
    void end_keyframe();
    std::vector<PredictedFeature> predict(TimeNs t_imu) const;
    void note_landmark(int idx);
    void give_up(const std::vector<bool>& remove);
    void log(TimeNs t, std::string text) {
        if (status.size() >= kMostStatus) status.erase(status.begin());
        status.push_back({t, std::move(text), told++});
    }
    TimeNs camera_time(TimeNs t_imu) const { return t_imu - from_seconds(rig.time_offset); }

    Rig rig;  // its mount as estimated last
    const Pose stated_T_I_C;
    const TimeNs stated_offset;
    IekfOptions options;
    bool use_imu;
    MessageQueue<> queue;
    static constexpr int kShortestPrefix = 3;  // images
    Prefix prefix;
    BatchOptions priors;
    RestDetector rest;
    std::unique_ptr<MotionModel> motion;
    Window window;
    double landmark_gate;

    std::optional<FilterState> state;      // once started
    std::optional<BatchTail> given_start;  // until readings reach it
    std::optional<Prefix::Start> waiting;  // from a prefix, until that is longer
    std::optional<ImuReading> last_reading;
    ImuReading now;                               // of the state's time
    TimeNs newest_reading = 0, newest_image = 0;  // taken so far
    TimeNs started_at = 0;
    int image_idx = 0;
    KeyframeSelector keyframes;
    int keyframe_idx = 0;  // image of the last key-frame
    TimeNs image_time = 0, keyframe_time = 0;
    double image_interval = 0;  // the last that was no gap; 0: none yet [s]
    bool after_gap = false;     // images were missing before the last

    // Of the image in work.
    std::vector<LandmarkSight> known;
    int used = 0;
    bool contradicted = false;
    double scale_correction = 0;  // in its standard deviations
    ImageInnovations innovations;
    std::vector<FeatureId> rejected;  // not yet taken by the caller

    // Health.
    static constexpr double kBadShare = 0.5;  // of an image's landmarks passing the gate
    static constexpr int kJudgedImages = 10;  // over which that share is judged, too
    // Of an image: landmarks of the state that it shows, and those that passed the gate.
    struct Sights {
        int known, passed;
    };
    std::deque<Sights> judged;  // of the last images
    bool restarting = false;    // a new start is being looked for while the state coasts
    bool abandoned = false;     // and images contradict the state: it is not updated
    std::map<TimeNs, StateEstimate> coasted;  // while restarting, at images
    int bad_images = 0;
    TimeNs last_good = 0;
    TimeNs gap_told = 0;  // reading after which there was a gap
    bool lost = false;

    TimeNs last_report = std::numeric_limits<TimeNs>::min();
    Estimate result;                          // but for what was taken
    std::optional<StateEstimate> last_taken;  // of its states
    std::map<FeatureId, LandmarkEstimate> landmark_estimates;
    static constexpr std::size_t kMostStatus = 10000;
    std::vector<StatusEntry> status;
    std::int64_t told = 0;  // status entries, those forgotten too
};

}  // namespace vio
