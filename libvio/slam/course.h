// The course from measurements in the order of their arrival to the estimate, in one place for all
// who estimate: into the order of time, through the tracker, to the estimator.
#pragma once

#include <deque>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "libvio/camera/rig.h"
#include "libvio/io/recording.h"
#include "libvio/slam/estimator.h"
#include "libvio/slam/ordered_messages.h"
#include "libvio/tracking/front_end.h"

namespace vio {

/// What has come to the estimator, and what was left out.
struct CourseCounts {
    int imu_readings = 0, images = 0;        ///< that reached the estimator
    int dropped_images = 0;                  ///< outside the IMU's readings
    int repeated_messages = 0;               ///< of the same stamp as another of their kind
    int late_messages = 0;                   ///< later than IekfOptions::message_window
    int late_images = 0;                     ///< of these
    TimeNs first_image = 0, last_image = 0;  ///< that reached the estimator
    double covered_s = 0;  ///< from one to the next, where that is no more than a second [s]
};

/// The loop of an application:
///
///     while (auto message = recording.next()) {
///         course.add(*message);
///         while (course.step()) use(course.estimator().take());
///     }
///     course.finish();
///     use(course.estimator().take());
///
/// An image outside the IMU's readings cannot be estimated with them: it is held back until
/// readings reach it, and dropped if they never do; but the recursive estimator goes on without
/// readings after MessageQueue::kLongestWait.
class Course {
 public:
    /// The rig is one with a camera. Throws InputError as make_estimator() does.
    Course(const EstimationRequest& request, const Rig& rig);
    Course(const Course&) = delete;
    Course& operator=(const Course&) = delete;

    /// Readings, images and features in any order within IekfOptions::message_window; other
    /// messages are passed over. Where tracks stand for the images, leave the images out.
    void add(const Message& message);
    /// Works on the next measurement whose turn has come; false if there is none. at_end: no more
    /// will be added.
    bool step(bool at_end = false);
    /// Works on all that waits. Call once after the last measurement. Throws as
    /// Estimator::finish().
    void finish();

    Estimator& estimator() { return *estimator_; }
    const Estimator& estimator() const { return *estimator_; }
    /// Why there is no pose after finish(), in words.
    std::string why_no_pose() const;

    CourseCounts counts() const;
    double tracking_s() const { return tracking_s_; }
    double estimation_s() const { return estimation_s_; }

    using Watch = std::function<void(const FeatureFrame&)>;
    /// Sees each image's features when they have been tracked.
    void watch_tracked(Watch watch) { tracked_ = std::move(watch); }
    /// Sees each image's features just before the estimator does, if it does.
    void watch_estimated(Watch watch) { estimated_ = std::move(watch); }

 private:
    void feed(const ImuReading& reading);
    void feed(const std::vector<FeatureFrame>& frames);
    void hold(const FeatureFrame& frame);
    void release();

    bool use_imu_, patient_;
    TimeNs time_offset_;
    OrderedMessages queue_;
    std::unique_ptr<Estimator> estimator_;
    TrackingFrontEnd front_end_;
    Watch tracked_ = [](const FeatureFrame&) {}, estimated_ = [](const FeatureFrame&) {};
    std::optional<TimeNs> first_reading_;
    TimeNs last_reading_ = 0;
    std::deque<FeatureFrame> waiting_;  // for readings, in order of time
    bool ended_ = false;
    CourseCounts counts_;  // but for the queue's
    double tracking_s_ = 0, estimation_s_ = 0;
};

}  // namespace vio
